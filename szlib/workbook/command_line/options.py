"""What may be said to each command."""

from __future__ import annotations

import argparse
import os

from ... import __version__, memory
from ...errors import SzlibError
from . import commands


def _jobs(text: str) -> int:
    """A number of processes, at least 1."""
    return _count(text, least=1)


def _count(text: str, least: int = 0) -> int:
    """A whole number of a command line."""
    if not text.isascii() or not text.isdigit() or len(text) > 9 or int(text) < least:
        raise argparse.ArgumentTypeError(f"expected a whole number >= {least}; got {text[:40]!a}")
    return int(text)


def _memory(text: str) -> int:
    """An amount of memory of a command line."""
    try:
        return memory.parse_size(text)
    except SzlibError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def parser() -> argparse.ArgumentParser:
    """Of the command line; each command has its own below it."""
    whole = argparse.ArgumentParser(
        prog="szlib", description="Social zones from pedestrian tracks, and a robot that respects them."
    )
    whole.add_argument("--version", action="version", version=f"szlib {__version__}")
    each = whole.add_subparsers(required=True, metavar="COMMAND")
    for name, add, summary in (
        ("run", _add_run, "execute the notebooks, headless, and check their results"),
        ("report", _add_report, "make the report of a run anew: one HTML file"),
        ("inspect", _add_inspect, "print what becomes of the rows of a file"),
        ("extract", _add_extract, "find the encounters of many days, resumably"),
    ):
        add(each.add_parser(name, help=summary))
    return whole


def _add_run(run: argparse.ArgumentParser) -> None:
    run.add_argument(
        "--data", nargs="+", default=["synthetic"], metavar="DATA",
        help="synthetic (default), atc-1hz, atc-10-days, or files, folders or globs of tracks",
    )  # fmt: skip
    run.add_argument(
        "--out", type=os.path.abspath, metavar="FOLDER",
        help="where results go (default: results, beside the notebooks)",
    )  # fmt: skip
    run.add_argument(
        "--jobs", type=_jobs, default=min(os.cpu_count() or 1, 4), metavar="N",
        help="notebooks at a time (default: the cores, at most 4)",
    )  # fmt: skip
    run.add_argument(
        "--only", nargs="+", default=[], metavar="NN", help="run these notebooks only, such as 07"
    )
    run.add_argument(
        "-p", "--parameter", action="append", default=[], metavar="NAME=VALUE",
        help="set a notebook parameter, such as seed=1",
    )  # fmt: skip
    _add_scheduler(run)
    _add_limits(run)
    run.set_defaults(command=commands.run_command)


def _add_report(report: argparse.ArgumentParser) -> None:
    report.add_argument(
        "folder", nargs="?", metavar="FOLDER",
        help="the run's folder of results (default: results/synthetic, beside the notebooks)",
    )  # fmt: skip
    report.add_argument("--open", action="store_true", help="and open it in a browser")
    report.set_defaults(command=commands.report_command, memory=None)


def _add_inspect(inspect: argparse.ArgumentParser) -> None:
    inspect.add_argument("file", help="a file of tracks: ATC, EWAP, or tidy; plain or .gz")
    _add_limits(inspect)
    inspect.set_defaults(command=commands.inspect_command)


def _add_extract(extract: argparse.ArgumentParser) -> None:
    extract.add_argument("data", nargs="+", metavar="PATH", help="files, folders or globs of tracks")
    extract.add_argument("--out", default="results/days", metavar="FOLDER", help="a Parquet file a day")
    extract.add_argument("--jobs", type=_jobs, metavar="N", help="days at a time (default: one)")
    extract.add_argument("--exclude", nargs="+", default=[], metavar="DAY", help="days to leave out")
    _add_scheduler(extract)
    _add_limits(extract)
    extract.set_defaults(command=commands.extract_command)


def _add_scheduler(command: argparse.ArgumentParser) -> None:
    command.add_argument("--scheduler", metavar="ADDRESS", help="hand the work to a Dask cluster")


def _add_limits(command: argparse.ArgumentParser) -> None:
    """Where people are looked at, and how much memory that may take."""
    area = command.add_mutually_exclusive_group()
    area.add_argument(
        "--square", nargs=4, type=float, metavar=("X0", "X1", "Y0", "Y1"),
        help="where encounters are found [m] (default: the mall's square for ATC files; else --auto)",
    )  # fmt: skip
    area.add_argument("--polygon", metavar="FILE", help="the same as a polygon: WKT or GeoJSON [m]")
    area.add_argument(
        "--auto", action="store_true", help="the largest rectangle in which people walked everywhere"
    )
    command.add_argument(
        "--memory", type=_memory, metavar="SIZE",
        help="what may be used, such as 4GB (default: 80 %% of what the machine has left)",
    )  # fmt: skip
