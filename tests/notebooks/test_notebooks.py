"""The notebooks: each pair holds together, each was executed, and all of them prove their results."""

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


def test_none_is_missing_and_no_copy_is_stray():
    numbers = [s.stem.split("_")[0] for s in SOURCES]
    assert len(set(numbers)) == len(numbers)
    assert {f"{n:02d}" for n in range(1, 19)} <= set(numbers)
    assert [p.stem for p in sorted(folders.NOTEBOOKS.glob("*.ipynb"))] == [s.stem for s in SOURCES]


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.stem)
class TestEach:
    def test_the_pair_holds_together(self, source):
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

    def test_rhythm(self, source):
        all_cells = cells(source)
        assert all_cells[0].cell_type == "markdown"
        assert "**Question.**" in all_cells[0].source
        assert "**Expectation.**" in all_cells[0].source
        assert "**What it means.**" in all_cells[-2].source
        assert all_cells[-1].source == "record.close()"
        assert sum("parameters" in c.metadata.get("tags", []) for c in all_cells) == 1
        assert max(code_lines(c) for c in all_cells if c.cell_type == "code") <= MAX_LINES

    def test_knows_the_common_parameters(self, source):
        (tagged,) = [c for c in cells(source) if "parameters" in c.metadata.get("tags", [])]
        assert {"data", "seed", "results"} <= {
            line.split("=")[0].strip() for line in tagged.source.splitlines()
        }


def test_each_knob_of_the_method_is_a_parameter_where_it_acts_with_the_default_that_it_has_elsewhere():
    found = [(n, v) for s in SOURCES for n, v in read_defaults(s).items() if n in METHOD_DEFAULTS]
    assert {name for name, _ in found} == set(METHOD_DEFAULTS)
    assert all(value == METHOD_DEFAULTS[name] for name, value in found)


def test_read_defaults_finds_what_the_cell_sets():
    for source in SOURCES:
        (tagged,) = [c for c in cells(source) if "parameters" in c.metadata.get("tags", [])]
        variables: dict[str, object] = {}
        exec(tagged.source, variables)
        assert variables == read_defaults(source) | {"__builtins__": variables["__builtins__"]}


def test_a_parameter_has_one_type_wherever_it_stands():
    types: dict[str, set[type]] = {}
    for source in SOURCES:
        for name, value in read_defaults(source).items():
            types.setdefault(name, set()).add(type(value))
    assert all(len(found) == 1 for found in types.values()), types


OF_DATA = ("01", "02", "03", "04", "05", "14")
"""Notebooks that read the data; the others only use the encounters and the zone."""


def proven(summary: dict, home: Path, only: tuple[str, ...] = ("",)) -> None:
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


def test_the_workbook_proves_itself_on_the_plaza(tmp_path):
    summary = runner.run(out=tmp_path, jobs=2)
    proven(summary, tmp_path / "synthetic")
    claims = [c for record in summary["notebooks"].values() for c in record["checks"] if c["kind"] == "claim"]
    assert sum(c["passed"] for c in claims) > len(claims) / 2
    assert any("true zone found" in c["name"] for c in summary["notebooks"]["05_zones"]["checks"])


@pytest.mark.skipif(
    not os.environ.get("SZLIB_DATA_DIR"), reason="SZLIB_DATA_DIR names no folder with real data"
)
def test_the_workbook_completes_on_the_real_day(tmp_path):
    summary = runner.run("atc-1hz", out=tmp_path, jobs=2, only=OF_DATA)
    proven(summary, tmp_path / "atc-1hz", only=OF_DATA)
    assert summary["notebooks"]["01_tracks"]["key_figures"]["rows"] == 624_951
    results = {c["name"]: c["result"] for record in summary["notebooks"].values() for c in record["checks"]}
    assert results["the zone at 1.1 m/s reaches farther ahead than behind"] == "not supported here"
