"""Tables that a notebook shows: parameters with the badge that says where each comes from."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence

import pandas as pd
from pandas.io.formats.style import Styler

from ...control.settings import MPCSettings

PAPER, ASSUMED, MEASURED = "paper", "assumed", "measured"
"""Badges: where a parameter comes from."""


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


def whole(table: pd.DataFrame) -> Styler:
    """A table whose long texts are shown to their end, the same HTML every time."""
    left = [{"selector": "td, th", "props": "text-align: left"}]
    return Styler(table, uuid="szlib", cell_ids=False).hide(axis="index").set_table_styles(left)  # type: ignore[arg-type]
