"""Records: what a notebook records, and the artefacts it leaves for the next."""

import json

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.workbook.record import NotebookRecord, parameters
from szlib.workbook.record import notebook as records


@pytest.fixture
def record(tmp_path):
    file = tmp_path / "mine.csv"
    file.write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")
    given = {"data": str(file), "results": tmp_path / "results", "area": "0 12 0 8"}
    return NotebookRecord("01_test", given)


def test_checks_and_claims_are_written_down(record, capsys):
    record.check("holds", np.True_, np.float64(0.5))
    record.check("breaks", np.bool_(False), np.array([1, 2]))
    record.claim("claimed", False, {"n": np.int64(3)})
    record.key["count"] = np.int64(7)
    table = record.close()
    left = json.loads((record.out / "records" / "01_test.json").read_text())
    assert [c["passed"] for c in left["checks"]] == [True, False, False]
    assert [c["value"] for c in left["checks"]] == [0.5, [1, 2], {"n": 3}]
    assert left["key_figures"] == {"count": 7}
    assert list(table.data["result"]) == ["holds", "FAILED", "not supported here"]
    assert "FAILED" in capsys.readouterr().out


def test_encounters_are_kept_for_this_data_and_found_anew_for_other(record, monkeypatch):
    made = []

    def fake(tracks, square):
        assert square == szlib.Square(x=(0, 12), y=(0, 8))
        made.append(len(tracks))
        return pd.DataFrame({"encounter": [0], "distance": [1.0]})

    monkeypatch.setattr(records, "find_encounters", fake)
    record.encounters()
    record.encounters()
    assert len(made) == 1
    other = {"data": record.data, "results": record.out.parents[1], "seed": 1, "area": record.area}
    NotebookRecord("02_test", other).encounters()
    assert len(made) == 2
    record.files()[0].write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n2,1,2,0\n")
    record.encounters()
    assert len(made) == 3


def test_an_unreadable_zone_is_fitted_again_and_said_so(record, monkeypatch, capsys):
    (record.out / "zone.json").write_text("{")
    monkeypatch.setattr(NotebookRecord, "encounters", lambda self: None)
    monkeypatch.setattr(records.SocialZone, "fit", lambda samples: "zone")
    monkeypatch.setattr(NotebookRecord, "keep_zone", lambda self, zone: zone)
    assert record.zone() == "zone"
    assert "fitting the zone again" in capsys.readouterr().out


def test_badges():
    table = parameters([("gamma", 0.05, "measured", "why")])
    assert table.data.set_index("parameter").loc["gamma", "badge"] == "measured"
    with pytest.raises(ValueError, match="guessed"):
        parameters([("gamma", 0.05, "guessed", "")])


def test_every_setting_of_the_controller_is_explained_and_has_a_badge():
    table = records.settings_table(szlib.MPCSettings()).data
    assert set(table["parameter"]) == set(szlib.MPCSettings.__dataclass_fields__)
    assert table["why"].str.len().min() > 5
    assert "v_max" in table.set_index("parameter").index
