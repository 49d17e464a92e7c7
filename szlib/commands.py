"""The commands beside `szlib run`: `szlib inspect` a file, `szlib extract` encounters from many days."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import datasets, funnels
from .errors import DataError, DataWarning
from .extraction import Chain, extract_days
from .jobs import cluster


def add_commands(commands: Any) -> None:
    """Add the parsers of `inspect` and `extract`; each sets `command`, which runs it."""
    inspect = commands.add_parser("inspect", help="print what becomes of the rows of a file")
    inspect.add_argument("file", help="a file of tracks: ATC, EWAP, or tidy; plain or .gz")
    inspect.set_defaults(command=lambda options: _inspect(options.file))
    extract = commands.add_parser("extract", help="find the encounters of many days, resumably")
    extract.add_argument("data", nargs="+", metavar="PATH", help="files, folders or globs of tracks")
    extract.add_argument("--out", default="results/days", metavar="FOLDER", help="a Parquet file a day")
    extract.add_argument("--jobs", type=int, default=None, help="days at a time (default: one)")
    extract.add_argument("--exclude", nargs="+", default=[], metavar="DAY", help="days to leave out")
    add_scheduler(extract)
    extract.set_defaults(command=_extract)


def add_scheduler(parser: argparse.ArgumentParser) -> None:
    """Add the option `--scheduler`."""
    parser.add_argument("--scheduler", metavar="ADDRESS", help="hand the work to a Dask cluster")


def inspect(file: str | Path) -> str:
    """The funnel of a file down to its encounters, one line for each count, as a table to read."""
    files = datasets.find([file], cache=Path())
    if len(files) != 1:
        raise DataError(f"{file}: are {len(files)} files; expected one: {', '.join(map(str, files[:5]))}")
    with warnings.catch_warnings():  # the table tells what a warning would
        warnings.simplefilter("ignore", DataWarning)
        samples = Chain().encounters(files)
    table = funnels.table(funnels.of(samples))
    table["stage"] = table["stage"].where(~table["stage"].duplicated(), "")
    wide = {name: int(table[name].str.len().max()) for name in ("stage", "what")}
    return "\n".join(
        f"{row.stage:<{wide['stage']}}  {row.what:<{wide['what']}} {row.rows:>12,}"
        for row in table.itertuples()
    )


def _inspect(file: str) -> int:
    print(inspect(file))
    return 0


def _extract(options: argparse.Namespace) -> int:
    paths: Sequence[str] = options.data
    with cluster(options.scheduler):
        done = extract_days(paths, out=options.out, n_jobs=options.jobs, exclude=options.exclude)
    print(done)
    return 1 if len(done.failed) else 0
