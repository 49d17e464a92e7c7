"""The funnel: how many rows entered each stage, how many were set aside, for which reason.

Tables carry their funnel in ``DataFrame.attrs["funnel"]`` (Parquet keeps it), each stage a plain
dict, so that provenance travels with the data and nothing is dropped in silence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from ..errors import SzlibError

KEY = "funnel"


def stage(name: str, entered: int, kept: int, rejected: Mapping[str, int]) -> dict[str, Any]:
    """One stage of a funnel; raises SzlibError where entered != kept + set aside."""
    reasons = {reason: int(count) for reason, count in rejected.items() if count}
    if int(entered) != int(kept) + sum(reasons.values()):
        raise SzlibError(f"funnel stage '{name}' does not add up: {entered} != {kept} + {reasons}")
    return {"stage": name, "entered": int(entered), "kept": int(kept), "rejected": reasons}


def get(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The stages a table has gone through so far (a copy; empty for a table made by hand)."""
    return list(frame.attrs.get(KEY, []))


def attach(frame: pd.DataFrame, stages: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Attach the stages to a table and return it."""
    frame.attrs[KEY] = [dict(s) for s in stages]
    return frame


def table(stages: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The funnel to read: one line for what entered and was kept, one for each reason."""
    rows: list[tuple[str, str, int]] = []
    for s in stages:
        rows.append((s["stage"], "entered", s["entered"]))
        rows += [(s["stage"], f"- {reason}", count) for reason, count in s["rejected"].items()]
        rows.append((s["stage"], "kept", s["kept"]))
    return pd.DataFrame(rows, columns=["stage", "what", "rows"])


def text(stages: Sequence[Mapping[str, Any]]) -> str:
    """The same in columns of plain text, each stage named once."""
    lines = table(stages)
    lines["stage"] = lines["stage"].where(~lines["stage"].duplicated(), "")
    wide = {name: int(lines[name].str.len().max()) for name in ("stage", "what")}
    return "\n".join(
        f"{row.stage:<{wide['stage']}}  {row.what:<{wide['what']}} {row.rows:>12,}"
        for row in lines.itertuples()
    )


def add(funnels: Iterable[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """One funnel of many: stages of the same name are added up, in the order in which they first come."""
    sums: dict[str, list[Mapping[str, Any]]] = {}
    for stages in funnels:
        for s in stages:
            sums.setdefault(s["stage"], []).append(s)
    added = []
    for name, parts in sums.items():
        reasons: Counter[str] = Counter()
        for part in parts:
            reasons.update(part["rejected"])
        added.append(stage(name, sum(p["entered"] for p in parts), sum(p["kept"] for p in parts), reasons))
    return added
