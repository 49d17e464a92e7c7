"""The command line: what it runs, what it tells, and with which exit code."""

import json

import pytest

from szlib.errors import DataError
from szlib.workbook import runner as workbook

HEADER = """# %%
import pathlib

from szlib.workbook.record import Page

# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"

# %%
page = Page("{name}", data=data, results=results, seed=seed)
page.key["seed"] = seed
"""


@pytest.fixture
def notebooks(tmp_path, monkeypatch):
    """A workbook of one's own: `notebooks(name=code)` writes them; its data is a file of two rows."""
    folder = tmp_path / "notebooks"
    folder.mkdir()
    monkeypatch.setattr(workbook, "NOTEBOOKS", folder)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.csv").write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")

    def write(**codes):
        for name, code in codes.items():
            text = HEADER.format(name=f"{name[1:]}") + code + "\n\n# %%\npage.close()\n"
            (folder / f"{name[1:]}.py").write_text(text)

    return write


def run(*arguments):
    return workbook.main(["run", "--data", "mine.csv", "--out", "out", "--jobs", "1", *arguments])


def summary(tmp_path):
    return json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())


def test_a_check_that_holds_a_claim_that_does_not_and_a_parameter(notebooks, tmp_path, capsys):
    notebooks(_01_good='page.check("sum", 1 + 1 == 2, 2)\npage.claim("paper", False, 0.25)')
    assert run("-p", "seed=3") == 0
    page = summary(tmp_path)["notebooks"]["01_good"]
    assert page["key_figures"] == {"seed": 3}
    assert [(c["name"], c["passed"], c["value"]) for c in page["checks"]] == [
        ("sum", True, 2),
        ("paper", False, 0.25),
    ]
    printed = capsys.readouterr().out
    assert "1/1" in printed
    assert "not supported here" in printed
    assert "all checks hold" in printed


def test_a_failed_check_and_a_crash_fail_the_run_but_not_the_others(notebooks, tmp_path, capsys):
    notebooks(_01_bad='page.check("sum", False, 3)', _02_crash="1 / 0", _03_fine='page.check("ok", True)')
    assert run() == 1
    told = summary(tmp_path)
    assert not told["passed"]
    assert {name: page["status"] for name, page in told["notebooks"].items()} == {
        "01_bad": "done", "02_crash": "error", "03_fine": "done",
    }  # fmt: skip
    assert "ZeroDivisionError" in told["notebooks"]["02_crash"]["error"]
    printed = capsys.readouterr().out
    assert "FAILED" in printed
    assert "NOT ALL CHECKS HOLD" in printed


def test_only_runs_what_is_asked_for(notebooks, tmp_path):
    notebooks(_01_one='page.check("ok", True)', _07_two='page.check("ok", True)')
    assert run("--only", "07") == 0
    assert list(summary(tmp_path)["notebooks"]) == ["07_two"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["-p", "sed=1"], "unknown parameter sed; the notebooks know data, results, seed"),
        (["-p", "seed"], "must be NAME=VALUE"),
        (["--only", "99"], "no notebook 99; there are 01_one"),
        (["--data", "nowhere.csv"], "nowhere.csv: no such file"),
    ],
)
def test_what_cannot_be_run_exits_with_2_and_says_why(notebooks, capsys, arguments, told):
    notebooks(_01_one="")
    assert run(*arguments) == 2
    assert told in capsys.readouterr().err


def test_without_notebooks_it_says_where_to_find_them(notebooks):
    with pytest.raises(DataError, match="run from a clone"):
        workbook.run()


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["--version"]])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        workbook.main(arguments)
    assert stop.value.code == 0
    assert "szlib" in capsys.readouterr().out


def test_ctrl_c_exits_with_130(notebooks, monkeypatch, capsys):
    def interrupted(*_args, **_kwargs):
        raise KeyboardInterrupt

    notebooks(_01_one="")
    monkeypatch.setattr(workbook, "as_completed", interrupted)
    assert run() == 130
    assert "stopped" in capsys.readouterr().err
