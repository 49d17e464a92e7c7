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

    def summary(notebooks: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "szlib": identity["szlib"],
            "data": identity["data"],
            "seed": identity["parameters"].get("seed", 0),
            "parameters": identity["parameters"],
            "passed": all(_passed(outcome) for outcome in notebooks.values()),
            "notebooks": dict(sorted(notebooks.items())),
        }

    write_file(home / SUMMARY, json.dumps(summary({**earlier, **outcomes}), indent=1))
    return summary(outcomes)


def _passed(outcome: Mapping[str, Any]) -> bool:
    return outcome["status"] == "done" and all(c["passed"] for c in outcome["checks"] if c["kind"] == "check")


def _read(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def render(summary: Mapping[str, Any]) -> str:
    """The table that ends a run: notebook, time, checks passed, key figures; then what did not hold."""
    lines = [f"{'notebook':<20} {'seconds':>7} {'checks':>11}  key figures"]
    notes, observed = [], 0
    for name, record in summary["notebooks"].items():
        checks = [c for c in record["checks"] if c["kind"] == "check"]
        observed += sum(c["kind"] == "observation" for c in record["checks"])
        held = (
            f"{sum(c['passed'] for c in checks)}/{len(checks)}"
            if record["status"] == "done"
            else record["status"]
        )
        key = ", ".join(
            f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in record["key_figures"].items()
        )
        lines.append(f"{name:<20} {record['seconds']:>7.1f} {held:>11}  {key}")
        notes += [
            f"{name}: {c['name']}: {c['result']} ({c['value']})" for c in record["checks"] if not c["passed"]
        ]
        if record.get("error"):
            notes.append(f"{name}: {record['error']}")
    ending = "all checks hold" if summary["passed"] else "NOT ALL CHECKS HOLD"
    if observed:
        ending += f"; {observed} are observations, for parameters differ from those they were made for"
    return "\n".join([*lines, *notes, ending])
