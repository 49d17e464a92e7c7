"""How files of tracks are read: a `Recipe`, which is found, saved, and used by every command.

Files of a kind that has a name have a `Shape`: how it is recognised, and the recipe that reads it. A new one
is an entry in `shapes.toml` beside this file.
"""

from __future__ import annotations

import json
import os
import shlex
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np

from ..core.errors import DataError, warn
from ..core.files import write_file
from ..core.input_files import explain_errors, read_small, reading, require

# Which column holds each quantity: its name, the number of the field from 0, or a sum of columns in SQL.
Columns = Mapping[str, str | int]
QUANTITIES = ("t", "frame", "id", "x", "y", "day", "speed")
_FOLDER = Path(__file__).parent
# Usual names of columns and of units, and the factors of units.
NAMES = tomllib.loads((_FOLDER / "names.toml").read_text("utf-8"))
UNITS = NAMES["metres"]
"""Metres in a unit of position."""
TIME_UNITS = NAMES["seconds"]
"""Seconds in a unit of time; days are those of Excel."""
PIXELS, DEGREES = "px", "deg"  # units that need a scale or a homography, and an origin
# A step of the common clock [s]; a track cannot end after a shorter gap.
SHORTEST_GAP = 0.1
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
_ENTRIES = tomllib.loads((_FOLDER / "shapes.toml").read_text("utf-8"))
# What a value must be one of, and the shapes of arrays.
_CHOICES = {
    "file_format": _ENTRIES,
    "unit": [*UNITS, PIXELS, DEGREES],
    "time_unit": TIME_UNITS,
}
_ARRAYS = {"homography": (3, 3), "origin": (2,)}


@dataclass(frozen=True)
class Recipe:
    """How files are read, checked when it is built.

    Attributes
    ----------
    file_format : a name in `szlib.tracks.recipe.SHAPES`; None recognises the file by its content.
    columns : the column that holds t or frame, id, x, y, and day (the recording): its name; the number of the
        field from 0 where the file has no header (f0, f1, ... in sums); or a sum of columns in SQL, such as
        "sec + 1e-9 * nanosec" or "(xmin + xmax) / 2".  Others are found by usual names.
    where : rows that are read, as a condition in SQL, such as "label = 'Pedestrian' AND score > 0.5": a value
        in quotes is compared with texts, another one with numbers.
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
    columns: Columns = field(default_factory=dict)
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
        for name, known in _CHOICES.items():
            value = getattr(self, name)
            require(value in (None, *known), name, value, f"one of {list(known)}")
        for name, shape in _ARRAYS.items():
            if (given := getattr(self, name)) is not None:
                numbers = np.ravel(np.array(given, float))
                fits = numbers.size == np.prod(shape) and np.isfinite(numbers).all()
                require(fits, name, given, f"numbers of shape {shape}")
                object.__setattr__(self, name, numbers.reshape(shape).tolist())
        ways = self.unit in UNITS, self.scale, self.homography, self.origin
        if sum(map(bool, ways)) > 1:
            raise DataError(
                "several of unit, scale, homography and origin are given; expected one of them"
            )
        _require_known("columns", self.columns, QUANTITIES)
        if {"t", "frame"} <= set(self.columns):
            raise DataError("columns: both t and frame are given; expected one of them")
        require(
            isinstance(self.where, str | None),
            "where",
            self.where,
            "a condition in SQL, as text",
        )
        expected = "expected one like 'Asia/Tokyo'"
        with explain_errors(f"unknown time zone {self.tz!r}", expected):
            ZoneInfo(self.tz or "UTC")

    @property
    def shape(self) -> Shape:
        """The shape of files that are read so: that of the `file_format`, or "tidy"."""
        return SHAPES[self.file_format or "tidy"]

    @property
    def metres(self) -> float:
        """Metres in one unit of position; 1 where nothing says it."""
        return self.scale or UNITS.get(self.unit or "m", 1.0)

    @property
    def has_metres(self) -> bool:
        """Whether it states how positions become metres."""
        return self.unit in UNITS or bool(self.scale or self.homography or self.origin)

    @property
    def has_people(self) -> bool:
        """Whether it names the columns of id, x and y."""
        return {"id", "x", "y"} <= set(self.columns)

    def over(self, base: Recipe) -> Recipe:
        """This recipe, completed by values of `base` where it has none."""
        own = self.as_json()
        more = base.as_json()
        mine = dict(self.columns)
        others = dict(base.columns)
        for given, kept, names in (
            (own, more, ("frame_rate", "time_unit")),
            (own, more, ("unit", "scale", *_ARRAYS)),
            (mine, others, ("t", "frame")),
        ):
            for name in names if given.keys() & names else ():
                kept.pop(name, None)
        return Recipe(**more | own | {"columns": others | mine})

    def as_json(self) -> dict[str, Any]:
        """The values that are given, as JSON: ``Recipe(**recipe.as_json())`` is the same."""
        return {
            k: value for k, value in asdict(self).items() if value not in (None, {})
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
        path = Path(path)
        with reading(path, "as a recipe", "JSON, as `szlib inspect --save` writes it"):
            content = dict(json.loads(read_small(path)))
            _require_known(f"{path}", content, [each.name for each in fields(cls)])
            return cls(**content)


def _require_known(where: str, names: Collection[str], known: Sequence[str]) -> None:
    """Raise DataError where one of the `names` is not `known`."""
    if unknown := sorted(set(names) - set(known)):
        raise DataError(f"{where}: {unknown} are unknown; expected some of {known}")


@dataclass(frozen=True)
class Shape:
    """A kind of files: an entry of `shapes.toml`.

    Attributes
    ----------
    name : of the shape.
    recipe : how it is read; values that users give take precedence.
    begins : regular expression for the first two lines; its named groups stand in braces in columns.
    file : regular expression for the name of the file; its named groups stand in columns, too.
    header : names that are in its header.
    n_fields : number of fields of a row without header.
    has_header : whether the first line names the columns; None: if it has a text that is no number.
    parse : what makes a table of the file: a name in `shapes.PARSERS`, or of a loader of PedPy.
    is_sequence : whether each file is a recording of its own, without a calendar.
    is_streamed : whether files are too large to be read as a whole.
    is_sure : whether units and columns are certain: no others are suggested.

    Examples
    --------
    >>> from szlib.tracks.recipe import SHAPES
    >>> SHAPES["ngsim"].recipe.unit
    'ft'
    """

    name: str
    recipe: Recipe
    begins: str = ""
    file: str = ""
    header: Collection[str] = ()
    n_fields: int = 0
    has_header: bool | None = None
    parse: str = ""
    is_sequence: bool = False
    is_streamed: bool = False
    is_sure: bool = False


SHAPES = {
    name: Shape(name, Recipe(**entry.pop("recipe", {})), **entry)
    for name, entry in _ENTRIES.items()
}
"""Shapes by name, in the order of recognition; "tidy" is any other table."""


def find_recipe(
    files: Sequence[Any], recipe: Recipe | None = None, **parameters: Any
) -> Recipe:
    """The `recipe` with `parameters` in place of its own; without one, that beside the first of `files`."""
    if recipe is None:
        paths = [Path(each) for each in files[:1] if isinstance(each, str | Path)]
        recipe = Recipe()
        for path in (each.parent / FILE_NAME for each in paths):
            if path.is_file():
                recipe = Recipe.load(path)
                warn(
                    f"the settings in {path} are used: {arguments(recipe.as_json())}; delete it if they are "
                    "wrong"
                )
    return Recipe(**{k: v for k, v in parameters.items() if v is not None}).over(recipe)


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
        if len(command) > _LONGEST_COMMAND:
            command = "the same command with"
        return f"try: {command} {arguments(recipe)}"
    return "pass " + " and ".join(f"{name}={value!r}" for name, value in recipe.items())
