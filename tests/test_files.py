"""The one door through which files are written, and the folders that are szlib's own."""

from __future__ import annotations

import ast
import errno
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import szlib
from szlib import files, memory
from szlib.errors import MemoryLimitError, StorageError

PACKAGE = Path(szlib.__file__).parent
WRITERS = {"write_text", "write_bytes", "touch"}
INTO_A_BUFFER = {"to_parquet", "to_csv", "savefig", "write_csv", "write_parquet"}


def test_every_file_is_written_through_the_door() -> None:
    """Nothing else opens a file to write; tables and figures are made in memory first."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            name, first = node.func.attr, ast.unparse(node.args[0]) if node.args else ""
            opens = name == "open" and first.strip("'\"").startswith(("w", "a", "x"))
            made = name in INTO_A_BUFFER and first not in ("", "content", "buffer")
            if name in WRITERS or opens or made:
                found.append(f"{path.relative_to(PACKAGE)}: {ast.unparse(node)[:60]}")
    allowed = ["files.py: unfinished.open('xb')", "tracks/formats/plain.py: unpacked.open('wb')"]
    assert sorted(found) == allowed, "write it with szlib.files.write_file"


def test_a_file_is_whole_or_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.txt"
    files.write_file(file, "first")
    real = files._fill

    def full(unfinished: Path, content: bytes, lasting: bool) -> None:
        real(unfinished, content[:2], lasting)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files, "_fill", full)
    with pytest.raises(StorageError, match=r"a\.txt: cannot be written \(No space left"):
        files.write_file(file, "second")
    assert file.read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"], "nothing half-written stays"


def test_what_must_last_is_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(handle))
    files.write_file(tmp_path / "a", "x")
    assert len(synced) == 2, "the file and its folder"
    files.write_file(tmp_path / "b", "x", lasting=False)
    assert len(synced) == 2


def test_only_folders_of_our_own_are_written_into(tmp_path: Path) -> None:
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "thesis.txt").write_text("x")
    with pytest.raises(StorageError, match=r"holds what szlib did not write, such as 'thesis\.txt'"):
        files.own_folder(theirs, "days")
    ours = files.own_folder(tmp_path / "ours", "days")
    (ours / "2012.json").write_text("{}")
    assert files.own_folder(ours, "days") == ours
    with pytest.raises(StorageError, match="holds days; rollouts need another folder"):
        files.own_folder(ours, "rollouts")
    with pytest.raises(StorageError, match=r"holds data that is to be read, a\.csv"):
        files.own_folder(ours, "days", inputs=[ours / "deep" / "a.csv"])
    files.own_folder(tmp_path / "all" / "days", "days")
    files.own_folder(tmp_path / "all", "results"), "folders of ours in it are nothing foreign"


def dead_process() -> int:
    done = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True)
    return int(done.stdout)


def test_what_the_dead_have_left_is_removed_and_the_living_keep_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, own = files._process().split("-")
    parent = os.getppid()
    for process in (dead_process(), parent):
        (tmp_path / f".szlib-{host}-{process}-abc").write_text("half")
        (tmp_path / f"szlib-{host}-{process}-xyz").mkdir()
        (tmp_path / f"szlib-{host}-{process}-xyz" / "unpacked").write_text("0.7 GB")
    (tmp_path / ".szlib-elsewhere-1-abc").write_text("of another machine")
    files.write_file(tmp_path / "a", "x")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with files.temporary_folder() as folder:
        assert folder.parent == tmp_path and f"-{own}-" in folder.name
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == sorted(
        ["a", ".szlib-elsewhere-1-abc", f".szlib-{host}-{parent}-abc", f"szlib-{host}-{parent}-xyz"]
    )


def test_a_file_is_known_by_what_it_was_made_of(tmp_path: Path) -> None:
    file = tmp_path / "a.bin"
    files.keep(file, b"content", {"seed": 1})
    assert files.kept(file, {"seed": 1}) == b"content"
    assert files.kept(file, {"seed": 2}) is None
    file.write_bytes(b"Content")
    assert files.kept(file, {"seed": 1}) is None, "damaged"


def test_names_that_are_no_text_are_spelled_out() -> None:
    assert files.printable("a\udce4\nb") == r"a\xe4\nb"
    assert files.printable("Brščić.csv") == "Brščić.csv"


@pytest.mark.parametrize(
    ("text", "size"), [("4GB", 4e9), ("1 KiB", 1024), ("2g", 2e9), ("1.5mb", 1.5e6), ("300", 300)]
)
def test_amounts_of_memory(text: str, size: float) -> None:
    assert memory.parse(text) == size


@pytest.mark.parametrize("text", ["", "much", "-1", "0", "nan", "1e9", "9" * 40, "4 XB"])
def test_what_is_no_amount_of_memory(text: str) -> None:
    with pytest.raises(MemoryLimitError, match="expected an amount such as 4GB"):
        memory.parse(text)


def test_the_ceiling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(memory.VARIABLE, raising=False)
    assert memory.ceiling() is None or memory.ceiling() > 1e7  # type: ignore[operator]
    monkeypatch.setenv(memory.VARIABLE, "2GB")
    assert memory.ceiling() == 2e9
    with memory.granted(1000):
        assert memory.ceiling() == 1000
        with pytest.raises(MemoryLimitError, match=r"it takes about 5\.0 GB of memory, and 0 MB may be used"):
            memory.require(5e9, "it")
    assert memory.ceiling() == 2e9
