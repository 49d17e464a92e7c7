"""Processes end with the one that started them, whenever it is killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

PROGRAM = """
import time, joblib
from szlib.core.parallel import run_tasks
if __name__ == "__main__":
    print("begun", flush=True)
    list(run_tasks([joblib.delayed(time.sleep)(60)] * 2, n_jobs=2))
"""


@pytest.mark.parametrize(("parent", "code"), [("os.getppid()", 0), ("10**9", 1)])
def test_a_worker_whose_parent_ended_before_it_was_up_ends_as_well(
    parent: str, code: int
) -> None:
    program = f"import os; from szlib.core.parallel import end_with; end_with({parent})"
    assert subprocess.run([sys.executable, "-c", program]).returncode == code


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


@pytest.mark.skipif(
    not Path("/dev/shm").is_dir(), reason="finds semaphores in /dev/shm"
)
def test_a_closed_terminal_leaves_no_semaphores(tmp_path: Path) -> None:
    """Every process of the group gets SIGHUP; the process that removes the semaphores must outlive it."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    parent = subprocess.Popen([sys.executable, str(program)], start_new_session=True)

    def semaphores() -> list[Path]:
        return list(Path("/dev/shm").glob(f"sem.loky-{parent.pid}-*"))

    assert wait_until(semaphores)
    time.sleep(0.2)
    os.killpg(parent.pid, signal.SIGHUP)
    assert parent.wait() == -signal.SIGHUP
    assert wait_until(lambda: not semaphores())


@pytest.mark.skipif(
    not Path("/dev/shm").is_dir(), reason="finds semaphores in /dev/shm"
)
def test_the_next_run_removes_the_semaphores_of_a_group_that_was_killed(
    tmp_path: Path,
) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    place = os.environ | {"TMPDIR": str(tmp_path)}
    parent = subprocess.Popen(
        [sys.executable, str(program)], start_new_session=True, env=place
    )

    def semaphores() -> list[Path]:
        return list(Path("/dev/shm").glob(f"sem.loky-{parent.pid}-*"))

    assert wait_until(semaphores)
    os.killpg(parent.pid, signal.SIGKILL)
    parent.wait()
    remove = (
        "from szlib.core.files import remove_abandoned_temporary as remove; remove()"
    )
    subprocess.run([sys.executable, "-c", remove], env=place, check=True)
    assert not semaphores()


def wait_until(condition: Callable[[], object], seconds: float = 60.0) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())
