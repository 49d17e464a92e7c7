"""The short form of `python tests/mutate_files.py 20000`."""

from pathlib import Path

import pytest
from mutate_files import survive


@pytest.mark.parametrize("part", range(4))
def test_mutated_files_are_read_or_refused(tmp_path: Path, part: int) -> None:
    outcomes = {survive(tmp_path, seed) for seed in range(100_000 + part * 75, 100_000 + (part + 1) * 75)}
    assert {"read", "read with rows set aside", "refused, with its line"} <= outcomes
