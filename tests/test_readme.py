"""The README: its program runs, its files exist, its commands are known."""

import re
from pathlib import Path

import pytest

from szlib import workbook

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_program_runs(capsys):
    (program,) = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    exec(compile(program, "README.md", "exec"), {})
    assert "optimal 0.0" in capsys.readouterr().out


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!http)([^)#]+)\)", TEXT))))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists()


def test_make_verbs_exist():
    known = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"`?make (\w+)", TEXT)) <= known


def test_options_exist():
    with pytest.raises(SystemExit):
        workbook.main(["run", "--help"])
    for line in re.findall(r"^szlib run.*?(?=\s+#|$)", TEXT, flags=re.MULTILINE):
        workbook._parser().parse_args(line.split()[1:])
