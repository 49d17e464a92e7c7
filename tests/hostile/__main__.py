"""The attacks: `python tests/hostile [--long] [NAME ...]`; their short form is part of `make test`.

Every module here that is not a test has a function `attack(long)`, which returns counts of what it tried
and found.  Counts whose name begins with "broken" must be 0; otherwise the exit code is 1.  Several attacks
run in one interpreter each, because some fork, which is not safe with threads.  The counts are printed and
written to results/hostile.json.
"""

import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
ATTACKS = sorted(f.stem for f in HERE.glob("*.py") if not f.stem.startswith(("_", "test_")))
TALLY = Path("results/hostile.json")


def main() -> int:
    sys.path.insert(0, str(HERE.parent))
    long = ["--long"] if "--long" in sys.argv else []
    names = [name for name in sys.argv[1:] if name != "--long"] or ATTACKS
    if unknown := sorted(set(names) - set(ATTACKS)):
        print(f"no attack is called {', '.join(unknown)}; there are {', '.join(ATTACKS)}", file=sys.stderr)
        return 2
    if len(names) == 1:
        return _finish({names[0]: _attack(names[0], bool(long))})
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
    print(f"\n{name}", *(f"  {what}: {count:g}" for what, count in tally.items()), sep="\n", flush=True)
    return tally


def _finish(tally: dict[str, dict[str, float]]) -> int:
    TALLY.parent.mkdir(exist_ok=True)
    TALLY.write_text(json.dumps(tally, indent=1), encoding="utf-8")
    found = [count for each in tally.values() for what, count in each.items() if what.startswith("broken")]
    return int(any(found))


if __name__ == "__main__":
    sys.exit(main())
