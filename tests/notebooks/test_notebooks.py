"""The notebooks: script and copy agree, and in the copy every cell was executed and every check holds.

`make run` executes the notebooks anew and fails where a check does not hold.
"""

import re

import jupytext
import nbformat
import pytest

from szlib.workbook import folders
from szlib.workbook.record.parameters import METHOD_DEFAULTS, read_defaults

SOURCES = folders.list_notebooks()
MAX_LINES = 25
"""Lines of the longest cell, and before the first figure."""
MAX_CHECKS = 8
"""Checks and claims that a cell shows; the outputs of longer lists are folded."""
CHAPTERS = [s for s in SOURCES if "01" <= s.stem[:2] <= "13"]


def cells(source):
    return jupytext.read(source).cells


def is_hidden(cell):
    return bool(cell.metadata.get("jupyter", {}).get("source_hidden"))


def code_lines(cell):
    return sum(
        1
        for line in cell.source.splitlines()
        if line.strip() and not line.strip().startswith("#")
    )


RESULT = re.compile(
    r"^(check|claim|observation): (.+): (holds|FAILED|supported|not supported here|not decidable here)\b",
    re.M,
)


def read_results(source):
    """Kind, name and result of each check and claim that the executed copy of a notebook shows."""
    executed = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
    outputs = [out for cell in executed.cells for out in cell.get("outputs", ())]
    return RESULT.findall(
        "\n".join(out.text for out in outputs if out.output_type == "stream")
    )


def test_each_notebook_has_a_copy_and_no_number_is_missing():
    numbers = [s.stem.split("_")[0] for s in SOURCES]
    assert len(set(numbers)) == len(numbers)
    assert {f"{n:02d}" for n in (*range(14), *range(21, 30))} <= set(numbers)
    copies = [
        copy
        for part in ("", "deeper")
        for copy in sorted((folders.NOTEBOOKS / part).glob("*.ipynb"))
    ]
    assert copies == [source.with_suffix(".ipynb") for source in SOURCES]


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.stem)
class TestEach:
    def test_script_and_copy_agree(self, source):
        executed = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
        copied, written = (
            [
                (c.cell_type, c.source, c.metadata.get("tags", []), is_hidden(c))
                for c in each
            ]
            for each in (executed.cells, cells(source))
        )
        assert copied == written

    def test_every_cell_was_executed_in_order_without_error(self, source):
        code = [
            c
            for c in nbformat.read(source.with_suffix(".ipynb"), as_version=4).cells
            if c.cell_type == "code"
        ]
        assert [c.execution_count for c in code] == list(range(1, len(code) + 1))
        assert all(out.output_type != "error" for c in code for out in c.outputs)

    def test_every_check_of_the_copy_holds(self, source):
        checks = [result for kind, _, result in read_results(source) if kind != "claim"]
        assert checks
        assert set(checks) == {"holds"}

    def test_committed_copies_name_no_machine(self, source):
        text = source.with_suffix(".ipynb").read_text(encoding="utf-8")
        assert not re.search(r"/(home|root|work|Users)/|[A-Z]:\\\\Users", text)

    def test_parameters_of_the_method_mean_the_same_everywhere(self, source):
        own = {
            name: value
            for name, value in read_defaults(source).items()
            if name in METHOD_DEFAULTS
        }
        assert own == {name: METHOD_DEFAULTS[name] for name in own}

    def test_notebook_has_question_expectation_and_meaning(self, source):
        all_cells = cells(source)
        assert all_cells[0].cell_type == "markdown"
        assert "**Question.**" in all_cells[0].source
        assert "**Expectation.**" in all_cells[0].source
        ends = ("**What it means.**", "**What we know now.**")
        assert any(end in cell.source for cell in all_cells[-3:] for end in ends)
        assert all_cells[-1].source.endswith("record.close()")
        assert sum("parameters" in c.metadata.get("tags", []) for c in all_cells) == 1
        code = [c for c in all_cells if c.cell_type == "code"]
        lengths = {c.source.splitlines()[0]: code_lines(c) for c in code}
        assert {name: n for name, n in lengths.items() if n > MAX_LINES} == {}

    def test_notebook_has_the_common_parameters(self, source):
        (tagged,) = [
            c for c in cells(source) if "parameters" in c.metadata.get("tags", [])
        ]
        assert {"data", "seed", "results"} <= {
            line.split("=")[0].strip() for line in tagged.source.splitlines()
        }


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.stem)
class TestShape:
    def test_parameters_checks_and_record_are_folded(self, source):
        plumbing = re.compile(
            r"^(record = |record\.(check|claim|close)\b|import |from .* import )", re.M
        )
        visible = [
            c.source
            for c in cells(source)
            if c.cell_type == "code" and not is_hidden(c)
        ]
        assert [text for text in visible if plumbing.search(text)] == []

    def test_each_folded_cell_says_what_it_hides(self, source):
        first_lines = [c.source.splitlines()[0] for c in cells(source) if is_hidden(c)]
        assert [line for line in first_lines if not line.startswith("# ")] == []

    def test_a_figure_comes_before_25_visible_lines_of_code(self, source):
        visible = 0
        for cell in nbformat.read(source.with_suffix(".ipynb"), as_version=4).cells:
            if any(
                "image/png" in out.get("data", {}) for out in cell.get("outputs", ())
            ):
                break
            visible += (
                0 if is_hidden(cell) or cell.cell_type != "code" else code_lines(cell)
            )
        assert visible <= MAX_LINES

    def test_the_copy_has_at_most_600_kb(self, source):
        assert source.with_suffix(".ipynb").stat().st_size <= 600_000


@pytest.mark.parametrize("source", CHAPTERS, ids=lambda s: s.stem)
class TestChapter:
    def test_two_folded_cells_stand_before_the_first_picture(self, source):
        """The parameters, which papermill replaces, and the set-up, which draws it."""
        code = [c for c in cells(source) if c.cell_type == "code"]
        assert "parameters" in code[0].metadata["tags"]
        assert code[1].source.startswith("# Set-up, and the figure\n")
        assert "record.figure(" in code[1].source
        assert is_hidden(code[0]) and is_hidden(code[1])

    def test_at_most_eight_checks_are_shown_at_once(self, source):
        executed = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
        for cell in executed.cells:
            text = "".join(o.get("text", "") for o in cell.get("outputs", ()))
            is_folded = cell.metadata.get("jupyter", {}).get("outputs_hidden")
            assert is_folded or len(RESULT.findall(text)) <= MAX_CHECKS, cell.source


def test_method_parameters_have_the_same_default_everywhere():
    found = [
        (n, v)
        for s in SOURCES
        for n, v in read_defaults(s).items()
        if n in METHOD_DEFAULTS
    ]
    assert {name for name, _ in found} == set(METHOD_DEFAULTS)
    assert all(value == METHOD_DEFAULTS[name] for name, value in found)


def test_read_defaults_finds_what_the_cell_sets():
    for source in SOURCES:
        (tagged,) = [
            c for c in cells(source) if "parameters" in c.metadata.get("tags", [])
        ]
        variables = {}
        exec(tagged.source, variables)
        assert variables == read_defaults(source) | {
            "__builtins__": variables["__builtins__"]
        }


def test_parameter_has_the_same_type_in_all_notebooks():
    types = {}
    for source in SOURCES:
        for name, value in read_defaults(source).items():
            types.setdefault(name, set()).add(type(value))
    assert all(len(found) == 1 for found in types.values()), types


def test_more_than_half_of_the_claims_are_supported_on_the_plaza():
    claims = [
        result
        for s in SOURCES
        for kind, _, result in read_results(s)
        if kind == "claim"
    ]
    assert len(claims) > 20
    assert claims.count("supported") > len(claims) / 2


def test_both_methods_find_the_true_zone_of_the_plaza():
    names = [name for _, name, _ in read_results(folders.NOTEBOOKS / "05_zones.py")]
    # two methods, four speeds
    assert sum("true zone found" in name for name in names) == 8
