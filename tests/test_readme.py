"""The README: its program runs, its files exist, its commands are known."""

import re
from pathlib import Path

import pytest

import szlib
from szlib.workbook import command_line

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)


def test_the_first_program_runs(capsys):
    exec(compile(PROGRAMS[0], "README.md", "exec"), {})
    assert "optimal 0.0" in capsys.readouterr().out


def test_the_programs_name_what_exists():
    for program in PROGRAMS:
        compile(program, "README.md", "exec")
        assert all(hasattr(szlib, name) for name in re.findall(r"szlib\.(\w+)", program))


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!http)([^)#]+)\)", TEXT))))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists()


def test_make_verbs_exist():
    known = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"`?make (\w+)", TEXT)) <= known


def test_options_exist():
    with pytest.raises(SystemExit):
        command_line.main(["run", "--help"])
    for line in re.findall(r"^szlib run.*?(?=\s+#|$)", TEXT, flags=re.MULTILINE):
        command_line._parser().parse_args(line.split()[1:])
