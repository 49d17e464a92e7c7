"""The examples to copy run, and the robot in a physics engine keeps what its controller claims."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import szlib

EXAMPLES = Path(__file__).parents[2] / "notebooks" / "examples"


@pytest.fixture
def load(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    yield importlib.import_module
    for name in ("plain_loop", "mujoco_drive"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def tracks(tmp_path_factory):
    """Pairs of people who meet, one pair after another."""
    settings = szlib.PlazaSettings(n_encounters=6, tracked=20.0)
    return szlib.make_plaza(
        tmp_path_factory.mktemp("plaza") / "plaza.csv", settings=settings
    )


def write_map(folder, middle):
    """A map with a block of 0.4 m x 2 m between the two goals."""
    cells = np.full((60, 200), 254, np.uint8)
    cells[20:40, 98:102] = 0
    (folder / "map.pgm").write_bytes(b"P5 200 60 255\n" + cells.tobytes())
    origin = f"[{middle[0] - 10.0}, {middle[1] - 3.0}, 0.0]"
    text = f"image: map.pgm\nresolution: 0.1\norigin: {origin}\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (folder / "map.yaml").write_text(text)
    return szlib.walls_from_map(folder / "map.yaml")


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("plain_loop", 80),
        ("mujoco_drive", 80),
        ("ros2_node", 80),
        ("many_days", 60),
        ("gymnasium_env", 120),
    ],
)
def test_examples_can_be_read_at_once(name, lines):
    assert len((EXAMPLES / f"{name}.py").read_text().splitlines()) <= lines


def test_the_plain_loop_arrives(load, capsys):
    assert load("plain_loop").main()
    assert "arrived after" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("has_walls", "seconds", "goals"), [(False, 25.0, 1), (True, 40.0, 2)]
)
def test_in_a_physics_engine_the_robot_arrives_and_no_safe_step_leads_to_a_contact(
    load, tracks, tmp_path, has_walls, seconds, goals
):
    pytest.importorskip("mujoco")
    middle = szlib.read_tracks(tracks)[["x", "y"]].median()
    walls = write_map(tmp_path, middle.to_list()) if has_walls else None
    count = load("mujoco_drive").run(tracks, walls, seconds=seconds)
    assert count["goals"] >= goals
    assert count["unannounced"] == 0
    assert count["contacts"] <= count["steps"] - count["safe"]
    assert count["safe"] >= 0.9 * count["steps"]
