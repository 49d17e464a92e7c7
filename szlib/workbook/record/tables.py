"""How a notebook shows values, tables and figures; where each parameter comes from, its badge."""

from __future__ import annotations

import inspect
import io
import re
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd
from pandas.io.formats.style import Styler

from ...control.settings import MPCSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, ASSUMED, MEASURED = "paper", "assumed", "measured"
"""Badges: where a parameter comes from."""
_SHOWN = 2 / 3
"""Of the width of a figure that is saved."""


def parameters(rows: Sequence[tuple[str, object, str, str]]) -> Styler:
    """A table of parameters for a notebook: name, value, badge (paper, assumed, measured), why."""
    unknown = {badge for _, _, badge, _ in rows} - {PAPER, ASSUMED, MEASURED}
    if unknown:
        raise ValueError(f"badges must be {PAPER}, {ASSUMED} or {MEASURED}; got {sorted(unknown)}")
    return whole(pd.DataFrame(rows, columns=["parameter", "value", "badge", "why"]))


def settings_table(settings: MPCSettings) -> Styler:
    """The controller's parameters as such a table; what each one is stands in the docstring of its class."""
    descriptions: dict[str, str] = {}
    names: list[str] = []
    for line in (inspect.getdoc(type(settings)) or "").splitlines():
        entry = re.fullmatch(r"([A-Za-z_]\w*(?:, \w+)*) : (.*)", line)
        if entry:
            names = entry[1].split(", ")
            descriptions |= dict.fromkeys(names, entry[2])
        elif line.startswith("    ") and names:
            descriptions |= {name: f"{descriptions[name]} {line.strip()}" for name in names}
        else:
            names = []
    badges = settings.badges()
    return parameters(
        [(name, getattr(settings, name), badge, descriptions[name]) for name, badge in badges.items()]
    )


class Table(Styler):
    """A table to look at, which is the same text and HTML every time."""

    def __repr__(self) -> str:
        return str(self.data.to_string(index=False))  # type: ignore[attr-defined]


def whole(table: pd.DataFrame) -> Styler:
    """A table whose long texts are shown to their end."""
    left = [{"selector": "td, th", "props": "text-align: left"}]
    styled = Table(table, uuid="szlib", cell_ids=False).format(as_text).hide(axis="index")
    return styled.set_table_styles(left)  # type: ignore[arg-type]


def as_text(value: Any) -> str:
    """A value of a check or a claim to read: four digits of a number, every entry of a table."""
    if value is None:
        return ""
    if isinstance(value, dict):
        return ", ".join(f"{k}: {as_text(v)}" for k, v in value.items())
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def show_drawn(figure: Figure, picture: bytes) -> None:
    """Show a figure as it was drawn to be saved, smaller and in 256 colours, in place of drawing it again.

    Where figures are not shown inline, as by ipympl, nothing is done.
    """
    import matplotlib.pyplot as plt
    from IPython.display import display
    from PIL import Image

    from ..figures.style import alt_text

    if "inline" not in plt.get_backend():
        return
    drawn = Image.open(io.BytesIO(picture)).convert("RGB")
    size = round(drawn.width * _SHOWN), round(drawn.height * _SHOWN)
    shown = io.BytesIO()
    drawn.resize(size, Image.Resampling.LANCZOS).quantize(dither=Image.Dither.NONE).save(shown, "PNG")
    content = {"image/png": shown.getvalue(), "text/plain": repr(figure)}
    told = {"image/png": {"alt": alt_text(figure)}}
    display(content, raw=True, metadata=told)  # type: ignore[no-untyped-call]
    plt.close(figure)


def show_with_words() -> None:
    """In a notebook, give every figure its words as alternative text, and tables three decimals.

    And nothing is shown that another machine or another run would show otherwise: addresses of objects,
    temporary files that warnings come from.
    """
    from IPython.core.getipython import get_ipython

    def words(figure: Figure, **_: object) -> tuple[dict[str, str], dict[str, Any]]:
        """No other form of the figure, but its words."""
        from ..figures.style import alt_text

        return {}, {"image/png": {"alt": alt_text(figure)}}

    shell = get_ipython()
    if shell is not None and shell.display_formatter is not None:
        pd.options.display.precision = 3
        warnings.formatwarning = lambda message, category, *_: f"{category.__name__}: {message}\n"
        shell.display_formatter.mimebundle_formatter.for_type_by_name("matplotlib.figure", "Figure", words)
        plain = shell.display_formatter.formatters["text/plain"]
        plain.for_type(Styler, lambda table, printer, _: printer.text(table.data.to_string()))
