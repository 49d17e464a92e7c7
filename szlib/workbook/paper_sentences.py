"""The sentences of the paper that can be checked, and their verdicts in a run.

The sentences are in paper_sentences.toml, which describes its fields.  The verdict of each is computed from
the checks and claims that the notebooks of the run recorded.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pandas as pd

from .claims import judge
from .record.display import format_result
from .record.notebook_record import NotebookRecord


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


def judge_sentences(record: NotebookRecord) -> pd.DataFrame:
    """The sentences with their verdicts in a run.

    Parameters
    ----------
    record : of the notebook that asks. Its own checks count, and those of other notebooks in its folder.

    Returns
    -------
    The table of `load_sentences` with the columns verdict, numbers (each check with its result and value, one
    a line) and unknown (checks that were not made, although their notebook was run).
    """
    records = {
        file.stem: json.loads(file.read_text(encoding="utf-8"))["checks"]
        for file in sorted((record.out / "records").glob("*.json"))
    }
    records[record.name] = record.checks
    checks = {
        f"{notebook.split('_')[0]}: {check['name']}": check
        for notebook, made in records.items()
        for check in made
    }
    numbers = {
        name: f"{name}: {format_result(check['result'], check['value'])}"
        for name, check in checks.items()
    }
    made_in = {notebook.split("_")[0] for notebook in records}
    table = load_sentences()
    table["verdict"] = [
        judge(kind, names, checks)
        for kind, names in zip(table["kind"], table["held_by"], strict=True)
    ]
    table["numbers"] = [
        "\n".join(numbers.get(name, name) for name in names)
        for names in table["held_by"]
    ]
    table["unknown"] = [
        [
            name
            for name in names
            if name.split(": ")[0] in made_in and name not in checks
        ]
        for names in table["held_by"]
    ]
    return table
