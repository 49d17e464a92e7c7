"""How a notebook shows tables, figures and the parameters with their sources."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd
from pandas.io.formats.style import Styler

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BADGES = ("paper", "assumed", "measured", "tuned", "chosen")
PAPER, ASSUMED, MEASURED, TUNED, CHOSEN = BADGES
"""Badges: the source of a parameter; tuned on the paper's four scenarios; chosen by the user."""
# width of a figure in the notebook, as a fraction of the saved figure's
_SHOWN_WIDTH = 2 / 3


def parameters(rows: Sequence[tuple[str, object, str, str]]) -> Styler:
    """Make a table of parameters for a notebook, folded to one line until it is opened.

    Parameters
    ----------
    rows : name, value, badge (`PAPER`, `ASSUMED`, `MEASURED`, `TUNED` or `CHOSEN`) and reason of each
        parameter.

    Examples
    --------
    >>> from szlib.workbook.record import PAPER, parameters
    >>> parameters([("window", "3 s", PAPER, "sec. 2")])
    parameter value badge    why
       window   3 s paper sec. 2
    """
    unknown = {badge for _, _, badge, _ in rows}.difference(BADGES)
    if unknown:
        raise ValueError(f"badges must be {', '.join(BADGES)}; got {sorted(unknown)}")
    return _style(
        _FoldedTable, pd.DataFrame(rows, columns=["parameter", "value", "badge", "why"])
    )


class _Table(Styler):
    """A table whose text and HTML are the same at every execution."""

    def __repr__(self) -> str:
        return str(self.data.to_string(index=False))  # type: ignore[attr-defined]


class _FoldedTable(_Table):
    """A table in a fold that says how many rows it has."""

    def _repr_html_(self) -> str:
        table = str(super()._repr_html_())  # type: ignore[misc]
        return f"<details><summary>{len(self.index)} parameters, with sources</summary>\n{table}</details>"


def style_table(table: pd.DataFrame) -> Styler:
    """Style a `table` so that long texts are shown in full, aligned to the left."""
    return _style(_Table, table)


def _style(kind: type[_Table], table: pd.DataFrame) -> Styler:
    left = [{"selector": "td, th", "props": "text-align: left"}]
    styled = (
        kind(table, uuid="szlib", cell_ids=False)
        .format(format_value)
        .hide(axis="index")
    )
    return styled.set_table_styles(left)  # type: ignore[arg-type]


def format_value(value: Any) -> str:
    """The `value` of a check or a claim as text: three digits of a number, all entries of a dictionary."""
    if value is None:
        return ""
    if isinstance(value, dict):
        return ", ".join(f"{k}: {format_value(v)}" for k, v in value.items())
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 100 else f"{value + 0.0:.3g}"  # not "-0"
    return str(value)


def format_result(result: str, value: Any) -> str:
    """The `result` of a check or a claim with its `value`: "holds (2)"."""
    return result if value is None else f"{result} ({format_value(value)})"


def show_figure(figure: Figure, picture: bytes) -> None:
    """Show a saved `picture` of a `figure` in the notebook, smaller and in 128 colours, with its alt text.

    The figure is not drawn a second time. Nothing is shown if the backend is not inline (such as ipympl).
    """
    import matplotlib.pyplot as plt
    from IPython.display import display
    from PIL import Image

    from ..figures.style import alt_text

    if "inline" not in plt.get_backend():
        return
    drawn = Image.open(io.BytesIO(picture)).convert("RGB")
    size = round(drawn.width * _SHOWN_WIDTH), round(drawn.height * _SHOWN_WIDTH)
    shown = io.BytesIO()
    small = drawn.resize(size, Image.Resampling.LANCZOS)
    small.quantize(128, Image.Quantize.MAXCOVERAGE, kmeans=1).save(
        shown, "PNG", optimize=True
    )
    content = {"image/png": shown.getvalue(), "text/plain": repr(figure)}
    display(content, raw=True, metadata={"image/png": {"alt": alt_text(figure)}})  # type: ignore[no-untyped-call]
    plt.close(figure)


def format_outputs() -> None:
    """In a notebook, show tables with three decimals and figures with an alt text.

    This registers display functions with the notebook's IPython; pandas and matplotlib are not changed.
    """
    from IPython.core.getipython import get_ipython

    shell = get_ipython()
    if shell is None or shell.display_formatter is None:
        return

    def describe(figure: Figure, **_: object) -> tuple[dict[str, str], dict[str, Any]]:
        """The alt text as metadata of the picture."""
        from ..figures.style import alt_text

        return {}, {"image/png": {"alt": alt_text(figure)}}

    def show_rounded(table: pd.DataFrame) -> str:
        """The table as HTML with three decimals."""
        with pd.option_context("display.precision", 3):
            return str(table._repr_html_())  # type: ignore[operator]

    shell.display_formatter.mimebundle_formatter.for_type_by_name(
        "matplotlib.figure", "Figure", describe
    )
    formatters = shell.display_formatter.formatters
    formatters["text/html"].for_type(pd.DataFrame, show_rounded)
    formatters["text/plain"].for_type(
        Styler, lambda table, printer, _: printer.text(table.data.to_string())
    )
