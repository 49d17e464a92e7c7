"""Social zones: a known one is recovered, files keep every bit, and what is undefined is told."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.tracks import funnels
from szlib.zones.social_zone import SPEEDS, SocialZone

ANGLES = np.linspace(-np.pi, np.pi, 180, endpoint=False)
SAGITTA = 2.0 * (1 - np.cos(np.pi / len(ANGLES)))
"""Straight edges between people two degrees apart cut off no more than this of a rim within 2 m [m]."""
STEPS = (0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6)

KNOWN = {
    "off centre and tilted": szlib.Ellipse((0.08, -0.05), (0.95, 0.75), 0.4),
    "behind, across": szlib.Ellipse((-0.15, 0.0), (0.8, 0.7), np.pi / 2),
    "a circle": szlib.Ellipse((0.0, 0.0), (0.9, 0.9), 0.0),
    "large": szlib.Ellipse((0.0, 0.1), (1.2, 1.1), -0.7),
}


def distance_to(ellipse: szlib.Ellipse, angles: np.ndarray) -> np.ndarray:
    """From the origin, inside the ellipse, to the ellipse in directions `angles`: a quadratic equation."""
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    turn = np.array([[cos, sin], [-sin, cos]]) / np.reshape(ellipse.semi_axes, (2, 1))
    away, start = turn @ np.stack([np.cos(angles), np.sin(angles)]), turn @ -np.asarray(ellipse.center)
    a, b, c = np.sum(away**2, axis=0), start @ away, start @ start - 1
    return (-b + np.sqrt(b * b - a * c)) / a


def people_around(rim: Callable[[float], np.ndarray], *, speeds: tuple[float, ...] = STEPS) -> pd.DataFrame:
    """People at just the given distances, all around and at every speed, and others farther away."""
    tables = [
        pd.DataFrame({"los_angle": ANGLES, "distance": np.minimum(rim(v) + extra, 2.4), "speed": v})
        for v in speeds
        for extra in (0.0, 0.3)
    ]
    return pd.concat(tables, ignore_index=True)


def fit_around(ellipse: szlib.Ellipse, **options: object) -> SocialZone:
    return SocialZone.fit(
        people_around(lambda _: distance_to(ellipse, ANGLES)), outlier_fraction=0, **options
    )


def assert_same_ellipse(found: szlib.Ellipse, expected: szlib.Ellipse, metres: float) -> None:
    np.testing.assert_allclose(found.center, expected.center, rtol=0, atol=metres)
    np.testing.assert_allclose(found.semi_axes, expected.semi_axes, rtol=0, atol=metres)
    a, b = expected.semi_axes
    if a > b:  # an error of the axes turns a rounder ellipse more
        turn = (found.angle - expected.angle + np.pi / 2) % np.pi - np.pi / 2
        assert abs(turn) <= 4 * metres * a / (a - b) / b


@pytest.fixture(scope="module")
def samples() -> pd.DataFrame:
    """Noisy people, fewer and farther at the fringes of speed."""
    rng = np.random.default_rng(0)
    n = 4000
    speed = np.clip(rng.normal(1.1, 0.25, n), 0.4, 1.9)
    angle = rng.uniform(-np.pi, np.pi, n)
    rim = distance_to(KNOWN["off centre and tilted"], angle)
    table = {"los_angle": angle, "distance": rim + rng.gamma(2, 0.3, n), "speed": speed}
    return pd.DataFrame({"encounter": np.arange(n) // 31, "day": "2012-10-24", **table})


@pytest.fixture(scope="module")
def zone(samples: pd.DataFrame) -> SocialZone:
    return SocialZone.fit(samples)


# --- the truth ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_a_known_zone_is_recovered_at_any_speed(name: str) -> None:
    zone = fit_around(KNOWN[name], speeds=(0.5, 1.1))
    assert sorted(zone.ellipses) == [0.5, 1.1]
    for speed in (0.41, 0.5, 0.777, 1.1, 1.599):
        assert_same_ellipse(zone.ellipse(speed), KNOWN[name], 4 * SAGITTA)
        rim = zone.boundary(speed, n=721)
        expected = distance_to(KNOWN[name], np.arctan2(rim[:, 1], rim[:, 0]))
        np.testing.assert_allclose(np.hypot(*rim.T), expected, rtol=0, atol=SAGITTA)


def test_a_zone_that_shrinks_with_speed_is_recovered() -> None:
    """Where the complement grows as a concave function of speed, the hull adds nothing to it."""

    def radius(speed: float) -> float:
        return 1.2 - 0.5 * math.sqrt(speed - 0.3)

    zone = SocialZone.fit(
        people_around(lambda v: np.full(len(ANGLES), radius(v))), outlier_fraction=0, speeds=STEPS[1:-1]
    )
    for speed, ellipse in zone.ellipses.items():
        expected = szlib.Ellipse((0, 0), (radius(speed), radius(speed)))
        assert_same_ellipse(ellipse, expected, 4 * SAGITTA)


def test_the_zone_is_the_mirror_of_close_approaches_not_the_ellipse_of_the_slice(zone: SocialZone) -> None:
    """Map first, enclose second: the boundary is where the complement leaves off."""
    section = zone.slice(1.1)
    theta = np.linspace(-np.pi, np.pi, 50)
    np.testing.assert_allclose(np.hypot(*section.boundary(theta).T), 2.0 - section.reach(theta))


@pytest.mark.parametrize("speed", [0.7, 0.9, 1.0, 1.1, 1.3])
def test_the_ellipse_contains_the_whole_boundary(zone: SocialZone, speed: float) -> None:
    level = zone.ellipse(speed).level(zone.boundary(speed, n=50_001))
    assert level.max() <= 1 + 1e-9
    assert level.max() > 1 - 1e-4  # and touches it


@pytest.mark.parametrize("turn", [0.3, -2.0, np.pi / 2])
def test_turning_the_people_turns_the_zone(samples: pd.DataFrame, zone: SocialZone, turn: float) -> None:
    turned = SocialZone.fit(samples.assign(los_angle=samples["los_angle"] + turn))
    for speed in (0.9, 1.1, 1.3):
        expected = zone.ellipse(speed).placed((0, 0), turn)
        assert_same_ellipse(turned.ellipse(speed), expected, 1e-5)


def test_a_mirror_mirrors_the_zone(samples: pd.DataFrame, zone: SocialZone) -> None:
    mirrored = SocialZone.fit(samples.assign(los_angle=-samples["los_angle"])).ellipse(1.1)
    known = zone.ellipse(1.1)
    x, y = known.center
    assert_same_ellipse(mirrored, szlib.Ellipse((x, -y), known.semi_axes, -known.angle), 1e-5)


def test_the_same_samples_in_any_order_give_the_same_zone(samples: pd.DataFrame, zone: SocialZone) -> None:
    before = samples.copy(deep=True)
    again = SocialZone.fit(samples)
    pd.testing.assert_frame_equal(samples, before)
    np.testing.assert_array_equal(again.vertices, zone.vertices)
    assert again.ellipses == zone.ellipses
    assert again.provenance == zone.provenance
    shuffled = SocialZone.fit(samples.sample(frac=1, random_state=0))
    assert {tuple(v) for v in shuffled.vertices} == {tuple(v) for v in zone.vertices}


# --- asking ------------------------------------------------------------------------------------------


def test_a_fitted_speed_is_the_one_in_the_table(zone: SocialZone) -> None:
    table = zone.table()
    assert table["speed"].tolist() == sorted(zone.ellipses)
    for row in table.itertuples():
        ellipse = zone.ellipse(row.speed)
        assert ellipse is zone.ellipses[row.speed]
        assert (row.center_x, row.center_y, row.a, row.b) == (*ellipse.center, *ellipse.semi_axes)
        assert np.radians(row.angle_deg) == pytest.approx(ellipse.angle)
        assert row.area == pytest.approx(np.pi * row.a * row.b)


def test_a_speed_between_is_fitted_when_asked(samples: pd.DataFrame, zone: SocialZone) -> None:
    fitted = SocialZone.fit(samples, speeds=[1.05]).ellipses[1.05]
    assert zone.ellipse(1.05) == fitted
    assert 1.05 not in zone.ellipses


def test_a_speed_outside_the_data_names_the_range(zone: SocialZone) -> None:
    low, high = zone.speed_range
    for speed in (low - 0.1, high + 0.1):
        for ask in (zone.ellipse, zone.boundary, zone.slice):
            with pytest.raises(szlib.ZoneError, match=rf"at {speed:g} m/s .* {low:.3f} to {high:.3f} m/s"):
                ask(speed)


def test_undefined_speeds_are_told_and_kept(samples: pd.DataFrame, tmp_path: Path) -> None:
    with pytest.warns(szlib.DataWarning, match=r"at 0\.1 m/s is undefined.*; .*at 9 m/s is undefined"):
        zone = SocialZone.fit(samples, speeds=(0.1, 1.1, 9))
    assert list(zone.ellipses) == [1.1]
    assert list(zone.undefined) == [0.1, 9.0]
    zone.save(tmp_path / "zone.json")
    assert SocialZone.load(tmp_path / "zone.json").undefined == zone.undefined


def test_people_seen_from_one_side_only_have_no_zone(samples: pd.DataFrame) -> None:
    ahead = samples[samples["los_angle"].abs() < np.pi / 3]
    with pytest.raises(
        szlib.ZoneError, match=r"no speed has a zone: .* nobody was seen in the directions from"
    ):
        SocialZone.fit(ahead)


# --- the funnel --------------------------------------------------------------------------------------


def test_the_provenance_counts_every_sample(samples: pd.DataFrame, zone: SocialZone) -> None:
    near, inliers, hull = zone.provenance["funnel"]
    assert near["entered"] == len(samples)
    assert (near["kept"], inliers["kept"]) == (inliers["entered"], hull["entered"])
    assert hull["kept"] == len(zone.vertices)
    assert zone.provenance["days"] == ["2012-10-24"]
    assert zone.provenance["encounters"] == samples["encounter"].nunique()
    options = {"r_max": 2.0, "outlier_fraction": None, "neighbours": None, "speed_scale": None}
    assert zone.provenance["parameters"] == options
    table = funnels.table(zone.provenance["funnel"])
    assert table.columns.tolist() == ["stage", "what", "rows"]
    entered, kept = (table.loc[table["what"] == what, "rows"].sum() for what in ("entered", "kept"))
    assert entered - kept == table.loc[table["what"].str.startswith("- "), "rows"].sum()


def test_a_stage_that_does_not_add_up_is_refused() -> None:
    with pytest.raises(szlib.SzlibError, match="funnel stage 'sieve' does not add up: 10 != 7"):
        funnels.stage("sieve", 10, 7, {"too long": 2})
    assert funnels.stage("sieve", 10, 7, {"too long": 3, "too short": 0})["set_aside"] == {"too long": 3}


@pytest.mark.parametrize(
    ("change", "error", "told"),
    [
        (lambda d: d.drop(columns="speed"), szlib.DataError, r"columns \['speed'\] are missing"),
        (lambda d: d.iloc[:0], szlib.DataError, "the table is empty"),
        (lambda d: d.assign(distance=5.0), szlib.DataError, "none of 4000 samples is within r_max = 2.0 m"),
        (lambda d: d.drop(columns="encounter"), szlib.DataError, "in a column encounter"),
        (lambda d: d.assign(speed=1.0), szlib.ZoneError, "points lie in one plane"),
        (lambda d: d.assign(speed=np.nan), szlib.ZoneError, "is not finite"),
    ],
)
def test_samples_without_a_zone(
    samples: pd.DataFrame, change: Callable, error: type[Exception], told: str
) -> None:
    with pytest.raises(error, match=told):
        SocialZone.fit(change(samples))


def test_three_points_have_no_hull(samples: pd.DataFrame) -> None:
    few = samples[samples["distance"] <= 2].head(3)
    with pytest.raises(szlib.ZoneError, match="needs at least 4 points; got 3"):
        SocialZone.fit(few, outlier_fraction=0)


def test_no_speed_asked_for(samples: pd.DataFrame) -> None:
    with pytest.raises(szlib.ZoneError, match="no speed has a zone: none was asked for"):
        SocialZone.fit(samples, speeds=())


# --- files -------------------------------------------------------------------------------------------


def test_a_saved_zone_comes_back_bit_by_bit(samples: pd.DataFrame, zone: SocialZone, tmp_path: Path) -> None:
    zone.save(tmp_path / "zone.json")
    loaded = SocialZone.load(tmp_path / "zone.json")
    np.testing.assert_array_equal(loaded.vertices, zone.vertices)
    assert loaded.r_max == zone.r_max
    assert loaded.ellipses == zone.ellipses
    assert loaded.provenance == zone.provenance
    assert loaded.ellipse(1.23) == zone.ellipse(1.23)
    loaded.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "zone.json").read_bytes()
    numpy_options = SocialZone.fit(
        samples,
        r_max=np.float64(2),
        outlier_fraction=np.float64(0.002),
        neighbours=np.int64(20),
        speeds=np.array([1.1]),
    )
    numpy_options.save(tmp_path / "numpy.json")


def test_the_file_says_what_it_is(zone: SocialZone, tmp_path: Path) -> None:
    zone.save(str(tmp_path / "zone.json"))
    content = json.loads((tmp_path / "zone.json").read_text(encoding="utf-8"))
    assert (content["format"], content["version"]) == ("szlib.SocialZone", 1)
    assert "m, s, rad" in content["units"]
    assert content["provenance"]["szlib"] == szlib.__version__


def test_saving_replaces_a_file_as_a_whole(zone: SocialZone, tmp_path: Path) -> None:
    path = tmp_path / "zone.json"
    zone.save(path)
    before = path.read_bytes()
    stubborn = SocialZone(zone.vertices, zone.r_max, zone.ellipses, {}, {"made by": object()})
    with pytest.raises(szlib.ZoneError, match=r"cannot write the zone .*JSON"):
        stubborn.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["zone.json"]


@pytest.mark.parametrize("place", ["missing/zone.json", "file/zone.json", "folder"])
def test_a_place_where_nothing_can_be_written_is_named(zone: SocialZone, tmp_path: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(szlib.ZoneError, match=f"{place}: cannot write the zone"):
        zone.save(tmp_path / place)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def broken(change: Callable[[dict], object]) -> Callable[[str], str]:
    def apply(text: str) -> str:
        content = json.loads(text)
        return json.dumps(change(content) or content)

    return apply


BROKEN: dict[str, tuple[Callable[[str], str | bytes], str]] = {
    "empty": (lambda _: "", "cannot be read as a zone"),
    "truncated": (lambda text: text[: len(text) // 2], "cannot be read as a zone"),
    "not UTF-8": (lambda _: b"\xff\xfe\x00", "cannot be read as a zone"),
    "too deep": (lambda _: "[" * 100_000, "cannot be read as a zone"),
    "a huge number": (lambda _: "9" * 10_000, "cannot be read as a zone"),
    "a list": (lambda _: "[1, 2]", "is JSON but no zone"),
    "null": (lambda _: "null", "is JSON but no zone"),
    "other JSON": (lambda _: '{"type": "FeatureCollection"}', "is JSON but no zone"),
    "newer": (broken(lambda c: c.update(version=2)), r"version 2, .* reads 1; install a newer szlib"),
    "no version": (broken(lambda c: c.pop("version") and None), "has format version None"),
    "no r_max": (broken(lambda c: c.pop("r_max") and None), "is damaged .*r_max"),
    "r_max below 0": (broken(lambda c: c.update(r_max=-2)), "is damaged .*r_max must be a positive distance"),
    "r_max is NaN": (broken(lambda c: c.update(r_max=math.nan)), "is damaged .*r_max"),
    "no ellipses": (broken(lambda c: c.pop("ellipses") and None), "is damaged .*ellipses"),
    "an ellipse without an axis": (broken(lambda c: c["ellipses"][0].update(semi_axes=[1])), "is damaged"),
    "an ellipse inside out": (broken(lambda c: c["ellipses"][0].update(semi_axes=[1, 2])), "is damaged"),
    "an ellipse of text": (broken(lambda c: c["ellipses"][0].update(angle="north")), "is damaged"),
    "a speed beyond numbers": (broken(lambda c: c["ellipses"][0].update(speed=10**400)), "is damaged"),
    "a hull that is flat": (broken(lambda c: c.update(hull_vertices=[[0, 0, 0]] * 9)), "is damaged"),
    "a ragged hull": (broken(lambda c: c.update(hull_vertices=[[0, 0, 0], [1]])), "is damaged"),
    "no hull": (broken(lambda c: c.update(hull_vertices=None)), "is damaged"),
    "no provenance": (broken(lambda c: c.update(provenance=3)), "is damaged"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "told"), BROKEN.values(), ids=BROKEN)
def test_a_file_that_is_no_zone_is_told_by_name(
    zone: SocialZone, tmp_path: Path, change: Callable[[str], str | bytes], told: str
) -> None:
    path = tmp_path / "zone.json"
    zone.save(path)
    content = change(path.read_text(encoding="utf-8"))
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(szlib.ZoneError, match=rf"zone\.json: .*{told}"):
        SocialZone.load(path)


def test_no_file(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.json", tmp_path):
        with pytest.raises(szlib.ZoneError, match=f"{path.name}: cannot be read as a zone"):
            SocialZone.load(path)


@pytest.mark.parametrize("r_max", [0, -1, np.nan, np.inf])
def test_a_zone_needs_a_distance(zone: SocialZone, r_max: float) -> None:
    with pytest.raises(szlib.ZoneError, match="r_max must be a positive distance"):
        SocialZone(zone.vertices, r_max, {})


# --- the real day ------------------------------------------------------------------------------------


def test_the_real_day_has_zones_at_walking_speeds(real_samples: pd.DataFrame, tmp_path: Path) -> None:
    zone = SocialZone.fit(real_samples)
    assert sorted(zone.ellipses) == list(SPEEDS)
    assert zone.undefined == {}
    for speed, ellipse in zone.ellipses.items():
        assert ellipse.level(zone.boundary(speed, n=20_001)).max() <= 1 + 1e-9
        assert ellipse.level([0.0, 0.0]) < 1  # the person is inside the own zone
        assert 0.3 < ellipse.semi_axes[1] <= ellipse.semi_axes[0] < 2.0
    stages = zone.provenance["funnel"]
    assert sum(stage["entered"] for stage in stages if stage["stage"].startswith("read ")) == 624_951
    assert all(s["entered"] == s["kept"] + sum(s["set_aside"].values()) for s in stages)
    zone.save(tmp_path / "zone.json")
    assert SocialZone.load(tmp_path / "zone.json").provenance == zone.provenance
