"""How near is too near, and how sure are we: from samples of encounters to the minimum social zone.

costmap       zones around people as a layer of a costmap, for navigation stacks: `Grid`
ellipses      ellipses, and the smallest one around points or a curve
outliers      encounters, or samples, that lie apart (local outlier factor): `remove_outliers`
by_direction  zones told by direction, and where all but a share of encounters keep out
hulls         the convex hull over (x', y', speed), its slices, and its way to zones
respect       people against the null model: the contour of half presence, and whether it is respect
uncertainty   who was seen on which side; intervals from other draws of the same people
zone_file     versioned JSON
social_zone   all of it behind one name, by speed, saved as JSON: `SocialZone`
"""
