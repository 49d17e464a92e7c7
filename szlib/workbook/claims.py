"""Verdicts on the claims of the paper, and on each of its sentences that can be checked.

A claim is judged in many conditions: with each zone that was drawn, each controller or chain of methods, in
each scenario. Its *share* is that of conditions and draws in which it holds. Zones are drawn at random,
conditions are not: the share is that of the conditions which were tried. The 95 % interval of the share is
that of Clopper and Pearson for as many trials as there are zones. Zones that were drawn from one recording
depend on each other, so it is an interval for new draws, not for new places.

    supported                   the interval lies at or above 90 %
    mostly supported            it lies above one half
    not decidable               it contains one half, and there are fewer than `MIN_ZONES` zones
    depends on the condition    it contains one half, with as many zones or more
    mostly not supported        it lies below one half
    not supported               it lies at or below 10 %

The sentences are in paper_sentences.toml, which describes its fields.  The verdict of each is computed from
the checks and claims that the notebooks of a run recorded.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from scipy.stats import beta

from ..core.checks import check_columns, require
from .folders import read_json_object
from .record.display import format_result
from .record.notebook_record import NotebookRecord

SENTENCES = Path(__file__).with_name("paper_sentences.toml")
Checks = Mapping[str, Mapping[str, Any]]
VERDICTS = (
    "not supported",
    "mostly not supported",
    "depends on the condition",
    "not decidable",
    "mostly supported",
    "supported",
)
"""The verdicts, the worst first: several results of one sentence give the worst of theirs."""
NOT_RUN = "not run with this data"  # verdict of a sentence whose checks were not made in this run
MIN_ZONES = 40  # with fewer zones, a share near one half is not decidable (assumed)
SURE = 0.9  # share from which a claim is supported, and from which its contrary is (assumed)
# difference of shares from which a factor decides about a claim (assumed)
DECISIVE = 0.2
FACTORS = ("condition", "source", "scenario")  # that may decide about a claim
_FIXED = {"untestable": "untestable here", "open": "not done here"}
_TESTS = "tests/"  # begins the name of a test, which a run does not execute


def find_interval(count: float, n: int) -> tuple[float, float]:
    """The 95 % interval of a share, `count` of `n` trials (Clopper and Pearson); `count` may be a fraction.

    Examples
    --------
    >>> from szlib.workbook.claims import find_interval
    >>> [round(end, 3) for end in find_interval(40, 40)]
    [0.912, 1.0]
    """
    require(0 <= count <= n and n > 0, "count", count, f"0 to n = {n}, with n > 0")
    tail = 0.025
    low = float(beta.ppf(tail, count, n - count + 1)) if count > 0 else 0.0
    high = float(beta.ppf(1 - tail, count + 1, n - count)) if count < n else 1.0
    return low, high


def judge_share(low: float, high: float, zones: int) -> str:
    """The verdict on a claim whose share has the interval `low` to `high`, from this number of `zones`."""
    if low >= SURE:
        return "supported"
    if high <= 1 - SURE:
        return "not supported"
    if low > 0.5:
        return "mostly supported"
    if high < 0.5:
        return "mostly not supported"
    return "not decidable" if zones < MIN_ZONES else "depends on the condition"


def judge_effect(low: float, high: float) -> str:
    """The verdict on a claim that an effect is above 0, from the interval `low` to `high` of the effect."""
    if low > 0:
        return "supported"
    return "not supported" if high < 0 else "not decidable"


def judge_claims(matrix: pd.DataFrame) -> pd.DataFrame:
    """The verdict on each claim of a `matrix` of claims by condition.

    Parameters
    ----------
    matrix : one row a cell: claim, `FACTORS`, draws (zones in the cell), held (those in which the claim
        holds), is_control. Controls lack what the paper gives as the cause: they do not count.

    Returns
    -------
    One row a claim, in the order of the matrix: claim, conditions (number of cells), zones, share, low, high,
    verdict, decides (the factor whose levels differ most, with its lowest and highest share; "": none
    differs by `DECISIVE`), control (the share in the controls; NaN without any).

    Raises
    ------
    DataError : a column is missing.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.workbook.claims import judge_claims
    >>> cell = {"claim": "It waits.", "scenario": "waiting", "source": "a site", "draws": 40}
    >>> cells = [{"condition": "gamma = 0.1", "held": 40}, {"condition": "gamma = 1", "held": 0}]
    >>> found = judge_claims(pd.DataFrame([cell | each | {"is_control": False} for each in cells]))
    >>> found["verdict"].item(), found["decides"].item()
    ('depends on the condition', 'condition: 0 % with gamma = 1, 100 % with gamma = 0.1')
    """
    check_columns(matrix, ["claim", *FACTORS, "draws", "held", "is_control"])
    rows = []
    for claim, cells in matrix.groupby("claim", sort=False):
        counted = cells[~cells["is_control"]]
        controls = cells[cells["is_control"]]
        zones = int(counted.groupby("source")["draws"].max().sum())
        share = _find_share(counted)
        low, high = find_interval(share * zones, zones)
        rows.append(
            {
                "claim": claim,
                "conditions": len(counted),
                "zones": zones,
                "share": share,
                "low": low,
                "high": high,
                "verdict": judge_share(low, high, zones),
                "decides": _find_deciding_factor(counted),
                "control": _find_share(controls) if len(controls) else float("nan"),
            }
        )
    return pd.DataFrame(rows)


def _find_share(cells: pd.DataFrame) -> float:
    return float(cells["held"].sum() / cells["draws"].sum())


def _find_deciding_factor(cells: pd.DataFrame) -> str:
    found = list[tuple[float, str]]()
    for factor in FACTORS:
        levels = cells.groupby(factor, sort=False)[["held", "draws"]].sum()
        shares = levels["held"] / levels["draws"]
        low = shares.min()
        high = shares.max()
        worst = f"{100 * low:.0f} % with {shares.idxmin()}"
        best = f"{100 * high:.0f} % with {shares.idxmax()}"
        found.append((high - low, f"{factor}: {worst}, {best}"))
    difference, text = max(found)
    return text if difference >= DECISIVE else ""


def judge(kind: str, names: Sequence[str], checks: Checks) -> str:
    """The verdict on a sentence of this `kind`, from the `checks` of a run that have these `names`.

    Tests among the names do not count: a run does not execute them. A sentence that only tests hold says so.
    """
    made = [name for name in names if not name.startswith(_TESTS)]
    if kind in _FIXED:
        return _FIXED[kind]
    if not all(name in checks for name in made):
        return NOT_RUN
    if kind not in ("claim", "stress"):
        if not all(checks[name]["passed"] for name in made):
            return f"{kind}, but a check fails"
        return kind if made else f"{kind}, by test"
    results = [_read_result(checks[name]) for name in made]
    return min(results, key=VERDICTS.index)


def _read_result(check: Mapping[str, Any]) -> str:
    """The verdict that a check or a claim of a run amounts to."""
    for verdict in VERDICTS:
        if check["result"].startswith(verdict):
            return verdict
    return "supported" if check["passed"] else "not supported"


def load_sentences() -> pd.DataFrame:
    """Read the sentences: one row for each, with the fields of paper_sentences.toml.

    Examples
    --------
    >>> from szlib.workbook.claims import load_sentences
    >>> load_sentences()["place"].iloc[0]
    'abstract'
    """
    text = SENTENCES.read_text(encoding="utf-8")
    return pd.DataFrame(tomllib.loads(text)["sentence"])


def read_checks(record: NotebookRecord) -> Checks:
    """The checks of a `record`, and those of other notebooks in its folder, by "NN: name"."""
    files = sorted((record.out / "records").glob("*.json"))
    records = {file.stem: read_json_object(file)["checks"] for file in files}
    records[record.name] = record.checks
    return {
        f"{notebook.split('_')[0]}: {check['name']}": check
        for notebook, made in records.items()
        for check in made
    }


def judge_sentences(checks: Checks) -> pd.DataFrame:
    """The sentences with their verdicts in a run.

    Parameters
    ----------
    checks : of the run, by "NN: name", as of `read_checks`.

    Returns
    -------
    The table of `load_sentences` with the columns verdict, numbers (each check with its result and value, one
    a line) and unknown (checks that were not made, although their notebook made others).
    """
    made_in = {name.split(": ")[0] for name in checks}
    rows = load_sentences().to_dict("records")
    for row in rows:
        names = row["held_by"]
        row["verdict"] = judge(row["kind"], names, checks)
        row["numbers"] = "\n".join(_describe(name, checks) for name in names)
        row["unknown"] = [
            name
            for name in names
            if name not in checks and name.split(": ")[0] in made_in
        ]
    return pd.DataFrame(rows)


def _describe(name: str, checks: Checks) -> str:
    """The check of a `name` with its result and value, or its name alone."""
    if name not in checks:
        return name
    check = checks[name]
    return f"{name}: {format_result(check['result'], check['value'])}"
