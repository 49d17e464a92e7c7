"""Pages: what a notebook records, and the artefacts it leaves for the next."""

import json

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.workbook import record as pages
from szlib.workbook.record import Page, parameters


@pytest.fixture
def page(tmp_path):
    file = tmp_path / "mine.csv"
    file.write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")
    return Page("01_test", data=str(file), results=tmp_path / "results")


def test_checks_and_claims_are_written_down(page, capsys):
    page.check("holds", np.True_, np.float64(0.5))
    page.check("breaks", np.bool_(False), np.array([1, 2]))
    page.claim("claimed", False, {"n": np.int64(3)})
    page.key["count"] = np.int64(7)
    table = page.close()
    left = json.loads((page.out / "pages" / "01_test.json").read_text())
    assert [c["passed"] for c in left["checks"]] == [True, False, False]
    assert [c["value"] for c in left["checks"]] == [0.5, [1, 2], {"n": 3}]
    assert left["key_figures"] == {"count": 7}
    assert list(table.data["result"]) == ["holds", "FAILED", "not supported here"]
    assert "FAILED" in capsys.readouterr().out


def test_encounters_are_kept_for_this_data_and_found_anew_for_other(page, monkeypatch):
    made = []

    def fake(tracks):
        made.append(len(tracks))
        return pd.DataFrame({"encounter": [0], "distance": [1.0]})

    monkeypatch.setattr(pages, "find_encounters", fake)
    page.encounters()
    page.encounters()
    assert len(made) == 1
    Page("02_test", data=page.data, results=page.results, seed=1).encounters()
    assert len(made) == 2
    page.files()[0].write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n2,1,2,0\n")
    page.encounters()
    assert len(made) == 3


def test_an_unreadable_zone_is_fitted_again_and_said_so(page, monkeypatch, capsys):
    (page.out / "zone.json").write_text("{")
    monkeypatch.setattr(Page, "encounters", lambda self: None)
    monkeypatch.setattr(pages.SocialZone, "fit", lambda samples: "zone")
    monkeypatch.setattr(Page, "keep_zone", lambda self, zone: zone)
    assert page.zone() == "zone"
    assert "fitting the zone again" in capsys.readouterr().out


def test_badges():
    table = parameters([("gamma", 0.05, "measured", "why")])
    assert table.data.set_index("parameter").loc["gamma", "badge"] == "measured"
    with pytest.raises(ValueError, match="guessed"):
        parameters([("gamma", 0.05, "guessed", "")])


def test_every_setting_of_the_controller_is_explained_and_has_a_badge():
    table = pages.settings_table(szlib.MPCSettings()).data
    assert set(table["parameter"]) == set(szlib.MPCSettings.__dataclass_fields__)
    assert table["why"].str.len().min() > 5
    assert "v_max" in table.set_index("parameter").index
