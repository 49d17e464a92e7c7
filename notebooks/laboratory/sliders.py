"""Sliders for one figure on a page of a notebook."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from typing import Any

from szlib.workbook import folders


def is_interactive() -> bool:
    """Return True if a page of JupyterLab or of the classic notebook started the kernel, not `szlib run`."""
    return "JPY_SESSION_NAME" in os.environ and folders.RUN_VARIABLE not in os.environ


def show_sliders(draw: Callable[..., Any], **sliders: tuple[float, float, float, float]) -> None:
    """Show a figure with sliders on a page of a notebook; do nothing in a headless run.

    There is one picture, which each new figure replaces, and which keeps its size.

    Parameters
    ----------
    draw : function of the sliders' values, by name, that returns a figure or its axes. If the limits of the
        axes do not depend on the values, the axes stay where they are.
    sliders : name -> (value, least, greatest, step).
    """
    if not is_interactive():
        return
    import matplotlib.pyplot as plt
    from IPython.display import display
    from ipywidgets import FloatSlider, Image, VBox

    widgets = {
        name: FloatSlider(value, min=low, max=high, step=step, description=name, continuous_update=False)
        for name, (value, low, high, step) in sliders.items()
    }
    picture, box = Image(format="png"), list[Any]()

    def redraw(_: object = None) -> None:
        figure, content = (
            draw(**{name: widget.value for name, widget in widgets.items()}).figure,
            io.BytesIO(),
        )
        if not box:
            figure.draw_without_rendering()
            box.append(figure.get_tightbbox().padded(0.1))
        figure.savefig(content, format="png", dpi=100, bbox_inches=box[0])
        plt.close(figure)
        picture.value = content.getvalue()

    for widget in widgets.values():
        widget.observe(redraw, "value")
    redraw()
    display(VBox([*widgets.values(), picture]))
