"""The attacks: `python tests/hostile [--long] [NAME ...]`; their short form is part of `make slow`.

Every module here that is not a test has a function `attack(long)`, which returns counts of what it tried
and found.  Counts whose name begins with "broken" must be 0; otherwise the exit code is 1.  Several attacks
run in one interpreter each, because some fork, which is not safe with threads.  The counts are printed and
written to results/hostile.json; those of the long form also to README.md beside this file.
"""

import importlib
import json
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

from szlib.core.files import claim_folder
from szlib.workbook.folders import PURPOSE

HERE = Path(__file__).parent
ATTACKS = sorted(
    f.stem for f in HERE.glob("*.py") if not f.stem.startswith(("_", "test_"))
)
TALLY = Path("results/hostile.json")
README = HERE / "README.md"
INTRODUCTION = """# Hostile suite

`make hostile` runs every attack in full and writes this file; `make slow` runs a short form of each. What
each attack does stands at the top of its module. Counts that begin with "broken" must be 0.
An attack that has no section was not run in full since it was last changed.
"""


def main() -> int:
    sys.path.insert(0, str(HERE.parent))
    long = ["--long"] if "--long" in sys.argv else []
    names = [name for name in sys.argv[1:] if name != "--long"] or ATTACKS
    if unknown := sorted(set(names) - set(ATTACKS)):
        print(
            f"no attack is called {', '.join(unknown)}; there are {', '.join(ATTACKS)}",
            file=sys.stderr,
        )
        return 2
    claim_folder(TALLY.parent, PURPOSE)
    if len(names) == 1:
        tally = {names[0]: _attack(names[0], bool(long))}
        if long:
            write_readme(names[0], tally[names[0]])
        return _finish(tally)
    tally: dict[str, dict[str, float]] = {}
    for name in names:
        TALLY.unlink(missing_ok=True)
        subprocess.run([sys.executable, str(HERE), *long, name], check=False)
        if not TALLY.exists():
            print(f"{name} broke off", file=sys.stderr)
            return 1
        tally |= json.loads(TALLY.read_text(encoding="utf-8"))
    return _finish(tally)


def _attack(name: str, long: bool) -> dict[str, float]:
    begun = time.monotonic()
    tally = dict(importlib.import_module(name).attack(long))
    tally["seconds"] = round(time.monotonic() - begun)
    print(
        f"\n{name}",
        *(f"  {what}: {count:g}" for what, count in tally.items()),
        sep="\n",
        flush=True,
    )
    return tally


def write_readme(name: str, tally: dict[str, float]) -> None:
    """Replace the section of one attack, with the date, the commit and the counts."""
    text = README.read_text(encoding="utf-8") if README.exists() else ""
    found = {part.partition("\n")[0]: part for part in text.split("\n## ")[1:]}
    total = sum(count for what, count in tally.items() if what.startswith("broken"))
    rows = [
        f"| {what} | {count:g} |"
        for what, count in ({"broken, in all": total} | tally).items()
    ]
    when = f"{datetime.now(UTC):%Y-%m-%d}, commit {commit()}"
    found[name] = "\n".join(
        [name, "", when, "", "| what | count |", "|---|--:|", *rows, ""]
    )
    README.write_text(
        "\n## ".join([INTRODUCTION, *(found[each] for each in sorted(found))]),
        encoding="utf-8",
    )


def commit() -> str:
    """The short name of the commit, and whether szlib differs from it."""

    def ask(*arguments: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(HERE), *arguments],
            capture_output=True,
            text=True,
            check=False,
        )
        return done.stdout.strip() if done.returncode == 0 else "unknown"

    changed = ask("status", "--porcelain", "--", str(HERE.parents[1] / "szlib"))
    return ask("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")


def _finish(tally: dict[str, dict[str, float]]) -> int:
    TALLY.write_text(json.dumps(tally, indent=1), encoding="utf-8")
    found = [
        count
        for each in tally.values()
        for what, count in each.items()
        if what.startswith("broken")
    ]
    return int(any(found))


if __name__ == "__main__":
    sys.exit(main())
