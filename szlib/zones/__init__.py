"""How near is too near, and how certain is that: from samples of encounters to the minimum social zone.

ellipses              ellipses, and the smallest one around points or a curve
outliers              encounters, or samples, far from all others (local outlier factor)
polar                 a zone given as a radius in each direction, and the ellipse fitted to it
hulls                 the zone outside the convex hull over (x', y', speed): estimator "hull"
quantile              the zone that all but a share of encounters keep out of: estimator "quantile"
occupancy             histograms of where people were, and the map of the pair correlation
respect               the zone where people are half as frequent as in the null model
respect_estimator     the respect zone at several speeds: estimator "respect"
respect_significance  the test of the data against its null model
uncertainty           encounters by side, and confidence intervals by resampling people
zone_file             the JSON file of a social zone
social_zone           `SocialZone`: all of it behind one name
costmaps              zones around people as a layer of a costmap
"""
