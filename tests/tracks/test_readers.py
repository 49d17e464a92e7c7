"""Reading: every format gives the same table, and errors name the file and what is wrong with it."""

from __future__ import annotations

import datetime
import gzip
import random
import re
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.raw_days import read_near
from helpers.track_files import (
    BEGIN,
    WRITERS,
    as_1hz,
    as_ewap,
    as_raw,
    as_tidy,
    lines_of,
    mutate,
    samples,
    write,
)
from helpers.track_tables import real_data

import szlib
from szlib.tracks import funnels
from szlib.tracks.readers import read_raw
from szlib.tracks.recipe import SHAPES


def scaled(factor: float) -> pd.DataFrame:
    """The same in other units of position."""
    return samples().assign(
        x=lambda rows: rows["x"] * factor, y=lambda rows: rows["y"] * factor
    )


def read_quietly(path: Path) -> tuple[pd.DataFrame, str]:
    """The table, and the warnings about rejected rows; any other warning is an error."""
    with warnings.catch_warnings(record=True) as message:
        warnings.simplefilter("error")
        warnings.simplefilter("always", szlib.DataWarning)
        frame = read_raw(path)
    return frame, "\n".join(str(w.message) for w in message)


def stage_of(frame: pd.DataFrame, name: str) -> dict:
    return next(s for s in funnels.get(frame) if s["stage"].startswith(name))


def without_day(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[["id", "t", "x", "y"]]


# --- every format ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gz"])
def test_every_format_gives_the_same_table(
    tmp_path: Path, name: str, packed: bool
) -> None:
    rows = samples()
    content = WRITERS[name](rows).encode()
    path = write(
        tmp_path / ("rec.txt" + ".gz" * packed),
        gzip.compress(content) if packed else content,
    )
    frame = read_raw(path)
    expected = rows.sort_values(["id", "t"], ignore_index=True)
    pd.testing.assert_frame_equal(
        without_day(frame), expected[["id", "t", "x", "y"]], rtol=0, atol=1e-6
    )
    assert list(frame["day"].unique()) == (
        ["rec"] if name == "ewap" else ["2012-10-24"]
    )
    assert (
        stage_of(frame, "read")["entered"]
        == len(rows)
        == stage_of(frame, "merge")["kept"]
    )
    assert frame.attrs["max_gap"] == (
        pytest.approx(0.9) if name == "ewap" else SHAPES[name].recipe.max_gap
    )


def test_parquet_gives_the_same_table_as_csv(tmp_path: Path) -> None:
    samples().to_parquet(tmp_path / "a.parquet")
    write(
        tmp_path / "a.parquet.gz", gzip.compress((tmp_path / "a.parquet").read_bytes())
    )
    from_csv = read_raw(write(tmp_path / "a.csv", as_tidy(samples())))
    for name in ("a.parquet", "a.parquet.gz"):
        pd.testing.assert_frame_equal(read_raw(tmp_path / name), from_csv)


@pytest.mark.parametrize("seed", range(5))
def test_tidy_columns_may_be_in_any_order_with_additional_ones(
    tmp_path: Path, seed: int
) -> None:
    rows = samples().assign(day="2013-01-06", note="", vx=1.0, vy=np.nan)
    plain = read_raw(
        write(tmp_path / "plain.csv", as_tidy(rows[["day", "t", "id", "x", "y"]]))
    )
    order = list(rows.columns)
    random.Random(seed).shuffle(order)
    rows[order].to_parquet(tmp_path / "mixed.parquet")
    pd.testing.assert_frame_equal(
        read_raw(write(tmp_path / "mixed.csv", as_tidy(rows[order]))), plain
    )
    pd.testing.assert_frame_equal(read_raw(tmp_path / "mixed.parquet"), plain)
    assert list(plain["day"].unique()) == ["2013-01-06"]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_written_track_table_is_read_back(tmp_path: Path, suffix: str) -> None:
    tracks = szlib.read_tracks(write(tmp_path / "a.csv", as_1hz(samples())))
    # a single tick has no velocity
    alone = tracks.iloc[:1].assign(id=99, vx=np.nan, vy=np.nan)
    tracks = pd.concat([tracks, alone], ignore_index=True)
    path = tmp_path / f"tracks.{suffix}"
    tracks.to_csv(path, index=False) if suffix == "csv" else tracks.to_parquet(path)
    pd.testing.assert_frame_equal(
        szlib.read_tracks(path), tracks, check_categorical=False, rtol=1e-9
    )


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize(
    "change",
    [
        lambda b: b.replace(b"\n", b"\r\n"),
        lambda b: b"\xef\xbb\xbf" + b,
        lambda b: b.removesuffix(b"\n"),
        lambda b: b"\xef\xbb\xbf" + b.replace(b"\n", b"\r\n").removesuffix(b"\r\n"),
    ],
    ids=["CRLF", "BOM", "no newline at the end", "all of it"],
)
def test_line_ends_and_byte_order_mark_are_ignored(
    tmp_path: Path, name: str, change: Callable
) -> None:
    content = WRITERS[name](samples()).encode()
    (tmp_path / "a").mkdir()
    plain = read_raw(write(tmp_path / "rec.csv", content))
    pd.testing.assert_frame_equal(
        read_raw(write(tmp_path / "a" / "rec.csv", change(content))), plain
    )


# --- days and files ----------------------------------------------------------------------------------


def test_files_of_one_day_are_merged(tmp_path: Path) -> None:
    rows = samples(count=30)
    whole = read_raw(write(tmp_path / "whole.csv", as_raw(rows)))
    pieces = [write(tmp_path / f"{k}.csv", as_raw(rows.iloc[k::3])) for k in (2, 0, 1)]
    together = read_raw(pieces)
    pd.testing.assert_frame_equal(together, whole)
    assert [s["entered"] for s in funnels.get(together)] == [30, 30, 30, 90]


def test_the_day_of_the_mall_is_the_date_in_tokyo_of_others_in_utc(
    tmp_path: Path,
) -> None:
    midnight = pd.Timestamp("2012-10-25", tz="Asia/Tokyo").timestamp()
    path = write(
        tmp_path / "atc-20200101.csv",
        as_1hz(samples(people=1, count=4, begin=midnight - 0.8)),
    )
    frame = read_raw(path)
    assert frame["day"].astype(str).tolist() == ["2012-10-24"] * 2 + ["2012-10-25"] * 2
    assert set(read_raw(path, recipe=szlib.Recipe(tz="UTC"))["day"]) == {"2012-10-24"}
    table = write(
        tmp_path / "hall.csv", as_tidy(samples(people=1, count=4, begin=midnight - 0.8))
    )
    assert set(read_raw(table)["day"]) == {"2012-10-24"}
    assert read_raw(table, recipe=szlib.Recipe(tz="Asia/Tokyo"))["day"].nunique() == 2
    with pytest.raises(szlib.DataError, match="unknown time zone 'Mars/Olympus'"):
        read_raw(path, recipe=szlib.Recipe(tz="Mars/Olympus"))


def test_excluded_days_are_left_out_and_counted(tmp_path: Path) -> None:
    first, second = samples(), samples(count=5, begin=BEGIN + 86_400)
    path = write(tmp_path / "two.csv", as_1hz(pd.concat([first, second])))
    for exclude in (
        ["2012-10-24"],
        "2012-10-24",
        iter([pd.Timestamp("2012-10-24").date()]),
    ):
        frame = read_raw(path, exclude=exclude)
        assert set(frame["day"]) == {"2012-10-25"}
        assert stage_of(frame, "merge")["rejected"] == {"excluded day": len(first)}
    with pytest.raises(
        szlib.DataError, match=r"excluded days .*2012-10-24.*2012-10-25"
    ):
        read_raw(path, exclude=["2012-10-25", "2012-10-24"])


def test_ewap_files_of_one_name_are_recordings_of_their_own(tmp_path: Path) -> None:
    paths = []
    for name, people in (("eth", 2), ("hotel", 3)):
        (tmp_path / name).mkdir()
        rows = samples(people=people)
        text = as_ewap(rows.assign(y=rows["y"] + people))
        paths.append(write(tmp_path / name / "obsmat.txt", text))
    assert set(read_raw(paths)["day"]) == {"eth-obsmat", "hotel-obsmat"}
    hotel = write(tmp_path / "hotel.txt", paths[1].read_text())
    assert set(read_raw([paths[0], hotel])["day"]) == {"obsmat", "hotel"}


# --- rejected rows -----------------------------------------------------------------------------------

GOOD = as_1hz(samples(people=1, count=60)).splitlines()
BAD_ROWS = {
    "1351040400.4,7,5,5,1.2": "missing or extra fields",
    "1351040400.4,7,5,5,1.2,0.1,9": "missing or extra fields",
    "": "missing or extra fields",
    "   ": "missing or extra fields",
    "1351040400.4,7,abc,5,1.2,0.1": "missing or not a number",
    "1351040400.4,7,,5,1.2,0.1": "missing or not a number",
    "one hour,7,5,5,1.2,0.1": "missing or not a number",
    "1351040400.4,7,nan,5,1.2,0.1": "not finite",
    "1351040400.4,7,5,NaN,1.2,0.1": "not finite",
    "1351040400.4,7,inf,5,1.2,0.1": "not finite",
    "1351040400.4,7,5,-1e400,1.2,0.1": "not finite",
    "1351040400.4,7.5,5,5,1.2,0.1": "id not a whole number of 0 or more",
    "1351040400.4,1e300,5,5,1.2,0.1": "id not a whole number of 0 or more",
    "1351040400400,7,5,5,1.2,0.1": "time not in seconds since 1970",
    "1e308,7,5,5,1.2,0.1": "time not in seconds since 1970",
    "1351040400.4,7,1e300,5,1.2,0.1": "position not on Earth",
    "\x00\x01\x02": "missing or extra fields",
}  # fmt: skip


@pytest.mark.parametrize(
    ("bad", "reason"), BAD_ROWS.items(), ids=[repr(row) for row in BAD_ROWS]
)
def test_a_bad_row_is_rejected_with_a_warning_that_gives_its_line(
    tmp_path: Path, bad: str, reason: str
) -> None:
    content = "\n".join([*GOOD[:3], bad, *GOOD[3:], bad])
    frame, message = read_quietly(write(tmp_path / "a.csv", content + "\n"))
    assert (
        re.sub(r" \(column .*?\)", "", message)
        == f"a.csv, first at line 4: rejected rows: 2 x {reason}"
    )
    assert ("holds" in message) == ("not a " in reason)
    assert stage_of(frame, "read") == {
        "stage": "read a.csv",
        "entered": len(GOOD) + 2,
        "kept": len(GOOD),
        "rejected": {reason: 2},
    }
    pd.testing.assert_frame_equal(
        frame, read_raw(write(tmp_path / "a.csv", "\n".join(GOOD)))
    )


@pytest.mark.parametrize(("name", "line"), [("atc-raw", 2), ("ewap", 2), ("tidy", 3)])
def test_every_format_gives_the_line_of_a_bad_row(
    tmp_path: Path, name: str, line: int
) -> None:
    rows = WRITERS[name](samples(count=9)).splitlines()
    _, message = read_quietly(
        write(
            tmp_path / "a.csv", "\n".join([*rows[: line - 1], "x", *rows[line - 1 :]])
        )
    )
    assert re.match(
        rf"a\.csv, first at line {line}\b.*: rejected rows: 1 x missing or", message
    )


def test_a_file_with_more_than_a_twentieth_of_bad_rows_is_refused(
    tmp_path: Path,
) -> None:
    path = write(tmp_path / "a.csv", "\n".join([*GOOD[:57], "x", "y", "z"]))
    frame, message = read_quietly(path)
    assert (len(frame), message) == (
        57,
        "a.csv, first at line 58: rejected rows: 3 x missing or extra fields",
    )
    path = write(tmp_path / "a.csv", "\n".join([*GOOD[:56], "x", "y", "z"]))
    with pytest.raises(
        szlib.DataError,
        match=r"a\.csv, line 57: missing or extra fields; 3 of 59 rows cannot be .*max_rejected=0\.06",
    ):
        read_raw(path)
    with pytest.warns(szlib.DataWarning, match="3 x missing"):
        assert len(read_raw(path, recipe=szlib.Recipe(max_rejected=0.06))) == 56
    with pytest.raises(szlib.DataError, match="max_rejected must be from 0 to 1"):
        szlib.Recipe(max_rejected=2)


@pytest.mark.parametrize("nobody", ["-1", "nan", "None", "NULL"])
def test_rows_of_nobody_are_rejected(tmp_path: Path, nobody: str) -> None:
    rows = samples().astype({"id": str})
    rows.loc[[3, 4], "id"] = nobody
    _, message = read_quietly(write(tmp_path / "a.csv", as_tidy(rows)))
    assert message.startswith(f"a.csv, first at line 5 (column 'id' holds {nobody!r})")
    assert message.endswith("2 x id not a whole number of 0 or more")


def test_names_that_are_not_utf8_are_refused(tmp_path: Path) -> None:
    rows = samples().assign(id="Müller")
    text = as_tidy(rows).encode("latin-1")
    with pytest.raises(szlib.DataError, match="is not UTF-8; save it as UTF-8"):
        read_raw(write(tmp_path / "a.csv", text))


def test_an_origin_far_from_the_positions_is_refused() -> None:
    rows = samples().assign(x=8.5, y=lambda table: 47.3 + 1e-5 * table["t"])
    for origin in ((0.0, 0.0), (47.3, 8.5)):
        with pytest.raises(szlib.DataError, match=r"near them.* origin=\[8.5, "):
            szlib.read_tracks(rows, unit="deg", origin=origin)


def test_rows_without_a_day_are_rejected(tmp_path: Path) -> None:
    rows = samples().assign(day="2013-01-06")
    rows.loc[[3, 4], "day"] = None
    _, message = read_quietly(write(tmp_path / "a.csv", as_tidy(rows)))
    assert message == "a.csv, first at line 5: rejected rows: 2 x no day"


def test_the_first_of_duplicate_rows_is_kept_and_others_are_counted(
    tmp_path: Path,
) -> None:
    rows = samples()
    again = rows.assign(x=rows["x"] + 1).iloc[:4]
    frame, message = read_quietly(
        write(tmp_path / "a.csv", as_1hz(pd.concat([rows, again])))
    )
    assert message == "all files: rejected rows: 4 x duplicate (day, id, t)"
    assert stage_of(frame, "merge")["rejected"] == {"duplicate (day, id, t)": 4}
    alone = read_raw(write(tmp_path / "a.csv", as_1hz(rows)))
    pd.testing.assert_frame_equal(frame, alone)


@pytest.mark.parametrize("name", WRITERS)
def test_unsorted_rows_are_sorted(tmp_path: Path, name: str) -> None:
    rows = samples()
    expected = read_raw(write(tmp_path / "rec.csv", WRITERS[name](rows)))
    shuffled = rows.sample(frac=1, random_state=3)
    pd.testing.assert_frame_equal(
        read_raw(write(tmp_path / "rec.csv", WRITERS[name](shuffled))), expected
    )


def test_the_order_of_rows_does_not_matter(tmp_path: Path) -> None:
    rows = samples(people=5)
    tables = [
        read_raw(
            write(
                tmp_path / "rec.csv",
                as_raw(rows.sort_values(by, kind="stable", ascending=way)),
            )
        )
        for by in (["id", "t"], ["t", "id"])
        for way in (True, False)
    ]
    for table in tables[1:]:
        pd.testing.assert_frame_equal(table, tables[0], check_exact=True)


# --- files that cannot be used -----------------------------------------------------------------------

TIDY_ROWS = "1351040400.0,7,5.0,5.0\n1351040400.4,7,5.4,5.0\n"
PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x01\x00\x00\x00\x01"
PNG += b"\x08\x06\x00\x00\x00\x1f\x15\xc4\x89"
UNUSABLE: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "line 1: the file is empty"),
    "only blank lines": ("\n\n\n", "line 1: the file is empty or begins with a blank line"),
    "blank first line": ("\n" + as_raw(samples()), "line 1: the file is empty or begins with a blank line"),
    "only a header": ("t,id,x,y\n", "holds no row"),
    "missing columns": ("t,id,x\n1,2,3\n", "line 1: 't,id,x' has no column y"),
    "other columns": ("time,person,east,north\n1,2,3,4\n", "has no column x, y"),
    "a column twice": ("t,id,x,y,x\n1,2,3,4,5\n", "names x twice"),
    "no header": (TIDY_ROWS, "has no column t, id, x, y"),
    "semicolons": (as_1hz(samples()).replace(",", ";"), "line 1"),
    "milliseconds": (as_1hz(samples()).replace(".", ""), "has no column t, id, x, y"),
    "days since 1970": ("t,id,x,y\n15637000000,7,5,5\n", "line 2: time not in seconds since 1970"),
    "places as names": ("t,id,x,y\n1,1,door,5\n2,1,5,6\n3,1,in,\n", "a number (column 'x' holds 'door')"),
    "millimetres, 1 Hz": (as_1hz(scaled(1e3)), "unit='mm'"),
    "millimetres, tidy": (as_tidy(scaled(1e3)), "unit='mm'"),
    "PNG": (PNG + bytes(range(256)) * 9, "line 1"),
    "HTML": ("<!doctype html>\n<html><body>404</body></html>\n", "line 1"),
    "JSON": ('{"t": 1, "id": 2, "x": 3}\n', "has no column y"),
    "zeros": (bytes(5000), "line 1"),
    "random bytes": (random.Random(1).randbytes(5000), "line 1"),
    "UTF-16": (as_raw(samples()).encode("utf-16")[:99], "line 1"),
    "one endless line": (b"1," * 300_000, "line 1"),
    "a truncated .gz": (gzip.compress(as_raw(samples()).encode())[:-30], "damaged .gz"),
    "a corrupt .gz": (gzip.compress(b"1,2\n" * 99)[:-8] + b"\x00" * 8, "damaged .gz"),
    "rubbish behind a .gz": (gzip.compress(as_raw(samples()).encode()) + b"rubbish", "damaged .gz"),
    "a .gz of nothing": (gzip.compress(b""), "line 1: the file is empty"),
    "a .gz of a .gz": (gzip.compress(gzip.compress(as_raw(samples()).encode())), "line 1"),
    "only the magic of .gz": (b"\x1f\x8b", "damaged .gz"),
    "damaged Parquet": (b"PAR1" + bytes(64) + b"PAR1", "damaged Parquet"),
    "only the magic of Parquet": (b"PAR1", "damaged Parquet"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "message"), UNUSABLE.values(), ids=UNUSABLE)
def test_an_unusable_file_is_refused_with_its_name_and_the_reason(
    tmp_path: Path, content: str | bytes, message: str
) -> None:
    path = write(tmp_path / "given.csv", content)
    with pytest.raises(szlib.DataError) as error:
        szlib.read_tracks(path)
    assert str(path) in str(error.value)
    assert message in str(error.value)
    assert len(str(error.value)) < 1000


@pytest.mark.parametrize(
    ("content", "message"),
    [(as_raw(scaled(1e-3)), "nobody walks"), (as_ewap(scaled(1e3)), "people move at")],
)
def test_another_unit_than_that_of_a_known_format_warns(
    tmp_path: Path, content: str, message: str
) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_raw(write(tmp_path / "given.csv", content))
    assert message in " ".join(str(each.message) for each in caught)


def test_one_file_in_a_zip_archive_is_read_several_are_refused(tmp_path: Path) -> None:
    plain = read_raw(write(tmp_path / "a.csv", as_raw(samples())))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("folder/b.csv", as_raw(samples()))
    pd.testing.assert_frame_equal(read_raw(tmp_path / "a.zip"), plain)
    with zipfile.ZipFile(tmp_path / "a.zip", "a") as archive:
        archive.writestr("c.csv", as_raw(samples()))
    with pytest.raises(szlib.DataError, match=r"a\.zip, line 1: .* holds 2 files; unp"):
        read_raw(tmp_path / "a.zip")


def test_utf_16_is_read(tmp_path: Path) -> None:
    plain = read_raw(write(tmp_path / "a.csv", as_tidy(samples())))
    for encoding in ("utf-16", "utf-8-sig"):
        path = write(tmp_path / "a.csv", as_tidy(samples()).encode(encoding))
        pd.testing.assert_frame_equal(read_raw(path), plain)


@pytest.mark.parametrize("cut", [0.2, 0.6, 0.95])
def test_truncated_parquet_is_refused(tmp_path: Path, cut: float) -> None:
    samples(count=300).to_parquet(tmp_path / "a.parquet")
    content = (tmp_path / "a.parquet").read_bytes()
    with pytest.raises(szlib.DataError, match=r"a\.parquet: damaged Parquet"):
        read_raw(write(tmp_path / "a.parquet", content[: int(len(content) * cut)]))


def test_parquet_columns_of_wrong_type_are_refused(tmp_path: Path) -> None:
    rows = samples()
    for message, table in {
        "no column y": rows.drop(columns="y"),
        "time not in seconds": rows.assign(t=[datetime.time(9, 30)] * len(rows)),
        "not a number": rows.assign(x="p" + rows["x"].astype(str)),
        "cannot be used as tidy": rows.assign(x=[[1.0, 2.0]] * len(rows)),
    }.items():
        table.to_parquet(tmp_path / "a.parquet")
        with pytest.raises(szlib.DataError, match=rf"a\.parquet.*{message}"):
            read_raw(tmp_path / "a.parquet")


@pytest.mark.parametrize(
    "times",
    [
        lambda t: pd.to_datetime(t, unit="s", utc=True).dt.round("ms").dt.as_unit("ms"),
        lambda t: (
            pd.to_datetime(t, unit="s", utc=True)
            .dt.tz_convert("Asia/Tokyo")
            .dt.tz_localize(None)
        ),
        lambda t: pd.to_timedelta(t, unit="s"),
    ],
    ids=["with a zone", "local", "duration"],
)
def test_parquet_times_with_a_type_are_read_in_seconds(
    tmp_path: Path, times: Callable[[pd.Series], pd.Series]
) -> None:
    rows = samples(begin=BEGIN)
    rows.assign(t=times(rows["t"])).to_parquet(tmp_path / "a.parquet")
    japan = szlib.Recipe(tz="Asia/Tokyo")
    read, expected = read_raw(tmp_path / "a.parquet", recipe=japan), read_raw(rows)
    np.testing.assert_allclose(read["t"], expected["t"], rtol=0, atol=1e-6)
    assert list(read["id"]) == list(expected["id"])


LARGE_ID = 2**53
LARGE = pd.DataFrame(
    {
        "t": np.tile(BEGIN + 0.4 * np.arange(20), 2),
        "id": np.repeat([LARGE_ID, LARGE_ID + 1], 20),
    }
)
LARGE["x"], LARGE["y"] = 5 + 0.4 * np.tile(np.arange(20), 2), np.repeat([5.0, 9.0], 20)


@pytest.mark.parametrize("name", [*WRITERS, "parquet", "table"])
def test_people_whose_ids_are_too_large_for_floats_stay_two(
    tmp_path: Path, name: str
) -> None:
    source: Any = LARGE
    if name == "parquet":
        source.to_parquet(tmp_path / "a.parquet")
        source = tmp_path / "a.parquet"
    elif name != "table":
        text = WRITERS[name](LARGE).replace("9.0071993e+15", "9007199254740992")  # EWAP
        lines = text.splitlines(keepends=True)
        lines[-20:] = [
            line.replace("9007199254740992", "9007199254740993") for line in lines[-20:]
        ]
        source = write(tmp_path / "a.csv", "".join(lines))
    options = szlib.Recipe(frame_rate=15 if name == "ewap" else None)
    assert set(read_raw(source, recipe=options)["id"]) == {LARGE_ID, LARGE_ID + 1}
    tracks = szlib.read_tracks(source, recipe=options)
    assert tracks.groupby("id")["y"].std().max() < 1e-9, "each walks straight ahead"


def test_streamed_people_whose_ids_are_too_large_for_floats_stay_two(
    tmp_path: Path,
) -> None:
    path = write(tmp_path / "a.csv", as_raw(LARGE.sort_values("t")))
    near = read_near(path, szlib.Square((0, 20), (0, 20)))
    assert set(near["id"]) == {LARGE_ID, LARGE_ID + 1} and len(near) == 40


@pytest.mark.parametrize(
    "text", ["9007199254740993.0", "9007199254740992.0", "1e16", str(2**63), "-1e300"]
)
def test_ids_that_are_not_exact_are_rejected_by_line(tmp_path: Path, text: str) -> None:
    lines = [*GOOD, f"{BEGIN + 40},{text},5,5,1.2,0.1"]
    frame, message = read_quietly(write(tmp_path / "a.csv", "\n".join(lines)))
    expected = f"line 61 (column id holds '{text}'): rejected rows: 1 x id not a whole"
    assert expected in message
    assert len(frame) == 60
    floats = LARGE.assign(id=LARGE["id"].astype(float))
    floats.to_parquet(tmp_path / "a.parquet")
    with pytest.raises(
        szlib.DataError,
        match=r"line 1: id not a whole number of 0 or more \(column 'id'\); 40 of 40 rows",
    ):
        read_raw(tmp_path / "a.parquet")


@pytest.mark.parametrize("name", ["می\u200cدان.csv", "👩\u200d🔬.csv.gz"])
def test_names_with_zero_width_joiners_are_text(tmp_path: Path, name: str) -> None:
    content = as_raw(samples()).encode()
    path = write(
        tmp_path / name, gzip.compress(content) if name.endswith("gz") else content
    )
    assert len(read_raw(path)) == 60
    done = szlib.extract_days(path, out=tmp_path / "out", progress=False)
    assert list(done.table["status"]) == ["done"]


def test_missing_files_folders_and_locked_files_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(szlib.DataError, match="no such file"):
        read_raw(tmp_path / "missing.csv")
    with pytest.raises(szlib.DataError, match="is a folder; pass the files in it"):
        read_raw(tmp_path)
    with pytest.raises(szlib.DataError, match="no track file was given"):
        read_raw([])
    path = write(tmp_path / "locked.csv", as_raw(samples()))

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(
        szlib.DataError, match=r"locked\.csv: cannot be opened .*Permission denied"
    ):
        read_raw(path)


def test_unknown_options_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", as_raw(samples()))
    with pytest.raises(szlib.DataError, match=r"file_format must be .*; got 'csv'"):
        read_raw(path, recipe=szlib.Recipe(file_format="csv"))
    with pytest.raises(szlib.DataError, match=r"unit must be one of .*; got 'ell'"):
        read_raw(path, recipe=szlib.Recipe(unit="ell"))
    with pytest.raises(
        szlib.DataError, match=r"a\.csv, line 1: missing or extra fields; 60 of 60 rows"
    ):
        read_raw(path, recipe=szlib.Recipe(file_format="atc-1hz"))


def test_a_given_unit_converts_positions(tmp_path: Path) -> None:
    rows = samples()
    millimetres = read_raw(write(tmp_path / "a.csv", as_raw(rows)))
    in_metres = read_raw(
        write(tmp_path / "a.csv", as_raw(scaled(1e-3))),
        recipe=szlib.Recipe(unit="m"),
    )
    pd.testing.assert_frame_equal(in_metres, millimetres, rtol=0, atol=2e-6)
    wide = read_raw(
        write(tmp_path / "a.csv", as_1hz(scaled(1e3))),
        recipe=szlib.Recipe(unit="mm"),
    )
    pd.testing.assert_frame_equal(wide, millimetres, rtol=0, atol=2e-6)


# --- random damage -----------------------------------------------------------------------------------


def read_or_refuse(path: Path) -> pd.DataFrame | None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", szlib.DataWarning)
        try:
            return szlib.read_tracks(path)
        except szlib.SzlibError as error:
            assert path.name in str(error) or "person" in str(error)
            return None


@pytest.mark.parametrize("seed", range(1))
@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gz"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_is_read_with_a_complete_funnel_or_refused(
    tmp_path: Path, name: str, packed: bool, seed: int
) -> None:
    rng = random.Random(f"{name} {packed} {seed}")
    content = WRITERS[name](samples(count=12)).encode()
    usable = 0
    for turn in range(25):
        path = tmp_path / f"m{turn}.csv"
        if packed and rng.random() < 0.3:
            path.write_bytes(mutate(gzip.compress(content), rng))
        else:
            path.write_bytes(
                gzip.compress(mutate(content, rng)) if packed else mutate(content, rng)
            )
        tracks = read_or_refuse(path)
        if tracks is None:
            continue
        usable += 1
        read, merged, clock = funnels.get(tracks)
        assert read["entered"] == lines_of(path) - (name == "tidy")
        assert (read["kept"], merged["kept"]) == (merged["entered"], clock["entered"])
        assert np.isfinite(tracks[["t", "x", "y"]].to_numpy()).all()
        assert not tracks.duplicated(["day", "id", "t"]).any()
    assert usable > 0


def test_damaged_parquet_is_read_or_refused(tmp_path: Path) -> None:
    samples(count=30).to_parquet(tmp_path / "a.parquet")
    content, rng = (tmp_path / "a.parquet").read_bytes(), random.Random(5)
    for turn in range(120):
        broken = bytearray(content)
        for _ in range(rng.randint(1, 4)):
            broken[rng.randrange(len(broken))] = rng.randrange(256)
        read_or_refuse(write(tmp_path / f"m{turn}.parquet", bytes(broken)))


# --- real data ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real_day() -> pd.DataFrame:
    return read_raw(sorted(real_data("atc-1hz").glob("*.csv")))


def test_the_real_day_is_read_completely(real_day: pd.DataFrame) -> None:
    assert len(real_day) == 624_951
    assert real_day["id"].nunique() == 15_066
    assert list(real_day["day"].cat.categories) == ["2012-10-24"]
    *files, merged = funnels.get(real_day)
    assert len(files) == 23
    assert (
        sum(f["entered"] for f in files)
        == sum(f["kept"] for f in files)
        == merged["kept"]
        == 624_951
    )
    opened, closed = (
        pd.Timestamp(t, unit="s", tz="Asia/Tokyo")
        for t in real_day["t"].agg(["min", "max"])
    )
    assert (opened.hour, closed.hour) == (9, 20)


def test_the_speed_column_of_the_real_day_is_too_large(real_day: pd.DataFrame) -> None:
    """Speed is computed from positions: the sensor gives 0.57 m/s to people who stand (< 0.1 m in 1 s)."""
    names = ["t", "id", "x", "y", "speed", "angle"]
    files = sorted(real_data("atc-1hz").glob("*.csv"))
    raw = pd.concat([pd.read_csv(file, names=names) for file in files]).sort_values(
        ["id", "t"]
    )
    step = raw.groupby("id")[["t", "x", "y"]].diff()
    moved = np.hypot(step["x"], step["y"]) / step["t"]
    said = raw.loc[(moved < 0.1) & (step["t"] < 1.2), "speed"].median()
    assert said == pytest.approx(0.57, abs=0.02)
    assert len(raw) == len(real_day)


def test_the_eth_sequence_is_read_completely() -> None:
    path = real_data("eth") / "seq_eth_obsmat.txt"
    frame = read_raw(path)
    assert (len(frame), frame["id"].nunique()) == (8908, 360)
    assert list(frame["day"].cat.categories) == ["seq_eth_obsmat"]
    given = pd.DataFrame(
        np.loadtxt(path)[:, [0, 1, 2, 4]], columns=["t", "id", "x", "y"]
    )
    given = given.assign(t=given["t"] / 15, id=given["id"].astype(int)).sort_values(
        ["id", "t"]
    )
    pd.testing.assert_frame_equal(
        without_day(frame), given[["id", "t", "x", "y"]].reset_index(drop=True)
    )
