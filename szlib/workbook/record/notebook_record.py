"""The record of one notebook: its checks, claims, figures, tables and key figures.

A *check* must hold, or the run fails. With other parameters than the defaults it becomes an *observation*,
which cannot fail the run, unless it holds for all parameters (`always`). A *claim* of the paper is measured:
if the data does not support it, the record says "not supported here", and the run goes on.

A table that is committed beside the notebooks is a CSV file whose first line is a comment, ``# {"command":
..., "seed": ..., "commit": ...}``: the command that made the table, its seed, and the commit of the code that
it ran; and, if the column or the rows that are computed again were added later, the commit that computed
them, as "probe".
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from pandas.io.formats.style import Styler

from ...core.files import claim_folder, write_file
from ...tracks import datasets
from .. import folders
from .data_cache import DataCache
from .display import (
    format_outputs,
    format_result,
    format_value,
    show_figure,
    style_table,
)
from .parameters import METHOD_DEFAULTS, NEUTRAL, OPTIONS, ZoneMethod, read_defaults

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TABLES = folders.NOTEBOOKS / "tables"
"""The folder of the committed tables."""
RELATIVE = 5e-4
ABSOLUTE = 5e-5
"""Differences that are due to rounding to four digits, relative to a number and absolute."""


class NotebookRecord:
    """The record of one notebook.

    Parameters
    ----------
    name : of the notebook, "NN_topic".
    variables : the variables of the notebook, ``globals()``. It reads those of the cell tagged "parameters":
        data: "synthetic" or as for `szlib.tracks.datasets.find`; area: where encounters are found, as for
        `szlib.as_area`, "auto", or "" for the default of the data; seed: of everything random; results:
        folder of all results; and those of `ZoneMethod`.
    plaza_zone : whether checks assume the zone of the plaza; with other data they are then observations.

    Attributes
    ----------
    cache : the data of the notebook, a `DataCache`: tracks, area, encounters and zone.
    changed : name and value of the parameters, of this notebook or of `ZoneMethod`, that differ from the
        defaults. They turn checks into observations.
    out : the folder of its results: that of the run, or one in `results/lab` if executed by hand.
    key : key figures by name, for the summary of the run.

    Examples
    --------
    >>> from szlib.workbook.record import NotebookRecord
    >>> record = NotebookRecord("99_example", {"data": "synthetic", "results": "results"})
    >>> record.check("two is even", 2 % 2 == 0, 2)
    check: two is even: holds (2)
    >>> record.close()
    kind        name result value
    check two is even  holds     2
    """

    def __init__(
        self, name: str, variables: Mapping[str, Any], *, plaza_zone: bool = False
    ) -> None:
        self.name = name
        self.checks: list[dict[str, Any]] = []
        self.figures: list[str] = []
        self.key: dict[str, Any] = {}
        script = next(
            (each for each in folders.list_notebooks() if each.stem == name), None
        )
        own_defaults = read_defaults(script) if script else {"area": "", "seed": 0}
        defaults = {**METHOD_DEFAULTS, **own_defaults}
        changed = {
            n: variables[n] for n, v in defaults.items() if variables.get(n, v) != v
        }
        self.changed = {n: v for n, v in changed.items() if n not in NEUTRAL}
        if plaza_zone and variables["data"] != datasets.SYNTHETIC:
            self.changed["zone"] = "that of other data"
        if self.changed:
            print(
                f"{self._settings()}: checks that assume the defaults are observations; text and sources may "
                "not apply"
            )
        data = variables["data"]
        contents = []
        run = os.environ.get(folders.RUN_VARIABLE)
        if run:
            self.out = Path(run)
            contents = folders.read_json_object(self.out / folders.PARAMETERS).get(
                "files", []
            )
        else:
            results = folders.results_root(variables.get("results", folders.RESULTS))
            claim_folder(results, folders.PURPOSE)
            given = {n: v for n, v in changed.items() if n not in OPTIONS}
            self.out = folders.claim_results(results / folders.LAB, data, given)
        for part in "records", "figures":
            (self.out / part).mkdir(exist_ok=True)
        method = ZoneMethod.from_variables(variables)
        area = variables.get("area", "")
        self.cache = DataCache(
            self.out, data, area, variables.get("seed", 0), method, contents
        )
        format_outputs()

    def check(
        self, what: str, passed: object, value: object = None, *, always: bool = False
    ) -> None:
        """Record a check.

        Parameters
        ----------
        what : the property that must hold, as a statement.
        passed : whether it holds; NaN does not.
        value : the number, or the numbers, that decide it.
        always : whether it must hold with all parameters. Otherwise a check with `changed` parameters is an
            observation. A failed check fails the run after the notebook has finished.
        """
        passed = _is_true(passed)
        if self.changed and not always:
            result = f"{'holds' if passed else 'does not hold'} {self._settings()}"
            self._record("observation", what, passed, value, result)
        else:
            self._record("check", what, passed, value, "holds" if passed else "FAILED")

    def claim(self, what: str, supported: object, value: object = None) -> None:
        """Record whether the data supports a claim of the paper.

        Parameters
        ----------
        what : the claim, as a statement.
        supported : whether the data supports it; None or NaN if it cannot decide; or one of
            `claims.VERDICTS`. If not, the run goes on.
        value : the number, or the numbers, that decide it.
        """
        result = "supported" if supported else "not supported here"
        if supported is None or supported != supported:
            result = "not decidable here"
        if isinstance(supported, str):
            result = supported
            supported = supported == "supported"
        self._record("claim", what, _is_true(supported), value, result)

    def figure(self, figure: Figure, name: str) -> None:
        """Save a `figure` in the results as NN_topic-`name`.png (`--figures`: also .svg), and show it."""
        for kind in filter(None, (os.environ.get(folders.FIGURES_VARIABLE), "png")):
            content = io.BytesIO()
            figure.savefig(content, format=kind, dpi=150, bbox_inches="tight")
            self._save_picture(content.getvalue(), f"{self.name}-{name}.{kind}")
        show_figure(figure, content.getvalue())

    def animation(self, content: bytes, name: str) -> None:
        """Save the `content` of an animated GIF in the results as NN_topic-`name`.gif."""
        self._save_picture(content, f"{self.name}-{name}.gif")

    def table(self, table: pd.DataFrame, name: str) -> None:
        """Save a `table` in the results as `name`.csv."""
        write_file(self.out / f"{name}.csv", table.to_csv(index=False))

    def committed_table(
        self,
        name: str,
        recompute: Callable[[pd.Series[Any]], Mapping[str, Any]],
        *,
        where: str = "index >= 0",
    ) -> pd.DataFrame:
        """Read a table that is committed beside the notebooks, and check that one of its rows is reproduced.

        Parameters
        ----------
        name : of the table, without ".csv".
        recompute : computes values of a row, by column, with the function that made the table. The row is
            drawn with the seed of the notebook. Columns that take long are left out; a column "probe" holds
            a part that does not.
        where : the rows to draw from, as for `pandas.DataFrame.query`. If there are none, as without a
            package that they need, nothing is checked, and a line says so.
        """
        table = read_table(name)
        rows = table.query(where)
        if rows.empty:
            print(
                f"not checked: tables/{name}.csv has no row that can be computed here ({where})"
            )
            return table
        row = rows.sample(1, random_state=self.cache.seed).iloc[0]
        again = dict(recompute(row))
        different = find_differences(row, again)
        what = f"row {row.name} of tables/{name}.csv is reproduced"
        self.check(what, not different, different or again, always=True)
        return table

    def close(self) -> Styler:
        """Write the record for the summary of the run, and return a table of its checks and claims."""
        self._store(closed=True)
        columns = ["kind", "name", "result", "value"]
        values = [format_value(check["value"]) for check in self.checks]
        return style_table(
            pd.DataFrame(self.checks, columns=columns).assign(value=values)
        )

    def _settings(self) -> str:
        """The changed parameters as text: "with gamma = 0.2"."""
        return "with " + ", ".join(
            f"{name} = {value}" for name, value in self.changed.items()
        )

    def _record(
        self, kind: str, name: str, passed: bool, value: object, result: str
    ) -> None:
        value = _to_plain(value)
        self.checks.append(
            {
                "kind": kind,
                "name": name,
                "passed": passed,
                "value": value,
                "result": result,
            }
        )
        print(f"{kind}: {name}: {format_result(result, value)}")
        self._store(closed=False)

    def _store(self, *, closed: bool) -> None:
        """Write the record; a notebook that ends early leaves the checks that it made."""
        record = {"notebook": self.name, "closed": closed, "checks": self.checks}
        record |= {"key_figures": self.key, "figures": self.figures}
        text = json.dumps(record, indent=1, default=_to_plain)
        write_file(self.out / "records" / f"{self.name}.json", text, durable=closed)

    def _save_picture(self, content: bytes, name: str) -> None:
        write_file(self.out / "figures" / name, content, durable=False)
        self.figures.append(name)


def read_table(name: str) -> pd.DataFrame:
    """Read `name`.csv from `TABLES`; its `attrs` are command, seed and commit."""
    with (TABLES / f"{name}.csv").open(encoding="utf-8") as file:
        header = file.readline()
        table = pd.read_csv(file)
    table.attrs |= json.loads(header.removeprefix("# "))
    return table


def find_differences(
    row: pd.Series[Any], again: Mapping[str, Any]
) -> dict[str, list[Any]]:
    """The values of a `row` and those computed `again`, by column, where they differ."""
    return {
        name: [row[name], value]
        for name, value in again.items()
        if not _is_same(row[name], value)
    }


def _is_same(stored: Any, value: Any) -> bool:
    if isinstance(stored, str) or isinstance(value, str):
        return bool(stored == value)
    return bool(np.isclose(stored, value, rtol=RELATIVE, atol=ABSOLUTE, equal_nan=True))


def _is_true(value: Any) -> bool:
    """Whether a `value` is true; NaN, which `bool` takes for true, is not."""
    return bool(value) and bool(value == value)


def _to_plain(value: Any) -> Any:
    """Convert numbers of NumPy to Python's, rounded to six digits."""
    if isinstance(value, Mapping):
        return {str(k): _to_plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_to_plain(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return round(value, 6) if isinstance(value, float) else value
