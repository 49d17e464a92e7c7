"""The short forms of the attacks, each in an interpreter of its own, and tests of their judges.

`make hostile` also kills processes and enters foreign environments, which tests/workbook does in short.
"""

import os
import random
import subprocess
import sys
from pathlib import Path

import commands
import processes
import pytest
from helpers import process_table

import szlib
from szlib.workbook.cli import build_parser


@pytest.mark.slow
@pytest.mark.parametrize(
    "attack",
    [
        "commands",
        "damaged_tracks",
        "files",
        "races",
        "reading",
        "terminal",
        "adversary",
        "among_people",
        "walls",
        "ways",
    ],
)
def test_attack_breaks_nothing(attack, tmp_path):
    done = subprocess.run(
        [sys.executable, str(Path(__file__).parent), attack],
        cwd=tmp_path, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]


@pytest.mark.parametrize(
    ("code", "printed", "fault"),
    [
        (0, "done", ""),
        (2, "szlib: day.csv: no such file", ""),
        (2, "szlib run: error: expected 4 arguments", ""),
        (2, "szlib: KeyError: 'x'", "an error that is not of szlib"),
        (2, "no", "it gives no reason"),
        (-9, "", "it hangs, or a signal ended it"),
        (1, "Traceback (most recent call last)", "a foreign traceback"),
    ],
)
def test_judge_of_command_lines(code, printed, fault):
    assert commands.judge(code, printed) == fault


def test_only_what_a_command_left_in_shared_memory_counts(tmp_path, monkeypatch):
    (tmp_path / "tmp").mkdir()
    (tmp_path / "sem.loky-1-another").touch()
    monkeypatch.setattr(processes, "SHARED_MEMORY", tmp_path)
    leave = "import os, time; open(f'sem.loky-{os.getpid()}-own', 'w'); time.sleep(0.5)"
    command = subprocess.Popen([sys.executable, "-c", leave], cwd=tmp_path)
    assert process_table.wait_and_note(command) == 0
    assert processes.everything_outside(tmp_path) == {
        str(tmp_path / f"sem.loky-{command.pid}-own")
    }


def test_every_command_and_option_is_drawn():
    lines = [commands.draw(random.Random(seed)) for seed in range(400)]
    words = {word.partition("=")[0] for line in lines for word in line}
    (verbs,) = [
        action for action in build_parser()._actions if isinstance(action.choices, dict)
    ]
    options = {
        name
        for verb in verbs.choices.values()
        for each in verb._actions
        for name in each.option_strings
    }
    assert {*verbs.choices, *options} - {"-h", "--help"} <= words
