"""Many days: the result does not depend on order, processes or interruptions."""

import errno
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import psutil
import pytest
from helpers.faulty_disk import FaultyDisk

import szlib
from szlib.core.files import claim_folder
from szlib.encounters import days as extraction
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks import funnels

DATES = ("2012-10-24", "2012-10-28", "2012-10-31", "2012-11-04")
HERE = {"PYTHONPATH": str(Path(szlib.__file__).parents[1])}
"""Other processes import the same szlib."""
ONE_RUN = "import sys, szlib; szlib.extract_days(sys.argv[2:], out=sys.argv[1], n_jobs={}, progress=False)"


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    folder = tmp_path_factory.mktemp("days")
    return [
        make_plaza(
            folder / f"atc-{date.replace('-', '')}.csv",
            seed=seed,
            settings=PlazaSettings(n_encounters=40, date=date),
        )
        for seed, date in enumerate(DATES)
    ]


def extract(paths, out, **given):
    return szlib.extract_days(paths, out=out, progress=False, **given)  # type: ignore[arg-type]


def contents(folder):
    """Every file of a folder, hidden ones too."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def reference(days, tmp_path_factory):
    out = tmp_path_factory.mktemp("reference")
    assert set(extract(days, out).table["status"]) == {"done"}
    return contents(out)


def test_samples_of_days_equal_those_of_one_table(days, tmp_path):
    ours = extract(days, tmp_path / "out").samples()
    whole = szlib.find_encounters(szlib.read_tracks(days))
    pd.testing.assert_frame_equal(
        ours, whole, check_exact=True, check_categorical=False
    )
    assert len(ours) > 0
    read = [stage for stage in funnels.get(ours) if stage["stage"].startswith("read ")]
    entered, kept = sum(s["entered"] for s in read), sum(s["kept"] for s in read)
    assert entered == sum(len(day.read_text().splitlines()) for day in days)
    assert kept == next(
        s["entered"] for s in funnels.get(ours) if s["stage"] == "merge files"
    )


def test_result_does_not_depend_on_order_or_processes(days, reference, tmp_path):
    extract(days[::-1], tmp_path / "reversed")
    extract(str(days[0].parent / "*.csv"), tmp_path / "two", n_jobs=2)
    for name in ("reversed", "two"):
        assert contents(tmp_path / name) == reference
    zones = [
        szlib.SocialZone.fit(
            extract(paths, tmp_path / "two").samples(),
            method="hull",
            speeds=(0.9, 1.1),
            n_resamples=2,
        )
        for paths in (days, days[::-1])
    ]
    assert zones[0].ellipses == zones[1].ellipses
    assert zones[0].provenance == zones[1].provenance


@pytest.mark.slow
def test_finished_days_are_kept_and_changed_days_computed_again(days, tmp_path):
    out, copies = tmp_path / "out", [tmp_path / day.name for day in days]
    for copy, day in zip(copies, days, strict=True):
        copy.write_bytes(day.read_bytes())

    def statuses(**given):
        return list(extract(given.pop("paths", copies), out, **given).table["status"])

    assert statuses(paths=copies[:3]) == ["done"] * 3
    assert statuses() == ["kept"] * 3 + ["done"], "a further day"
    assert statuses(exclude=[DATES[1]]) == ["kept", "excluded", "kept", "kept"], (
        "excluded days stay"
    )
    os.utime(copies[0])
    assert statuses(n_jobs=2) == ["kept"] * 4, (
        "content counts, not the time of the file"
    )
    content = bytearray(copies[2].read_bytes())
    content[-2] ^= 1  # the last digit of the last row
    copies[2].write_bytes(content)
    assert statuses() == ["kept", "kept", "done", "kept"]
    (out / f"{DATES[3]}.parquet").write_bytes(
        (out / f"{DATES[3]}.parquet").read_bytes()[:-1]
    )
    (out / f"{DATES[0]}.parquet.json").write_text("{")
    assert statuses() == ["done", "kept", "kept", "done"], (
        "what is damaged is done again"
    )
    assert statuses(min_speed=0.5) == ["done"] * 4
    assert statuses() == ["done"] * 4
    record = json.loads((out / f"{DATES[0]}.parquet.json").read_text())
    assert record["made_of"]["parameters"]["min_speed"] == 0.4


def test_a_day_that_fails_leaves_no_earlier_result(days, tmp_path):
    copies = [tmp_path / day.name for day in days[:2]]
    for copy, day in zip(copies, days, strict=False):
        copy.write_bytes(day.read_bytes())
    extract(copies, tmp_path / "out")
    lines = copies[1].read_text().splitlines()
    lines[1::3] = ["x,y,z,,,,,"] * len(lines[1::3])
    copies[1].write_text("\n".join(lines))
    assert list(extract(copies, tmp_path / "out").table["status"]) == ["kept", "failed"]
    assert list(szlib.Extraction.load(tmp_path / "out").sources) == [DATES[0]]


def test_an_excluded_day_that_does_not_exist_is_named(days, tmp_path):
    with pytest.warns(szlib.DataWarning, match="hall: excluded, but there is no such"):
        found = extract(days[:1], tmp_path, exclude=["hall"])
    assert list(found.table["status"]) == ["done"]
    with pytest.warns(szlib.DataWarning, match="hall: excluded, but there is no such"):
        szlib.Extraction.load(tmp_path, exclude="hall")


def test_one_excluded_day_or_several_are_left_out_when_days_are_loaded(days, tmp_path):
    extract(days[:2], tmp_path)
    for exclude in (DATES[0], [DATES[0]]):
        loaded = szlib.Extraction.load(tmp_path, exclude=exclude)
        assert list(loaded.sources) == [DATES[1]]
        assert set(loaded.samples()["day"]) == {DATES[1]}


def test_a_result_that_cannot_be_removed_does_not_stop_the_other_days(
    days, tmp_path, monkeypatch
):
    copies = [tmp_path / day.name for day in days[:2]]
    for copy, day in zip(copies, days, strict=False):
        copy.write_bytes(day.read_bytes())
    extract(copies, tmp_path / "out")
    copies[0].write_text("no table\n")
    error = OSError(errno.EROFS, os.strerror(errno.EROFS))

    def refuse(path, missing_ok=False):
        raise error

    monkeypatch.setattr(Path, "unlink", refuse)
    found = extract(copies, tmp_path / "out").table
    assert "kept" in list(found["status"]) and "failed" in list(found["status"])


def test_links_keep_their_names_and_the_recipe_beside_them(tmp_path):
    walk = pd.DataFrame({"t": np.arange(9.0), "id": 1, "x": np.arange(9.0), "y": 0.0})
    (tmp_path / "store").mkdir()
    walk.assign(x=100 * walk["x"]).to_csv(tmp_path / "store" / "8f3a", index=False)
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "hall.csv").symlink_to(tmp_path / "store" / "8f3a")
    szlib.Recipe(unit="cm", max_gap=2.0).save(folder / "reading.json")
    both = [folder / "hall.csv", folder / ".." / "data" / "hall.csv"]
    for number, paths in enumerate((folder / "hall.csv", folder, both)):
        with pytest.warns(szlib.DataWarning, match="reading.json are used"):
            found = extract(paths, tmp_path / f"out{number}", area="-1 9 -3 3")
        assert list(found.table["day"]) == ["hall"]
        assert found.recipe.unit == "cm" and found.recipe.max_gap == 2.0


def test_files_of_finished_days_are_not_read_again(days, tmp_path, monkeypatch):
    copy = tmp_path / days[0].name
    copy.write_bytes(days[0].read_bytes())
    extract(copy, tmp_path / "out")
    os.utime(copy)
    assert list(extract(copy, tmp_path / "out").table["status"]) == ["kept"]
    monkeypatch.setattr(extraction, "file_content", None)
    assert list(extract(copy, tmp_path / "out").table["status"]) == ["kept"]
    copy.rename(tmp_path / "away")
    copy.write_bytes((tmp_path / "away").read_bytes())
    again = extract(copy, tmp_path / "out")
    assert list(again.table["status"]) == ["failed"], "another file is read"


@contextmanager
def other_file(file):
    """Replace `file` by its namesake in the folder "other", and put it back."""
    away, other = file.with_name("away"), file.parents[1] / "other" / file.name
    os.link(file, away)
    other.replace(file)
    yield
    os.link(file, other)
    away.replace(file)


@contextmanager
def other_content(file):
    """Write the content of its namesake into `file`, then its own, with the old time of change."""
    content, before = file.read_bytes(), file.stat()
    file.write_bytes((file.parents[1] / "other" / file.name).read_bytes())
    yield
    file.write_bytes(content)
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize("exchange", [other_file, other_content])
def test_rows_are_of_the_bytes_of_their_checksum(
    exchange,
    days,
    reference,
    tmp_path,
    monkeypatch,
):
    """The file is another one while its rows are read, not while its checksum is computed."""
    for name, day in (("data", days[0]), ("other", days[1])):
        (tmp_path / name).mkdir()
        (tmp_path / name / days[0].name).write_bytes(day.read_bytes())
    file, read = tmp_path / "data" / days[0].name, extraction.load_files

    def read_the_other(*given, **options):
        with exchange(file):
            return read(*given, **options)

    monkeypatch.setattr(extraction, "load_files", read_the_other)
    done = extract(file, tmp_path / "out")
    stored = {
        name: content
        for name, content in contents(tmp_path / "out").items()
        if "parquet" in name
    }
    assert "changed while it was read; try again" in done.failed["why"].item()
    assert not stored, "nothing is kept of the day"


def test_day_whose_file_changes_after_the_area_was_found_fails(
    days, tmp_path, monkeypatch
):
    copies = [tmp_path / day.name for day in days[:2]]
    for copy, day in zip(copies, days, strict=False):
        copy.write_bytes(day.read_bytes())

    def change_and_run(*given, **options):
        last = copies[0].read_bytes().splitlines(keepends=True)[-1]
        copies[0].write_bytes(copies[0].read_bytes() + last)
        return run_tasks(*given, **options)

    run_tasks = extraction.run_tasks
    monkeypatch.setattr(extraction, "run_tasks", change_and_run)
    found = replace(szlib.ATC_SQUARE, reason="people walked there")
    monkeypatch.setattr("szlib.encounters.areas.walked_area", lambda _, **__: found)
    done = extract(copies, tmp_path / "out", area="auto")
    assert list(done.table["status"]) == ["failed", "done"]
    assert "changed after its day or the area was found" in done.failed["why"].item()


def test_days_that_fail_do_not_stop_the_others(days, tmp_path):
    (tmp_path / "atc-20121107.csv").write_text(
        "1352246400.0,1,2,3,4,5,6,7\n" + "rubbish\n" * 5
    )
    (tmp_path / "broken.csv.gz").write_bytes(b"\x1f\x8b rubbish")
    done = extract([*days[:2], tmp_path], tmp_path / "out")
    assert list(done.table["status"]) == ["done", "done", "failed", "failed"]
    assert list(done.failed["day"]) == ["2012-11-07", "broken"]
    assert "line 2: missing or extra fields" in done.failed["why"].iloc[0]
    assert "damaged .gz" in done.failed["why"].iloc[1]
    assert "2 done, 2 failed" in str(done)
    assert list(done.samples()["day"].cat.categories) == list(DATES[:2])


def test_files_of_one_date_make_one_day(days, tmp_path):
    lines = days[0].read_text().splitlines(keepends=True)
    for part in range(
        2
    ):  # as in the public 1 Hz day: people of one hour in several files
        (tmp_path / f"part{part}.csv").write_text("".join(lines[part::2]))
    pieces = extract(sorted(tmp_path.glob("part*.csv")), tmp_path / "pieces")
    assert list(pieces.table["files"]) == [2]
    whole = extract(days[:1], tmp_path / "whole").samples()
    pd.testing.assert_frame_equal(pieces.samples(), whole, check_exact=True)


def test_day_without_encounters_gives_an_empty_table(days, tmp_path):
    far = extract(
        days[:2], tmp_path / "far", square=szlib.Square(x=(500, 520), y=(500, 520))
    )
    assert list(far.table["encounters"]) == [0, 0]
    samples = far.samples()
    assert len(samples) == 0
    assert list(samples.columns) == list(
        szlib.find_encounters(szlib.read_tracks(days[0])).columns
    )


@pytest.mark.parametrize("empty", [0, 1])
def test_day_without_encounters_changes_no_type_of_the_others(days, tmp_path, empty):
    rows = pd.read_csv(days[empty], header=None)
    rows[2] += 500_000  # x [mm]: far from the area
    far = tmp_path / days[empty].name
    rows.to_csv(far, header=False, index=False, float_format="%.3f")
    both = extract([days[1 - empty], far], tmp_path / "both")
    assert both.table["encounters"][empty] == 0
    alone = extract(days[1 - empty], tmp_path / "alone").samples()
    pd.testing.assert_frame_equal(both.samples(), alone, check_exact=True)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"speed": 1}, "unknown parameter"),
        ({"tz": "Mars"}, "unknown time zone 'Mars'"),
        ({"unit": "ell"}, "unit must be one of"),
        ({"file_format": "csv"}, "file_format must be .*; got 'csv'"),
    ],
)
def test_invalid_parameters_raise(days, tmp_path, given, message):
    with pytest.raises(szlib.DataError, match=message):
        extract(days, tmp_path / "out", **given)


def test_output_or_input_that_does_not_exist_raises(days, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(szlib.DataError, match="cannot be made"):
        extract(days, tmp_path / "file" / "out")
    with pytest.raises(szlib.DataError, match="no such file"):
        extract(tmp_path / "nothing.csv", tmp_path / "out")


def test_full_disk_is_reported_and_earlier_days_stay_intact(days, reference, tmp_path):
    extract(days[:2], tmp_path)
    before = contents(tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # no file may grow beyond 4 KiB: as on a full disk
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        full = extract(days, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(full.table["status"]) == ["kept", "kept", "failed", "failed"]
    assert "cannot be written" in full.failed["why"].iloc[0]
    assert "make room" in full.failed["why"].iloc[0]
    assert contents(tmp_path) == before, "nothing half-written stays"
    extract(days, tmp_path)
    assert contents(tmp_path) == reference


def test_read_only_output_fails_each_day(days, tmp_path):
    claim_folder(tmp_path / "out", extraction.PURPOSE)
    with FaultyDisk(0, errno.EROFS):
        refused = extract(days[:1], tmp_path / "out")
    assert "Read-only file system" in refused.failed["why"].iloc[0]
    with pytest.raises(szlib.DataError, match="no day was finished"):
        refused.samples()


def kill_and_resume(days, out, reference, kills, seed):
    """Kill runs at random moments, each with its processes; then let one finish. How often it struck."""
    rng, struck, longest = random.Random(seed), 0, 4.0
    for _ in range(kills):
        command = [sys.executable, "-c", ONE_RUN.format(2), str(out), *map(str, days)]
        begun = time.monotonic()
        run = subprocess.Popen(
            command,
            start_new_session=True,
            stderr=subprocess.DEVNULL,
            env=os.environ | HERE,
        )
        try:
            run.wait(timeout=rng.uniform(0.3, longest))
            longest = max(1.0, time.monotonic() - begun)
        except subprocess.TimeoutExpired:
            workers = psutil.Process(run.pid).children(recursive=True)
            os.killpg(run.pid, signal.SIGKILL)
            run.wait()
            psutil.wait_procs(workers, timeout=5)  # a write that has begun ends first
            struck += 1
        finished = (
            {name for name in contents(out) if not name.startswith(".")}
            if out.exists()
            else set()
        )
        for name in finished:
            if name.endswith(".json"):
                assert contents(out)[name] == reference[name], (
                    "a record that is there is whole"
                )
        if rng.random() < 0.3 and finished:
            (out / rng.choice(sorted(finished))).unlink()
    assert contents_after_an_hour(days, out) == reference, (
        "and nothing unfinished is left"
    )
    return struck


def contents_after_an_hour(days, out):
    """The files of a folder, extracted again when the unfinished files of killed processes are old."""
    for unfinished in out.glob(".szlib-part-*"):
        os.utime(unfinished, (0, 0))
    extract(days, out, n_jobs=2)
    return contents(out)


@pytest.mark.slow
def test_killed_runs_resume_to_the_same_result(days, reference, tmp_path):
    assert kill_and_resume(days, tmp_path / "out", reference, kills=2, seed=1) > 0


@pytest.mark.slow
def test_killed_worker_raises(days, tmp_path, monkeypatch):
    monkeypatch.setattr(extraction, "extract_day", _die)
    with pytest.raises(szlib.SzlibError, match="a worker process was killed"):
        extract(days, tmp_path / "out", n_jobs=2)


def _die(*_):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_dask_cluster_that_loses_a_worker_gives_the_same_result(
    days, reference, tmp_path
):
    """In a process of its own: the cluster leaves sockets and threads behind."""
    pytest.importorskip("distributed")
    program = tmp_path / "program.py"
    program.write_text(
        "import os, signal, sys, threading, time\n"
        "import joblib, szlib\n"
        "from pathlib import Path\n"
        "from distributed import Client, LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    out = Path(sys.argv[1])\n"
        "    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True,\n"
        "                      dashboard_address=None) as cluster, Client(cluster) as client:\n"
        "        victim = next(iter(client.run(os.getpid).values()))\n"
        "        def strike():\n"
        "            while not list(out.glob('*.json')):\n"
        "                time.sleep(0.01)\n"
        "            os.kill(victim, signal.SIGKILL)\n"
        "        threading.Thread(target=strike, daemon=True).start()\n"
        "        with joblib.parallel_config('dask'):\n"
        "            done = szlib.extract_days(sys.argv[2:], out=out, n_jobs=-1, progress=False)\n"
        "        print(victim in client.run(os.getpid).values(), *done.table['status'])\n"
    )
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, str(program), str(out), *map(str, days)],
        capture_output=True, text=True, timeout=120, check=True, env=os.environ | HERE,
    )  # fmt: skip
    assert done.stdout.split()[0] == "False", "the worker is gone"
    assert set(done.stdout.split()[1:]) <= {"done", "kept"}
    assert contents_after_an_hour(days, out) == reference


def test_another_backend_of_joblib_gives_the_same_result(days, reference, tmp_path):
    with joblib.parallel_config("threading"):
        extract(days, tmp_path, n_jobs=2)
    assert contents(tmp_path) == reference


def test_extraction_is_loaded_from_its_folder(days, tmp_path):
    made = extract(days, tmp_path / "out", min_speed=0.5, max_gap=0.7)
    loaded = szlib.Extraction.load(tmp_path / "out")
    pd.testing.assert_frame_equal(loaded.samples(), made.samples(), check_exact=True)
    assert list(loaded.table["day"]) == list(DATES) and loaded.settings == made.settings
    assert loaded.settings == szlib.EncounterSettings(
        area=szlib.ATC_SQUARE, min_speed=0.5
    )
    assert loaded.recipe == szlib.Recipe(max_gap=0.7)
    some = szlib.Extraction.load(tmp_path / "out", exclude=DATES[:3])
    assert set(some.samples()["day"]) == {DATES[3]}


def test_folder_without_extracted_days_is_refused(days, tmp_path):
    with pytest.raises(szlib.DataError, match="holds no extracted days"):
        szlib.Extraction.load(tmp_path)
    extract(days[:1], tmp_path / "out")
    (tmp_path / "out" / f"{DATES[0]}.parquet.json").write_text("{")
    message = rf"{DATES[0]}.parquet.json: cannot be read .*; extract the day again"
    with pytest.raises(szlib.DataError, match=message):
        szlib.Extraction.load(tmp_path / "out")


def test_days_of_different_settings_are_not_mixed(days, tmp_path):
    extract(days[:1], tmp_path / "out", min_speed=0.5)
    extract(days[1:2], tmp_path / "out", min_speed=0.6)
    message = f"{DATES[1]} was extracted with other settings than {DATES[0]}"
    with pytest.raises(szlib.DataError, match=message):
        szlib.Extraction.load(tmp_path / "out")
