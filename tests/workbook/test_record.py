"""What a notebook records, and the data that it stores for later notebooks."""

import json
import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from studies import committed, lesson_zones

import szlib
from szlib.core.input_files import file_content
from szlib.workbook import folders
from szlib.workbook.record import (
    DataCache,
    NotebookRecord,
    data_cache,
    notebook_record,
    parameters,
)
from szlib.zones.ellipses import EllipseZone


@pytest.fixture
def record(tmp_path):
    file = tmp_path / "mine.csv"
    file.write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")
    given = {"data": str(file), "results": tmp_path / "results", "area": "0 12 0 8"}
    return NotebookRecord("01_test", given)


def test_checks_and_claims_are_recorded(record, capsys):
    record.check("holds", np.True_, np.float64(0.5))
    record.check("breaks", np.bool_(False), np.array([1, 2]))
    record.claim("claimed", False, {"n": np.int64(3)})
    record.claim("undecided", None)
    record.key["count"] = np.int64(7)
    table = record.close()
    left = json.loads((record.out / "records" / "01_test.json").read_text())
    assert [c["passed"] for c in left["checks"]] == [True, False, False, False]
    assert [c["value"] for c in left["checks"]] == [0.5, [1, 2], {"n": 3}, None]
    assert left["key_figures"] == {"count": 7}
    assert list(table.data["result"]) == [
        "holds",
        "FAILED",
        "not supported here",
        "not decidable here",
    ]
    assert "FAILED" in capsys.readouterr().out


@pytest.mark.parametrize(
    "unknown", [float("nan"), np.float32("nan"), np.array([np.nan]), pd.NaT]
)
def test_nan_passes_no_check_and_supports_no_claim(record, unknown):
    record.check("mean is small", unknown)
    record.claim("mean is small", unknown)
    assert [(c["passed"], c["result"]) for c in record.checks] == [
        (False, "FAILED"),
        (False, "not decidable here"),
    ]


def test_check_with_changed_parameters_is_an_observation(record, capsys):
    given = {"data": record.cache.data, "results": record.out.parents[1], "r_max": 1.5}
    other = NotebookRecord("01_test", given)
    other.check("few infeasible steps", False, 4)
    other.check("goal reached", True)
    other.check("the funnel adds up", False, always=True)
    kinds = [(c["kind"], c["passed"], c["result"]) for c in other.checks]
    assert kinds == [
        ("observation", False, "does not hold with r_max = 1.5"),
        ("observation", True, "holds with r_max = 1.5"),
        ("check", False, "FAILED"),
    ]
    assert (
        "with r_max = 1.5: checks that assume the defaults are observations"
        in capsys.readouterr().out
    )
    assert not NotebookRecord(
        "01_test", given | {"r_max": 2.0, "n_jobs": 7, "area": "auto"}
    ).changed


def test_checks_that_assume_the_zone_of_the_plaza_observe_other_data(record):
    given = {"data": record.cache.data, "results": record.out.parents[1]}
    other = NotebookRecord("01_test", given, plaza_zone=True)
    other.check("the robot arrives in 14 s", False, 20)
    other.check("d = 0 on the zone", False, always=True)
    assert [c["kind"] for c in other.checks] == ["observation", "check"]
    own = given | {"data": "synthetic"}
    plaza = NotebookRecord("01_test", own, plaza_zone=True)
    plaza.check("the robot arrives in 14 s", False, 20)
    assert [c["kind"] for c in plaza.checks] == ["check"]


def test_method_parameters_change_encounters_and_zone(record, monkeypatch):
    searched, fitted = [], []
    found = pd.DataFrame({"encounter": [0], "distance": [1.0]})
    shape = EllipseZone({1.3: szlib.Ellipse((0, 0), (1, 1))})
    zone = szlib.SocialZone(shape, 1.5, {1.3: szlib.Ellipse((0, 0), (1, 1))})
    monkeypatch.setattr(
        data_cache, "find_encounters", lambda *_, **k: searched.append(k) or found
    )
    monkeypatch.setattr(
        data_cache.SocialZone, "fit", lambda _, **k: fitted.append(k) or zone
    )
    given = {
        "data": record.cache.data,
        "results": record.out.parents[1],
        "area": record.cache.area,
    }
    NotebookRecord("02_test", given).cache.zone()
    turned = NotebookRecord(
        "02_test",
        given | {"min_speed": 0.6, "space_length": 4.0, "r_max": 1.5},
    )
    turned = replace(turned.cache, folder=record.out)
    turned.zone()
    turned.zone()
    assert [each["settings"].min_speed for each in searched] == [0.4, 0.6]
    assert searched[1]["settings"].space == szlib.AttentionalSpace(length=4.0)
    assert [each["r_max"] for each in fitted] == [2.0, 1.5]
    assert (
        NotebookRecord("02_test", given | {"zone_speed": 1.3}).cache.method.zone_speed
        == 1.3
    )


def test_encounters_are_cached_for_the_same_data_only(record, monkeypatch):
    made = []

    def fake(tracks, settings):
        assert settings.area == szlib.Square(x=(0, 12), y=(0, 8))
        made.append(len(tracks))
        return pd.DataFrame({"encounter": [0], "distance": [1.0]})

    monkeypatch.setattr(data_cache, "find_encounters", fake)
    record.cache.encounters()
    record.cache.encounters()
    assert len(made) == 1
    other = {
        "data": record.cache.data,
        "results": record.out.parents[1],
        "seed": 1,
        "area": record.cache.area,
    }
    NotebookRecord("02_test", other).cache.encounters()
    assert len(made) == 2
    record.cache.files()[0].write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n2,1,2,0\n")
    with pytest.raises(
        szlib.DataError, match="has changed since it was first read; run again"
    ):
        record.cache.encounters()
    NotebookRecord("02_test", other).cache.encounters()
    assert len(made) == 3


def test_rows_of_a_file_that_is_replaced_and_put_back_are_not_stored(
    record, monkeypatch
):
    file, read = record.cache.files()[0], data_cache.read_tracks
    content, before = file.read_bytes(), file.stat()

    def read_another(files, recipe):
        file.write_text("t,id,x,y\n0,1,0,0\n1,1,5,0\n")
        try:
            return read(files, recipe=recipe)
        finally:
            file.write_bytes(content)
            os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))

    monkeypatch.setattr(data_cache, "read_tracks", read_another)
    with pytest.raises(szlib.DataError, match="changed while it was read"):
        record.cache.encounters()
    assert not list(record.out.glob("*.parquet"))


def test_notebook_of_a_run_uses_the_data_with_which_the_run_began(record, monkeypatch):
    content = [[file.name, *file_content(file)] for file in record.cache.files()]
    (record.out / folders.PARAMETERS).write_text(json.dumps({"files": content}))
    monkeypatch.setenv(folders.RUN_VARIABLE, str(record.out))
    given = {"data": record.cache.data}
    assert len(NotebookRecord("02_test", given).cache.tracks())
    record.cache.files()[0].write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n2,1,2,0\n")
    with pytest.raises(
        szlib.DataError, match=r"mine\.csv: has changed since it was first read"
    ):
        NotebookRecord("02_test", given).cache.tracks()


def test_zone_of_other_data_is_not_loaded_if_it_replaces_the_file(record, monkeypatch):
    shape = EllipseZone({1.3: szlib.Ellipse((0, 0), (1, 1))})
    zone = szlib.SocialZone(shape, 2.0, {1.3: szlib.Ellipse((0, 0), (1, 1))})
    monkeypatch.setattr(
        DataCache, "encounters", lambda self: pd.DataFrame({"encounter": []})
    )
    monkeypatch.setattr(data_cache.SocialZone, "fit", lambda *_, **__: zone)
    stored, load = record.cache.zone(), szlib.SocialZone.load
    other = replace(stored, r_max=1.0, provenance={"source": "other data"})
    monkeypatch.setattr(
        data_cache.SocialZone, "load", lambda file: (other.save(file), load(file))[1]
    )
    assert record.cache.zone().r_max == 2.0


def test_damaged_zone_is_fitted_again(record, monkeypatch):
    (record.out / "zone.json").write_text("{")
    monkeypatch.setattr(
        DataCache, "encounters", lambda self: pd.DataFrame({"encounter": []})
    )
    monkeypatch.setattr(data_cache.SocialZone, "fit", lambda samples, **_: "zone")
    monkeypatch.setattr(DataCache, "store_zone", lambda self, zone: zone)
    assert record.cache.zone() == "zone"


def test_zone_of_the_paper_is_fitted_at_the_speed_of_the_robot(record, monkeypatch):
    path = szlib.make_plaza(
        record.out / "plaza.csv", settings=szlib.PlazaSettings(n_encounters=400)
    )
    samples = szlib.find_encounters(szlib.read_tracks(path))
    monkeypatch.setattr(DataCache, "encounters", lambda self: samples)
    found = lesson_zones.choose_paper_zone(record)
    expected = szlib.SocialZone.fit(
        samples, method="paper", speeds=[1.1], n_resamples=0
    )
    assert found == expected.ellipses[1.1]
    assert not (record.out / "zone.json").exists()


def test_unknown_badge_is_refused():
    table = parameters([("gamma", 0.05, "measured", "why")])
    assert table.data.set_index("parameter").loc["gamma", "badge"] == "measured"
    assert "gamma" in repr(table) and " at 0x" not in repr(table)
    with pytest.raises(ValueError, match="guessed"):
        parameters([("gamma", 0.05, "guessed", "")])


def test_committed_table_says_how_it_was_made_and_fails_if_a_row_is_not_reproduced(
    record, tmp_path, monkeypatch, capsys
):
    for module in (committed, notebook_record):
        monkeypatch.setattr(module, "TABLES", tmp_path)
    monkeypatch.setattr("sys.argv", ["somewhere/study.py", "3"])
    monkeypatch.setattr(committed, "STUDIES", {})
    committed.study("99_made", notebook="99")(lambda row: {})
    monkeypatch.setattr(committed, "_describe_commit", lambda: "1234567")
    made = pd.DataFrame(
        {
            "name": ["a", "b", "c"],
            "mean": [0.123456, np.nan, 1e6],
            "probe": [1, 2, np.nan],
        }
    )
    committed.write_table(made, "99_made", seed=7)
    table = notebook_record.read_table("99_made")
    assert table.attrs == {
        "command": "python -m studies.study 3",
        "seed": 7,
        "commit": "1234567",
    }
    pd.testing.assert_frame_equal(
        table, made.astype({"probe": float}), check_exact=True
    )
    record.committed_table("99_made", lambda row: made.loc[row.name].to_dict())
    record.committed_table(
        "99_made", lambda row: {"mean": row["mean"] + 0.001}, where="name == 'a'"
    )
    record.committed_table(
        "99_made", lambda row: {"name": "other"}, where="name == 'b'"
    )
    assert [c["passed"] for c in record.checks] == [True, False, False]
    assert record.checks[1]["value"] == {"mean": [0.123456, 0.124456]}
    assert record.checks[1]["name"] == "row 0 of tables/99_made.csv is reproduced"
    capsys.readouterr()
    whole = record.committed_table("99_made", lambda row: {}, where="name in []")
    assert len(whole) == 3 and len(record.checks) == 3
    assert (
        "not checked: tables/99_made.csv has no row that can be computed here"
        in capsys.readouterr().out
    )


def test_every_committed_table_says_how_it_was_made():
    for file in notebook_record.TABLES.glob("*.csv"):
        table = notebook_record.read_table(file.stem)
        assert table.attrs["command"].startswith("python -m studies.")
        assert len(table)
        assert table.attrs.keys() - {"probe"} == {"command", "seed", "commit"}
