"""The funnel: how many rows entered each stage, how many were rejected, and why.

A table has its funnel in ``DataFrame.attrs["funnel"]``, which Parquet preserves.  Each stage is a plain dict
with the keys stage, entered, kept and rejected, so that the funnel stays with the data.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ..core.errors import SzlibError

KEY = "funnel"
WARNING = "warning: "  # how the name of a stage begins that rejects nothing, but says what is implausible


def stage(
    name: str, entered: int, kept: int, rejected: Mapping[str, int]
) -> dict[str, Any]:
    """One stage of a funnel.

    Parameters
    ----------
    name : name of the stage.
    entered, kept : number of rows before and after the stage.
    rejected : number of rejected rows by reason.

    Raises
    ------
    SzlibError : `entered` is not `kept` plus the rejected rows.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> funnels.stage("read a.csv", 10, 9, {"not finite": 1, "no day": 0})
    {'stage': 'read a.csv', 'entered': 10, 'kept': 9, 'rejected': {'not finite': 1}}
    """
    reasons = {reason: int(count) for reason, count in rejected.items() if count}
    if int(entered) != int(kept) + sum(reasons.values()):
        raise SzlibError(
            f"funnel stage '{name}' does not add up: {entered} != {kept} + {reasons}"
        )
    return {
        "stage": name,
        "entered": int(entered),
        "kept": int(kept),
        "rejected": reasons,
    }


def get(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The stages that `frame` has gone through (a copy); empty for a table made by hand.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import funnels
    >>> table = funnels.attach(pd.DataFrame({"x": [1]}), [funnels.stage("read", 2, 1, {"not finite": 1})])
    >>> funnels.get(table)[0]["rejected"]
    {'not finite': 1}
    """
    return list(frame.attrs.get(KEY, []))


def warnings(stages: Sequence[Mapping[str, Any]]) -> list[str]:
    """What is implausible in the rows of these `stages`, as texts.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> funnels.warnings([funnels.stage("warning: nobody walks", 9, 9, {})])
    ['nobody walks']
    """
    return [
        s["stage"].removeprefix(WARNING)
        for s in stages
        if s["stage"].startswith(WARNING)
    ]


def attach(frame: pd.DataFrame, stages: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Attach `stages` to `frame` and return it; example at `get`."""
    frame.attrs[KEY] = [dict(s) for s in stages]
    return frame


def select(
    frame: pd.DataFrame, is_kept: ArrayLike, name: str, reason: str
) -> pd.DataFrame:
    """The rows of a `frame` that are kept, with a further stage in its funnel.

    Parameters
    ----------
    frame : any table.
    is_kept : whether each row is kept, shape (n,).
    name : of the stage.
    reason : why the other rows are rejected.
    """
    kept = frame[np.asarray(is_kept)].copy()
    rejected = {reason: len(frame) - len(kept)}
    return attach(kept, [*get(frame), stage(name, len(frame), len(kept), rejected)])


def table(stages: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The funnel `stages` as a table: a row for entered and for kept, and one for each reason.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> funnels.table([funnels.stage("read", 10, 9, {"not finite": 1})])
      stage          what  rows
    0  read       entered    10
    1  read  - not finite     1
    2  read          kept     9
    """
    rows: list[tuple[str, str, int]] = []
    for s in stages:
        rows.append((s["stage"], "entered", s["entered"]))
        rows += [
            (s["stage"], f"- {reason}", count)
            for reason, count in s["rejected"].items()
        ]
        rows.append((s["stage"], "kept", s["kept"]))
    return pd.DataFrame(rows, columns=["stage", "what", "rows"])


def text(stages: Sequence[Mapping[str, Any]]) -> str:
    """The table of `stages` as plain text in which each stage is named once."""
    lines = table(stages)
    lines["stage"] = lines["stage"].where(~lines["stage"].duplicated(), "")
    wide = {name: int(lines[name].str.len().max()) for name in ("stage", "what")}
    return "\n".join(
        f"{row.stage:<{wide['stage']}}  {row.what:<{wide['what']}} {row.rows:>12,}"
        for row in lines.itertuples()
    )


def add(funnels: Iterable[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Add up several `funnels`, stage by stage of the same name, in the order of first occurrence.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> days = [[funnels.stage("read", 10, 9, {"not finite": 1})], [funnels.stage("read", 5, 5, {})]]
    >>> funnels.add(days)
    [{'stage': 'read', 'entered': 15, 'kept': 14, 'rejected': {'not finite': 1}}]
    """
    sums: dict[str, list[Mapping[str, Any]]] = {}
    for stages in funnels:
        for s in stages:
            sums.setdefault(s["stage"], []).append(s)
    added = []
    for name, parts in sums.items():
        reasons: Counter[str] = Counter()
        for part in parts:
            reasons.update(part["rejected"])
        added.append(
            stage(
                name,
                sum(p["entered"] for p in parts),
                sum(p["kept"] for p in parts),
                reasons,
            )
        )
    return added
