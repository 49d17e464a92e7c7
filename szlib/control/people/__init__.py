"""Who is there: people as the controller sees them, from one look to the next, and met head-on.

person    a person and their zone in the world: `Person`
tracker   headings by id, people brought forward to now, and those not seen any more: `Tracker`
meetings  on which side one who is met head-on is passed
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["person", "tracker", "meetings"],
    submod_attrs={
        "person": ["BODY_RADIUS", "Person", "PlacedZone", "SpeedZone", "as_ellipse", "place"],
        "tracker": ["Tracker"],
        "meetings": ["subgoal"],
    },
)
