"""How near is too near, and how certain is that: from samples of encounters to the minimum social zone.

ellipses              ellipses in a person's frame, one or one for each speed
enclosing_ellipse     the smallest ellipse around points or a curve
outliers              encounters, or samples, far from all others (local outlier factor); smoothed paths
estimators            what all estimators and shapes of zones have in common
hulls                 the zone outside the convex hull over (x', y', speed): estimator "hull"
respect               the ellipse that careful people keep out of, by the null model: estimator "respect"
respect_likelihood    its likelihood, and the posterior of its parameters
respect_test          the test of the data against its null model, and the radius over all directions
uncertainty           encounters by side, and confidence intervals by resampling people
verdict               whether a zone can be used, and why not
social_zone           `SocialZone`: all of it behind one name, and its JSON file
reference_zones       zones of real people that szlib ships: `reference_zone`

`__init__.pyi` beside this file lists the names. Each is imported when it is first used: a robot that needs an
`Ellipse` loads no pandas.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
