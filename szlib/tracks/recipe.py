"""How files of tracks are read: a `Recipe`, which is found, saved, and used by every command."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np

from ..core.checks import require
from ..core.errors import DataError
from ..core.files import write_file
from ..core.input_files import read_small, reading

# Which column holds each quantity: its name, the number of the field from 0, or a sum of columns in SQL.
Columns = Mapping[str, str | int]
QUANTITIES = ("t", "frame", "id", "x", "y", "day", "speed")
UNITS = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "km": 1e3,
    "in": 0.0254,
    "ft": 0.3048,
    "yd": 0.9144,
}
"""Metres in a unit of position."""
PIXELS, DEGREES = "px", "deg"  # units that need a scale or a homography, and an origin
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "days": 86_400.0}
"""Seconds in a unit of time; days are those of Excel."""
SHORTEST_GAP = (
    0.1  # a step of the common clock [s]; a track cannot end after a shorter gap
)
FILE_NAME = "reading.json"  # a recipe beside the data
# Environment variable of the command that reads files, such as "szlib inspect hall.csv"; unset in a program.
COMMAND_VARIABLE = "SZLIB_COMMAND"
_LONGEST_COMMAND = 400  # a longer one, of many files, is not repeated
_FASTEST_COUNT = 1e9  # highest frame rate [1/s]
# The lowest and the highest value of each number, and what it is.
_BOUNDS = {
    "scale": (1e-12, 1e3, "metres in one unit of position, more than 0"),
    "frame_rate": (1, _FASTEST_COUNT, f"frames a second from 1 to {_FASTEST_COUNT:g}"),
    "max_gap": (SHORTEST_GAP + 1e-9, np.inf, "longer than the clock's 0.1 s"),
    "max_rejected": (0, 1, "from 0 to 1"),
}


@dataclass(frozen=True)
class Recipe:
    """How files are read, checked when it is built.

    Attributes
    ----------
    file_format : a name in `szlib.tracks.shapes.SHAPES`; None recognises the file by its content.
    columns : the column that holds t or frame, id, x, y, and day (the recording): its name; the number of the
        field from 0 where the file has no header (f0, f1, ... in sums); or a sum of columns in SQL, such as
        "sec + 1e-9 * nanosec" or "(xmin + xmax) / 2".  Others are found by usual names.
    where : rows that are read, as a condition in SQL, such as "label = 'Pedestrian'"; all values are text.
    frame_rate : frames a second, where times are counted in column frame.
    time_unit : unit of t, one of `TIME_UNITS`; None takes that of the column's name, else seconds, or
        milliseconds and less since 1970.
    unit : unit of the positions: one of `UNITS`, "px" or "deg"; None takes that of the column's name, else m.
    scale : metres in one unit of position, such as 0.02 for pixels of 2 cm, in place of `unit`.
    homography : 3 x 3 numbers that map (x, y, 1) to the floor [m].
    origin : longitude and latitude [degrees] of the point (0, 0), where positions are in degrees.
    tz : time zone of the calendar, and of times without a zone; None: the file's, else UTC.
    area : where encounters are found, as text for `szlib.as_area`, or "auto".
    max_gap : a longer gap between two samples ends a track [s], more than 0.1.
    max_rejected : share of the rows of a file that may be unusable, from 0 to 1; None takes 0.05.

    Raises
    ------
    DataError : a value has no meaning.

    Examples
    --------
    >>> import szlib
    >>> recipe = szlib.Recipe(unit="cm", columns={"frame": "Frame", "id": "ped"}, frame_rate=25)
    >>> szlib.Recipe.load(recipe.save("reading.json")) == recipe
    True
    >>> szlib.Recipe(unit="feet")
    Traceback (most recent call last):
    ...
    szlib.core.errors.DataError: unit must be one of ['m', ...]; got 'feet'
    """

    file_format: str | None = None
    columns: Columns | None = None
    where: str | None = None
    frame_rate: float | None = None
    time_unit: str | None = None
    unit: str | None = None
    scale: float | None = None
    homography: Sequence[Sequence[float]] | None = None
    origin: Sequence[float] | None = None
    tz: str | None = None
    area: str | None = None
    max_gap: float | None = None
    max_rejected: float | None = None

    def __post_init__(self) -> None:
        for name, (low, high, expected) in _BOUNDS.items():
            value = getattr(self, name)
            require(value is None or low <= value <= high, name, value, expected)
        units, times = [None, *UNITS, PIXELS, DEGREES], [None, *TIME_UNITS]
        require(self.unit in units, "unit", self.unit, f"one of {units[1:]}")
        expected = f"one of {times[1:]}"
        require(self.time_unit in times, "time_unit", self.time_unit, expected)
        for name, shape in (("homography", (3, 3)), ("origin", (2,))):
            if (given := getattr(self, name)) is not None:
                numbers = np.ravel(np.array(given, float))
                fits = numbers.size == np.prod(shape) and np.isfinite(numbers).all()
                require(fits, name, given, f"numbers of shape {shape}")
                object.__setattr__(self, name, numbers.reshape(shape).tolist())
        if self.origin is not None and self.unit is None:
            object.__setattr__(self, "unit", DEGREES)
        if self.unit in UNITS and self.scale:
            raise DataError("both unit and scale are given; expected one of them")
        columns = set(self.columns or ())
        if unknown := sorted(columns - set(QUANTITIES)):
            raise DataError(
                f"columns: {unknown} are unknown; expected some of {list(QUANTITIES)}"
            )
        if columns >= {"t", "frame"}:
            raise DataError("columns: both t and frame are given; expected one of them")
        is_text = isinstance(self.where, str | None)
        require(is_text, "where", self.where, "a condition in SQL, as text")
        try:
            ZoneInfo("UTC" if self.tz is None else self.tz)
        except (KeyError, ValueError, OSError) as error:
            raise DataError(
                f"unknown time zone {self.tz!r}; expected one like 'Asia/Tokyo'"
            ) from error

    @property
    def metres(self) -> float | None:
        """Metres in one unit of position; None where nothing says it."""
        return self.scale or UNITS.get(self.unit or "")

    @property
    def has_places(self) -> bool:
        """Whether it says how positions become metres."""
        return bool(self.metres or self.homography or self.origin)

    @property
    def names_people(self) -> bool:
        """Whether it names the columns of id, x and y."""
        return {"id", "x", "y"} <= set(self.columns or ())

    def over(self, base: Recipe) -> Recipe:
        """This recipe, completed by values of `base` where it has none."""
        own, more = self.as_json(), base.as_json()
        mine, others = own.get("columns", {}), more.get("columns", {})
        for given, kept, names in (
            (own, more, ("frame_rate", "time_unit")),
            (own, more, ("unit", "scale", "homography", "origin")),
            (mine, others, ("t", "frame")),
        ):
            for name in names if given.keys() & names else ():
                kept.pop(name, None)
        return Recipe(**more | own | {"columns": (others | mine) or None})

    def as_json(self) -> dict[str, Any]:
        """The values that are given, as JSON: ``Recipe(**recipe.as_json())`` is the same."""
        return {
            name: value for name, value in asdict(self).items() if value is not None
        }

    def save(self, path: str | Path) -> Path:
        """Write the recipe to the file `path`, as JSON; returns its path."""
        write_file(
            path, json.dumps(self.as_json(), indent=1, ensure_ascii=False) + "\n"
        )
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> Recipe:
        """Read a recipe from the file `path`; raises DataError where it holds something else."""
        with reading(
            Path(path), "as a recipe", "JSON, as `szlib inspect --save` writes it"
        ):
            content = dict(json.loads(read_small(Path(path))))
        known = {each.name for each in fields(cls)}
        if unknown := sorted(content.keys() - known):
            raise DataError(
                f"{path}: {unknown} are unknown; expected some of {sorted(known)}"
            )
        try:
            return cls(**content)
        except (TypeError, ValueError) as error:
            raise DataError(f"{path}: is no recipe ({error})") from error


def find_recipe(
    files: Sequence[Any], recipe: Recipe | None = None, **parameters: Any
) -> Recipe:
    """The `recipe` with `parameters` in place of its own; without one, that beside the first of `files`."""
    if recipe is None:
        recipe, first = Recipe(), next(iter(files), None)
        if isinstance(first, str | Path):
            beside = Path(first).parent / FILE_NAME
            recipe = Recipe.load(beside) if beside.is_file() else recipe
    given = {name: value for name, value in parameters.items() if value is not None}
    return Recipe(**given).over(recipe) if given else recipe


def arguments(recipe: Mapping[str, Any]) -> str:
    """The values of a `recipe`, by name, as the command line takes them.

    Examples
    --------
    >>> from szlib.tracks.recipe import arguments
    >>> arguments({"columns": {"t": "Zeit", "id": "Person"}, "file_format": "tidy"})
    '--columns t=Zeit,id=Person --format tidy'
    """
    words = []
    for name, value in recipe.items():
        text = [f"{value:.12g}" if isinstance(value, float) else str(value)]
        if isinstance(value, Mapping):
            text = [",".join(f"{key}={column}" for key, column in value.items())]
        elif isinstance(value, list):
            text = [f"{number:.17g}" for number in np.ravel(value)]
        words += ["--" + name.removeprefix("file_").replace("_", "-"), *text]
    return shlex.join(words)


def advise(**recipe: Any) -> str:
    """Advice to read again with values of a `recipe`: arguments, or from a shell the whole command."""
    if command := os.environ.get(COMMAND_VARIABLE):
        command = (
            command if len(command) <= _LONGEST_COMMAND else "the same command with"
        )
        return f"try: {command} {arguments(recipe)}"
    return "pass " + " and ".join(f"{name}={value!r}" for name, value in recipe.items())
