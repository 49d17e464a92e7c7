"""The command line: `szlib run` the workbook, `report` on it, `inspect` a file, `extract` encounters.

Nothing heavy is imported before a command needs it, so that `--version`, `--help` and a typo answer at once.
Exit codes: 0; 1 where a check does not hold or a day failed; 2 where something was asked that cannot be
done, explained in one line (SZLIB_TRACEBACK=1 shows where); 130 after Ctrl-C, 143 after SIGTERM, 129 where
the terminal was closed: all three end the same way.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .. import __version__, memory
from ..errors import DataError, DataWarning, SzlibError
from ..files import printable

WORKBOOK_PACKAGES = ("anywidget", "ipykernel", "jupytext", "latex2mathml", "nbconvert", "papermill")
"""What `szlib run` needs beside the library: the extra `workbook`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line `szlib`; returns the exit code."""
    for stream in (sys.stdout, sys.stderr):  # a terminal that knows no umlauts gets them spelled out
        with suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    options = _parser().parse_args(arguments)
    try:
        with _endings(), memory.granted(options.memory), warnings.catch_warnings():
            warnings.showwarning = _show_warning  # type: ignore[assignment]
            code = int(options.command(options))
            if sys.stdout is not None:
                sys.stdout.flush()
        return code
    except KeyboardInterrupt as stop:
        _complain("stopped; what was finished stays in the results")
        return int(stop.args[0]) if stop.args else 130
    except Exception as error:
        if os.environ.get("SZLIB_TRACEBACK"):
            raise
        expected = isinstance(error, SzlibError | OSError)
        _complain(str(error) if expected and str(error) else f"{type(error).__name__}: {error}")
        return 2


@contextmanager
def _endings() -> Iterator[None]:
    """SIGTERM, and SIGHUP unless it is ignored, end a command as Ctrl-C does."""

    def stop(number: int, _frame: object) -> None:
        """End as Ctrl-C does, with the signal's own exit code."""
        raise KeyboardInterrupt(128 + number)

    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    here = threading.current_thread() is threading.main_thread()
    numbers = [getattr(signal, name) for name in names] if here else []
    before = {n: signal.signal(n, stop) for n in numbers if signal.getsignal(n) is not signal.SIG_IGN}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _complain(what: str) -> None:
    """One line on standard error, and nothing left for a standard output that takes no more."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"szlib: {printable(' '.join(what.split()))}", file=sys.stderr, flush=True)
    try:
        sys.stdout.flush()
    except (OSError, ValueError, AttributeError):
        with suppress(OSError, ValueError, AttributeError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())


def _show_warning(message: Warning | str, *_: object) -> None:
    with suppress(OSError, ValueError, AttributeError):
        print(f"szlib: {printable(message)}", file=sys.stderr)


def inspect(file: str | Path, *, area: str = "") -> str:
    """The funnel of a file down to its encounters in the area, a line for each count, as a table to read."""
    from ..encounters.pipeline import Chain
    from ..tracks import datasets, funnels

    files = datasets.find([file])
    if len(files) != 1:
        raise DataError(f"{file}: are {len(files)} files; expected one: {', '.join(map(str, files[:5]))}")
    with warnings.catch_warnings():  # the table shows what a warning would
        warnings.simplefilter("ignore", DataWarning)
        samples = Chain(square=area or None).encounters(files)
    where = f"area {samples.attrs['area']}\n" if "area" in samples.attrs else ""
    return where + funnels.text(funnels.of(samples))


def _inspect(options: argparse.Namespace) -> int:
    print(inspect(options.file, area=_area(options)))
    return 0


def _extract(options: argparse.Namespace) -> int:
    from ..encounters.days import extract_days
    from ..parallel import cluster

    with cluster(options.scheduler):
        done = extract_days(
            options.data,
            out=options.out,
            n_jobs=options.jobs,
            exclude=options.exclude,
            square=_area(options) or None,
        )
    print(done)
    return 1 if len(done.failed) else 0


def _run(options: argparse.Namespace) -> int:
    parameters = dict(_assignment(text) for text in options.parameter)
    if area := _area(options):
        parameters["area"] = area
    _check_workbook()
    from .record import places
    from .runner.execution import run
    from .runner.summary import render

    summary = run(
        options.data[0] if len(options.data) == 1 else options.data,
        out=options.out or places.RESULTS,
        jobs=options.jobs,
        only=options.only,
        parameters=parameters,
        scheduler=options.scheduler,
    )
    print(render(summary))
    if "report" in summary:
        print(f"report: {printable(os.path.relpath(summary['report']))}")
    refused = [name for name, record in summary["notebooks"].items() if record["status"] == "refused"]
    if refused:
        error = summary["notebooks"][refused[0]]["error"]
        raise SzlibError(f"{', '.join(refused)}: could not be run: {error}; what was finished stays")
    return 0 if summary["passed"] else 1


def _report(options: argparse.Namespace) -> int:
    _check_workbook()
    from .record import places
    from .report import document

    home = Path(options.folder) if options.folder else places.root(places.RESULTS) / "synthetic"
    print(printable(os.path.relpath(file := document.write(home))))
    if options.open:
        import webbrowser

        if not webbrowser.open(file.resolve().as_uri()):
            raise SzlibError("no browser could be opened here; open that file in one")
    return 0


def _area(options: argparse.Namespace) -> str:
    """The area that was asked for, as it is recorded: "" for the data's own, "auto", numbers or a polygon."""
    if options.auto or not (options.square or options.polygon):
        return "auto" if options.auto else ""
    from ..encounters.areas import as_area

    return str(as_area(options.square or Path(options.polygon)))


def _check_workbook() -> None:
    """Raise SzlibError where packages are missing that execute the notebooks."""
    missing = [name for name in WORKBOOK_PACKAGES if find_spec(name) is None]
    if missing:
        raise SzlibError(
            f"`szlib run` needs {', '.join(missing)}: pip install 'szlib[workbook]'; and it needs the "
            "notebooks, which come with the repository: get a copy of it, and there `make run`"
        )


def _assignment(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise DataError(f"parameter {text!r} must be NAME=VALUE, such as seed=1")
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        return name, value
    except (ValueError, RecursionError) as error:  # a number of too many digits, too many brackets
        raise DataError(f"parameter {name}: cannot be read ({error})") from error


def _jobs(text: str) -> int:
    """A number of processes of a command line, at least 1."""
    if not text.isascii() or not text.isdigit() or len(text) > 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1; got {text[:40]!a}")
    return int(text)


def _memory(text: str) -> int:
    """An amount of memory of a command line."""
    try:
        return memory.parse(text)
    except SzlibError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="szlib", description="Social zones from pedestrian tracks, and a robot that respects them."
    )
    parser.add_argument("--version", action="version", version=f"szlib {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, add, summary in (
        ("run", _add_run, "execute the notebooks, headless, and check their results"),
        ("report", _add_report, "make the report of a run anew: one HTML file"),
        ("inspect", _add_inspect, "print what becomes of the rows of a file"),
        ("extract", _add_extract, "find the encounters of many days, resumably"),
    ):
        add(commands.add_parser(name, help=summary))
    return parser


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
    run.set_defaults(command=_run)


def _add_report(report: argparse.ArgumentParser) -> None:
    report.add_argument(
        "folder", nargs="?", metavar="FOLDER",
        help="the run's folder of results (default: results/synthetic, beside the notebooks)",
    )  # fmt: skip
    report.add_argument("--open", action="store_true", help="and open it in a browser")
    report.set_defaults(command=_report, memory=None)


def _add_inspect(inspect: argparse.ArgumentParser) -> None:
    inspect.add_argument("file", help="a file of tracks: ATC, EWAP, or tidy; plain or .gz")
    _add_limits(inspect)
    inspect.set_defaults(command=_inspect)


def _add_extract(extract: argparse.ArgumentParser) -> None:
    extract.add_argument("data", nargs="+", metavar="PATH", help="files, folders or globs of tracks")
    extract.add_argument("--out", default="results/days", metavar="FOLDER", help="a Parquet file a day")
    extract.add_argument("--jobs", type=_jobs, metavar="N", help="days at a time (default: one)")
    extract.add_argument("--exclude", nargs="+", default=[], metavar="DAY", help="days to leave out")
    _add_scheduler(extract)
    _add_limits(extract)
    extract.set_defaults(command=_extract)


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
