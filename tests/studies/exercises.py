"""Attack the judges of the exercises: every wrong answer and every solution in many checks.

    PYTHONPATH=.:tests:notebooks/exercises python tests/studies/exercises.py [--seeds 300] [TASK ...]

Prints for each task in how many checks the solution passed, and each wrong answer was refused with the right
message; `--honest` takes the solutions only, `--cheats` the sixty cheats. The test suite does the same with
few seeds.
"""

from __future__ import annotations

import argparse
import sys
import warnings

from helpers import exercises
from helpers.cheats import CHEATS
from helpers.wrong_answers import WRONG

import szlib


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=300)
    parser.add_argument("--honest", action="store_true", help="the solutions only")
    parser.add_argument("--cheats", action="store_true", help="the sixty cheats only")
    parser.add_argument("tasks", nargs="*")
    options = parser.parse_args()
    warnings.simplefilter("ignore", szlib.DataWarning)
    seeds = range(options.seeds)
    if options.cheats:
        return attack(options.seeds)
    failures = 0
    for name in options.tasks or exercises.TASKS:
        solution, refused, total, faults = exercises.solution(name), 0, 0, []
        verdicts = list(exercises.judge(name, solution, seeds))
        passed = sum(verdict.passed for verdict in verdicts)
        faults += [
            f"    seed {seed}: {str(verdict)[:200]}"
            for seed, verdict in zip(seeds, verdicts, strict=True)
            if not verdict.passed
        ]
        for message, answer in () if options.honest else WRONG[name]:
            verdicts = list(exercises.judge(name, answer, seeds))
            total += len(verdicts)
            for seed, verdict in zip(seeds, verdicts, strict=True):
                if not verdict.passed and message in verdict.message:
                    refused += 1
                else:
                    said = str(verdict)[:200]
                    faults.append(f"    seed {seed}, expected {message!r}: {said}")
        print(
            f"{name}: solution {passed} of {options.seeds}; wrong {refused} of {total}"
        )
        print("\n".join(faults[:8]) + "\n" * bool(faults), end="", flush=True)
        failures += len(faults)
    return min(failures, 1)


def attack(n: int) -> int:
    """Try each cheat in n checks; one that is stopped by the time limit is tried once."""
    failures = 0
    for kind, cheats in CHEATS.items():
        for number, (name, source) in enumerate(cheats):
            seeds = range(1 if kind in ("concurrency", "exhaustion") else n)
            passed = sum(v.passed for v in exercises.judge(name, source, seeds))
            print(
                f"{kind} {number}, {name}: passed {passed} of {len(seeds)}", flush=True
            )
            failures += passed
    return min(failures, 1)


if __name__ == "__main__":
    sys.exit(main())
