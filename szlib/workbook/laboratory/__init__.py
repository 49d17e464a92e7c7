"""A scene that can be dragged and set while it runs, with a robot for each choice of settings.

bench  the scene, its robots, and the parameter cell that begins with them
page   the same on a page: sliders, canvases, and what is shown where no page is open: nothing
"""

from .bench import Bench, Choice, scene
from .page import Laboratory, live, slide

__all__ = ["Bench", "Choice", "Laboratory", "live", "scene", "slide"]
