"""Identical runs are kept, not repeated; anything else that changed is run again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from szlib.workbook import runner
from szlib.workbook.cli import main

pytestmark = pytest.mark.usefixtures("without_kernels")
CODE = """
with open("{log}", "a") as log:
    log.write("{name} ")
record.check("ok", True)
record.animation(b"GIF89a", "movie")"""


@pytest.fixture
def executed(
    notebooks: Callable[..., Path], tmp_path: Path
) -> Callable[..., list[str]]:
    """Run two notebooks and the summary of all; return which of them were executed."""
    log = tmp_path / "log"
    names = ("01_one", "03_two", "28_all")
    notebooks(**{f"_{name}": CODE.format(log=log, name=name) for name in names})

    def run(*arguments: str, code: int = 0) -> list[str]:
        log.write_text("")
        assert (
            main(["run", "--data", "mine.csv", "--out", "out", "-j", "1", *arguments])
            == code
        )
        return log.read_text().split()

    assert run() == list(names)
    return run


def outputs(folder: Path) -> dict[str, bytes]:
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in folder.rglob("*")
        if file.is_file()
    }


def test_an_identical_run_executes_nothing_and_changes_nothing(
    executed: Callable[..., list[str]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert executed("--force") == ["01_one", "03_two", "28_all"]
    before, printed = outputs(tmp_path / "out"), capsys.readouterr().out
    assert executed() == []
    assert outputs(tmp_path / "out") == before
    again = capsys.readouterr().out
    assert (
        "3 of 3 notebooks are kept from an earlier run; --force repeats them" in again
    )
    assert [line for line in printed.splitlines() if line[:2].isdigit()] == [
        line for line in again.splitlines() if line[:2].isdigit()
    ]
    assert executed("--only", "03") == []


def test_a_changed_notebook_runs_again_with_the_summary_of_all(
    executed: Callable[..., list[str]], tmp_path: Path
) -> None:
    script = tmp_path / "notebooks" / "03_two.py"
    script.write_text(script.read_text() + "\n# one more line\n")
    assert executed() == ["03_two", "28_all"]
    assert executed() == []


@pytest.mark.parametrize(
    "change",
    [
        lambda tmp_path, _: (tmp_path / "mine.csv").write_text(
            "t,id,x,y\n0,1,0,0\n1,1,1,0.5\n"
        ),
        lambda _, patch: patch.setattr(runner, "__version__", "9.9"),
        lambda _, patch: patch.setattr(
            runner, "package_checksum", lambda _: "other code"
        ),
    ],
    ids=["data", "version", "code"],
)
def test_other_data_version_or_code_runs_everything_again(
    executed: Callable[..., list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    change: Callable[[Path, pytest.MonkeyPatch], None],
) -> None:  # fmt: skip
    change(tmp_path, monkeypatch)
    assert executed() == ["01_one", "03_two", "28_all"]
    assert executed() == []


@pytest.mark.parametrize(
    "name", ["01_one.ipynb", "records/01_one.json", "figures/01_one-movie.gif"]
)
@pytest.mark.parametrize("damage", ["missing", "changed"])
def test_a_damaged_result_is_made_again(
    executed: Callable[..., list[str]], tmp_path: Path, name: str, damage: str
) -> None:
    file = tmp_path / "out" / "mine" / name
    whole = file.read_bytes()
    file.unlink() if damage == "missing" else file.write_bytes(whole[:-1])
    assert executed() == ["01_one", "28_all"]
    # ids of cells are random
    assert file.suffix == ".ipynb" or file.read_bytes() == whole
    assert (
        json.loads(file.read_bytes())["cells"]
        if file.suffix == ".ipynb"
        else file.exists()
    )


def test_a_notebook_that_is_gone_leaves_the_summary(
    executed: Callable[..., list[str]], tmp_path: Path
) -> None:
    (tmp_path / "notebooks" / "03_two.py").unlink()
    assert executed() == []
    summary = json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())
    assert list(summary["notebooks"]) == ["01_one", "28_all"]


def test_a_damaged_summary_or_report_is_made_again(
    executed: Callable[..., list[str]], tmp_path: Path
) -> None:
    home = tmp_path / "out" / "mine"
    page = (home / "report.html").read_text(encoding="utf-8")
    (home / "report.html").write_text("damaged")
    assert executed() == []
    assert len((home / "report.html").read_text(encoding="utf-8")) == len(page)
    summary = json.loads((home / "summary.json").read_text())
    summary["notebooks"]["01_one"]["checks"][0]["passed"] = False
    (home / "summary.json").write_text(json.dumps(summary))
    assert executed() == ["01_one", "28_all"]
    (home / "summary.json").write_text('{"notebooks": [1]}')
    assert executed() == ["01_one", "03_two", "28_all"]


def test_a_stopped_run_keeps_what_it_had_finished_and_nothing_else(
    executed: Callable[..., list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, calls = runner.wait, []

    def stop_at_the_second(*arguments: object, **options: object) -> object:
        """Ctrl-C after the first batch."""
        calls.append(arguments)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return whole(*arguments, **options)  # type: ignore[call-overload]

    monkeypatch.setattr(runner, "wait", stop_at_the_second)
    assert executed("--force", code=130)[:1] == ["01_one"]
    monkeypatch.setattr(runner, "wait", whole)
    assert executed() == ["03_two", "28_all"]


def test_figures_of_another_format_are_added_once(
    executed: Callable[..., list[str]], tmp_path: Path
) -> None:
    script, home = (
        tmp_path / "notebooks" / "01_one.py",
        tmp_path / "out" / "mine" / "figures",
    )
    draw = "import matplotlib.figure as m\nf = m.Figure()\n"
    draw += "f.subplots().plot([1, 2])\nrecord.figure(f, 'line')"
    script.write_text(
        script.read_text().replace("record.close()", f"{draw}\nrecord.close()")
    )
    assert executed() == ["01_one", "28_all"]
    assert executed("--figures", "svg") == ["01_one", "28_all"]
    assert (home / "01_one-line.svg").read_text().startswith("<?xml") and (
        home / "01_one-line.png"
    ).exists()
    assert executed("--figures", "svg") == executed() == []
    assert executed("--figures", "pdf") == ["01_one", "28_all"]
    assert (home / "01_one-line.pdf").read_bytes().startswith(b"%PDF")


def test_a_notebook_that_failed_is_repeated(
    executed: Callable[..., list[str]], tmp_path: Path
) -> None:
    script = tmp_path / "notebooks" / "01_one.py"
    script.write_text(script.read_text().replace("record.close()", "1 / 0"))
    assert executed(code=1) == ["01_one", "28_all"]
    assert executed(code=1) == ["01_one", "28_all"]
