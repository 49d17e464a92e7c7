"""The hostile suite: `python tests/hostile [--long] [NAME ...]`; its short form is part of `make test`.

Every module here that is no test has `attack(long) -> {what: how many}`: what was tried and what came of it.
Whatever is counted under a name that begins with "broken" must be 0: else the exit code is 1. The tally is
printed and written to results/hostile.json.
"""

import importlib
import json
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
ATTACKS = sorted(f.stem for f in HERE.glob("*.py") if not f.stem.startswith(("_", "test_")))


def main() -> int:
    sys.path.insert(0, str(HERE.parent))
    names = [name for name in sys.argv[1:] if name != "--long"] or ATTACKS
    if unknown := sorted(set(names) - set(ATTACKS)):
        print(f"no attack is called {', '.join(unknown)}; there are {', '.join(ATTACKS)}", file=sys.stderr)
        return 2
    tally: dict[str, dict[str, float]] = {}
    for name in names:
        begun = time.monotonic()
        tally[name] = dict(importlib.import_module(name).attack("--long" in sys.argv))
        tally[name]["seconds"] = round(time.monotonic() - begun)
        print(
            f"\n{name}",
            *(f"  {what}: {count:g}" for what, count in tally[name].items()),
            sep="\n",
            flush=True,
        )
    Path("results").mkdir(exist_ok=True)
    Path("results/hostile.json").write_text(json.dumps(tally, indent=1), encoding="utf-8")
    return int(
        any(count for each in tally.values() for what, count in each.items() if what.startswith("broken"))
    )


if __name__ == "__main__":
    sys.exit(main())
