"""How near is too near: from samples of encounters to the minimum social zone.

ellipses     ellipses, and the smallest one around points or a curve
hulls        the convex hull over (x', y', speed) and its slices
outliers     encounters, or samples, that lie apart (local outlier factor): `remove_outliers`
social_zone  all of it behind one name, by speed, saved as JSON: `SocialZone`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__, submodules=["ellipses", "hulls", "outliers", "social_zone"]
)
