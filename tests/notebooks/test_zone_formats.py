"""A zone in the formats of other programs, read back as they read it."""

import json
import re
import sys

import numpy as np
import pandas as pd
import pytest
import shapely
import yaml
from zone_formats import as_geojson, as_latex, as_ros_params

import szlib


@pytest.fixture(scope="module")
def zone():
    rng, n = np.random.default_rng(0), 2000
    samples = pd.DataFrame(
        {"encounter": np.arange(n), "los_angle": rng.uniform(-np.pi, np.pi, n)}
    )
    samples["speed"] = rng.uniform(0.8, 1.4, n)
    samples["distance"] = (
        0.6 + 0.4 * np.cos(samples["los_angle"] - 0.3) ** 2 + rng.exponential(0.5, n)
    )
    return szlib.SocialZone.fit(samples, speeds=[0.9, 1.1, 1.3], n_resamples=20)


def test_geojson_holds_the_ellipses(zone):
    content = json.loads(as_geojson(zone, n=180))
    assert content["type"] == "FeatureCollection"
    assert [feature["properties"]["speed"] for feature in content["features"]] == [
        0.9,
        1.1,
        1.3,
    ]
    for feature in content["features"]:
        ellipse = zone.ellipses[feature["properties"]["speed"]]
        shape = shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid and len(shape.exterior.coords) == 181
        assert shapely.is_ccw(shape.exterior), "RFC 7946"
        assert shape.area == pytest.approx(ellipse.area, rel=1e-3)
        np.testing.assert_allclose(ellipse.level(shape.exterior.coords), 1, atol=1e-3)
        assert feature["properties"]["verdict"] == str(
            zone.verdict(feature["properties"]["speed"])
        )


def test_geojson_file_is_an_area(zone, tmp_path):  # type: ignore[no-untyped-def]
    one = json.loads(as_geojson(zone))["features"][1]
    (tmp_path / "zone.geojson").write_text(json.dumps(one))
    assert szlib.as_area(tmp_path / "zone.geojson").area == pytest.approx(
        zone.ellipses[1.1].area, rel=5e-3
    )


def test_ros_parameters_are_lists_of_one_type_by_speed(zone):
    content = yaml.safe_load(as_ros_params(zone, layer="people"))
    (values,) = (content["/**"]["ros__parameters"][name] for name in ["people"])
    assert values["speeds"] == [0.9, 1.1, 1.3]
    assert {len(each) for each in values.values()} == {3}
    assert {
        type(each) for name in values.keys() - {"verdict"} for each in values[name]
    } == {float}
    names = ("center_x", "center_y", "semi_major", "semi_minor", "angle")
    for k, speed in enumerate(values["speeds"]):
        x, y, a, b, angle = (values[name][k] for name in names)
        curve = zone.ellipses[speed].curve()
        np.testing.assert_allclose(
            szlib.Ellipse((x, y), (a, b), angle).curve(), curve, atol=3e-4
        )
        assert (
            np.hypot(*curve.T).max() <= values["radius"][k] < a + np.hypot(x, y) + 1e-3
        )


def test_latex_needs_no_jinja(zone, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    lines = as_latex(zone).splitlines()
    assert lines[0] == r"\begin{tabular}{rllrl}" and lines[-1] == r"\end{tabular}"
    assert (
        lines[2]
        == r"speed [m/s] & a [m] (95 \%) & b [m] (95 \%) & encounters & verdict \\"
    )
    rows = [
        line.removesuffix(r" \\").split(" & ")
        for line in lines
        if re.match(r"\d", line)
    ]
    assert [float(row[0]) for row in rows] == [0.9, 1.1, 1.3]
    assert [row[1][:4] for row in rows] == [
        f"{zone.ellipses[v].semi_axes[0]:.2f}" for v in (0.9, 1.1, 1.3)
    ]
    assert not re.search(r"(?<!\\)[%#_]", as_latex(zone))


def test_a_reference_zone_is_written_as_well():
    hall = szlib.reference_zone("hall")
    (feature,) = json.loads(as_geojson(hall))["features"]
    assert feature["properties"]["semi_major"] == 1.2
    (layer,) = yaml.safe_load(as_ros_params(hall))["/**"]["ros__parameters"].values()
    assert layer["speeds"] == [1.1] and layer["verdict"] == ["undecided"]
    assert layer["radius"] == [1.2]
