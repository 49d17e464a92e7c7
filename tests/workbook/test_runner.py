"""`szlib run`: the notebooks that it executes, its output, and its exit codes."""

import asyncio
import json
import os
import re
import sys
from concurrent.futures import ThreadPoolExecutor

import psutil
import pytest

from szlib.core.errors import DataError
from szlib.core.files import write_checksum
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.workbook import execution, folders, runner
from szlib.workbook.cli import main
from szlib.workbook.record.parameters import check_parameters

DONE = {
    "status": "done",
    "seconds": 0.0,
    "checks": [],
    "key_figures": {},
    "figures": [],
}


def run(*arguments):
    return main(
        ["run", "--data", "mine.csv", "--out", "out", "--jobs", "1", *arguments]
    )


def summary(tmp_path, folder="mine"):
    return json.loads((tmp_path / "out" / folder / "summary.json").read_text())


@pytest.mark.usefixtures("without_kernels")
def test_run_records_checks_claims_and_key_figures(notebooks, tmp_path, capsys):
    notebooks(
        _01_good='record.check("sum", 1 + 1 == 2, 2)\nrecord.claim("paper", False, 0.25)'
    )
    assert run() == 0
    record = summary(tmp_path)["notebooks"]["01_good"]
    assert record["key_figures"] == {"seed": 0}
    assert [(c["name"], c["passed"], c["value"]) for c in record["checks"]] == [
        ("sum", True, 2),
        ("paper", False, 0.25),
    ]
    printed = capsys.readouterr().out
    assert "1/1" in printed
    assert "not supported here" in printed
    assert "all checks hold" in printed
    assert (
        "report.html" in printed
        and (tmp_path / "out" / "mine" / "report.html").exists()
    )


ZONE = """
import numpy as np, pandas as pd, szlib
n, rng = 3000, np.random.default_rng(0)
samples = pd.DataFrame({"encounter": np.arange(n), "los_angle": rng.uniform(-3.1, 3.1, n)})
samples["speed"] = rng.uniform(1.0, 1.2, n)
zone = szlib.SocialZone.fit(samples.assign(distance=rng.uniform(0.9, 2.5, n)), speeds=[1.1], n_resamples=0)
record.cache.store_zone(zone)
"""


@pytest.mark.usefixtures("without_kernels")
def test_verdict_on_the_zone_ends_the_run_and_begins_the_report(
    notebooks, tmp_path, capsys
):
    notebooks(_05_zone=ZONE)
    assert run() == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("zone at 1.1 m/s: undecided: no null model: ")
    page = (tmp_path / "out" / "mine" / "report.html").read_text(encoding="utf-8")
    answer = re.search(
        r"<h1>Social zones of mine.*?</h1>\s*<p class=.answer.>(.*?)</p>",
        page,
        re.DOTALL,
    )[1]
    assert re.match(
        r"At 1.1 m/s the social zone has semi-axes of \d\.\d\d m and \d\.\d\d m: <strong>un",
        answer,
    )
    assert last == summary(tmp_path)["verdict"]


FEW = {
    "_02_few": 'record.check("some met", record.cache.encounters()["encounter"].nunique() == 4, always=True)',
    "_04_hull": """
record.check("before", {before})
szlib = __import__("szlib")
szlib.SocialZone.fit(record.cache.encounters(), method="paper", speeds=[1.6])
record.check("after", False)""",
    "_07_other": 'record.check("later", True)',
}


@pytest.mark.usefixtures("without_kernels")
@pytest.mark.parametrize("before", [True, False])
def test_too_few_encounters_for_a_zone_end_in_a_verdict(
    notebooks, tmp_path, capsys, before
):
    """The notebook that needs a zone ends early; its checks until then count, and later notebooks run."""
    notebooks(
        **{name: code.replace("{before}", str(before)) for name, code in FEW.items()}
    )
    make_plaza(tmp_path / "mine.csv", settings=PlazaSettings(n_encounters=4))
    assert run() == (0 if before else 1)
    found = summary(tmp_path)
    states = {name: notebook["status"] for name, notebook in found["notebooks"].items()}
    assert states == {"02_few": "done", "04_hull": "undecided", "07_other": "done"}
    assert [
        (c["name"], c["passed"]) for c in found["notebooks"]["04_hull"]["checks"]
    ] == [("before", before)]
    lines = capsys.readouterr().out.splitlines()
    assert re.match(
        r"undecided: 4 encounters were found, 600 are needed: .* more hours of recording at this rate$",
        lines[-1],
    )  # fmt: skip
    assert "not decidable on this data, see the report: 04_hull" in lines
    assert ("all checks that were made hold" in lines) == before
    page = (tmp_path / "out" / "mine" / "report.html").read_text(encoding="utf-8")
    assert "04_hull: not decidable on this data: ZoneError: " in page


@pytest.mark.usefixtures("without_kernels")
@pytest.mark.parametrize(
    "raised", ["szlib.core.errors.ZoneError", "szlib.core.errors.DataError"]
)
def test_errors_of_other_causes_are_not_undecided(notebooks, tmp_path, raised, capsys):
    """An error about the data, and one about a zone where no encounters were stored, refuse the notebook."""
    make = "import szlib\n" + (
        "record.cache.encounters()\n" if "Data" in raised else ""
    )
    notebooks(_02_wrong=f"{make}raise {raised}('wrong')")
    make_plaza(tmp_path / "mine.csv", settings=PlazaSettings(n_encounters=4))
    assert run() == 2
    assert summary(tmp_path)["notebooks"]["02_wrong"]["status"] == "refused"
    assert "wrong" in capsys.readouterr().err


@pytest.mark.usefixtures("without_kernels")
def test_stored_zone_of_another_version_is_no_obstacle(notebooks, tmp_path, capsys):
    notebooks(_05_zone=ZONE, _07_other="")
    assert run("--only", "05") == 0
    file = tmp_path / "out" / "mine" / "zone.json"
    older = file.read_text().replace('"version": 5', '"version": 4')
    file.write_text(older)
    capsys.readouterr()
    assert run("--only", "07") == 0
    assert "zone at" not in capsys.readouterr().out
    source = json.loads(older)["provenance"]["source"]
    write_checksum(file, older.encode(), source)  # whole, but written by an older szlib
    assert run("--only", "07") == 0
    assert "zone at" not in capsys.readouterr().out


@pytest.mark.usefixtures("without_kernels")
def test_a_notebook_that_is_gone_fails_no_later_run(notebooks, tmp_path):
    folder = notebooks(_01_good="", _02_bad='record.check("fine", False)')
    assert run() == 1
    (folder / "02_bad.py").unlink()
    assert run() == 0
    assert list(summary(tmp_path)["notebooks"]) == ["01_good"]


@pytest.mark.usefixtures("without_kernels")
@pytest.mark.parametrize("change", ["write_text('t,id,x,y')", "unlink()"])
def test_data_that_changes_at_the_end_of_a_run_loses_no_summary(
    notebooks, tmp_path, change
):
    """A zone is judged against the data that the run began with."""
    file = tmp_path / "mine.csv"
    notebooks(
        _05_zone=ZONE,
        _07_last=f"from pathlib import Path; Path({str(file)!r}).{change}",
    )
    assert run() == 0
    assert "zone at" in summary(tmp_path)["verdict"]


@pytest.mark.usefixtures("without_kernels")
def test_with_changed_parameters_only_checks_that_always_hold_fail_the_run(
    notebooks, tmp_path, capsys
):
    notebooks(_01_good='record.check("no infeasible step", seed == 0, 4)')
    assert run("-p", "seed=3") == 0
    (folder,) = (path.name for path in (tmp_path / "out").glob("mine-*"))
    assert summary(tmp_path, folder)["passed"]
    printed = capsys.readouterr().out
    assert "01_good: no infeasible step: does not hold with seed = 3 (4)" in printed
    (line,) = (line for line in printed.splitlines() if line.startswith("01_good "))
    assert line.split()[2:4] == ["-", "0/1"], (
        "no check; one observation, which does not hold"
    )
    assert "all checks hold" in printed
    notebooks(_01_good='record.check("funnel", False, always=True)')
    assert run("-p", "seed=3") == 1


def test_default_of_one_notebook_is_passed_to_the_others(notebooks):
    folder = notebooks(_01_few="", _07_many="")
    for name, worlds in (("01_few", 2), ("07_many", 4)):
        script = folder / f"{name}.py"
        script.write_text(
            script.read_text().replace(
                "seed = 0\n", f"seed = 0\nworlds = {worlds}\n", 1
            )
        )
    sources = sorted(folder.glob("*.py"))
    assert check_parameters({"worlds": 2, "seed": 0}, sources) == {"worlds": 2}
    assert check_parameters({"worlds": 4}, sources[1:]) == {}


@pytest.mark.usefixtures("without_kernels")
def test_failed_check_and_error_fail_the_run_but_not_other_notebooks(
    notebooks, tmp_path, capsys
):
    notebooks(
        _01_bad='record.check("sum", False, 3)',
        _02_crash="1 / 0",
        _03_fine='record.check("ok", True)',
    )
    assert run() == 1
    found = summary(tmp_path)
    assert not found["passed"]
    assert {name: record["status"] for name, record in found["notebooks"].items()} == {
        "01_bad": "done", "02_crash": "error", "03_fine": "done",
    }  # fmt: skip
    assert "ZeroDivisionError" in found["notebooks"]["02_crash"]["error"]
    printed = capsys.readouterr().out
    assert "FAILED" in printed
    assert "NOT ALL CHECKS HOLD" in printed


@pytest.mark.usefixtures("without_kernels")
def test_only_selects_notebooks(notebooks, tmp_path):
    notebooks(_01_one='record.check("ok", True)', _07_two='record.check("ok", True)')
    assert run("--only", "07") == 0
    assert list(summary(tmp_path)["notebooks"]) == ["07_two"]


def test_notebooks_are_ordered_and_chosen_by_full_number(notebooks):
    names = ["00_start", "06_barriers", "06b_build", "07_passing", "10_room"]
    notebooks(**{f"_{name}": "" for name in reversed(names)})
    known = folders.list_notebooks(folders.find_notebooks())
    chosen = [
        [s.stem for s in runner.choose_notebooks(known, only)]
        for only in ([], ["06"], ["06b"], ["10_room", "00"])
    ]
    assert chosen == [names, ["06_barriers"], ["06b_build"], ["00_start", "10_room"]]
    with pytest.raises(DataError, match="no notebook 0; there are 00_start"):
        runner.choose_notebooks(known, ["0"])


def test_notebooks_wait_only_for_encounters_and_zone_and_the_summary_for_all(notebooks):
    names = [
        "00_start",
        "01_tracks",
        "02_met",
        "03_far",
        "05_zone",
        "06_robot",
        "06b_build",
        "17_a",
        "28_sentences",
    ]
    notebooks(**{f"_{name}": "" for name in names})
    known = folders.list_notebooks(folders.find_notebooks())
    stems = [[s.stem for s in batch] for batch in runner.split_batches(known)]
    assert stems == [
        names[:3],
        names[3:5],
        ["06_robot", "06b_build", "17_a"],
        ["28_sentences"],
    ]
    one = runner.choose_notebooks(known, ["06"])
    assert runner.split_batches(one) == [one]


@pytest.mark.parametrize(("jobs", "threads"), [(1, "6"), (2, "3"), (4, "1")])
def test_notebooks_that_run_at_the_same_time_share_the_cores(
    notebooks, monkeypatch, jobs, threads
):
    given = []
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    monkeypatch.setattr(
        runner, "execute_notebook", lambda *task: given.append(task[-1]) or DONE
    )
    notebooks(**{f"_0{n}_a": "" for n in range(1, 5)})
    monkeypatch.delenv("OMP_NUM_THREADS")
    runner.run("mine.csv", out="out", jobs=jobs)
    assert {environment["OMP_NUM_THREADS"] for environment in given} == {threads}
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    runner.run("mine.csv", out="out", jobs=jobs)
    assert given[-1]["OMP_NUM_THREADS"] == "5", "the user's own value stays"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["-p", "sed=1"],
            "unknown parameter 'sed'; the notebooks know data, results, seed",
        ),
        (["-p", "seed"], "must be NAME=VALUE"),
        (["-p", "seed=abc"], "parameter seed: expected int, such as 0; got 'abc'"),
        (["-p", "seed=1.5"], "parameter seed: expected int"),
        (["-p", "seed=true"], "parameter seed: expected int"),
        (["--only", "99"], "no notebook 99; there are 01_one"),
        (["--data", "nowhere.csv"], "nowhere.csv: no such file"),
    ],
)
def test_invalid_options_exit_with_2_and_one_reason(
    notebooks, capsys, arguments, message
):
    notebooks(_01_one="")
    assert run(*arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("place", ["taken", "taken/inside"])
def test_unwritable_results_exit_with_2(notebooks, tmp_path, capsys, place):
    notebooks(_01_one="")
    (tmp_path / "taken").write_text("a file")
    assert run("--out", str(tmp_path / place)) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("jobs", ["0", "-1", "two", "1.5", "²"])
def test_invalid_number_of_jobs_is_refused(jobs, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["run", "--jobs", jobs])
    assert stop.value.code == 2
    assert "expected a whole number >= 1" in capsys.readouterr().err


def test_missing_packages_are_named(notebooks, monkeypatch, capsys):
    notebooks(_01_one="")
    monkeypatch.setitem(sys.modules, "ipykernel.kernelspec", None)
    for name in ("execution", "runner"):
        monkeypatch.delitem(sys.modules, f"szlib.workbook.{name}")
    assert run() == 2
    assert "is missing: pip install 'szlib[workbook]'" in capsys.readouterr().err


def test_missing_notebooks_are_explained(notebooks):
    with pytest.raises(
        DataError, match="notebooks: there are no notebooks; expected a folder"
    ):
        runner.run()


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["--version"]])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 0
    assert "szlib" in capsys.readouterr().out


def test_ctrl_c_exits_with_130(notebooks, monkeypatch, capsys):
    def interrupted(*_args, **_kwargs):
        raise KeyboardInterrupt

    notebooks(_01_one="")
    monkeypatch.setattr(runner, "execute_notebook", interrupted)
    assert run() == 130
    assert "stopped" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="kernels are not forked")
def test_a_stopped_run_leaves_the_server_of_kernels_to_the_next_run(
    notebooks, monkeypatch
):
    servers = []

    def interrupted(*arguments):
        assert execution.execute_notebook(*arguments)["status"] == "done"
        servers.extend(
            process
            for process in psutil.Process().children()
            if process.status() != psutil.STATUS_ZOMBIE
            and "multiprocessing.forkserver" in " ".join(process.cmdline())
        )
        raise KeyboardInterrupt

    notebooks(_01_one="")
    with monkeypatch.context() as patched:
        patched.setattr(runner, "execute_notebook", interrupted)
        assert run() == 130
    assert len(servers) == 1 and servers[0].status() != psutil.STATUS_ZOMBIE
    assert run() == 0


KILLS_ITS_KERNEL = """# %% tags=["parameters"]
file = ""

# %%
import os, pathlib, signal
pathlib.Path(file).touch()
os.kill(os.getpid(), signal.SIGTERM)
"""


@pytest.mark.slow
def test_a_notebook_whose_kernel_is_ended_leaves_no_unfinished_copy(tmp_path):
    script, folder = tmp_path / "01_one.py", tmp_path / "out"
    script.write_text(KILLS_ITS_KERNEL)
    folder.mkdir()
    given = {"file": str(tmp_path / "begun")}
    outcome = execution.execute_notebook(script, given, folder, {})
    assert "DeadKernelError" in outcome["error"]
    assert outcome["status"] == "refused"
    assert not (folder / "01_one.ipynb").exists()


def test_a_notebook_is_executed_where_an_event_loop_runs(tmp_path):
    async def execute():
        return execution.execute_notebook(script, {}, tmp_path, {})

    script = tmp_path / "01_one.py"
    script.write_text("# %%\n1 + 1\n")
    with ThreadPoolExecutor(1) as thread:  # a loop may run in this one as well
        outcome = thread.submit(lambda: asyncio.run(execute())).result()
    assert "wrote no record" in outcome["error"]
    assert (tmp_path / "01_one.ipynb").exists()
