"""The short forms of the attacks, each in an interpreter of its own; `make hostile` kills processes too."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import szlib


@pytest.mark.parametrize("attack", ["commands", "damaged_tracks", "files", "races", "terminal"])
def test_attack_breaks_nothing(attack, tmp_path):
    done = subprocess.run(
        [sys.executable, str(Path(__file__).parent), attack],
        cwd=tmp_path, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
