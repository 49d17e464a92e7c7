"""The copies on the real day: up to date, executed, small, and without paths of a machine."""

import importlib.util
import re

import nbformat
import pytest

from szlib.workbook import folders

COPIES = sorted((folders.NOTEBOOKS / "real_day").glob("*.ipynb"))


def _refresh():
    spec = importlib.util.spec_from_file_location("refresh", folders.NOTEBOOKS / "tools" / "refresh.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


refresh = _refresh()


@pytest.mark.parametrize("copy", COPIES, ids=lambda c: c.stem)
class TestCopy:
    def test_copy_has_the_cells_of_the_notebook(self, copy):
        executed = nbformat.read(copy, as_version=4)
        now = refresh.replace_data(folders.NOTEBOOKS / f"{copy.stem}.py", "atc-1hz")
        again = "python notebooks/tools/refresh.py real_day"
        assert [c.source for c in executed.cells] == [c.source for c in now.cells], again
        code = [c for c in executed.cells if c.cell_type == "code"]
        assert [c.execution_count for c in code] == list(range(1, len(code) + 1))
        assert all(out.output_type != "error" for c in code for out in c.outputs)

    def test_every_check_of_the_copy_holds(self, copy):
        outputs = [o for c in nbformat.read(copy, as_version=4).cells for o in c.get("outputs", ())]
        text = "\n".join(out.text for out in outputs if out.output_type == "stream")
        checks = re.findall(r"^check: .+", text, re.M)
        assert checks
        assert [line for line in checks if ": holds" not in line] == []

    def test_copy_is_small_and_names_no_machine(self, copy):
        text = copy.read_text(encoding="utf-8")
        assert len(text) < 1_500_000
        assert not re.search(r"/(home|root|work|tmp|Users)/|at 0x", text)


def test_copy_has_other_data_and_links_from_its_folder():
    notebook = refresh.replace_data(folders.NOTEBOOKS / "01_tracks.py", "atc-1hz")
    (tagged,) = (c.source for c in notebook.cells if "parameters" in c.metadata.get("tags", []))
    assert tagged.startswith('data = "atc-1hz"')
    links = re.findall(r"\]\(([^)]+)\)", notebook.cells[1].source)
    assert links
    assert all(link.startswith(("../", "http")) for link in links)


def test_zone_does_not_reach_farther_ahead_on_the_real_day():
    executed = nbformat.read(folders.NOTEBOOKS / "real_day" / "05_zones.ipynb", as_version=4)
    text = "".join(out.get("text", "") for cell in executed.cells for out in cell.get("outputs", ()))
    assert "the zone at 1.1 m/s reaches farther ahead than behind: not supported here" in text
