"""Write files of tracks in every format, and damage them."""

from __future__ import annotations

import gzip
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

BEGIN = 1_351_040_400  # 2012-10-24 10:00 in Tokyo


def samples(people: int = 3, count: int = 20, begin: float = BEGIN) -> pd.DataFrame:
    """People seen every 0.4 s: multiples of 1/15 s and of 1 ms, as every format can hold them."""
    rng = np.random.default_rng(4)
    rows = [
        (
            begin + round(0.4 * k, 3),
            7 + person,
            *(5 + person + 0.4 * k + rng.normal(0, 0.01, 2)).round(6),
        )
        for k in range(count)
        for person in range(people)
    ]
    return pd.DataFrame(rows, columns=["t", "id", "x", "y"])


def as_raw(rows: pd.DataFrame) -> str:
    return "".join(
        f"{r.t:.3f},{r.id},{r.x * 1e3:.6f},{r.y * 1e3:.6f},1650.5,1210.3,0.78,-0.1\n"
        for r in rows.itertuples()
    )


def as_1hz(rows: pd.DataFrame) -> str:
    return "".join(
        f"{r.t:.3f},{r.id},{r.x:.6f},{r.y:.6f},1.2,0.78\n" for r in rows.itertuples()
    )


def as_ewap(rows: pd.DataFrame, *, rate: float = 15.0) -> str:
    """With velocities like those of the ETH sequence: differences over both neighbours."""
    with_velocities = rows.copy()
    for _, one in rows.groupby("id"):
        for name in ("x", "y"):
            with_velocities.loc[one.index, f"v{name}"] = np.gradient(
                one[name], one["t"]
            )
    return "".join(
        f"  {round(r.t * rate):.12e}  {r.id:.7e}   {r.x:.9e}  0.0000000e+00  {r.y:.9e}"
        f"   {r.vx:.7e}  0.0000000e+00  {r.vy:.7e}\n"
        for r in with_velocities.itertuples()
    )


def as_tidy(rows: pd.DataFrame) -> str:
    return rows.to_csv(index=False)


WRITERS: dict[str, Callable[[pd.DataFrame], str]] = {
    "atc-raw": as_raw, "atc-1hz": as_1hz, "ewap": as_ewap, "tidy": as_tidy,
}  # fmt: skip


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


TOKENS = [
    b"", b"\n", b"\n\n", b"\r", b"\r\n", b",", b",,", b" ", b"\t", b'"', b"'", b"#", b"-", b"nan", b"inf",
    b"1e308", b"-1e308", b"99999999999999999999", b"1e-320", b"1_000", b"0x1F", b"\xd9\xa1", b".", b"e", b"0",
    b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\x0c", b"\x85", b"\xe2\x80\xa8", b"\x1a", b"t,id,x,y", b"PAR1",
]  # fmt: skip


def mutate(content: bytes, rng: random.Random) -> bytes:
    """One to four small accidents."""
    for _ in range(rng.randint(1, 4)):
        i, j = sorted(rng.randrange(len(content) + 1) for _ in range(2))
        j = min(j, i + rng.choice([0, 1, 5, 40, 400]))
        lines = content.split(b"\n")
        content = rng.choice(
            [
                content[:i] + rng.choice(TOKENS) + content[j:],
                content[:i] + content[i:j] * 2 + content[j:],
                content[:i] + rng.randbytes(j - i) + content[j:],
                content[: max(i, 1)],
                b"\n".join(rng.sample(lines, len(lines))),
                b"\n".join(
                    rng.choice([line, line[: rng.randrange(len(line) + 1)]])
                    for line in lines
                ),
                content.replace(
                    rng.choice([b",", b".", b"1", b" "]),
                    rng.choice(TOKENS),
                    rng.choice([1, 3, -1]),
                ),
            ]
        )
    return content


def lines_of(path: Path) -> int:
    content = path.read_bytes()
    content = gzip.decompress(content) if content[:2] == b"\x1f\x8b" else content
    return content.count(b"\n") + (not content.endswith(b"\n"))


RATE = 12.5
"""Frames a second; a frame is 0.08 s."""


def people(seed: int = 0, *, count: int = 12, begin: int = 0) -> pd.DataFrame:
    """People who walk straight through a hall of 12 m by 8 m: id, frame, x, y [m]."""
    rng = np.random.default_rng(seed)
    rows = []
    for person in range(count):
        frame = begin + rng.integers(0, 100) + np.arange(100)
        a, b = rng.uniform((0, 0), (12, 8), (2, 2))
        where = a + np.linspace(0, 1, 100)[:, None] * (b - a)
        rows.append(
            pd.DataFrame(
                {"id": person + 1, "frame": frame, "x": where[:, 0], "y": where[:, 1]}
            )
        )
    return pd.concat(rows, ignore_index=True).round(4)


def in_seconds(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(t=rows["frame"] / RATE)[["t", "id", "x", "y"]]
