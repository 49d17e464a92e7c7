"""Hold every pinned version against the published vulnerabilities (https://osv.dev): `make audit`.

Exit codes: 0, none is known, or nobody could be asked, which is said; 1, some are, one line each.
IGNORED names those that do not concern szlib, each with the reason.
"""

import json
import re
import sys
import urllib.error
import urllib.request
from pathlib import Path

LOCK = Path(__file__).resolve().parents[1] / "environment.lock"
SERVICE = "https://api.osv.dev/v1/querybatch"
PATIENCE = 20  # s
IGNORED: dict[str, str] = {}


def pins(text: str) -> list[tuple[str, str]]:
    """Names and versions of a lock."""
    return sorted(set(re.findall(r"^([A-Za-z0-9._-]+)==([^\s;\\]+)", text, flags=re.MULTILINE)))


def ask(pinned: list[tuple[str, str]]) -> list[list[str]]:
    """Ids of the vulnerabilities of each version, in one request."""
    queries = [
        {"package": {"name": name, "ecosystem": "PyPI"}, "version": version} for name, version in pinned
    ]
    request = urllib.request.Request(
        SERVICE, json.dumps({"queries": queries}).encode(), {"Content-Type": "application/json"}
    )
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        results = json.load(answer)["results"]
    if len(results) != len(pinned):
        raise ValueError(f"{len(results)} answers to {len(pinned)} questions")
    return [[found["id"] for found in result.get("vulns", [])] for result in results]


def main() -> int:
    """Print what is known of the lock; the exit code."""
    pinned = pins(LOCK.read_text(encoding="utf-8"))
    if not pinned:
        print(f"{LOCK.name}: pins nothing")
        return 1
    try:
        answers = ask(pinned)
    except (OSError, ValueError, KeyError) as error:  # URLErrors are OSErrors
        print(f"not audited: {SERVICE} does not answer ({error}); go online and try again")
        return 0
    known = [
        f"{name} {version}: {number}, see https://osv.dev/{number}"
        for (name, version), found in zip(pinned, answers, strict=True)
        for number in found
        if number not in IGNORED
    ]
    print("\n".join([*known, f"{len(pinned)} pinned versions, {len(known)} published vulnerabilities"]))
    return 1 if known else 0


if __name__ == "__main__":
    sys.exit(main())
