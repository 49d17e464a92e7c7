"""What `szlib run` writes for machines: JUnit XML, no progress bar in a log."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from helpers.junit_schema import violations

from szlib.workbook.cli import main
from szlib.workbook.report import write_junit

pytestmark = pytest.mark.usefixtures("without_kernels")
GOOD = 'record.check("sum", True, 2)\nrecord.claim("paper", False, 0.25)'
BAD = 'record.check("a < b & c", False, "\\x1b[0m")\nrecord.check("fine", True)'


def run(*arguments):
    return main(["run", "--data", "mine.csv", "--out", "out", "-j", "1", *arguments])


def test_junit_has_a_suite_for_each_notebook_and_a_case_for_each_check(
    notebooks,
):
    notebooks(_01_good=GOOD, _02_bad=BAD, _03_crash="1 / 0")
    assert run("--junit", "junit.xml") == 1
    assert run("--junit", "junit.xml") == 1, "written again"
    root = ET.parse("junit.xml").getroot()
    assert root.tag == "testsuites"
    assert violations(root) == []
    suites = {suite.attrib["name"]: suite for suite in root}
    assert list(suites) == ["01_good", "02_bad", "03_crash"]
    cases = {
        name: [(c.attrib["name"], [e.tag for e in c]) for c in suite]
        for name, suite in suites.items()
    }
    assert cases == {
        "01_good": [("01_good", []), ("sum", [])],
        "02_bad": [("02_bad", []), ("a < b & c", ["failure"]), ("fine", [])],
        "03_crash": [("03_crash", ["error"])],
    }
    for suite in root:
        assert all(
            case.tag == "testcase" and case.attrib["classname"] == suite.attrib["name"]
            for case in suite
        )
        found = {
            tag: len(suite.findall(f".//{tag}"))
            for tag in ("testcase", "failure", "error", "skipped")
        }
        names = {
            "testcase": "tests",
            "failure": "failures",
            "error": "errors",
            "skipped": "skipped",
        }
        assert {
            names[tag]: str(n) for tag, n in found.items()
        }.items() <= suite.attrib.items()
        assert float(suite.attrib["time"]) >= 0
    assert "ZeroDivisionError" in suites["03_crash"][0][0].attrib["message"]


def test_undecided_and_not_started_notebooks_are_skipped_in_junit(
    notebooks,
):
    notebooks(_02_wrong="import szlib\nraise szlib.DataError('wrong')", _07_later="")
    assert run("--junit", "junit.xml") == 2
    root = ET.parse("junit.xml").getroot()
    assert violations(root) == []
    tags = [[child.tag for child in case] for case in root.iter("testcase")]
    assert tags == [["error"], ["skipped"]]


@pytest.mark.parametrize("seconds", [0, 1e-5, 2.3456789, 98765.4])
def test_junit_is_valid_in_the_schema_of_jenkins(tmp_path, seconds):
    """With every status, whatever the time, and with control characters in names and messages."""
    check = {
        "kind": "check",
        "name": "\x00 < & \udc80",
        "result": "\x1b[0m",
        "value": None,
        "passed": False,
    }
    each = {"seconds": seconds, "checks": [check], "error": "ValueError: \x08"}
    statuses = ("done", "error", "refused", "undecided", "not started")
    outcomes = {status: {"status": status, **each} for status in statuses}
    write_junit({"notebooks": outcomes}, tmp_path / "junit.xml")
    assert violations(ET.parse(tmp_path / "junit.xml").getroot()) == []


@pytest.mark.parametrize(
    ("suite", "problem"),
    [
        ('<testsuite name="a" failures="0" errors="0"/>', "<testsuite> lacks tests"),
        (
            '<testsuite name="a" tests="0" failures="0" errors="0" passed="1"/>',
            "<testsuite> has passed",
        ),
        (
            '<testsuite name="a" tests="0" failures="0" errors="0" time="1e-05"/>',
            "time='1e-05' is not",
        ),
        (
            '<testsuite name="a" tests="0" failures="0" errors="0"><failure/></testsuite>',
            "has <failure>",
        ),
        (
            '<testsuite name="a" tests="0" failures="0" errors="0">b</testsuite>',
            "has the text 'b'",
        ),
    ],
)
def test_the_schema_of_jenkins_refuses(suite, problem):
    assert problem in "\n".join(
        violations(ET.fromstring(f"<testsuites>{suite}</testsuites>"))
    )


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ("nowhere/junit.xml", "nowhere: is no folder that can be written"),
        ("mine.csv/junit.xml", "mine.csv: is no folder that can be written"),
        (".", ": is a folder; name a file in it"),
    ],
)
def test_junit_file_that_cannot_be_written_is_refused_before_the_run(
    notebooks,
    capsys,
    place,
    message,
):
    notebooks(_01_good=GOOD)
    assert run("--junit", place) == 2
    assert message in capsys.readouterr().err
    assert not Path("out").exists()


def test_a_log_has_no_progress_bar(notebooks, capsys):
    notebooks(_01_good=GOOD)
    assert run() == 0
    assert capsys.readouterr().err == ""
