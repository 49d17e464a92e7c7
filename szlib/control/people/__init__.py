"""Who is there: people as the controller sees them, from one look to the next, and met head-on.

person    a person and their zone in the world: `Person`
tracker   headings by id, people brought forward to now, and those not seen any more: `Tracker`
meetings  on which side one who is met head-on is passed
"""

from .meetings import subgoal
from .person import BODY_RADIUS, Person, PlacedZone, SpeedZone, as_ellipse, place
from .tracker import Tracker

__all__ = ["BODY_RADIUS", "Person", "PlacedZone", "SpeedZone", "Tracker", "as_ellipse", "place", "subgoal"]
