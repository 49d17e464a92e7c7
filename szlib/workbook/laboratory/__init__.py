"""A scene that can be dragged and set while it runs, with a robot for each choice of settings.

bench  the scene, its robots, and the parameter cell that begins with them
page   the same on a page: sliders, canvases, and what is shown where no page is open: nothing
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["bench", "page"],
    submod_attrs={"bench": ["Bench", "Choice", "scene"], "page": ["Laboratory", "live", "slide"]},
)
