from .ellipses import BODY_RADIUS, Ellipse, EllipseZone, circle_around
from .enclosing_ellipse import (
    minimum_enclosing_ellipse,
    minimum_enclosing_ellipse_of_curve,
)
from .hulls import HullZone, hull_vertices, slice_hull
from .outliers import complementary_points, is_outlier, remove_outliers
from .reference_zones import ReferenceZone, reference_zone
from .respect_test import NullTest, RespectRadius, null_test
from .social_zone import SocialZone
from .uncertainty import count_by_side

__all__ = [
    "BODY_RADIUS",
    "Ellipse",
    "EllipseZone",
    "HullZone",
    "NullTest",
    "ReferenceZone",
    "RespectRadius",
    "SocialZone",
    "circle_around",
    "complementary_points",
    "count_by_side",
    "hull_vertices",
    "is_outlier",
    "minimum_enclosing_ellipse",
    "minimum_enclosing_ellipse_of_curve",
    "null_test",
    "reference_zone",
    "remove_outliers",
    "slice_hull",
]
