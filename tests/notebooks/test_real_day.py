"""The copies on the real day: up to date, executed, small, and without paths of a machine."""

import importlib.util
import re
from types import SimpleNamespace

import nbformat
import pytest
from studies import real_day

from szlib.workbook import claims, folders

COPIES = sorted((folders.NOTEBOOKS / "real_day").glob("*.ipynb"))
SCRIPTS = {script.stem: script for script in folders.list_notebooks()}


def _refresh():
    spec = importlib.util.spec_from_file_location(
        "refresh", folders.NOTEBOOKS / "tools" / "refresh.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


refresh = _refresh()


@pytest.mark.parametrize("copy", COPIES, ids=lambda c: c.stem)
class TestCopy:
    def test_copy_has_the_cells_of_the_notebook(self, copy):
        executed = nbformat.read(copy, as_version=4)
        now = refresh.replace_data(SCRIPTS[copy.stem], "atc-1hz")
        again = "python notebooks/tools/refresh.py real_day"
        assert [c.source for c in executed.cells] == [c.source for c in now.cells], (
            again
        )
        code = [c for c in executed.cells if c.cell_type == "code"]
        assert [c.execution_count for c in code] == list(range(1, len(code) + 1))
        assert all(out.output_type != "error" for c in code for out in c.outputs)

    def test_every_check_of_the_copy_holds(self, copy):
        outputs = [
            o
            for c in nbformat.read(copy, as_version=4).cells
            for o in c.get("outputs", ())
        ]
        text = "\n".join(out.text for out in outputs if out.output_type == "stream")
        checks = re.findall(r"^check: .+", text, re.M)
        assert checks
        assert [line for line in checks if ": holds" not in line] == []

    def test_copy_is_small_and_names_no_machine(self, copy):
        text = copy.read_text(encoding="utf-8")
        assert len(text) < 1_500_000
        assert not re.search(r"/(home|root|work|tmp|Users)/|at 0x", text)


@pytest.mark.parametrize("folder", ["deeper", "real_day"])
def test_sentences_that_were_not_run_are_in_no_share_and_are_said(folder):
    cells = nbformat.read(
        folders.NOTEBOOKS / folder / "28_sentences.ipynb", as_version=4
    ).cells
    outputs = [out for cell in cells for out in cell.get("outputs", ())]
    tables = "".join(out.get("data", {}).get("text/html", "") for out in outputs)
    counts = {
        verdict: int(number)
        for verdict, number in re.findall(
            r"<summary>(.+): (\d+) sentences</summary>", tables
        )
    }
    n_not_run = counts.pop(claims.NOT_RUN, 0)
    n_judged = sum(counts.values())
    assert (n_not_run > 0) == (folder == "real_day")
    (meaning,) = (
        text
        for out in outputs
        if "What it means" in (text := out.get("data", {}).get("text/markdown", ""))
    )
    title = next(
        out.metadata["image/png"]["alt"]
        for out in outputs
        if "image/png" in out.get("data", {})
    )
    assert f"Of {n_judged} sentences " in meaning and f" of {n_judged} " in title
    for text in (meaning, title):
        assert ("not run with this data" in text) == (n_not_run > 0)
        assert not n_not_run or f"; {n_not_run} other" in text
    meanings = "".join(cell.source for cell in cells if cell.cell_type == "markdown")
    assert f"\n| {claims.NOT_RUN} | " in meanings


# --- numbers beside those of the plaza ---------------------------------------------------------------


def record_of(data, name="99_none"):
    return SimpleNamespace(
        name=name, cache=SimpleNamespace(is_synthetic=data == "synthetic")
    )


def write_plaza_copy(folder, monkeypatch, numbers):
    """An executed copy of the chapter 99_a, on the plaza, that shows these numbers."""
    monkeypatch.setattr(folders, "NOTEBOOKS", folder)
    line = real_day.compare_with_plaza(record_of("synthetic"), numbers).data
    output = nbformat.v4.new_output("execute_result", data={"text/markdown": line})
    cell = nbformat.v4.new_code_cell("compare", outputs=[output])
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), folder / "99_a.ipynb")


def test_numbers_are_shown_beside_those_of_the_plaza(tmp_path, monkeypatch):
    write_plaza_copy(
        tmp_path, monkeypatch, {"people": "5,000", "speed, median": "1.02 m/s"}
    )
    numbers = {"people": "15,066", "speed, median": "1.11 m/s", "gaps": "221"}
    text = real_day.compare_with_plaza(
        record_of("atc-1hz", "99_a"), numbers, "More people."
    ).data
    assert text.startswith("**On this data.** More people.\n\n|")
    rows = [
        [part.strip() for part in line.strip("|").split("|")]
        for line in text.splitlines()[4:]
    ]
    assert rows == [
        ["people", "15,066", "5,000"],
        ["speed, median", "1.11 m/s", "1.02 m/s"],
        ["gaps", "221", "-"],
    ]


def test_numbers_are_shown_without_a_copy_of_the_plaza(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "NOTEBOOKS", tmp_path)
    text = real_day.compare_with_plaza(record_of("atc-1hz"), {"people": "3"}).data
    assert "| people | 3 | - |" in text


@pytest.mark.parametrize(
    "numbers", [{"a: b": "1"}, {"a": "1; 2"}, {"a|b": "1"}, {"a": "1\n2"}]
)
def test_number_that_cannot_be_read_back_is_an_error(numbers):
    with pytest.raises(ValueError, match="expected names and numbers without"):
        real_day.compare_with_plaza(record_of("synthetic"), numbers)


def test_copies_on_the_real_day_show_the_numbers_of_the_plaza_copies():
    for copy in COPIES:
        numbers = real_day.read_numbers(SCRIPTS[copy.stem].with_suffix(".ipynb"))
        cells = nbformat.read(copy, as_version=4).cells
        texts = [
            o.get("data", {}).get("text/markdown", "")
            for c in cells
            for o in c.get("outputs", ())
        ]
        shown = " ".join(text for text in texts if text.startswith("**On this data.**"))
        for name, value in numbers.items():
            assert re.search(
                rf"\| {re.escape(name)} \| [^|]+ \| {re.escape(value)} \|", shown
            ), copy.name


def test_copy_has_other_data_and_links_from_its_folder():
    notebook = refresh.replace_data(folders.NOTEBOOKS / "01_tracks.py", "atc-1hz")
    (tagged,) = (
        c.source for c in notebook.cells if "parameters" in c.metadata.get("tags", [])
    )
    assert re.search('^data = "atc-1hz"', tagged, re.M)
    links = re.findall(r"\]\(([^)]+)\)", notebook.cells[1].source)
    assert links
    assert all(link.startswith(("../", "http")) for link in links)


def test_the_real_day_cannot_decide_whether_the_zone_reaches_farther_ahead():
    executed = nbformat.read(
        folders.NOTEBOOKS / "real_day" / "05_zones.ipynb", as_version=4
    )
    text = "".join(
        out.get("text", "")
        for cell in executed.cells
        for out in cell.get("outputs", ())
    )
    assert (
        "the zone at 1.1 m/s reaches farther ahead than behind: not decidable" in text
    )
