"""Social zones: a known one is recovered, files keep every bit, and what is undefined is message."""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from helpers.passers import passers, wanderers
from helpers.passing_pairs import null_of, passing_pairs, respecting

import szlib
from szlib.tracks import funnels
from szlib.zones.ellipses import EllipseZone
from szlib.zones.social_zone import METHODS, SPEEDS, SocialZone

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


def distance_to(ellipse, angles):
    """From the origin, inside the ellipse, to the ellipse in directions `angles`: a quadratic equation."""
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    turn = np.array([[cos, sin], [-sin, cos]]) / np.reshape(ellipse.semi_axes, (2, 1))
    away, start = (
        turn @ np.stack([np.cos(angles), np.sin(angles)]),
        turn @ -np.asarray(ellipse.center),
    )
    a, b, c = np.sum(away**2, axis=0), start @ away, start @ start - 1
    return (-b + np.sqrt(b * b - a * c)) / a


def people_around(rim, *, speeds=STEPS):
    """People at just the given distances, all around and at every speed, and others farther away."""
    tables = [
        pd.DataFrame(
            {
                "los_angle": ANGLES,
                "distance": np.minimum(rim(v) + extra, 2.4),
                "speed": v,
            }
        )
        for v in speeds
        for extra in (0.0, 0.3)
    ]
    return pd.concat(tables, ignore_index=True).rename_axis("encounter").reset_index()


def fit(samples, **options):
    """The zone without intervals, which take their time."""
    return SocialZone.fit(samples, **{"n_resamples": 0, "method": "hull", **options})


def fit_around(ellipse, **options):
    return fit(
        people_around(lambda _: distance_to(ellipse, ANGLES)), fraction=0, **options
    )


def assert_same_ellipse(found, expected, metres):
    np.testing.assert_allclose(found.center, expected.center, rtol=0, atol=metres)
    np.testing.assert_allclose(found.semi_axes, expected.semi_axes, rtol=0, atol=metres)
    a, b = expected.semi_axes
    if a > b:  # an error of the axes turns a rounder ellipse more
        turn = (found.angle - expected.angle + np.pi / 2) % np.pi - np.pi / 2
        assert abs(turn) <= 4 * metres * a / (a - b) / b


@pytest.fixture(scope="module")
def samples():
    """Noisy people, fewer and farther at the fringes of speed."""
    rng = np.random.default_rng(0)
    n = 4000
    speed = np.clip(rng.normal(1.0, 0.35, n), 0.4, 1.9)
    angle = rng.uniform(-np.pi, np.pi, n)
    rim = distance_to(KNOWN["off centre and tilted"], angle)
    table = {"los_angle": angle, "distance": rim + rng.gamma(2, 0.3, n), "speed": speed}
    return pd.DataFrame({"encounter": np.arange(n) // 31, "day": "2012-10-24", **table})


@pytest.fixture(scope="module")
def zone(samples):
    return SocialZone.fit(samples, method="hull", n_resamples=20)


# --- the truth ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_a_known_zone_is_recovered_at_any_speed(name):
    zone = fit_around(KNOWN[name], speeds=(0.41, 0.5, 1.1, 1.599))
    assert sorted(zone.ellipses) == [0.41, 0.5, 1.1, 1.599]
    for speed in (0.41, 0.5, 0.777, 1.1, 1.599):
        assert_same_ellipse(zone.ellipse(speed), KNOWN[name], 4 * SAGITTA)
        rim = zone.boundary(speed, n=721)
        expected = distance_to(KNOWN[name], np.arctan2(rim[:, 1], rim[:, 0]))
        np.testing.assert_allclose(np.hypot(*rim.T), expected, rtol=0, atol=SAGITTA)


def test_a_zone_that_shrinks_with_speed_is_recovered():
    """Where the complement grows as a concave function of speed, the hull adds nothing to it."""

    def radius(speed):
        return 1.2 - 0.5 * math.sqrt(speed - 0.3)

    zone = fit(
        people_around(lambda v: np.full(len(ANGLES), radius(v))),
        fraction=0,
        speeds=STEPS[1:-1],
    )
    for speed, ellipse in zone.ellipses.items():
        expected = szlib.Ellipse((0, 0), (radius(speed), radius(speed)))
        assert_same_ellipse(ellipse, expected, 4 * SAGITTA)


def test_the_zone_is_the_mirror_of_close_approaches_not_the_ellipse_of_the_slice(
    zone,
):
    """Map first, enclose second: the boundary is where the complement leaves off."""
    section = zone.shape.slice(1.1)
    theta = np.linspace(-np.pi, np.pi, 50)
    np.testing.assert_allclose(
        np.hypot(*section.boundary(theta).T), 2.0 - section.reach(theta)
    )


@pytest.mark.parametrize("speed", [0.7, 0.9, 1.0, 1.1, 1.3])
def test_the_ellipse_contains_the_whole_boundary(zone, speed):
    level = zone.ellipse(speed).level(zone.boundary(speed, n=50_001))
    assert level.max() <= 1 + 1e-9
    assert level.max() > 1 - 1e-4  # and touches it


@pytest.mark.parametrize("turn", [0.3, -2.0, np.pi / 2])
def test_rotated_samples_rotate_the_zone(samples, zone, turn):
    turned = fit(samples.assign(los_angle=samples["los_angle"] + turn))
    for speed in (0.9, 1.1, 1.3):
        expected = zone.ellipse(speed).placed((0, 0), turn)
        assert_same_ellipse(turned.ellipse(speed), expected, 1e-5)


def test_mirrored_samples_mirror_the_zone(samples, zone):
    mirrored = fit(samples.assign(los_angle=-samples["los_angle"])).ellipse(1.1)
    known = zone.ellipse(1.1)
    x, y = known.center
    assert_same_ellipse(
        mirrored, szlib.Ellipse((x, -y), known.semi_axes, -known.angle), 1e-5
    )


def test_the_same_samples_in_any_order_give_the_same_zone(samples, zone):
    before = samples.copy(deep=True)
    again = fit(samples)
    pd.testing.assert_frame_equal(samples, before)
    np.testing.assert_array_equal(again.shape.vertices, zone.shape.vertices)
    assert again.ellipses == zone.ellipses
    assert again.provenance == zone.provenance
    shuffled = fit(samples.sample(frac=1, random_state=0))
    assert {tuple(v) for v in shuffled.shape.vertices} == {
        tuple(v) for v in zone.shape.vertices
    }


# --- asking ------------------------------------------------------------------------------------------


def test_a_fitted_speed_is_the_one_in_the_table(zone):
    table = zone.table()
    assert table["speed"].tolist() == sorted(zone.ellipses)
    for row in table.itertuples():
        ellipse = zone.ellipse(row.speed)
        assert ellipse is zone.ellipses[row.speed]
        assert (row.center_x, row.center_y, row.a, row.b) == (
            *ellipse.center,
            *ellipse.semi_axes,
        )
        assert np.radians(row.angle_deg) == pytest.approx(ellipse.angle)
        assert row.area == pytest.approx(np.pi * row.a * row.b)


def test_speed_between_fitted_speeds_is_fitted_on_demand(samples, zone):
    fitted = fit(samples, speeds=[1.05]).ellipses[1.05]
    assert zone.ellipse(1.05) == fitted
    assert 1.05 not in zone.ellipses


def test_a_speed_outside_the_data_names_the_range(zone):
    low, high = zone.speed_range
    for speed in (low - 0.1, high + 0.1):
        for ask in (zone.ellipse, zone.boundary):
            with pytest.raises(
                szlib.ZoneError,
                match=rf"at {speed:g} m/s .* {low:.3f} to {high:.3f} m/s",
            ):
                ask(speed)


def test_undefined_speeds_warn_and_are_saved(samples, tmp_path):
    with pytest.warns(
        szlib.DataWarning, match=r"at 0\.1 m/s is undefined.*; .*at 9 m/s is undefined"
    ):
        zone = fit(samples, speeds=(0.1, 1.1, 9))
    assert list(zone.ellipses) == [1.1]
    assert list(zone.undefined) == [0.1, 9.0]
    zone.save(tmp_path / "zone.json")
    assert SocialZone.load(tmp_path / "zone.json").undefined == zone.undefined


def test_people_seen_from_one_side_only_have_no_zone(samples):
    ahead = samples[samples["los_angle"].abs() < np.pi / 3]
    with pytest.raises(
        szlib.ZoneError,
        match=r"no speed has a zone: .* no person was seen in the directions from",
    ):
        fit(ahead)


# --- the funnel --------------------------------------------------------------------------------------


def test_the_provenance_counts_every_sample(samples, zone):
    near, inliers, hull = zone.provenance["funnel"]
    assert near["entered"] == len(samples)
    assert (near["kept"], inliers["kept"]) == (inliers["entered"], hull["entered"])
    assert hull["kept"] == len(zone.shape.vertices)
    assert zone.provenance["days"] == ["2012-10-24"]
    assert zone.provenance["encounters"] == samples["encounter"].nunique()
    options = {"method": "hull", "r_max": 2.0, "fraction": None, "n_neighbours": None}
    assert zone.provenance["parameters"] == options
    table = funnels.table(zone.provenance["funnel"])
    assert table.columns.tolist() == ["stage", "what", "rows"]
    entered, kept = (
        table.loc[table["what"] == what, "rows"].sum() for what in ("entered", "kept")
    )
    assert entered - kept == table.loc[table["what"].str.startswith("- "), "rows"].sum()


def test_a_stage_that_does_not_add_up_is_refused():
    with pytest.raises(
        szlib.SzlibError, match="funnel stage 'sieve' does not add up: 10 != 7"
    ):
        funnels.stage("sieve", 10, 7, {"too long": 2})
    assert funnels.stage("sieve", 10, 7, {"too long": 3, "too short": 0})[
        "rejected"
    ] == {"too long": 3}


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (
            lambda d: d.drop(columns="speed"),
            szlib.DataError,
            r"columns \['speed'\] are missing",
        ),
        (lambda d: d.iloc[:0], szlib.DataError, "the table is empty"),
        (
            lambda d: d.assign(distance=5.0),
            szlib.DataError,
            "none of 4000 samples is within r_max = 2.0 m",
        ),
        (lambda d: d.assign(speed=1.0), szlib.ZoneError, "points lie in one plane"),
        (lambda d: d.assign(speed=np.nan), szlib.ZoneError, "must be finite"),
    ],
)
def test_samples_without_a_zone_are_refused(samples, change, error, message):
    with pytest.raises(error, match=message):
        fit(change(samples))


def test_three_points_have_no_hull(samples):
    few = samples[samples["distance"] <= 2].head(3)
    with pytest.raises(szlib.ZoneError, match=r"n >= 4, .*got \(3, 3\)"):
        fit(few, fraction=0)


def test_empty_speeds_are_refused(samples):
    with pytest.raises(szlib.ZoneError, match="no speed has a zone: `speeds` is empty"):
        fit(samples, speeds=())


def test_repr_states_method_and_verdict(zone):
    assert len(repr(zone).splitlines()) == 6
    assert "verdict: undecided at 0.5" in repr(zone)
    assert "method 'hull'" in repr(zone)


def test_plot_shows_one_speed_or_all(zone):
    assert "1.1 m/s" in zone.plot(1.1).get_title()
    labels = [text.get_text() for text in zone.plot().get_legend().get_texts()]
    assert len(labels) == len(zone.ellipses)


# --- files -------------------------------------------------------------------------------------------


def test_saved_zone_loads_bit_by_bit(samples, zone, tmp_path):
    zone.save(tmp_path / "zone.json")
    loaded = SocialZone.load(tmp_path / "zone.json")
    np.testing.assert_array_equal(loaded.shape.vertices, zone.shape.vertices)
    assert loaded.r_max == zone.r_max
    assert loaded.ellipses == zone.ellipses
    assert loaded.provenance == zone.provenance
    assert loaded.ellipse(1.23) == zone.ellipse(1.23)
    loaded.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (
        tmp_path / "zone.json"
    ).read_bytes()
    numpy_options = fit(
        samples,
        r_max=np.float64(2),
        fraction=np.float64(0.002),
        n_neighbours=np.int64(20),
        speeds=np.array([1.1]),
    )
    numpy_options.save(tmp_path / "numpy.json")


def test_file_states_format_version_and_units(zone, tmp_path):
    zone.save(str(tmp_path / "zone.json"))
    content = json.loads((tmp_path / "zone.json").read_text(encoding="utf-8"))
    assert (content["format"], content["version"]) == ("szlib.SocialZone", 5)
    assert "m, s, rad" in content["units"]
    assert content["provenance"]["szlib"] == szlib.__version__


def test_zone_of_another_version_of_szlib_loads(zone, tmp_path):
    old = replace(zone, provenance=zone.provenance | {"szlib": "0.1.0"})
    old.save(tmp_path / "zone.json")
    loaded = SocialZone.load(tmp_path / "zone.json")
    assert loaded.ellipses == zone.ellipses
    assert loaded.provenance["szlib"] == "0.1.0" != szlib.__version__


def test_saving_replaces_a_file_as_a_whole(zone, tmp_path):
    path = tmp_path / "zone.json"
    zone.save(path)
    before = path.read_bytes()
    stubborn = replace(zone, provenance={"made by": object()})
    with pytest.raises(szlib.ZoneError, match=r"cannot write the zone .*JSON"):
        stubborn.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["zone.json"]


@pytest.mark.parametrize("place", ["missing/zone.json", "file/zone.json", "folder"])
def test_unwritable_path_is_named(zone, tmp_path, place):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(szlib.ZoneError, match=f"{place}: cannot write the zone"):
        zone.save(tmp_path / place)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def broken(change):
    def apply(text):
        content = json.loads(text)
        return json.dumps(change(content) or content)

    return apply


CHECKSUM = "is damaged: its checksum"
BROKEN = {
    "empty": (lambda _: "", "cannot be read as a zone"),
    "truncated": (lambda text: text[: len(text) // 2], "cannot be read as a zone"),
    "not UTF-8": (lambda _: b"\xff\xfe\x00", "cannot be read as a zone"),
    "too deep": (lambda _: "[" * 100_000, "cannot be read as a zone"),
    "a huge number": (lambda _: "9" * 10_000, "cannot be read as a zone"),
    "a list": (lambda _: "[1, 2]", "is JSON but no zone"),
    "null": (lambda _: "null", "is JSON but no zone"),
    "other JSON": (lambda _: '{"type": "FeatureCollection"}', "is JSON but no zone"),
    "newer": (broken(lambda c: c.update(version=6)), r"version 6, .* reads 5; install the szlib"),
    "older": (broken(lambda c: c.update(version=1)), "has format version 1, .* fit the zone again"),
    "no version": (broken(lambda c: c.pop("version") and None), "has format version None"),
    "no r_max": (broken(lambda c: c.pop("r_max") and None), CHECKSUM),
    "another zone": (broken(lambda c: c["ellipses"][0].update(semi_axes=[0.01, 0.01])), CHECKSUM),
    "another origin": (broken(lambda c: c["provenance"].update(szlib="9")), CHECKSUM),
    "no checksum": (broken(lambda c: c.pop("checksum") and None), "is damaged: its checksum is None"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "message"), BROKEN.values(), ids=BROKEN)
def test_damaged_file_is_refused_by_name(zone, tmp_path, change, message):
    path = tmp_path / "zone.json"
    zone.save(path)
    content = change(path.read_text(encoding="utf-8"))
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(szlib.ZoneError, match=rf"zone\.json: .*{message}"):
        SocialZone.load(path)


def test_a_zone_of_an_unknown_method_names_it(zone, tmp_path, monkeypatch):
    path = tmp_path / "zone.json"
    with monkeypatch.context() as program:
        program.setitem(METHODS, "own", METHODS["respect"])
        shape = EllipseZone(zone.ellipses)
        replace(zone, method="own", shape=shape).save(path)
        assert SocialZone.load(path).method == "own"
    message = r"zone\.json: its method 'own' is unknown here; .*import the module"
    with pytest.raises(szlib.ZoneError, match=message):
        SocialZone.load(path)


def test_missing_file_is_refused(tmp_path):
    for path in (tmp_path / "missing.json", tmp_path):
        with pytest.raises(
            szlib.ZoneError, match=f"{path.name}: cannot be read as a zone"
        ):
            SocialZone.load(path)


@pytest.mark.parametrize("r_max", [0, -1, np.nan, np.inf])
def test_invalid_r_max_is_refused(zone, r_max):
    with pytest.raises(szlib.ZoneError, match="r_max must be a positive distance"):
        replace(zone, r_max=r_max)


# --- three ways, one object ---------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["hull", "paper"])
def test_every_method_finds_the_known_zone(samples, method):
    """One person in thirty is within 6 cm of the rim: so near are both ways to it."""
    zone = fit(
        samples, method=method, **({"fraction": 0.0} if method == "hull" else {})
    )
    assert zone.method == method
    assert_same_ellipse(zone.ellipse(1.1), KNOWN["off centre and tilted"], 0.12)
    for speed in (1.1, 1.0):  # fitted, and between
        rim = zone.boundary(speed)
        assert rim.shape == (361, 2)
        np.testing.assert_allclose(rim[0], rim[-1], atol=1e-12)
    assert list(zone.table().columns[:7]) == [
        "speed", "center_x", "center_y", "a", "b", "angle_deg", "area",
    ]  # fmt: skip


@pytest.mark.parametrize("method", ["hull", "paper"])
def test_zone_of_every_method_drives_the_robot_and_reloads(samples, method, tmp_path):
    zone = SocialZone.fit(samples, method=method, n_resamples=20)
    with pytest.warns(szlib.DataWarning, match="should not be relied on: undecided"):
        assert szlib.MPCCBF(zone).zone == zone.ellipse(1.1)
    zone.save(tmp_path / "zone.json")
    loaded = SocialZone.load(tmp_path / "zone.json")
    assert (loaded.method, loaded.ellipses, loaded.provenance) == (
        method,
        zone.ellipses,
        zone.provenance,
    )
    assert loaded.ellipse(1.05) == zone.ellipse(1.05)
    np.testing.assert_array_equal(loaded.boundary(1.05), zone.boundary(1.05))
    pd.testing.assert_frame_equal(loaded.table(), zone.table())
    for name in ("intervals", "bands"):
        pd.testing.assert_frame_equal(
            getattr(loaded.uncertainty, name), getattr(zone.uncertainty, name)
        )
    loaded.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (
        tmp_path / "zone.json"
    ).read_bytes()


def test_intervals_do_not_change_the_zone(samples, zone):
    plain = fit(samples)
    assert plain.ellipses == zone.ellipses
    np.testing.assert_array_equal(plain.shape.vertices, zone.shape.vertices)
    assert plain.uncertainty is None
    assert plain.table().filter(regex="_low$|_high$").isna().all(axis=None)
    assert zone.table().filter(regex="_low$|_high$").notna().all(axis=None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "guess"}, "method must be one of paper, hull, respect.*; got 'guess'"),
        ({"q": 0.05}, "method 'hull' has no option 'q'; 'paper' has none; 'hull' has"),
        ({"method": "respect", "n_neighbours": 200}, "has no option 'n_neighbours'; .*'hull' has"),
        ({"outlier_share": 0.1}, "method 'hull' has no option 'outlier_share'"),
        ({"n_resamples": 1}, "resamples must be a whole number, 0 .no intervals. or at least 2; got 1"),
    ],
)  # fmt: skip
def test_invalid_options_are_refused(samples, options, message):
    with pytest.raises(szlib.SzlibError, match=message):
        fit(samples, **options)


def made_null(n=3000, *, r_max=2.0):
    samples = wanderers(n).assign(shift=lambda d: d["encounter"] % 20)
    first = samples.groupby("encounter")
    encounters = pd.DataFrame(
        {"shift": first["shift"].first(), "nearest": first["distance"].min()}
    )
    close = samples[samples["distance"] < r_max]
    return szlib.NullEncounters(
        close, encounters.reset_index().assign(kind="crossing"), 20, r_max
    )


@pytest.mark.slow
def test_respect_zone_is_found_and_saved_with_its_test(tmp_path):
    people = respecting(
        passing_pairs(1200, 1), szlib.Ellipse((0.0, 0.0), (0.8, 0.7)), careless=0.05
    )
    null = null_of(passing_pairs(2500, 0))
    zone = SocialZone.fit(people, null=null, speeds=(1.1,), n_resamples=4)
    assert zone.method == "respect"
    assert zone.null_test.is_significant
    row = zone.table().iloc[0]
    assert row["a_low"] < row["a_high"]
    zone.save(tmp_path / "zone.json")
    loaded = SocialZone.load(tmp_path / "zone.json")
    assert (loaded.ellipses, loaded.null_test) == (zone.ellipses, zone.null_test)
    assert loaded.provenance == zone.provenance


def test_any_zone_can_be_tested_against_a_null(samples):
    zone = fit(wanderers(300, seed=5), method="hull", speeds=(1.1,), null=made_null())
    assert zone.null_test.p_value > 0.05
    assert fit(samples).null_test is None


# --- what is not adequate ----------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:6 encounters are too few to find outliers")
def test_low_sample_zone_warns(samples, tmp_path):
    six = samples[samples["encounter"] < 6]
    for method in ("hull", "paper"):
        with pytest.warns(
            szlib.DataWarning,
            match=r"at 1\.1 m/s fewer than 20 encounters were seen ahead \(",
        ):
            zone = fit(six, method=method, speeds=(1.1,))
        assert not zone.adequate(1.1)
        assert not zone.table()["adequate"].any()
        zone.save(tmp_path / "zone.json")
        for again in (zone, SocialZone.load(tmp_path / "zone.json")):
            with pytest.warns(szlib.DataWarning, match="fewer than 20"):
                szlib.MPCCBF(again)


def test_side_with_few_encounters_is_named(samples):
    left = np.abs(samples["los_angle"] - np.pi / 2) < np.pi / 8
    with pytest.warns(
        szlib.DataWarning, match=r"fewer than 20 encounters were seen left \([0-9]\)$"
    ):
        zone = fit(samples[~left | (samples["encounter"] < 10)], speeds=(1.1,))
    assert zone.missing_data(1.1).endswith(
        "seen left (9)"
    ) or "left (" in zone.missing_data(1.1)


def test_speed_without_encounters_is_not_adequate(zone):
    enough = replace(zone, provenance=zone.provenance | {"encounters": 600})
    assert enough.adequate(1.0)  # between 0.9 and 1.1
    assert not zone.adequate(1.0)  # 130 encounters
    with pytest.warns(
        szlib.DataWarning,
        match=r"at 1\.6 m/s no encounters were counted \(only at 0\.5 to 1\.5 m/s\)",
    ):
        zone.ellipse(1.6)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda c: c["ellipses"][0].update(speed=10**400), "is damaged"),
        (lambda c: c["ellipses"][0].update(semi_axes=[1]), "is damaged"),
        (lambda c: c["ellipses"][0].update(semi_axes=[1, 2]), "semi-axes must satisfy"),
        (lambda c: c["ellipses"][0].update(angle="north"), "is damaged"),
        (lambda c: c.pop("ellipses"), "ellipses"),
        (lambda c: c.pop("r_max"), "r_max"),
        (lambda c: c.update(r_max=-2), "r_max must be a positive distance"),
        (lambda c: c.update(r_max=math.nan), "r_max"),
        (lambda c: c.update(hull_vertices=[[0, 0, 0]] * 9), "lie in one plane"),
        (lambda c: c.update(hull_vertices=[[0, 0, 0], [1]]), "is damaged"),
        (lambda c: c.update(hull_vertices=None), "EllipseZone is not the shape"),
        (lambda c: c.update(method="respect"), "HullZone is not the shape"),
        (lambda c: c.update(provenance=3), "is damaged"),
    ],
)
def test_damaged_content_with_a_matching_checksum_is_refused(
    zone, tmp_path, damage, message
):
    file = tmp_path / "zone.json"
    zone.save(file)
    content = json.loads(file.read_text(encoding="utf-8"))
    del content["checksum"]
    damage(content)
    checksum = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    file.write_text(json.dumps(content | {"checksum": checksum}), encoding="utf-8")
    with pytest.raises(szlib.ZoneError, match=r"zone\.json: .* is damaged") as error:
        SocialZone.load(file)
    assert message in str(error.value)


def test_samples_without_encounter_give_a_zone_of_unknown_quality(
    samples,
):
    with pytest.warns(
        szlib.DataWarning,
        match="^the quality of the zone is unknown.*samples without `encounter`.*again$",
    ):
        zone = SocialZone.fit(
            samples.drop(columns="encounter"), method="hull", fraction=0.002
        )
    assert (zone.side_counts, zone.uncertainty) == (None, None)


def test_default_speeds_are_those_of_walking_people():
    assert pytest.approx(np.arange(0.5, 1.6, 0.2)) == SPEEDS


# --- the real day ------------------------------------------------------------------------------------


def test_real_day_has_zones_at_walking_speeds(real_samples, tmp_path):
    with pytest.warns(
        szlib.DataWarning,
        match=r"at 1\.1 m/s fewer than 20 encounters were seen .*behind \(",
    ):
        zone = fit(real_samples)
    assert sorted(zone.ellipses) == list(SPEEDS)
    assert zone.undefined == {}
    for speed, ellipse in zone.ellipses.items():
        assert ellipse.level(zone.boundary(speed, n=20_001)).max() <= 1 + 1e-9
        assert ellipse.level([0.0, 0.0]) < 1  # the person is inside the own zone
        assert 0.3 < ellipse.semi_axes[1] <= ellipse.semi_axes[0] < 2.0
    stages = zone.provenance["funnel"]
    assert (
        sum(stage["entered"] for stage in stages if stage["stage"].startswith("read "))
        == 624_951
    )
    assert all(s["entered"] == s["kept"] + sum(s["rejected"].values()) for s in stages)
    assert not any(map(zone.adequate, SPEEDS))  # hardly anybody is seen behind
    zone.save(tmp_path / "zone.json")
    assert SocialZone.load(tmp_path / "zone.json").provenance == zone.provenance


def test_the_papers_method_is_a_hull_after_lof_over_samples():
    samples = passers(400, seed=3)
    paper = fit(samples, method="paper", speeds=(1.1,))
    same = fit(samples, fraction=0.002, n_neighbours=20, speeds=(1.1,))
    assert paper.method == "paper"
    assert paper.ellipses == same.ellipses
    assert [stage["rejected"] for stage in paper.provenance["funnel"]] == [
        stage["rejected"] for stage in same.provenance["funnel"]
    ]
    with pytest.raises(
        szlib.ZoneError, match="method 'paper' has no option 'fraction'"
    ):
        fit(samples, method="paper", fraction=0.01)


@pytest.mark.parametrize(
    ("people", "size"), [("everybody", (1.01, 0.77)), ("strangers", (1.31, 1.03))]
)
@pytest.mark.filterwarnings("ignore::szlib.DataWarning")
def test_the_papers_zone_of_the_real_day(people, size, real_samples):
    samples = (
        real_samples if people == "everybody" else szlib.of_kind(real_samples, people)
    )
    zone = fit(samples, method="paper")
    assert tuple(round(axis, 2) for axis in zone.ellipse(1.1).semi_axes) == size
