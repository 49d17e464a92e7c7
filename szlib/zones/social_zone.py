"""The social zone: from samples of encounters to one ellipse for each speed, and to a file.

`SocialZone.fit` has these methods:

respect   careful people keep out, compared with people who ignore each other (ours)
paper     (nearly) no person was ever inside: outliers, hull, slices, smallest ellipses (paper, sec. 2)
hull      the same, but whole encounters are outliers, as many as there are

A zone is written to a JSON file as a whole or not at all, with a checksum of its content, which is checked
when it is read.

It also estimates how certain the zone is: intervals, the number of encounters on each side, and the speeds at
which this number is sufficient.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, is_dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from .. import __version__
from ..core.checks import Array, check_columns, require
from ..core.errors import DataError, SzlibError, ZoneError, warn
from ..core.files import write_file
from ..core.input_files import read_small, reading
from ..encounters.finding import find_place
from ..encounters.kinds import of_kind
from ..encounters.null_model import NullEncounters, null_pairs
from ..encounters.pairs import find_pairs
from ..encounters.sensor import SensorCheck
from ..encounters.settings import EncounterSettings
from .ellipses import Ellipse, EllipseZone
from .estimators import Estimator, ZoneShape
from .hulls import HullEstimator, HullZone
from .outliers import FRACTION, N_NEIGHBOURS, R_MAX, encounter_numbers
from .respect import RespectEstimator
from .respect_test import NullTest, RespectRadius, null_test
from .uncertainty import (
    N_RESAMPLES,
    QUANTITIES,
    Uncertainty,
    count_by_side,
    describe_missing_sides,
    describe_missing_speed,
    estimate_uncertainty,
)
from .verdict import Verdict, describe_missing_encounters, judge

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SPEEDS = (0.5, 0.7, 0.9, 1.1, 1.3, 1.5)
"""Default speeds of the reference pedestrian [m/s] (assumed; the paper shows a range)."""

FORMAT = "szlib.SocialZone"
VERSION = 5
UNITS = "m, s, rad; frame of the reference pedestrian: x ahead, y to the left"

# The methods of `SocialZone.fit`: the estimator, and its options.
METHODS: dict[str, tuple[Callable[..., Estimator], tuple[str, ...]]] = {
    "paper": (
        partial(
            HullEstimator.from_samples, fraction=FRACTION, n_neighbours=N_NEIGHBOURS
        ),
        (),
    ),
    "hull": (HullEstimator.from_samples, ("fraction", "n_neighbours")),
    "respect": (RespectEstimator.from_samples, ()),
}


@dataclass(frozen=True, eq=False, repr=False)
class SocialZone:
    """Minimum social zones by speed, in the frame of the reference pedestrian (paper, fig. 5).

    Parameters
    ----------
    shape : the boundary by speed and direction, a `HullZone` or an `EllipseZone`.
    r_max : distance within which people count [m].
    ellipses : the fitted ellipse by speed.
    undefined : the reason why there is no zone, by speed.
    provenance : data, parameters and the row counts of every stage.
    method : the estimator, one of `METHODS`.
    side_counts : encounters by speed and side (see `szlib.zones.count_by_side`); None: unknown.
    uncertainty : intervals; None: unknown.
    null_test : the test against the null model; None: not tested.

    Raises
    ------
    ZoneError : `method` and `shape` do not fit each other, or `r_max` is not a positive distance.

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=300))
    >>> samples = szlib.find_encounters(szlib.read_tracks(path))
    >>> zone = szlib.SocialZone.fit(samples, speeds=[1.1], n_resamples=0)
    >>> 0.7 < zone.ellipse(1.1).semi_axes[1] < 1.0
    True
    >>> zone.save("zone.json")
    >>> szlib.SocialZone.load("zone.json").ellipse(1.1) == zone.ellipse(1.1)
    True
    """

    shape: ZoneShape
    r_max: float
    ellipses: dict[float, Ellipse]
    undefined: dict[float, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    method: str = "respect"
    side_counts: pd.DataFrame | None = None
    uncertainty: Uncertainty | None = None
    null_test: NullTest | None = None

    def __post_init__(self) -> None:
        check_method(self.method)
        if (self.method in ("hull", "paper")) != isinstance(self.shape, HullZone):
            raise ZoneError(
                f"a {type(self.shape).__name__} is not the shape of a zone of method {self.method!r}"
            )
        require(
            0 < self.r_max < np.inf,
            "r_max",
            self.r_max,
            "a positive distance in metres",
            ZoneError,
        )

    def __repr__(self) -> str:
        def listed(speeds: Iterable[float]) -> str:
            """The `speeds` as a text."""
            return ", ".join(f"{speed:g}" for speed in speeds) or "none"

        table = self.table()
        rows = table.itertuples()
        by_verdict = table.groupby("verdict", sort=False)["speed"].agg(listed)
        return (
            f"SocialZone: method {self.method!r}, people within {self.r_max:g} m\n"
            "semi-axes at each speed [m/s: m]: "
            f"{', '.join(f'{row.speed:g}: {row.a:.2f} x {row.b:.2f}' for row in rows) or 'none'}\n"
            f"undefined at [m/s]: {listed(self.undefined)}\n"
            f"enough encounters at [m/s]: {listed(table['speed'][table['adequate']])}\n"
            f"verdict: {'; '.join(f'{verdict} at {at} m/s' for verdict, at in by_verdict.items())}\n"
            f"intervals: {'none' if self.uncertainty is None else self.uncertainty.description}"
        )

    @classmethod
    def from_tracks(
        cls,
        tracks: pd.DataFrame,
        *,
        area: object = None,
        kinds: str | Collection[str] | None = None,
        r_max: float = R_MAX,
        shifts: int = 99,
        seed: int = 0,
        progress: bool = False,
        **options: Any,
    ) -> SocialZone:
        """Fit the zones to every pair of people in a track table, against the same streams moved in time.

        Parameters
        ----------
        tracks : a track table as from `szlib.read_tracks`.
        area : as in `szlib.find_pairs`.
        kinds : of pairs, as for `szlib.of_kind`, among those who come towards each other or cross.
        r_max, seed : distance within which people count [m], and seed of the shifts, and of the resampling as
            in `fit`.
        shifts, progress : as in `szlib.null_pairs`. A verdict needs at least 19 shifts.
        options : further ones of `fit`.

        Raises
        ------
        DataError : as `szlib.null_pairs`; or no two people came within `r_max` of each other.
        ZoneError : as `fit`.

        Examples
        --------
        >>> import szlib
        >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=600))
        >>> zone = szlib.SocialZone.from_tracks(szlib.read_tracks(plaza), speeds=[1.1])
        >>> zone.verdict(1.1), zone.method
        ('usable', 'respect')
        """
        tracks, place = find_place(tracks, EncounterSettings(area=area))
        pairs = of_kind(find_pairs(tracks, area=place, r_max=r_max), kinds)
        if pairs.empty:
            raise DataError(
                f"no two people who come towards each other or cross came within {r_max:g} m of each other "
                f"in the area {place} (kinds: {kinds or 'both'}): use more data, or give a larger area"
            )
        null = null_pairs(
            tracks, area=place, shifts=shifts, seed=seed, r_max=r_max, progress=progress
        )
        null = null.of_kind(kinds)
        return cls.fit(pairs, null=null, r_max=r_max, seed=seed, **options)

    @classmethod
    def fit(
        cls,
        samples: pd.DataFrame,
        *,
        method: str | None = None,
        r_max: float = R_MAX,
        speeds: Iterable[float] = SPEEDS,
        null: NullEncounters | None = None,
        n_resamples: int = N_RESAMPLES,
        seed: int = 0,
        **options: Any,
    ) -> SocialZone:
        """Fit the zones to samples of encounters.

        Parameters
        ----------
        samples : as from `szlib.find_encounters`: los_angle [rad], distance [m], speed [m/s], encounter. With
            ref_id and other_id, people are resampled, not encounters. With t, paths are smoothed.
        method : "respect", "paper" or "hull". "paper" is the paper's method to the letter: LOF over samples
            with 20 neighbours removes 0.2 %, then hull, slices, ellipses. "hull" differs in one step: it
            judges whole encounters and removes as many as are outliers. Both zones shrink as the data grows.
            None: "respect" if, within r_max, the data holds 150 encounters and the null model as many,
            and they show respect, else "paper", which describes where hardly anybody was.
        r_max : distance within which people count [m].
        speeds : speeds of the zones [m/s].
        null : the null model, from `szlib.null_pairs` for pairs, or `szlib.null_encounters` for lone
            encounters. "respect" needs it; with any method, the data is tested against it (`null_test`).
        n_resamples : number of zones estimated again for the intervals; 0: no intervals. "respect" draws from
            its posterior until the draws agree, so for it only 0 or not 0 matters.
        seed : of the resampling. It does not change the intervals of "respect": its draws have a fixed seed.
        options : options of the method. "hull": `fraction` and `n_neighbours` as in `szlib.remove_outliers`.
            "paper", "respect": none.

        Raises
        ------
        DataError : the samples lack columns, or are too few.
        ZoneError : an option is unknown or belongs to another method, or no speed has a zone.

        Warns
        -----
        DataWarning : names the speeds without a zone (`undefined`), and sides with too few encounters.

        Examples
        --------
        >>> import szlib
        >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=300))
        >>> samples = szlib.find_encounters(szlib.read_tracks(path))
        >>> zone = szlib.SocialZone.fit(samples, method="paper", speeds=[1.1], n_resamples=0)
        >>> zone.method, list(zone.ellipses)
        ('paper', [1.1])
        """
        check_method(method or "paper", options)
        check_columns(samples, ["los_angle", "distance", "speed"])
        fitted_speeds = sorted({float(speed) for speed in speeds})
        if not fitted_speeds:
            raise ZoneError("no speed has a zone: `speeds` is empty")
        if method == "respect":
            options["null"] = null
        if method is None:
            method, estimator = _choose_estimator(samples, fitted_speeds, r_max, null)
        else:
            estimator = METHODS[method][0](samples, r_max=r_max, **options)
        shape = estimator.fit_shape(fitted_speeds)
        ellipses, undefined = _fit_ellipses(shape, fitted_speeds, samples)
        provenance = _describe_source(samples, estimator, method, r_max)
        test = None
        if null is not None:
            require(
                r_max <= null.r_max,
                "r_max",
                r_max,
                f"at most the null model's {null.r_max} m",
                ZoneError,
            )
            test = null_test(samples, null)
        sides = uncertainty = None
        if "encounter" in samples:
            sides = count_by_side(samples, fitted_speeds, r_max=r_max)
            if n_resamples:
                uncertainty = estimate_uncertainty(
                    estimator, ellipses, n_resamples=n_resamples, seed=seed
                )
        zone = cls(
            shape,
            float(r_max),
            ellipses,
            undefined,
            provenance,
            method,
            sides,
            uncertainty,
            test,
        )
        problems = [
            *undefined.values(),
            *filter(None, map(zone.missing_data, ellipses)),
        ]
        if problems:
            warn("; ".join(dict.fromkeys(problems)))
        return zone

    @property
    def meaning(self) -> str:
        """What the zone is, and what its intervals are of, in one line."""
        if self.method == "respect":
            return "respect: the zone that people keep, with 95 % intervals"
        return (
            f"{self.method}: where (nearly) nobody was; the 95 % intervals are of that with everybody "
            "there is, so a hull of few can lie above them; they are not of the zone that people keep"
        )

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the shape [m/s]."""
        return self.shape.speed_range

    def boundary(self, speed: float, n: int = 361) -> Array:
        """Boundary of the zone at a `speed` [m/s]: `n` points in the person's frame, shape (n, 2) [m]."""
        return self.shape.boundary(speed, np.linspace(-np.pi, np.pi, n))

    def ellipse(self, speed: float) -> Ellipse:
        """The ellipse at any `speed` [m/s] in the range of the data.

        A DataWarning names the sides that lack encounters. Raises ZoneError, with the speed,
        the range and the missing directions, if the zone is undefined.
        """
        ellipse = self.ellipses.get(float(speed)) or self.shape.ellipse(speed)
        missing = self.missing_data(speed)
        if missing:
            warn(missing)
        return ellipse

    def adequate(self, speed: float) -> bool:
        """Whether there are enough encounters, and on every side, to rely on the zone at a `speed` [m/s]."""
        return not (
            describe_missing_encounters(self.provenance) or self.missing_data(speed)
        )

    def verdict(self, speed: float) -> Verdict:
        """Whether the zone can be used at a `speed` [m/s]: "usable", "undecided" or "no respect shown".

        The attribute `reasons` holds the reasons as plain sentences. A zone is usable if the data shows
        respect against the null model, is enough on each side and plausible, and if the zone is clearly
        larger than that of people who ignore each other, with few careless encounters and sound intervals.

        Examples
        --------
        >>> import szlib
        >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=600))
        >>> samples = szlib.find_encounters(szlib.read_tracks(path))
        >>> zone = szlib.SocialZone.fit(samples, speeds=[1.1], n_resamples=0)
        >>> zone.verdict(1.1)
        'undecided'
        >>> zone.verdict(1.1).reasons[0]
        'no null model: fit the zone with SocialZone.from_tracks(tracks)'
        """
        return judge(self, speed)

    def missing_data(self, speed: float) -> str:
        """Describe the sides that lack encounters at a `speed` [m/s]; "" if none does."""
        counts = self.side_counts
        if self.method == "respect" and self.uncertainty is not None:
            # its intervals say what else is missing
            return "" if counts is None else describe_missing_speed(counts, speed)
        if counts is None:
            return (
                "the quality of the zone is unknown: encounters were not counted by side (an older file, or "
                "samples without `encounter`); fit it again"
            )
        return describe_missing_sides(counts, speed)

    def table(self) -> pd.DataFrame:
        """One row for each fitted speed.

        Columns: speed [m/s]; center_x, center_y, a, b [m], angle_deg [deg], area [m2], each with _low and
        _high (its interval, NaN if there is none); encounters within r_max at that speed; adequate; verdict.
        """
        rows = [
            (v, *e.center, *e.semi_axes, np.degrees(e.angle), e.area)
            for v, e in sorted(self.ellipses.items())
        ]
        table = pd.DataFrame(rows, columns=["speed", *QUANTITIES]).set_index("speed")
        ends = [f"{name}_{end}" for name in QUANTITIES for end in ("low", "high")]
        table[[*ends, "encounters"]] = np.nan
        if self.uncertainty is not None:
            intervals = self.uncertainty.intervals
            for end in ("low", "high"):
                wide = intervals.pivot(index="speed", columns="quantity", values=end)
                table.update(wide.add_suffix(f"_{end}"))
        if self.side_counts is not None:
            table["encounters"] = self.side_counts.set_index("speed")["encounters"]
        return table.assign(
            adequate=[self.adequate(v) for v in table.index],
            verdict=[str(self.verdict(v)) for v in table.index],
        ).reset_index()

    def plot(self, speed: float | None = None, *, ax: Axes | None = None) -> Axes:
        """Plot the zone at a `speed` [m/s] with its interval, or all ellipses (None), into the axes `ax`."""
        from ..workbook.figures.zones import plot_zone, plot_zones

        return (
            plot_zones(self, ax=ax) if speed is None else plot_zone(self, speed, ax=ax)
        )

    def save(self, path: str | Path) -> None:
        """Write the zone as JSON to the file `path`, as a whole or not at all.

        Its verdicts are for other programs: when the file is read, they are made again. Raises ZoneError if
        the file cannot be written.
        """
        fields = dict(vars(self))
        shape = fields.pop("shape")
        verdicts = {v: self.verdict(v) for v in self.ellipses}
        content = {"format": FORMAT, "version": VERSION, "units": UNITS} | fields
        content |= {
            "ellipses": [
                {
                    "speed": v,
                    "center": e.center,
                    "semi_axes": e.semi_axes,
                    "angle": e.angle,
                }
                for v, e in sorted(self.ellipses.items())
            ],
            "undefined": [
                {"speed": v, "why": reason}
                for v, reason in sorted(self.undefined.items())
            ],
            "verdicts": [
                {"speed": v, "verdict": verdict, "reasons": verdict.reasons}
                for v, verdict in verdicts.items()
            ],
            "hull_vertices": shape.vertices if isinstance(shape, HullZone) else None,
        }
        try:
            content = json.loads(json.dumps(content, default=_to_json))
            content["checksum"] = _checksum(content)
            write_file(Path(path), json.dumps(content, indent=1))
        except (SzlibError, OSError, TypeError, ValueError) as error:
            raise ZoneError(
                f"{path}: cannot write the zone ({error}); choose a file in a folder that exists and is "
                "writable, and use only JSON values in the provenance"
            ) from error

    @classmethod
    def load(cls, path: str | Path) -> SocialZone:
        """Read a zone that `save` wrote to the file `path`.

        Raises ZoneError if the file holds no zone, is damaged, was written by another version of szlib, or
        its method is not in `METHODS`: the module that adds it must be imported before.
        """
        content = _read_content(Path(path))
        try:
            return cls(**_fields(content))
        except (
            LookupError,
            TypeError,
            ValueError,
            OverflowError,
            AttributeError,
        ) as error:
            raise ZoneError(
                f"{path}: the zone in it is damaged ({error!r}); fit and save it again"
            ) from error


def _choose_estimator(
    samples: pd.DataFrame,
    speeds: Sequence[float],
    r_max: float,
    null: NullEncounters | None,
) -> tuple[str, Estimator]:
    """The estimator "respect" if the data suffices for it and shows respect, else "paper"."""
    with suppress(SzlibError):
        respect = RespectEstimator.from_samples(samples, r_max=r_max, null=null)
        if respect.is_large and respect.fit_shape(speeds):
            return "respect", respect
    return "paper", METHODS["paper"][0](samples, r_max=r_max)


def _fit_ellipses(
    shape: ZoneShape, speeds: Sequence[float], samples: pd.DataFrame
) -> tuple[dict[float, Ellipse], dict[float, str]]:
    """The ellipse of a `shape` at each of the `speeds`, and why there is none; ZoneError if all lack one."""
    ellipses = {}
    undefined = {}
    for speed in speeds:
        try:
            ellipses[speed] = shape.ellipse(speed)
        except ZoneError as error:
            undefined[speed] = str(error)
    if not ellipses:
        raise ZoneError(
            f"no speed has a zone: {'; '.join(undefined.values())}; half of the samples are slower than "
            f"{samples['speed'].median():.1f} m/s: "
            "choose a speed near that, or add data"
        )
    return ellipses, undefined


def _describe_source(
    samples: pd.DataFrame, estimator: Estimator, method: str, r_max: float
) -> dict[str, Any]:
    """What a zone was made from, and how: its provenance."""
    n = len(encounter_numbers(samples)[1]) if "encounter" in samples else None
    return {
        "szlib": __version__,
        "days": sorted(map(str, set(samples.get("day", [])))),
        "encounters": n,
        "hours": recorded_hours(samples),
        "parameters": {"method": method, "r_max": float(r_max), **estimator.parameters},
        "funnel": estimator.funnel,
    }


def recorded_hours(samples: pd.DataFrame) -> float | None:
    """Time from the first to the last of `samples`, summed over the days [h]; None without times."""
    if "t" not in samples or samples.empty:
        return None
    days = samples.get("day", np.zeros(len(samples)))
    return float(samples["t"].groupby(days, observed=True).agg(np.ptp).sum() / 3600)


def check_method(method: str, options: Iterable[str] = ()) -> None:
    """Raise ZoneError if the method is unknown, or does not have one of the options.

    Parameters
    ----------
    method : name of a method, one of `METHODS`.
    options : names of its options.
    """
    require(
        method in METHODS, "method", method, f"one of {', '.join(METHODS)}", ZoneError
    )
    for name in set(options).difference(METHODS[method][1]):
        known = "; ".join(
            f"{each!r} has {', '.join(names) or 'none'}"
            for each, (_, names) in METHODS.items()
        )
        raise ZoneError(f"method {method!r} has no option {name!r}; {known}")


def _read_content(path: Path) -> dict[str, Any]:
    """The content of the file at `path`: a zone of a known version, undamaged."""
    with reading(path, "as a zone", "JSON written by SocialZone.save", ZoneError):
        content = json.loads(read_small(path))
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ZoneError(
            f'{path}: is JSON but no zone; expected "format": "{FORMAT}", as SocialZone.save writes it'
        )
    if content.get("version") != VERSION:
        raise ZoneError(
            f"{path}: has format version {content.get('version')!r}, this szlib {__version__} reads "
            f"{VERSION}; install the szlib that wrote it, or fit the zone again"
        )
    expected = content.pop("checksum", None)
    if expected != _checksum(content):
        raise ZoneError(
            f"{path}: the zone in it is damaged: its checksum is {expected!r}, which is not that of its "
            "content; do not edit zone files: fit and save the zone again"
        )
    method = content.get("method")
    if method not in [*METHODS]:
        raise ZoneError(
            f"{path}: its method {method!r} is unknown here; expected one of {', '.join(METHODS)}: "
            "import the module that adds it to szlib.zones.social_zone.METHODS"
        )
    return content


def _fields(content: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a `SocialZone` from the content of its file; damage raises an ordinary Python error."""
    r_max = float(content["r_max"])
    hull = content["hull_vertices"]
    ellipses = {
        float(e["speed"]): Ellipse(e["center"], e["semi_axes"], e["angle"])
        for e in content["ellipses"]
    }
    counts = content["side_counts"]
    uncertainty = content["uncertainty"]
    test = content["null_test"]
    if uncertainty:
        for name in ("intervals", "bands"):
            uncertainty[name] = _table(uncertainty[name])
        uncertainty = Uncertainty(**uncertainty)
    if test:
        test["null_statistics"] = tuple(test["null_statistics"])
        test["respect"] = RespectRadius(**test["respect"])
        if test.get("sensor"):
            test["sensor"] = SensorCheck(**test["sensor"])
        test = NullTest(**test)
    return {
        "shape": EllipseZone(ellipses)
        if hull is None
        else HullZone(np.array(hull, float), r_max),
        "r_max": r_max,
        "ellipses": ellipses,
        "undefined": {float(u["speed"]): u["why"] for u in content["undefined"]},
        "provenance": dict(content["provenance"]),
        "method": content["method"],
        "side_counts": counts and _table(counts),
        "uncertainty": uncertainty,
        "null_test": test,
    }


def _checksum(content: Mapping[str, Any]) -> str:
    """SHA-256 of everything else in the file."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _table(content: Mapping[str, Any]) -> pd.DataFrame:
    table = pd.DataFrame(content)
    numbers = table.columns.intersection(["speed", "direction", "low", "high"])
    return table.astype(dict.fromkeys(numbers, float))


def _to_json(value: Any) -> Any:
    """JSON values of a table, array or group of fields; missing values of a table are null."""
    if isinstance(value, pd.DataFrame):
        return value.astype(object).where(value.notna(), None).to_dict("list")
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value):
        return vars(value)
    raise TypeError(f"{type(value).__name__} is no JSON value")
