"""Attack the judges of the exercises: every wrong answer and every solution in many checks.

    PYTHONPATH=.:tests:notebooks/exercises python tests/studies/exercises.py [--seeds 300] [TASK ...]

Prints for each task in how many checks the solution passed, and each wrong answer was refused with the right
message. The test suite does the same with few seeds.
"""

from __future__ import annotations

import argparse
import sys
import warnings

import judges
from helpers import exercises
from helpers.wrong_answers import WRONG

import szlib


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=300)
    parser.add_argument("tasks", nargs="*")
    options = parser.parse_args()
    warnings.simplefilter("ignore", szlib.DataWarning)
    failures = 0
    for name in options.tasks or exercises.TASKS:
        passed, refused, total, faults = 0, 0, 0, []
        for seed in range(options.seeds):
            passed += judges.check(name, exercises.solution(name), seed=seed).passed
            for message, answer in WRONG[name]:
                total += 1
                verdict = judges.check(name, answer, seed=seed)
                if not verdict.passed and message in verdict.message:
                    refused += 1
                else:
                    faults.append(
                        f"    seed {seed}, expected {message!r}: {str(verdict)[:200]}"
                    )
        n = len(WRONG[name])
        print(
            f"{name}: solution {passed} of {options.seeds}; {n} wrong answers refused {refused} of {total}"
        )
        print("\n".join(faults[:8]) + "\n" * bool(faults), end="", flush=True)
        failures += len(faults) + options.seeds - passed
    return min(failures, 1)


if __name__ == "__main__":
    sys.exit(main())
