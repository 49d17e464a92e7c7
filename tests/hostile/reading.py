"""Valid but odd tables, and damaged ones: read as the table they were made of, or refused, or counted.

A known table of people is written with an odd separator, quoting, numbers, times, ids, columns and libraries,
nothing of it by szlib. Each row that is accepted must be a row of the truth, of the same person in the same
recording; each row that is missing must be counted as rejected. Else the file is read wrong in silence.
"""

from __future__ import annotations

import csv
import io
import json
import os
import random
import sqlite3
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

import szlib
from szlib.tracks.readers import read_raw

FILES = {False: 80, True: 10_000}
BEGIN = 1_700_000_000.0
RECORDINGS = ("scene", "camera", "recordingId", "date", "take")
NAMES = {
    "t": "t time Time",
    "frame": "frame Frame",
    "id": "id ped track_id",
    "x": "x pos_x",
    "y": "y pos_y",
}


def attack(long: bool) -> Counter[str]:
    """Read the files, and count the outcomes."""
    tally = Counter(dict.fromkeys(("read", "refused", "broken: wrong in silence"), 0))
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(int(os.environ.get("SZLIB_FILES", FILES[long]))):
            outcome = read(Path(folder), seed)
            tally[outcome] += 1
            if outcome.startswith("broken"):
                print(f"seed {seed}: {outcome}", flush=True)
    return tally


def make_truth(rng: np.random.Generator, n_recordings: int) -> pd.DataFrame:
    """People who walk straight, at 10 Hz; ids and times begin again in each recording."""
    rows = []
    for recording in range(n_recordings):
        for person in range(int(rng.integers(3, 7))):
            n, begin = int(rng.integers(60, 120)), int(rng.integers(0, 50))
            start, velocity = rng.uniform(-6, 6, 2), rng.normal(0, 0.9, 2)
            tick = begin + np.arange(n)
            places = start + np.arange(n)[:, None] / 10 * (
                velocity + 0.6 * np.sign(velocity)
            )
            rows.append(pd.DataFrame({"recording": recording, "person": person, "tick": tick,
                                      "x": places[:, 0].round(3), "y": places[:, 1].round(3)}))  # fmt: skip
    return pd.concat(rows, ignore_index=True)


def read(folder: Path, seed: int) -> str:
    """Write one file, read it, and judge what came."""
    draw, rng = random.Random(seed), np.random.default_rng(seed)
    n_recordings = draw.choice((1, 1, 2))
    truth = make_truth(rng, n_recordings)
    ids = draw.choice(("whole", "large", "text", "padded"))
    write_id: dict[str, Callable[[int], object]] = {
        "whole": lambda k: k + 1,
        "large": lambda k: 9_007_199_254_740_993 + k,
        "text": lambda k: f"p{k}",
        "padded": lambda k: ("1", "01", "2", "1e3", "1000", "x")[k],
    }
    table = pd.DataFrame(
        {"id": truth["person"].map(write_id[ids]), "x": truth["x"], "y": truth["y"]}
    )
    clock = draw.choice(("seconds", "frame", "since 1970", "milliseconds", "text"))
    seconds = truth["tick"] / 10 + (0 if clock in ("seconds", "frame") else BEGIN)
    options: dict[str, object] = {}
    if clock == "frame":
        table.insert(0, "frame", truth["tick"])
        options["frame_rate"] = 10
    elif clock == "milliseconds":
        table.insert(0, "t", (seconds * 1000).round().astype("int64"))
    elif clock == "text":
        when = pd.to_datetime((seconds * 1000).round().astype("int64"), unit="ms")
        table.insert(0, "t", when.dt.strftime("%Y-%m-%dT%H:%M:%S.%f").str[:-3] + "Z")
    else:
        table.insert(0, "t", seconds.round(1))
    table = table.rename(
        columns={name: draw.choice(NAMES[name].split()) for name in table}
    )
    if n_recordings > 1 or draw.random() < 0.3:
        name = draw.choice(RECORDINGS)
        table[name] = [f"r{k}" for k in truth["recording"]]
        if draw.random() < 0.5:
            options["columns"] = {"day": name}
    if draw.random() < 0.5:
        table["speed"] = rng.random(len(table)).round(2)
    if draw.random() < 0.3:
        table["constant"] = 7
    if (
        clock in ("since 1970", "milliseconds", "text")
        and ids == "whole"
        and draw.random() < 0.3
    ):
        table = table.sample(frac=1, random_state=seed)
    path = WRITERS[draw.choice(list(WRITERS))](table, folder, draw)
    options |= draw.choice(({}, {}, {"area": "0 12 0 8"}))
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        try:
            found = read_raw(path, recipe=szlib.Recipe(**options))
        except szlib.SzlibError:
            return "refused"
    if found.attrs.get("area") != options.get("area"):
        return "broken: another area"
    return judge(found, truth, table.index.to_numpy())


def judge(found: pd.DataFrame, truth: pd.DataFrame, order: np.ndarray) -> str:
    """Whether all rows are those of the truth, under one id a person, and none is lost uncounted."""
    at = (
        found["t"].to_numpy() % BEGIN
        if found["t"].min() > BEGIN / 2
        else found["t"].to_numpy()
    )
    who = found["day"].astype(str) + "/" + found["id"].astype(str)
    rows = (
        found[["x", "y"]].round(3).assign(who=who, tick=(10 * at).round().astype(int))
    )
    known = rows.merge(truth, on=["tick", "x", "y"], how="left")
    person = known["recording"].astype(str) + "/" + known["person"].astype(str)
    n_lost = sum(sum(s["rejected"].values()) for s in found.attrs["funnel"])
    whole = known["person"].notna().all() and len(known) == len(rows)
    one_each = (person.groupby(known["who"]).nunique() == 1).all()
    one_id = (known["who"].groupby(person).nunique() == 1).all()
    is_true = whole and one_each and one_id and len(rows) + n_lost >= len(truth)
    return "read" if is_true else "broken: wrong in silence"


def write_text(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """Text, by the csv module, perhaps with damaged rows."""
    separator, end = draw.choice((",", ";", "\t", " ")), draw.choice(("\n", "\r\n"))
    out = io.StringIO()
    quoting = (
        draw.choice((csv.QUOTE_MINIMAL, csv.QUOTE_NONNUMERIC))
        if separator != " "
        else csv.QUOTE_NONE
    )
    writer = csv.writer(
        out, delimiter=separator, lineterminator="\n", quoting=quoting, escapechar="\\"
    )
    writer.writerows([table.columns, *table.itertuples(index=False)])
    lines = out.getvalue().splitlines()
    if separator == ";" and draw.random() < 0.5:
        lines = [line.replace(".", ",") for line in lines]
    share = draw.choice((0.0, 0.0, 0.001, 0.01, 0.04))
    for k in range(1, len(lines)):
        if draw.random() < share:
            lines[k] = damage(lines[k], separator, draw)
    if separator == " " and draw.random() < 0.5:
        lines = [line.replace(" ", "   ") for line in lines]
    path = folder / f"hall.{draw.choice(('csv', 'txt'))}"
    path.write_bytes(
        end.join([*lines, ""]).encode(draw.choice(("utf-8", "utf-8-sig", "utf-16")))
    )
    return path


def damage(line: str, separator: str, draw: random.Random) -> str:
    """A row with one accident."""
    fields = line.split(separator)
    i = draw.randrange(len(fields))
    kind = draw.choice(("blank", "missing", "doubled", "quote", "cut"))
    if kind == "cut":
        return line[: draw.randrange(line.rindex(separator))]
    changed = {
        "blank": [""],
        "missing": [],
        "doubled": 2 * [fields[i]],
        "quote": ['"' + fields[i]],
    }
    return separator.join([*fields[:i], *changed[kind], *fields[i + 1 :]])


def write_parquet(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """By Polars or by pandas."""
    path = folder / "hall.parquet"
    if draw.random() < 0.5:
        pl.from_pandas(table.reset_index(drop=True)).write_parquet(path)
    else:
        table.to_parquet(path)
    return path


def write_sqlite(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """As the one table of a database."""
    path = folder / f"hall{draw.randrange(10**9)}.sqlite"
    with closing(sqlite3.connect(path)) as file:
        table.to_sql("tracks", file, index=False)
    return path


def write_json(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """As JSON lines, or as a list of objects."""
    path = folder / "hall.json"
    rows = table.astype(object).to_dict("records")
    texts = [json.dumps(row, default=lambda value: value.item()) for row in rows]
    is_list = draw.random() < 0.5
    path.write_text(f"[{', '.join(texts)}]" if is_list else "\n".join(texts))
    return path


def write_fixed_width(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """Columns of a fixed width, perhaps with blank fields."""
    path = folder / "hall.txt"
    texts = table.astype(str)
    if draw.random() < 0.5:
        at = draw.sample(range(len(table)), len(table) // draw.choice((200, 40, 10)))
        texts.iloc[at, draw.randrange(texts.shape[1])] = ""
    path.write_text(texts.to_string(index=False))
    return path


def write_zip(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """A text in a zip archive, sometimes beside another file."""
    plain, path = write_text(table, folder, draw), folder / "hall.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(plain, "data/hall.csv")
        if draw.random() < 0.2:
            archive.writestr("readme.txt", "people")
    return path


def write_sheet(table: pd.DataFrame, folder: Path, draw: random.Random) -> Path:
    """What Excel writes: to be refused with a command."""
    path = folder / "hall.xlsx"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
        archive.writestr("xl/worksheets/sheet1.xml", table.to_html())
    return path


WRITERS = {
    "text": write_text,
    "csv": write_text,
    "parquet": write_parquet,
    "sqlite": write_sqlite,
    "json": write_json,
    "fixed width": write_fixed_width,
    "zip": write_zip,
    "sheet": write_sheet,
}
