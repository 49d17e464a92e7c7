"""The README: its programs run, its links lead somewhere, its commands exist."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.workbook.cli import build_parser

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
WHOLE, OWN_DATA, OWN_ROBOT = (compile(text, "README.md", "exec") for text in PROGRAMS)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fewer than 20 encounters:szlib.DataWarning")
def test_the_program_goes_from_tracks_to_a_robot_that_respects_the_zone(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    found = {}
    exec(WHOLE, found)
    assert found["log"].metrics()["success"]
    assert float(capsys.readouterr().out.splitlines()[-1]) >= 0
    true, fitted = PlazaSettings().true_zone(1.1), found["zone"].ellipse(1.1)
    assert fitted.semi_axes == pytest.approx(true.semi_axes, abs=0.04)
    assert {path.name for path in tmp_path.iterdir()} == {
        "plaza.csv",
        "plaza_zone.png",
        "corridor.png",
    }


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fewer than 3 people walked:szlib.DataWarning")
def test_a_file_with_other_columns_frames_and_origin_gives_the_zone(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    plaza = make_plaza(
        tmp_path / "plaza.csv", seed=1, settings=PlazaSettings(n_encounters=1000)
    )
    tracks = szlib.read_tracks(plaza)
    hall = pd.DataFrame(
        {
            "Frame": (25 * (tracks["t"] - tracks["t"].min())).round().astype(int),
            "Ped": tracks["id"],
            "X": tracks["x"] + 18.5,
            "Y": tracks["y"] + 10.0,
        }
    )
    hall.to_csv("hall.csv", index=False)
    found = {"szlib": szlib}
    exec(OWN_DATA, found)
    assert found["zone"].method == "respect"
    true = PlazaSettings().true_zone(1.1)
    assert found["zone"].ellipse(1.1).semi_axes == pytest.approx(
        true.semi_axes, abs=0.1
    )
    assert "Ellipse" in capsys.readouterr().out


def test_the_program_for_a_robot_gives_a_safe_step(capsys):
    found = {"szlib": szlib}
    exec(OWN_ROBOT, found)
    assert found["step"].safe and np.abs(found["step"].control).max() <= 1
    assert "True" in capsys.readouterr().out


def test_readme_can_be_read_in_five_minutes():
    assert len(TEXT.splitlines()) <= 150
    whole = [line for line in PROGRAMS[0].splitlines() if line.strip()]
    assert len(whole) <= 15


def test_it_shows_recorded_and_synthetic_people():
    pictures = dict(re.findall(r"!\[([^\]]+)\]\(notebooks/figures/([^)]+)\)", TEXT))
    assert {
        file: re.findall("synthetic|recorded", alt) for alt, file in pictures.items()
    } == {
        "zone.png": ["synthetic"],
        "mall.png": ["recorded"],
    }


def test_named_functions_exist():
    for name in re.findall(r"szlib\.(\w+)", TEXT):
        assert hasattr(szlib, name) or name in ("csv", "json"), name


@pytest.mark.parametrize(
    "target", sorted(set(re.findall(r"\]\((?!http)([^)#]+)\)", TEXT)))
)
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists()


def test_make_verbs_exist():
    known = set(
        re.findall(
            r"^(\w+):",
            (ROOT / "Makefile").read_text(encoding="utf-8"),
            flags=re.MULTILINE,
        )
    )
    assert set(re.findall(r"make (\w+)", TEXT)) - {"are"} <= known


def test_commands_parse():
    for line in re.findall(r"`szlib ((?:run|inspect|extract)[^`]*)`", TEXT):
        build_parser().parse_args(line.split())
