"""The notebooks: script and copy agree, every cell was executed, and all checks hold."""

import json
import os
import re
from pathlib import Path

import jupytext
import nbformat
import pytest

from szlib.workbook import folders, runner
from szlib.workbook.record.parameters import METHOD_DEFAULTS, read_defaults

SOURCES = folders.list_notebooks()
MAX_LINES = 25


def cells(source: Path) -> list[nbformat.NotebookNode]:
    return jupytext.read(source).cells


def code_lines(cell: nbformat.NotebookNode) -> int:
    return sum(1 for line in cell.source.splitlines() if line.strip() and not line.strip().startswith("#"))


def test_each_notebook_has_a_copy_and_no_number_is_missing():
    numbers = [s.stem.split("_")[0] for s in SOURCES]
    assert len(set(numbers)) == len(numbers)
    assert {f"{n:02d}" for n in range(1, 19)} <= set(numbers)
    assert [p.stem for p in sorted(folders.NOTEBOOKS.glob("*.ipynb"))] == [s.stem for s in SOURCES]


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.stem)
class TestEach:
    def test_script_and_copy_agree(self, source):
        executed = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
        found = [(c.cell_type, c.source, c.metadata.get("tags", [])) for c in executed.cells]
        assert found == [(c.cell_type, c.source, c.metadata.get("tags", [])) for c in cells(source)]

    def test_every_cell_was_executed_in_order_without_error(self, source):
        code = [
            c
            for c in nbformat.read(source.with_suffix(".ipynb"), as_version=4).cells
            if c.cell_type == "code"
        ]
        assert [c.execution_count for c in code] == list(range(1, len(code) + 1))
        assert all(out.output_type != "error" for c in code for out in c.outputs)

    def test_committed_copies_are_small_and_name_no_machine(self, source):
        text = source.with_suffix(".ipynb").read_text(encoding="utf-8")
        assert len(text) < 1_048_576
        assert not re.search(r"/(home|root|work|Users)/|[A-Z]:\\\\Users", text)

    def test_notebook_has_question_expectation_and_meaning(self, source):
        all_cells = cells(source)
        assert all_cells[0].cell_type == "markdown"
        assert "**Question.**" in all_cells[0].source
        assert "**Expectation.**" in all_cells[0].source
        assert "**What it means.**" in all_cells[-2].source
        assert all_cells[-1].source == "record.close()"
        assert sum("parameters" in c.metadata.get("tags", []) for c in all_cells) == 1
        assert max(code_lines(c) for c in all_cells if c.cell_type == "code") <= MAX_LINES

    def test_notebook_has_the_common_parameters(self, source):
        (tagged,) = [c for c in cells(source) if "parameters" in c.metadata.get("tags", [])]
        assert {"data", "seed", "results"} <= {
            line.split("=")[0].strip() for line in tagged.source.splitlines()
        }


def test_method_parameters_have_the_same_default_everywhere():
    found = [(n, v) for s in SOURCES for n, v in read_defaults(s).items() if n in METHOD_DEFAULTS]
    assert {name for name, _ in found} == set(METHOD_DEFAULTS)
    assert all(value == METHOD_DEFAULTS[name] for name, value in found)


def test_read_defaults_finds_what_the_cell_sets():
    for source in SOURCES:
        (tagged,) = [c for c in cells(source) if "parameters" in c.metadata.get("tags", [])]
        variables: dict[str, object] = {}
        exec(tagged.source, variables)
        assert variables == read_defaults(source) | {"__builtins__": variables["__builtins__"]}


def test_parameter_has_the_same_type_in_all_notebooks():
    types: dict[str, set[type]] = {}
    for source in SOURCES:
        for name, value in read_defaults(source).items():
            types.setdefault(name, set()).add(type(value))
    assert all(len(found) == 1 for found in types.values()), types


REAL_DAY = ("01", "02", "03", "04", "05", "14")
"""Notebooks that read the data; the others only use the encounters and the zone."""


def check_run(summary: dict, home: Path, only: tuple[str, ...] = ("",)) -> None:
    assert summary["passed"], runner.format_summary(summary)
    assert json.loads((home / "summary.json").read_text(encoding="utf-8"))["passed"]
    assert list(summary["notebooks"]) == [s.stem for s in SOURCES if s.stem.startswith(only)]
    for name, record in summary["notebooks"].items():
        assert record["seconds"] > 0
        assert record["checks"], name
        assert all({"name", "passed", "value"} <= set(c) for c in record["checks"])
        assert all((home / "figures" / figure).stat().st_size > 1000 for figure in record["figures"])
    for artefact in ("encounters.parquet", "zone.json"):
        assert (home / artefact).exists()


def test_all_checks_hold_on_the_plaza(tmp_path):
    summary = runner.run(out=tmp_path, jobs=2)
    check_run(summary, tmp_path / "synthetic")
    claims = [c for record in summary["notebooks"].values() for c in record["checks"] if c["kind"] == "claim"]
    assert sum(c["passed"] for c in claims) > len(claims) / 2
    assert any("true zone found" in c["name"] for c in summary["notebooks"]["05_zones"]["checks"])


@pytest.mark.skipif(
    not os.environ.get("SZLIB_DATA_DIR"), reason="SZLIB_DATA_DIR names no folder with real data"
)
def test_notebooks_complete_on_the_real_day(tmp_path):
    summary = runner.run("atc-1hz", out=tmp_path, jobs=2, only=REAL_DAY)
    check_run(summary, tmp_path / "atc-1hz", only=REAL_DAY)
    assert summary["notebooks"]["01_tracks"]["key_figures"]["rows"] == 624_951
    results = {c["name"]: c["result"] for record in summary["notebooks"].values() for c in record["checks"]}
    assert results["the zone at 1.1 m/s reaches farther ahead than behind"] == "not supported here"
