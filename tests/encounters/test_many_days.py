"""The example many_days.py: processes here, a real SSH server, and a SLURM of two scripts."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import szlib

pytest.importorskip("asyncssh")
pytest.importorskip("dask_jobqueue")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="starts shells")
ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "notebooks" / "examples" / "many_days.py"
HERE = {"PYTHONPATH": str(Path(szlib.__file__).parents[1]), "PYTHONWARNINGS": "ignore"}

SBATCH = """#!/bin/sh
# Start a job in the background, from a copy of its script, as SLURM does.
cp "$1" "$LOGS/job.$$"
setsid sh "$LOGS/job.$$" > "$LOGS/job.$$.out" 2>&1 &
echo "submitted $!" >> "$LOGS/slurm.log"
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
echo "cancelled $1" >> "$LOGS/slurm.log"
kill -- "-$1"
"""


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many_days")
    for seed, date in enumerate(("2012-10-24", "2012-10-28", "2012-10-31")):
        settings = szlib.PlazaSettings(n_encounters=40, date=date)
        szlib.make_plaza(folder / f"{date}.csv", seed=seed, settings=settings)
    return folder


@pytest.fixture(scope="module")
def samples(days, tmp_path_factory):
    """The encounters of these days, found without a cluster."""
    return szlib.extract_days(
        days, out=tmp_path_factory.mktemp("alone"), progress=False
    ).samples()


def run(kind, size, days, out, **environment):
    """What the example prints."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), kind, size, str(days), str(out)],
        capture_output=True, text=True, timeout=300, env=os.environ | HERE | environment, cwd=out.parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def check(printed, out, samples):
    """The days were extracted as without a cluster, and the zone was saved and judged."""
    assert "3 done" in printed and "undecided: " in printed.splitlines()[-1]
    found = szlib.Extraction.load(out / "days").samples()
    pd.testing.assert_frame_equal(found, samples, check_exact=True)
    assert (
        szlib.SocialZone.load(out / "zone.json").provenance["encounters"]
        == samples["encounter"].nunique()
    )


@pytest.mark.slow
def test_on_this_machine(days, samples, tmp_path):
    check(run("local", "2", days, tmp_path / "out"), tmp_path / "out", samples)


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("setsid") is None, reason="the scripts in place of SLURM need setsid"
)
def test_on_slurm_each_job_is_a_process_and_is_cancelled(days, samples, tmp_path):
    commands = tmp_path / "commands"
    commands.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    path = f"{commands}{os.pathsep}{os.environ['PATH']}"
    check(
        run("slurm", "2", days, tmp_path / "out", PATH=path, LOGS=str(tmp_path)),
        tmp_path / "out",
        samples,
    )
    jobs = [line.split() for line in (tmp_path / "slurm.log").read_text().splitlines()]
    submitted, cancelled = (
        {pid for verb, pid in jobs if verb == which}
        for which in ("submitted", "cancelled")
    )
    assert len(submitted) == 2 and cancelled == submitted
    for script in tmp_path.glob("job.*[0-9]"):
        assert "#SBATCH --cpus-per-task=1" in script.read_text()
        assert (
            "Starting established connection"
            in script.with_name(script.name + ".out").read_text()
        )


@pytest.fixture
def home(tmp_path):
    """A home whose SSH configuration leads to a server on this machine."""
    server = [
        sys.executable,
        str(ROOT / "tests" / "helpers" / "ssh_server.py"),
        str(tmp_path),
    ]
    with subprocess.Popen(server, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None and running.stdout.readline() == "ready\n"
        yield tmp_path
        running.terminate()


@pytest.mark.slow
def test_on_machines_with_ssh(days, samples, home):
    check(
        run("ssh", "node1,node2", days, home / "out", HOME=str(home)),
        home / "out",
        samples,
    )
    commands = (home / "commands.log").read_text()
    assert (
        commands.count("distributed.Scheduler") == 1
        and commands.count("distributed.Nanny") == 2
    )


def test_what_is_no_cluster_is_refused(days, tmp_path):
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), "cloud", "2", str(days), str(tmp_path / "out")],
        capture_output=True, text=True, env=os.environ | HERE,
    )  # fmt: skip
    assert (
        done.returncode == 1
        and "must be local, ssh or slurm; got 'cloud'" in done.stderr
    )
