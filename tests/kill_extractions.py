"""The long form of "killed at random moments": `python tests/kill_extractions.py 20`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from test_days import DATES, contents, extract, kill_and_resume

from szlib.plaza.people import make_plaza
from szlib.plaza.truth import PlazaSettings


def main() -> None:
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        days = [
            make_plaza(
                folder / f"day-{day}.csv",
                seed=day,
                settings=PlazaSettings(encounters=150, date=f"2012-11-{day:02}"),
            )
            for day in range(1, 2 * len(DATES) + 1)
        ]
        extract(days, folder / "reference")
        reference = contents(folder / "reference")
        struck = tries = 0
        while struck < kills:
            struck += kill_and_resume(days, folder / f"out{tries}", reference, kills=5, seed=tries)
            tries += 1
    print(f"{struck} runs killed at random moments, {tries} results of {len(days)} days: all identical")


if __name__ == "__main__":
    main()
