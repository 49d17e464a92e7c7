"""Faults at the heart of the chain, and whether a run of the notebooks notices them.

    python tests/studies/run_mutants.py [--jobs 2] [--only TEXT]

Each mutant of run_mutants.toml is one change of the package. It is made in a copy of the repository, and
`szlib run` executes the chapters of its part there. A mutant is noticed if the run fails. It prints each and
the share; the copy is thrown away. Half an hour on two cores.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
CHAPTERS = {"data": "01 02 03 04 05 06", "robot": "07 08 09 10 11"}
"""Chapters that are run for a fault in the data's part, and in the robot's."""
MUTANTS = [
    (each["file"], each["before"], each["after"], CHAPTERS[part])
    for part, found in tomllib.loads(
        Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    ).items()
    for each in found
]
"""File, text, what takes its place, and the chapters that are run."""


def try_mutant(place: str, before: str, after: str, chapters: str, jobs: int) -> bool:
    """Whether a run of these chapters fails with `after` in place of `before`."""
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        skipped = shutil.ignore_patterns(
            "results", ".venv", ".git", "__pycache__", ".*_cache"
        )
        shutil.copytree(ROOT, copy, ignore=skipped)
        file = copy / "szlib" / place
        text = file.read_text(encoding="utf-8")
        if before not in text:
            raise SystemExit(f"{place} has no {before!r}; renew the mutant")
        file.write_text(text.replace(before, after, 1), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "szlib",
            "run",
            "--jobs",
            str(jobs),
            "--only",
            *chapters.split(),
        ]
        run = subprocess.run(
            command,
            cwd=copy,
            env=os.environ | {"PYTHONPATH": str(copy)},
            capture_output=True,
        )
        return run.returncode != 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--only", default="", help="mutants whose file or text has this in it"
    )
    asked = parser.parse_args()
    noticed, chosen = 0, [each for each in MUTANTS if asked.only in each[0] + each[2]]
    for place, before, after, chapters in chosen:
        is_noticed = try_mutant(place, before, after, chapters, asked.jobs)
        noticed += is_noticed
        print(f"{'noticed' if is_noticed else 'LIVES  '}  {place}: {after}", flush=True)
    print(f"{noticed} of {len(chosen)} noticed")
    return int(noticed < 0.9 * len(chosen))


if __name__ == "__main__":
    sys.exit(main())
