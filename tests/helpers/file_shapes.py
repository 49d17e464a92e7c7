"""Files of tracks in the shapes that people have; each holds the same people in a hall of 12 m by 8 m."""

from __future__ import annotations

import gzip
import json
import sqlite3
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd

from .track_files import BEGIN as ATC_BEGIN
from .track_files import as_1hz, as_ewap, as_raw

RATE, INTERVAL = 25, 10  # frames a second, and frames between two samples: 0.4 s
BEGIN = 1_700_000_000  # 2023-11-14 22:13:20 UTC
PIXEL = 0.02  # metres in a pixel


def hall(people: int = 40, seed: int = 0) -> pd.DataFrame:
    """Columns frame, t [s] since the recording began, id, x, y [m]."""
    rng, parts = np.random.default_rng(seed), []
    for person in range(people):
        frame = INTERVAL * (rng.integers(0, 100) + np.arange(26))
        start, end = (
            np.array([0.5, rng.uniform(1, 7)]),
            np.array([11.5, rng.uniform(1, 7)]),
        )
        if person % 2:
            start, end = end, start
        where = start + np.linspace(0, 1, 26)[:, None] * (end - start)
        parts.append(
            pd.DataFrame(
                {"frame": frame, "id": person + 1, "x": where[:, 0], "y": where[:, 1]}
            )
        )
    rows = pd.concat(parts, ignore_index=True).round(3)
    return rows.assign(t=rows["frame"] / RATE)[["frame", "t", "id", "x", "y"]]


def _table(
    *,
    names: str = "t,id,x,y",
    separator: str = ",",
    decimal: str = ".",
    **changes: Callable,
) -> str:
    """The rows as text: columns called `names`, after `changes`."""
    rows = hall().assign(**changes)
    columns = (
        ["t", "id", "x", "y"]
        if "frame" not in names.casefold()
        else ["frame", "id", "x", "y"]
    )
    rows = rows[columns].set_axis(names.split(","), axis=1)
    return rows.to_csv(index=False, sep=separator, decimal=decimal)


def _times(zone: str | None) -> list[str]:
    moments = [datetime.fromtimestamp(BEGIN + t, UTC) for t in hall()["t"]]
    local = [moment.astimezone(ZoneInfo(zone or "Europe/Berlin")) for moment in moments]
    return [
        m.isoformat() if zone else m.replace(tzinfo=None).isoformat(sep=" ")
        for m in local
    ]


def _scaled(factor: float) -> dict[str, Callable]:
    return {
        name: (lambda rows, name=name: (rows[name] / factor).round(3)) for name in "xy"
    }


def _trajnet() -> str:
    rows = hall()
    scene = {
        "id": 0,
        "p": 1,
        "s": 0,
        "e": int(rows["frame"].max()),
        "fps": 2.5,
        "tag": 2,
    }
    tracks = [{"f": r.frame, "p": r.id, "x": r.x, "y": r.y} for r in rows.itertuples()]
    return (
        "\n".join(
            json.dumps(line)
            for line in [{"scene": scene}, *({"track": t} for t in tracks)]
        )
        + "\n"
    )


def _pathfinder_csv() -> str:
    rows = [
        f"{r.t:.2f},{r.id},Occ{r.id},1,{r.x},{r.y},0.0" for r in hall().itertuples()
    ]
    return "\n".join(["t,id,name,active,x,y,z", "s,,,,m,m,m", *rows]) + "\n"


def _magni() -> str:
    rows = hall().sort_values("t")
    names = rows["id"].map("Helmet_{}".format)
    more = {
        "speed": 1.2,
        "x_speed": 1.2,
        "y_speed": 0.0,
        "theta_delta": 0.0,
        "data_label": "Visitors-Alone",
    }
    table = pd.DataFrame(
        {"Time": rows["t"], "ag_id": names, "x": rows["x"], "y": rows["y"]}
    )
    return table.assign(**more).to_csv(index=False)


def _sqlite(path: Path) -> None:
    with sqlite3.connect(path) as file:
        rows = hall()[["t", "id", "x", "y"]].set_axis(
            ["time", "person_id", "x", "y"], axis=1
        )
        rows.to_sql("tracks", file, index=False)
        file.execute("CREATE TABLE cameras(name TEXT, height REAL)")
    file.close()


def _excel(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("[Content_Types].xml", "<Types/>")
        file.writestr("xl/workbook.xml", "<workbook/>")


_SINCE_1970: dict[str, Callable] = {"t": lambda r: BEGIN + r["t"]}
TEXTS: dict[str, Callable[[], str]] = {
    "plain.csv": _table,
    "semicolons.csv": lambda: _table(separator=";", decimal=","),
    "tabs.txt": lambda: _table(separator="\t"),
    "german.csv": lambda: _table(names="Zeit,Person,X,Y", separator=";", decimal=","),
    "japanese.csv": lambda: _table(names="時刻,人物ID,X座標,Y座標"),
    "french.csv": lambda: _table(
        names="temps,personne,x,y", separator=";", decimal=","
    ),
    "time.csv": lambda: _table(names="time,pedestrian_id,pos_x,pos_y"),
    "iso-zone.csv": lambda: _table(t=lambda r: _times("Asia/Tokyo")),
    "iso-local.csv": lambda: _table(names="timestamp,id,x,y", t=lambda r: _times(None)),
    "nanoseconds.csv": lambda: _table(
        names="timestamp,id,x,y",
        t=lambda r: BEGIN * 10**9 + (r["t"] * 1000).astype(int) * 10**6,
    ),
    "milliseconds.csv": lambda: _table(
        names="time_ms,id,x,y", t=lambda r: (r["t"] * 1000).astype(int)
    ),
    "text-ids.csv": lambda: _table(id=lambda r: r["id"].map("P{:03d}".format)),
    "quoted.csv": lambda: _table().replace("t,id,x,y", '"t","id","x","y"'),
    "frames.csv": lambda: _table(names="frame,id,x,y"),
    "pixels.csv": lambda: _table(names="frame,track_id,x,y", **_scaled(PIXEL)),
    "mm.csv": lambda: _table(**_scaled(1e-3)),
    "cm.csv": lambda: _table(**_scaled(1e-2)),
    "feet.csv": lambda: _table(**_scaled(0.3048)),
    "headerless.txt": lambda: _table(names="frame,id,x,y", separator=" ").partition(
        "\n"
    )[2],
    "unknown-names.csv": lambda: _table(names="a,b,c,d"),
    "trajnet.ndjson": _trajnet,
    "crowdit.csv": lambda: _table(names="time,pedID,posX,posY"),
    "pathfinder.csv": _pathfinder_csv,
    "magni.csv": _magni,
    "obsmat.txt": lambda: as_ewap(hall(), rate=RATE),
    "atc-raw.csv": lambda: as_raw(hall().assign(**_SINCE_1970)),
    "atc-1hz.csv": lambda: as_1hz(hall().assign(t=lambda r: ATC_BEGIN + r["t"])),
}
BINARIES: dict[str, Callable[[Path], object]] = {
    "packed.csv.gz": lambda path: path.write_bytes(gzip.compress(_table().encode())),
    "own.feather": lambda path: hall()[["t", "id", "x", "y"]].to_feather(path),
    "own.parquet": lambda path: hall()[["t", "id", "x", "y"]].to_parquet(path),
    "own.sqlite": _sqlite,
    "hall.xlsx": _excel,
}
SHAPES = (*TEXTS, *BINARIES)


def write_shape(name: str, folder: Path) -> Path:
    """Write the file of shape `name` into `folder`."""
    path = folder / name
    if name in TEXTS:
        path.write_text(TEXTS[name](), encoding="utf-8")
    else:
        BINARIES[name](path)
    return path
