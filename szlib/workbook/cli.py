"""Learn social zones from pedestrian tracks, and keep a robot out of them.

exit codes:
  0    success
  1    a check failed, or a day could not be extracted
  2    the command cannot be carried out; one line says why (set SZLIB_TRACEBACK=1 for the traceback)
  129, 130, 143   stopped by a closed terminal, by Ctrl-C or by SIGTERM; finished results of this command stay
"""

from __future__ import annotations

# A command imports what it needs when it starts, so that --version, --help and a typing error answer at once.
import argparse
import errno
import inspect
import json
import os
import re
import shlex
import signal
import sys
import threading
import tomllib
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..core.errors import DataError, DataWarning, SzlibError
from ..core.input_files import MEMORY_VARIABLE, environment, parse_size, printable

if TYPE_CHECKING:
    import pandas as pd

    from ..encounters.geometry import Area
    from ..tracks.recipe import Recipe

_STOPPED = "stopped; finished results of this command stay in their folder"
# Errors of standard output or standard error that is full, closed or missing (None).
_BROKEN_STREAM = (OSError, ValueError, AttributeError)
# Numbers of errors of writing; those of files, not of streams, have a file name.
_UNWRITABLE = (errno.EBADF, errno.EFBIG, errno.EIO, errno.ENOSPC)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that `arguments` name (default: those of the process) and return its exit code."""
    # print escapes where the terminal's encoding lacks a letter
    for stream in (sys.stdout, sys.stderr):
        with suppress(*_BROKEN_STREAM):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        with _stop_on_signals(), warnings.catch_warnings():
            options = build_parser().parse_args(arguments)
            memory = options.memory and {
                MEMORY_VARIABLE: str(parse_size(options.memory))
            }
            warnings.showwarning = lambda message, *_, **__: _print_error(str(message))
            with environment(**memory or {}):
                code = int(options.command(options))
            if sys.stdout:
                sys.stdout.flush()
        return code
    except KeyboardInterrupt as stop:
        _print_error(_STOPPED)
        return int(stop.args[0]) if stop.args else 130
    except BrokenPipeError:  # the reader of standard output has ended, such as `head`
        _drop_output()
        return 128 + signal.SIGPIPE
    except Exception as error:
        if os.environ.get("SZLIB_TRACEBACK"):
            traceback.print_exc()
        _print_error(_describe(error))
        return 2


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of the command line from `commands.toml`, which describes each command."""
    content = tomllib.loads(
        Path(__file__).with_name("commands.toml").read_text(encoding="utf-8")
    )
    as_written = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="szlib", description=__doc__, formatter_class=as_written
    )
    parser.add_argument("--version", action="version", version=f"szlib {__version__}")
    parser.set_defaults(memory=None)
    groups = dict[str, argparse.ArgumentParser]()
    for name, each in content["groups"].items():
        group = groups[name] = argparse.ArgumentParser(add_help=False)
        one = group.add_mutually_exclusive_group() if name == "area" else group
        _add_arguments(one, each)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, each in content["commands"].items():
        parents = [groups[group] for group in each.get("groups", ())]
        command = commands.add_parser(
            name, help=each["summary"], parents=parents, formatter_class=as_written
        )
        _add_arguments(command, each["arguments"])
        command.set_defaults(command=globals()[f"_{name}"])
    run = commands.choices["run"]
    run.set_defaults(jobs=min(os.cpu_count() or 1, 4))
    run.description, _, run.epilog = str(inspect.getdoc(_run)).partition("\n\n")
    return parser


def _add_arguments(parser: Any, arguments: dict[str, dict[str, Any]]) -> None:
    """Add the `arguments` of `commands.toml` to a parser, or to a group of one."""
    for names, options in arguments.items():
        if "type" in options:
            options["type"] = _TYPES[options["type"]]
        if isinstance(options.get("metavar"), list):
            options["metavar"] = tuple(options["metavar"])
        parser.add_argument(*names.split(), **options)


def _read_options(options: argparse.Namespace, data: Sequence[str]) -> Recipe:
    """The recipe of a command: single values, over that of --recipe or of a file beside the data."""
    from ..tracks import datasets
    from ..tracks.recipe import Recipe, find_recipe

    is_named = any(name in datasets.NAMES for name in data)
    files = [] if is_named else datasets.find(data)
    columns: dict[str, str | int] = {}
    for pair in filter(None, re.split(r",(?=[a-z]+=)", ",".join(options.columns))):
        name, equals, column = pair.partition("=")
        if not equals or not column:
            raise DataError(
                f"columns: {pair!r} must be NAME=COLUMN, such as t=Zeit or id=0; see --help"
            )
        columns[name.strip()] = (
            int(column) if column.isdecimal() and column.isascii() else column.strip()
        )
    known = {each.name for each in fields(Recipe)} - {"columns", "area"}
    given = {name: getattr(options, name) for name in known}
    recipe = Recipe.load(options.recipe) if options.recipe else None
    return find_recipe(files, recipe, columns=columns or None, **given)


def _run(options: argparse.Namespace) -> int:
    """Execute the notebooks without a browser, and check their results.

    results:
      The results go to results/DATA/: the executed notebooks, records/, figures/, encounters.parquet,
      zone.json, parameters.json, summary.json (time, checks and key figures of each notebook), report.html.
      A run with other parameters than the defaults has a folder of its own, results/DATA-HASH/.
      Notebooks that you execute by hand write to results/lab/ and never change the results of a run.
      szlib writes only to folders that are new, empty or marked by a file `.szlib`, and never to a folder
      that holds the input data. Each run executes its notebooks again; the encounters and the zone of the
      same data and parameters are kept.

    checks:
      A failed check fails the run. With other parameters, checks that assume the defaults are reported as
      observations but cannot fail the run. Checks that hold for all parameters can still fail it.

    data:
      The data set atc-1hz is one real day of the ATC mall (31 MB). It is downloaded once and verified. If
      $SZLIB_DATA_DIR names a folder that holds atc-1hz/, no network is used.
      A run stops if no encounters are left. The message names the condition that rejected the last rows. With
      too few for a zone, notebooks that need one end early as "undecided", which fails no run.

    examples:
      szlib run --data atc-1hz
      szlib run --data my/tracks/*.csv --area 0 12 0 8
      szlib run --only 07 -p gamma=0.1
    """
    parameters = dict(_parse_parameter(text) for text in options.parameter)
    if options.area:
        parameters["area"] = options.area
    if options.walls:
        parameters["has_walls"] = True
    reading = _read_options(options, options.data).as_json()
    if reading:
        parameters["reading"] = reading
    from .folders import require_place
    from .runner import run

    junit = require_place(Path(options.junit)) if options.junit else None
    summary = run(
        options.data[0] if len(options.data) == 1 else options.data,
        out=options.out,
        jobs=options.jobs,
        only=options.only,
        parameters=parameters,
        notebooks=options.notebooks,
        figures=options.figures,
    )
    from .report import format_summary, write_junit

    print(format_summary(summary))
    if junit:
        write_junit(summary, junit)
    outcomes = summary["notebooks"].items()
    refused = {name: o["error"] for name, o in outcomes if o["status"] == "refused"}
    if refused:
        raise SzlibError(
            f"{', '.join(refused)}: could not be run: {next(iter(refused.values()))}; finished results stay"
        )
    return 0 if summary["passed"] else 1


def _notebooks(options: argparse.Namespace) -> int:
    """Copy the notebooks, and say how to go on."""
    from .folders import copy_notebooks

    place = shlex.quote(printable(copy_notebooks(options.folder)))
    print(
        f"{place}: szlib run --notebooks {place} runs them, jupyter lab {place} opens them"
    )
    return 0


def describe_pairs(tracks: pd.DataFrame, area: Area) -> str:
    """How many pairs of `tracks` in an `area` are compared with chance, and what they say of the sensor."""
    from ..encounters.kinds import name_kinds
    from ..encounters.pairs import CLOSE, COMPARED, Crowd

    crowd = Crowd.from_tracks(tracks, area)
    compared = name_kinds(crowd.meet(CLOSE).kind).isin(COMPARED)
    found = "resolves people at every distance"
    if crowd.sensor.loses_people:
        found = f"loses people who are nearer than {crowd.sensor.resolved:.1f} m to each other"
    return (
        f"pairs who come towards each other or cross, within {CLOSE:g} m: {compared.sum():,}\n"
        f"sensor: it {found}: {crowd.sensor}"
    )


def _inspect(options: argparse.Namespace) -> int:
    """Print the funnel of a file, from its rows to its encounters."""
    from .. import EncounterSettings, find_encounters
    from ..encounters.finding import find_place, select_near
    from ..tracks import datasets, funnels
    from ..tracks.clock import interpolate
    from ..tracks.readers import describe_file, load_files, merge_files
    from ..tracks.recipe import COMMAND_VARIABLE, FILE_NAME

    files = datasets.find([options.file])
    if len(files) != 1:
        raise DataError(
            f"{options.file}: stands for {len(files)} files; expected one file; inspect each by itself"
        )
    reading = _read_options(options, [options.file])
    settings = EncounterSettings(area=options.area, has_walls=options.walls)
    description, found = describe_file(files[0], reading)
    print(description)
    # The funnel shows the same counts.
    with warnings.catch_warnings(action="ignore", category=DataWarning):
        loaded = load_files(files, reading)
        rows = merge_files(loaded, select=partial(select_near, settings))
        tracks = interpolate(rows, reading.max_gap)
        tracks, area = find_place(tracks, settings)
        samples = find_encounters(tracks, settings=replace(settings, area=area))
    print(f"area {area}")
    if area.reason:
        print(f"area found: {area.reason}")
    counts = funnels.table(funnels.get(samples)).set_index(["stage", "what"])["rows"]
    print(counts.map("{:,}".format).to_string(header=False))
    print(describe_pairs(tracks, area))
    command = f"{os.environ.get(COMMAND_VARIABLE, 'the same command')} --save"
    if options.save is not None:
        found = replace(found, area=str(area))
        file = found.save(options.save or files[0].with_name(FILE_NAME))
        print("recipe saved:", printable(file))
        words = ["--recipe", options.save] if options.save else []
        words += options.walls * ["--walls"]
        command = shlex.join(["szlib", "fit", options.file, *words])
    print("go on with:", command)
    return 0


def _extract(options: argparse.Namespace) -> int:
    """Extract the encounters of many days, and print the table of days."""
    from ..core.parallel import cluster
    from ..encounters.days import extract_days

    with cluster(options.scheduler, wait=options.wait):
        extraction = extract_days(
            options.data,
            out=options.out,
            n_jobs=options.jobs,
            exclude=options.exclude,
            recipe=_read_options(options, options.data),
            area=options.area,
            has_walls=options.walls,
        )
    print(extraction)
    return 1 if len(extraction.failed) else 0


def _fit(options: argparse.Namespace) -> int:
    """Fit a zone to extracted days or tracks."""
    from .. import EncounterSettings
    from .fit_command import fit

    names = ("out", "method", "kind", "tracks", "exclude")
    given = {name: getattr(options, name) for name in names}
    given["settings"] = EncounterSettings(area=options.area, has_walls=options.walls)
    given["reading"] = _read_options(options, options.data)
    print(fit(options.data, **given))
    return 0


def _parse_parameter(text: str) -> tuple[str, Any]:
    """Name and value of NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise DataError(f"parameter {text!r} must be NAME=VALUE, such as seed=1")
    try:
        return name, json.loads(value)
    except (ValueError, RecursionError):
        return name, value


def _job_count(text: str) -> int:
    """A number of processes."""
    if not re.fullmatch("[1-9][0-9]{0,8}", text):
        raise argparse.ArgumentTypeError(
            f"expected a whole number >= 1; got {text[:40]!a}"
        )
    return int(text)


# Types of arguments in `commands.toml`.
_TYPES: dict[str, Callable[[str], Any]] = {
    "float": float,
    "path": os.path.abspath,
    "count": _job_count,
}


@contextmanager
def _stop_on_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP stop the command as Ctrl-C does; a SIGHUP that is ignored stays ignored.

    A second signal ends the process at once; those that it started end soon after it.
    """

    def stop(number: int, _frame: object) -> None:
        """Stop with the exit code of the signal."""
        signal.signal(number, signal.SIG_DFL)
        raise KeyboardInterrupt(128 + number)

    is_main = threading.current_thread() is threading.main_thread()
    names = ("SIGINT", "SIGTERM", "SIGHUP") if is_main else ()
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {
        n: signal.signal(n, stop)
        for n in numbers
        if signal.getsignal(n) is not signal.SIG_IGN
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _describe(error: Exception) -> str:
    """One line about an error that ends the command."""
    # a library says that it failed to map a segment
    if isinstance(error, MemoryError) or "failed to map segment" in str(error):
        return f"this process has no more memory ({error}); raise its limit (ulimit -v), or free memory"
    if isinstance(error, ModuleNotFoundError):
        return f"{error.name} is missing: pip install 'szlib[workbook]'"
    if isinstance(error, OSError) and error.errno in _UNWRITABLE and not error.filename:
        return f"standard output cannot be written ({error.strerror}); make room, or name another file"
    is_expected = isinstance(error, SzlibError | OSError) and str(error)
    return str(error) if is_expected else f"{type(error).__name__}: {error}"


def _drop_output() -> None:
    """Send the rest of standard output nowhere."""
    with suppress(*_BROKEN_STREAM):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _print_error(text: str) -> None:
    """Print one line on standard error, and drop the rest of a standard output that cannot be written."""
    with suppress(*_BROKEN_STREAM):
        print(
            f"szlib: {printable(' '.join(text.split()))}", file=sys.stderr, flush=True
        )
    try:
        sys.stdout.flush()
    except _BROKEN_STREAM:
        _drop_output()
