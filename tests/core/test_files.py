"""Atomic files, claimed folders, cached results, and the memory limit."""

from __future__ import annotations

import ast
import errno
import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import szlib
from szlib.core import files, input_files
from szlib.core.errors import MemoryLimitError, StorageError
from szlib.simulation.log import SimulationLog

PACKAGE = Path(szlib.__file__).parent
WRITERS = {"write_text", "write_bytes", "touch"}
INTO_A_BUFFER = {"to_parquet", "to_csv", "savefig", "write_csv", "write_parquet"}


def test_only_files_py_writes_files() -> None:
    """Nothing else opens a file to write; tables and figures are made in memory first."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(
                node.func, ast.Attribute
            ):
                continue
            name, first = node.func.attr, ast.unparse(node.args[0]) if node.args else ""
            opens = name == "open" and first.strip("'\"").startswith(("w", "a", "x"))
            made = name in INTO_A_BUFFER and first not in ("", "content", "buffer")
            if name in WRITERS or opens or made:
                found.append(f"{path.relative_to(PACKAGE)}: {ast.unparse(node)[:60]}")
    unpacked = "tracks/sources.py: target.open('wb')"  # into a temporary folder
    assert sorted(found) == ["core/files.py: unfinished.open('xb')", unpacked]


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a.txt"
    files.write_file(file, "first")

    def fail(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(
        StorageError, match=r"a\.txt: cannot be written \(No space left"
    ):
        files.write_file(file, "second")
    assert file.read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"], (
        "no unfinished file is left"
    )


def test_durable_files_are_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(handle))
    files.write_file(tmp_path / "a", "x")
    assert len(synced) == 1
    files.write_file(tmp_path / "b", "x", durable=False)
    assert len(synced) == 1


def test_a_folder_with_foreign_files_or_other_results_is_refused(
    tmp_path: Path,
) -> None:
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.txt").write_text("x")
    with pytest.raises(
        StorageError,
        match=r"holds files that szlib did not write, such as 'thesis\.txt'",
    ):
        files.claim_folder(foreign, "days")
    assert [path.name for path in foreign.iterdir()] == ["thesis.txt"], (
        "nothing is written into it"
    )
    ours = files.claim_folder(tmp_path / "ours", "days")
    (ours / "2012.json").write_text("{}")
    assert files.claim_folder(ours, "days") == ours
    assert files.folder_purpose(ours) == "days"
    with pytest.raises(StorageError, match="holds days; rollouts need another folder"):
        files.claim_folder(ours, "rollouts")
    files.claim_folder(tmp_path / "all" / "days", "days")
    (
        files.claim_folder(tmp_path / "all", "results"),
        "claimed folders in it are not foreign",
    )


def test_unfinished_files_of_killed_processes_are_removed_after_an_hour(
    tmp_path: Path,
) -> None:
    folder = files.claim_folder(tmp_path, "days")
    ages = {"old": 3700, "new": 3500}
    for name, age in ages.items():
        part = folder / f".szlib-part-{name}"
        part.write_text("half")
        os.utime(part, (0, time.time() - age))
    files.claim_folder(tmp_path, "days")
    left = sorted(path.name for path in folder.iterdir())
    assert left == [".szlib", ".szlib-part-new"]


def test_a_cached_file_is_known_by_its_content_and_what_it_was_made_of(
    tmp_path: Path,
) -> None:
    file = tmp_path / "a.bin"
    files.store_cached(file, b"content", {"seed": 1})
    assert files.load_cached(file, {"seed": 1}) == b"content"
    assert files.load_cached(file, {"seed": 2}) is None
    file.write_bytes(b"Content")
    assert files.load_cached(file, {"seed": 1}) is None, "damaged"


NO_SMALL_FILES: dict[str, Callable[[Path], object]] = {
    "it is no regular file": os.mkfifo,
    "no regular file": lambda path: path.symlink_to("/dev/zero"),
    "o regular file": Path.mkdir,
    "it is larger than 10 MB": lambda path: path.write_bytes(b" " * 10_000_001),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs FIFOs")
@pytest.mark.parametrize("reason", NO_SMALL_FILES)
@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("area.json", szlib.as_area),
        ("zone.json", szlib.SocialZone.load),
        ("reading.json", szlib.Recipe.load),
        ("run.npz", SimulationLog.load),
    ],
)
def test_what_is_no_small_regular_file_is_refused(
    name: str, read: Callable[[Path], object], reason: str, tmp_path: Path
) -> None:
    if name == "run.npz" and "larger" in reason:
        pytest.skip("a run may be large")
    NO_SMALL_FILES[reason](tmp_path / name)
    with pytest.raises(szlib.SzlibError, match=reason) as refused:
        read(tmp_path / name)
    assert str(tmp_path) in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["walk.csv", "walk.parquet"])
def test_a_file_of_tracks_that_never_ends_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(szlib.DataError, match="no regular file"):
        szlib.read_tracks(tmp_path / name)


def test_cached_files_that_never_end_are_not_read(tmp_path: Path) -> None:
    files.store_cached(tmp_path / "a", b"content", 1)
    for name in ("a", "a.json", files.MARKER):
        (tmp_path / name).unlink(missing_ok=True)
        (tmp_path / name).symlink_to("/dev/zero")
        assert files.load_cached(tmp_path / "a", 1) is None
        assert files.folder_purpose(tmp_path) is None


def test_file_names_that_are_not_text_are_escaped() -> None:
    assert input_files.printable("a\udce4\nb") == r"a\udce4\nb"
    assert input_files.printable("Brščić.csv") == "Brščić.csv"


@pytest.mark.parametrize(
    ("text", "size"),
    [("4GB", 4e9), ("1 KB", 1000), ("2g", 2e9), ("1.5mb", 1.5e6), ("300", 300)],
)
def test_amounts_of_memory(text: str, size: float) -> None:
    assert input_files.parse_size(text) == size


@pytest.mark.parametrize(
    "text", ["", "much", "-1", "0", "nan", "1e9", "9" * 40, "4 XB"]
)
def test_text_that_is_not_an_amount_of_memory_is_refused(text: str) -> None:
    with pytest.raises(MemoryLimitError, match="expected an amount such as 4GB"):
        input_files.parse_size(text)


def test_memory_limit_is_the_amount_granted_or_the_environments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(input_files.MEMORY_VARIABLE, raising=False)
    assert 1e7 < input_files.memory_limit() < 1e15
    monkeypatch.setenv(input_files.MEMORY_VARIABLE, "2GB")
    assert input_files.memory_limit() == 2e9
    with input_files.environment(SZLIB_MEMORY="1000"):
        assert input_files.memory_limit() == 1000
        with pytest.raises(
            MemoryLimitError,
            match=r"it takes about 5 GB of memory, and the limit is 1e-06",
        ):
            input_files.require_memory(5e9, "it")
    assert input_files.memory_limit() == 2e9
