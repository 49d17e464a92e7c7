"""What came of a run: summary.json in its folder, and the table that ends it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import StorageError
from ...files import write_file

NOT_STARTED = "not started"
"""The status of a notebook that needs what another could not make."""
PARAMETERS, SUMMARY = "parameters.json", "summary.json"


def begin(home: Path, identity: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Withdraw what a run of these notebooks replaces; the outcomes of others that stay, by name.

    They stay where parameters.json, which the run then writes, says the same as `identity`: version, content
    of the data, parameters.  Until the run is finished, no summary there has passed.
    """
    earlier = {}
    if _read(home / PARAMETERS) == json.loads(json.dumps(identity)):
        notebooks = _read(home / SUMMARY).get("notebooks", {})
        earlier = {name: outcome for name, outcome in notebooks.items() if name not in names}
    try:
        (home / SUMMARY).unlink(missing_ok=True)
    except OSError as error:
        raise StorageError(
            f"{home / SUMMARY}: is in the way ({error.strerror or error}); remove it"
        ) from error
    if earlier:
        left = {"passed": False, "unfinished": list(names), "notebooks": earlier}
        write_file(home / SUMMARY, json.dumps(left, indent=1))
    write_file(home / PARAMETERS, json.dumps(identity, indent=1))
    return earlier


def finish(
    home: Path, identity: Mapping[str, Any], earlier: Mapping[str, Any], outcomes: Mapping[str, Any]
) -> dict[str, Any]:
    """The summary of this run; in the folder, with the outcomes that stayed."""
    write_file(home / SUMMARY, json.dumps(_summary(identity, {**earlier, **outcomes}), indent=1))
    return _summary(identity, outcomes)


def _summary(identity: Mapping[str, Any], notebooks: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "szlib": identity["szlib"],
        "data": identity["data"],
        "seed": identity["parameters"].get("seed", 0),
        "parameters": identity["parameters"],
        "passed": all(_passed(outcome) for outcome in notebooks.values()),
        "notebooks": dict(sorted(notebooks.items())),
    }


def _passed(outcome: Mapping[str, Any]) -> bool:
    return outcome["status"] == "done" and all(c["passed"] for c in outcome["checks"] if c["kind"] == "check")


def _read(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def render(summary: Mapping[str, Any]) -> str:
    """The table that ends a run: notebook, time, checks passed, key figures; then what did not hold.

    Where parameters differ from those that checks were made for, a column tells how many observations hold.
    """
    notebooks = summary["notebooks"].items()
    observed = any(_held(record, "observation") for _, record in notebooks)
    lines = [_row("notebook", "seconds", "checks", "observed" if observed else "", "key figures")]
    notes = []
    for name, record in notebooks:
        held = _held(record, "check") or "-" if record["status"] == "done" else record["status"]
        seen = (_held(record, "observation") or "-") if observed else ""
        key = ", ".join(
            f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in record["key_figures"].items()
        )
        lines.append(_row(name, f"{record['seconds']:.1f}", held, seen, key))
        notes += [
            f"{name}: {c['name']}: {c['result']} ({c['value']})" for c in record["checks"] if not c["passed"]
        ]
        if record.get("error"):
            notes.append(f"{name}: {record['error']}")
    return "\n".join([*lines, *notes, "all checks hold" if summary["passed"] else "NOT ALL CHECKS HOLD"])


def _row(name: str, seconds: str, checks: str, observed: str, key: str) -> str:
    return f"{name:<20} {seconds:>7} {checks:>11}" + (f" {observed:>9}" if observed else "") + f"  {key}"


def _held(record: Mapping[str, Any], kind: str) -> str:
    """How many of a kind hold, of how many; "" where there are none."""
    passed = [c["passed"] for c in record["checks"] if c["kind"] == kind]
    return f"{sum(passed)}/{len(passed)}" if passed else ""
