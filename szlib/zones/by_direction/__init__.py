"""Zones told by direction: a radius in each, and the ellipse fitted to them.

radii     a zone told by direction, and the ellipse fitted to it
quantile  where all but a share of encounters keep out
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(__name__, submodules=["radii", "quantile"])
