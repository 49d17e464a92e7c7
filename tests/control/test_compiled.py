"""Compiled functions: the same numbers to the last bit, in the place of the others; and what goes wrong."""

import copy
import logging
import os
import shutil
import time

import numpy as np
import pytest
from helpers.random_states import ZONE

import szlib
from szlib.control.problem import Buffered
from szlib.control.solvers import compiled
from szlib.control.solvers.ipopt import Ipopt
from szlib.control.solvers.sqp import Sqp
from szlib.simulation.closed_loop import advance
from szlib.workbook.command_line import main

pytestmark = [
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc"),
    pytest.mark.skipif("SZLIB_COMPILED" in os.environ, reason="everything is compiled already"),
]
FORMULATIONS = ({}, {"N_h": 8}, {"terminal": "rest"})


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def use_the_cache(cache, monkeypatch):
    monkeypatch.setenv("SZLIB_CACHE", str(cache))
    monkeypatch.setattr(compiled, "_processes", {})
    forget = compiled._compiler.cache_clear
    forget()
    yield
    forget()
    for process in compiled._processes.values():
        process.wait()


def settings_of(**given):
    return szlib.MPCSettings(time_limit=np.inf, **given)


def drive(controller, steps=30):
    """Controls of a robot past two people who come towards it."""
    controller.reset()
    state, found = np.array([-4.0, 0.1, 0.5, 0.0]), []
    for k in range(steps):
        people = np.array([[2.0 - 0.08 * k, 0.1, -0.8, 0.0], [3.0, 1.5, 0.0, -0.3]])
        step = controller.step(state, (4.0, 0.0), people)
        found.append(np.r_[step.control, step.slack, step.cost, step.h])
        state = advance(state, step.control, 0.1)
    return np.array(found)


def awkward(rng, n):
    """Numbers of every kind: none, huge, equal, not finite."""
    numbers = rng.normal(size=n) * 10.0 ** rng.integers(-3, 4)
    numbers[rng.random(n) < 0.1] = rng.choice([0.0, 1.0, 1e8, np.inf, np.nan])
    return numbers


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=str)
@pytest.mark.parametrize("kind", [Sqp, Ipopt])
def test_the_numbers_are_the_same_to_the_last_bit(kind, formulation, cache):
    solver, rng = kind(settings_of(**formulation), 2, 1), np.random.default_rng(1)
    assert compiled.compile_now(solver.functions) > 0
    assert compiled.compile_now(solver.functions) == 0, "it is in the cache"
    replaced = compiled.Compiled("auto")
    for each in solver.functions:
        arguments = [np.zeros(each.function.nnz_in(i)) for i in range(each.function.n_in())]
        by_machine, as_before = (Buffered(each.function, *arguments) for _ in range(2))
        by_machine.become(compiled.loaded(each.function, compiled.library(solver.functions)))
        for _ in range(200):
            for array in arguments:
                array[:] = awkward(rng, array.size)
            by_machine.call(), as_before.call()
            for one, other in zip(by_machine.results, as_before.results, strict=True):
                assert np.array_equal(one, other, equal_nan=True)
    replaced.take(solver.functions)
    assert not replaced._waiting


def test_a_controller_takes_what_is_compiled_while_it_drives(cache):
    expected = drive(szlib.MPCCBF(ZONE, settings=settings_of(gamma=0.11), max_people=2))
    controller = szlib.MPCCBF(ZONE, settings=settings_of(gamma=0.11, compile="auto"), max_people=2)
    before = [each.call for each in controller._sizes.of(2, 0).functions]
    while controller._sizes._compiled._waiting:
        assert np.array_equal(drive(controller), expected)
    now = [each.call for each in controller._sizes.of(2, 0).functions]
    assert all(one is not other for one, other in zip(before, now, strict=True))
    assert np.array_equal(drive(controller), expected)
    at_once = szlib.MPCCBF(ZONE, settings=settings_of(gamma=0.11, compile="auto"), max_people=2)
    assert not at_once._sizes._compiled._waiting, "they are in the cache"
    assert np.array_equal(drive(at_once), expected)


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("CC", "no_such_compiler", "there is no C compiler 'no_such_compiler'"),
        ("SZLIB_CACHE", "off", "is off"),
    ],
)
def test_where_nothing_can_be_compiled_it_drives_all_the_same_and_says_why(
    monkeypatch, caplog, capsys, variable, value, said
):
    monkeypatch.setenv(variable, value)
    expected = drive(szlib.MPCCBF(ZONE, max_people=2))
    with caplog.at_level(logging.WARNING, logger="szlib"):
        controller = szlib.MPCCBF(ZONE, settings=szlib.MPCSettings(compile="auto"), max_people=2)
    assert [said in record.getMessage() for record in caplog.records] == [True]
    assert np.array_equal(drive(controller), expected)
    assert main(["compile", "--people", "0"]) == 2
    assert said in capsys.readouterr().err


def test_a_compiler_that_fails_is_told_in_the_background_and_in_the_foreground(
    monkeypatch, caplog, capsys, tmp_path
):
    fails = tmp_path / "fails"
    fails.write_text('#!/bin/sh\n[ "$1" = --version ] && exit 0\necho "no room for a program" >&2\nexit 3\n')
    fails.chmod(0o755)
    monkeypatch.setenv("CC", str(fails))
    controller = szlib.MPCCBF(ZONE, settings=settings_of(compile="auto"), max_people=0)
    deadline = time.monotonic() + 60
    while controller._sizes._compiled._waiting and time.monotonic() < deadline:
        controller.step((0, 0, 0, 0), (4.0, 0.0))
        time.sleep(0.1)
    assert ["`szlib compile` says why" in record.getMessage() for record in caplog.records] == [True]
    assert main(["compile", "--people", "0"]) == 2
    assert "failed (3): no room for a program" in capsys.readouterr().err


def test_the_command_compiles_every_size_once(capsys, cache):
    assert main(["compile", "--people", "1", "-p", "gamma=0.3", "-p", "Q=[1, 1, 1, 1]"]) == 0
    assert [line.partition(":")[0] for line in capsys.readouterr().out.splitlines()] == [
        "0 people, 0 walls", "1 people, 0 walls"
    ]  # fmt: skip
    assert main(["compile", "--people", "1", "-p", "gamma=0.3", "-p", "Q=[1, 1, 1, 1]"]) == 0
    assert capsys.readouterr().out.count("was there already") == 2
    assert main(["compile", "-p", "gama=0.3"]) == 2
    assert "gama: is none of MPCSettings; expected one of dt, N," in capsys.readouterr().err


def test_a_copy_has_compiled_what_it_builds_anew(monkeypatch):
    original = szlib.MPCCBF(ZONE, settings=settings_of(gamma=0.07, compile="auto"), max_people=1)
    for process in compiled._processes.values():
        process.wait()
    monkeypatch.setenv("CC", "cc -g0")  # another compiler, of which nothing is in the cache
    monkeypatch.setattr(compiled, "_processes", {})
    compiled._compiler.cache_clear()
    copied = copy.deepcopy(original)._sizes._compiled
    assert copied._waiting and copied._waiting.keys() <= compiled._processes.keys()


def test_another_compiler_or_other_settings_have_a_file_of_their_own(monkeypatch):
    solvers = [Sqp(settings_of(gamma=gamma), 1, 0) for gamma in (0.05, 0.1)]
    one, other = (compiled.library(solver.functions) for solver in solvers)
    assert one == compiled.library(Sqp(settings_of(compile="auto"), 1, 0).functions) != other
    monkeypatch.setattr(compiled, "_compiler", lambda: ("cc", "another version"))
    assert compiled.library(solvers[0].functions) != one


def test_the_oldest_give_way(monkeypatch, tmp_path):
    monkeypatch.setenv("SZLIB_CACHE", str(tmp_path))
    monkeypatch.setattr(compiled, "MOST", 1)
    paths = []
    for walls in (0, 1):
        solver = Ipopt(settings_of(), 0, walls)
        compiled.compile_now(solver.functions)
        paths.append(compiled.library(solver.functions))
    assert [path.exists() for path in paths] == [False, True]


def test_a_damaged_file_is_compiled_anew(monkeypatch, tmp_path):
    monkeypatch.setenv("SZLIB_CACHE", str(tmp_path))
    functions = Ipopt(settings_of(), 0, 0).functions
    compiled.compile_now(functions)
    path = compiled.library(functions)
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], whole[:5000] + b"?" + whole[5001:]):
        path.unlink()  # what is loaded stays as it is
        path.write_bytes(damaged)
        waits = compiled.Compiled("auto")
        waits.take(functions)
        assert waits._waiting, "it is not used"
        assert compiled.compile_now(functions) > 0
        waits.look()
        assert not waits._waiting
