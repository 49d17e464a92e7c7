"""`make audit`: a pinned version with a published vulnerability fails; without network it says so."""

import runpy
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / ".ci" / "audit.py"
pytestmark = pytest.mark.skipif(not SCRIPT.exists(), reason="an sdist has no .ci")


def audit(monkeypatch, lock, answers):
    def ask(pinned):
        if isinstance(answers, Exception):
            raise answers
        return [answers.get(name, []) for name, _ in pinned]

    module = runpy.run_path(str(SCRIPT))
    space = module["main"].__globals__
    monkeypatch.setitem(space, "ask", ask)
    monkeypatch.setitem(space, "LOCK", lock)
    return module["main"]()


@pytest.mark.parametrize(
    ("answers", "code", "printed"),
    [
        ({}, 0, "2 pinned versions, 0 published vulnerabilities"),
        ({"b": ["GHSA-1"]}, 1, "b 2.0: GHSA-1, see https://osv.dev/GHSA-1"),
        (OSError("no route"), 0, "not audited"),
    ],
)
def test_what_is_known_fails_and_silence_is_said(tmp_path, monkeypatch, capsys, answers, code, printed):
    lock = tmp_path / "environment.lock"
    lock.write_text(
        "a==1.0 ; python_version == '3.12'\n    --hash=sha256:0\nb==2.0 \\\n    --hash=sha256:1\n"
    )
    assert audit(monkeypatch, lock, answers) == code
    assert printed in capsys.readouterr().out


def test_every_pin_of_our_lock_is_asked_for():
    module = runpy.run_path(str(SCRIPT))
    text = module["LOCK"].read_text(encoding="utf-8")
    pinned = module["pins"](text)
    assert len(pinned) > 100
    assert {"numpy", "casadi", "papermill"} <= {name for name, _ in pinned}
