"""The README: its program runs, its files exist, its commands are known."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.plaza.people import make_plaza
from szlib.plaza.truth import PlazaSettings
from szlib.simulation.robots import advance
from szlib.workbook.command_line import main, options

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)


def program(start):
    """The one program of the README that has this in its first line or two."""
    (found,) = (each for each in PROGRAMS if start in each)
    return compile(found, "README.md", "exec")


def test_the_first_program_runs(capsys):
    exec(program("szlib.Person("), {})
    assert "optimal 0.0" in capsys.readouterr().out


@pytest.mark.filterwarnings("ignore:.*fewer than 20 encounters:szlib.DataWarning")
def test_a_strangers_file_gives_a_zone(tmp_path, monkeypatch, capsys):
    """People of the plaza in a hall with other columns, frames and origin."""
    monkeypatch.chdir(tmp_path)
    plaza = make_plaza(tmp_path / "plaza.csv", settings=PlazaSettings(encounters=1000))
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
    exec(program("hall.csv"), found)
    assert found["samples"]["encounter"].nunique() > 500
    true = PlazaSettings().true_zone(1.1)
    assert found["zone"].ellipse(1.1).semi_axes == pytest.approx(true.semi_axes, abs=0.1)
    assert "Ellipse" in capsys.readouterr().out


def test_a_strangers_loop(capsys):
    """Somebody who stands in noise, comes late, is hidden for a while, and whose numbers break."""
    rng, driven = np.random.default_rng(0), []
    state = np.array([-4.0, 0.0, 0.0, 0.0])

    def sensors():
        for k in range(100):
            now = 0.1 * k
            person = [1.0, 0.4, -0.4, 0.0] if k < 20 else [0.2, 0.4, *rng.normal(0, 0.02, 2)]
            person[0] = 1.0 - 0.4 * min(now, 2.0)
            if k == 50:
                person[0] = np.nan
            hidden = 60 <= k < 65
            yield (
                now,
                state.copy(),
                [] if hidden else ["a"],
                np.reshape([] if hidden else person, (-1, 4)),
                now,
            )

    def drive(control):
        driven.append(control)
        state[:] = advance(state, control, 0.1)

    names = {"szlib": szlib, "sensors": sensors, "drive": drive, "goal": (4.0, 0.0), "walls": []}
    names["zone"] = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    exec(program("sensors()"), names)
    assert len(driven) == 100
    assert state[0] > 0, "it goes past"
    assert all(fault == "[]" for fault in capsys.readouterr().out.splitlines() if fault.startswith("["))


def test_a_strangers_controller(capsys):
    exec(program("class Straight"), {"szlib": szlib, "np": np, "SimpleNamespace": SimpleNamespace})
    assert float(capsys.readouterr().out) < 0


def test_a_strangers_program_has_at_most_ten_lines():
    for start in ("hall.csv", "sensors()", "class Straight"):
        (text,) = (each for each in PROGRAMS if start in each)
        assert len([line for line in text.splitlines() if line.strip()]) <= 10


def test_the_programs_name_what_exists():
    for program in PROGRAMS:
        compile(program, "README.md", "exec")
        assert all(hasattr(szlib, name) for name in re.findall(r"szlib\.(\w+)", program))


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!http)([^)#]+)\)", TEXT))))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists()


def test_make_verbs_exist():
    known = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"`?make (\w+)", TEXT)) <= known


def test_options_exist():
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    for line in re.findall(r"^szlib run.*?(?=\s+#|$)", TEXT, flags=re.MULTILINE):
        options.parser().parse_args(line.split()[1:])
