"""The sentences of the paper that can be checked, and their verdicts in a run.

The sentences are in paper_sentences.toml, which describes its fields.  The verdict of each is computed from
the checks and claims that the notebooks of the run recorded.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ..core.input_files import read_json_object
from .claims import judge
from .record.display import format_result
from .record.notebook_record import NotebookRecord

Checks = Mapping[str, Mapping[str, Any]]


def load_sentences() -> pd.DataFrame:
    """Read the sentences: one row for each, with the fields of paper_sentences.toml.

    Examples
    --------
    >>> from szlib.workbook.paper_sentences import load_sentences
    >>> load_sentences()["place"].iloc[0]
    'abstract'
    """
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
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
