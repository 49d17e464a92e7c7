"""Processes end with the one that started them, whenever it is killed."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

PROGRAM = """
import time, joblib
from szlib.core.parallel import run_tasks
if __name__ == "__main__":
    print("begun", flush=True)
    list(run_tasks([joblib.delayed(time.sleep)(60)] * 2, n_jobs=2))
"""


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/proc/self/environ").exists(), reason="finds processes in /proc"
)
@pytest.mark.parametrize("delay", [0.05, 1.5])
def test_no_worker_outlives_a_killed_parent(delay: float, tmp_path: Path) -> None:
    """Killed while workers start, wait, and are at work; nothing is imported from the folder."""
    word, program = f"{os.getpid()}-{delay}", tmp_path / "program" / "program.py"
    program.parent.mkdir()
    program.write_text(PROGRAM)
    (tmp_path / "downloads").mkdir()
    for name in ("joblib", "types", "multiprocessing", "numpy", "psutil"):
        (tmp_path / "downloads" / f"{name}.py").write_text(
            f"open({str(tmp_path / 'imported')!r}, 'w').close()"
        )
    parent = subprocess.Popen(
        [sys.executable, str(program)],
        env=os.environ | {"CARRIED": word},
        cwd=tmp_path / "downloads",
        stdout=subprocess.PIPE,
    )
    with parent:
        if parent.stdout is None or parent.stdout.readline() != b"begun\n":
            pytest.fail("the program did not begin")
        time.sleep(delay)
        parent.kill()
    end = time.monotonic() + 30
    while (left := _carriers(word)) and time.monotonic() < end:
        time.sleep(0.1)
    assert left == []
    assert not (tmp_path / "imported").exists()


def _carriers(word: str) -> list[str]:
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            alive = "\nState:\tZ" not in (process / "status").read_text()
            if (
                alive
                and f"CARRIED={word}\0".encode()
                in (process / "environ").read_bytes() + b"\0"
            ):
                found.append((process / "cmdline").read_text())
        except OSError:
            continue
    return found
