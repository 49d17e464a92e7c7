"""A task of an exercise sheet: it asks the learner's function for fresh cases and judges the results.

Each check draws new cases from a seed, and a case that fails can be drawn again with that seed. Typical
mistakes are functions as well: if one of them gives the learner's results in every case, the learner reads
its message. An answer is judged from a process of its own (`answers`), which has nothing of szlib but what
the task allows.
"""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .answers import Failure, Other, Refusal
from .client import Verdict
from .qp import Infeasible

Answer = Callable[..., Any]
Args = tuple[Any, ...]  # the arguments of one call
Call = tuple[Args, Any]  # a call of the learner's function, and its result
Rng = np.random.Generator
# Function of the arguments and the learner's result that returns what is wrong; "" accepts the result.
Judge = Callable[[Args, Any], str]

_MANY = 40  # cases of a check: a mistake that shows in one case of three passes once in ten million checks
_MAX_SHOWN = 8  # numbers of the arguments in a message
ESSAY_MINUTES = 10  # of a sheet


@dataclass(frozen=True)
class Task:
    """A task of an exercise sheet.

    Parameters
    ----------
    name : name of the task and of the function that the learner writes.
    minutes : time that the task takes [min].
    hints : hints in order; they end before the answer.
    cases : function that draws the arguments of the cases of one check.
    solution : the correct answer. Results must equal its results up to `tolerance`.
    judge : accepts or refuses one result, where there are many correct answers.
    drive : function of (answer, arguments) that calls the answer many times, as in a closed loop, and returns
        what went wrong.
    plot : function of (answer, arguments) that draws a case.
    mistakes : message -> function that makes this typical mistake.
    hidden : number of values at the end of a case that the judge sees, but not the answer.
    allowed : modules of szlib that an answer may use.
    seconds : time of a check in the learner's function [s].
    tolerance : largest allowed difference of any number [unit].
    unit : unit of the result; "" if it has none.
    """

    name: str
    minutes: int
    hints: Sequence[str]
    cases: Callable[[Rng], Iterable[Args]]
    solution: Answer | None = None
    judge: Judge | None = None
    drive: Callable[[Answer, Args], str] | None = None
    plot: Callable[[Answer, Args], Any] | None = None
    mistakes: Mapping[str, Answer] = field(default_factory=dict)
    hidden: int = 0
    allowed: tuple[str, ...] = ()
    seconds: float = 20.0
    tolerance: float = 1e-6
    unit: str = ""

    def case(self, seed: int, number: int) -> Args:
        """The arguments of one case, from 1, of the check with this seed."""
        args = list(self.cases(np.random.default_rng(seed)))[number - 1]
        return args[: len(args) - self.hidden]

    def check(self, answer: Answer, seed: int) -> Verdict:
        """Check the function `answer` in cases drawn from `seed`."""
        calls: list[list[Call]] = []  # of each case
        fault, number = "", 0
        try:
            for number, args in enumerate(self.cases(np.random.default_rng(seed)), 1):
                calls.append([])
                found = self._run(answer, args, calls[-1])
                fault = fault or (f"{found}{self._replay(args, seed, number)}" if found else "")
        except NotImplementedError as error:
            reason = str(error) or "write it, then run this cell"
            return Verdict(self.name, False, f"no answer yet: {reason}")
        except (Refusal, Failure) as error:
            return Verdict(self.name, False, f"{error}{self._replay(args, seed, number)}")
        for case, made in enumerate(calls, 1):
            if not fault and (found := self._compare(made)):
                fault = f"{found}{self._replay(self.case(seed, case), seed, case)}"
        if fault:
            mistake = self._mistake([call for made in calls for call in made])
            return Verdict(self.name, False, f"{mistake}\n    {fault}" if mistake else fault)
        return Verdict(self.name, True, f"correct in {number} fresh case{'s' * (number > 1)}")

    def _run(self, answer: Answer, args: Args, calls: list[Call]) -> str:
        """Run the answer in one case, record its `calls`, and return what the judge refuses."""

        def ask(*arguments: Any) -> Any:
            got = answer(*arguments)
            calls.append((arguments, got))
            return got

        if self.drive:
            return self.drive(ask, args)
        got = ask(*args[: len(args) - self.hidden])
        return self.judge(args, got) if self.judge else ""

    def _compare(self, calls: list[Call]) -> str:
        """How the first wrong result differs from that of the solution; "" if there is none."""
        if self.solution is None:
            return ""
        for arguments, got in calls:
            if fault := compare(self.solution(*deepcopy(arguments)), got, self.tolerance, self.unit):
                return fault
        return ""

    def _mistake(self, calls: list[Call]) -> str:
        """Message of the typical mistake that gives the same results in every call; "" if there is none."""
        for message, mistake in self.mistakes.items():
            if calls and all(self._agrees(mistake, *call) for call in calls):
                return message
        constant = len(calls) > 1 and len({str(got) for _, got in calls}) == 1
        return (
            "your result is the same in every case: it does not depend on the arguments" if constant else ""
        )

    def _agrees(self, mistake: Answer, args: Args, got: Any) -> bool:
        try:
            return not compare(mistake(*deepcopy(args)), got, self.tolerance)
        except Infeasible:
            return False

    def _replay(self, args: Args, seed: int, number: int) -> str:
        """The arguments of a case, and the command that draws it again."""
        if self.plot:
            return f"\n    see it: judges.plot({self.name!r}, {self.name}, seed={seed}, number={number})"
        names = (
            [f"{name} = " for name in _argument_names(self.solution)]
            if self.solution
            else [""] * (len(args) - self.hidden)
        )
        texts, room = [], _MAX_SHOWN
        for name, arg in zip(names, args, strict=False):
            texts.append(f"{name}{show(arg, room)}")
            room -= size if (size := getattr(arg, "size", 1)) <= room else 0
        shown = ", ".join(texts)
        again = f"{self.name}(*judges.case({self.name!r}, seed={seed}, number={number}))"
        return "" if self.drive else f"\n    for {shown}\n    the same case again: {again}"


def make_task(
    names: dict[str, Any], name: str, cases: Callable[[Rng], Iterable[Args]], **options: Any
) -> Task:
    """Build a task with the texts, numbers and mistakes of `texts.toml`.

    Parameters
    ----------
    names : what the expressions of the mistakes may use: `globals()` of the sheet's file.
    name : name of the task, and of its section in `texts.toml`.
    cases, options : as for `Task`.

    Raises
    ------
    KeyError : a task has no text.
    """
    texts, mistakes = dict(load_texts()[name]), {}
    for message, expression in texts.pop("mistakes", {}).items():
        given = ", ".join(_argument_names(options["solution"]))
        mistakes[message] = eval(f"lambda {given}: {expression}", names)
    return Task(name, cases=cases, mistakes=mistakes, **texts, **options)


def _argument_names(function: Answer) -> list[str]:
    parameters = inspect.signature(function).parameters.values()
    return [each.name for each in parameters if each.default is each.empty and each.kind != each.VAR_KEYWORD]


@cache
def load_texts() -> dict[str, Any]:
    """Texts of all tasks, by the name of the task."""
    return tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))


def repeat(draw: Callable[[Rng], Args], n: int = _MANY) -> Callable[[Rng], Iterator[Args]]:
    """Cases that are all drawn by the function `draw`."""
    return lambda rng: (draw(rng) for _ in range(n))


def compare(expected: Any, got: Any, tolerance: float, unit: str = "") -> str:
    """Describe how two results differ; "" if they agree."""
    if form := check_form(expected, got):
        return form
    want, have = np.asarray(expected), np.asarray(got)
    wrong = np.flatnonzero(~np.isclose(have.astype(float), want.astype(float), rtol=0, atol=tolerance))
    if not len(wrong):
        return ""
    unit, at = (f" {unit}" if unit else ""), ""
    if want.size > 1:
        first = np.unravel_index(wrong[0], want.shape)
        at = f"{len(wrong)} of {want.size} numbers are wrong; at [{', '.join(map(str, first))}] "
        want, have = want[first], have[first]
    texts = [str(want), str(have)]
    for digits in (4, 8, 17) if want.dtype != bool else ():  # as many as show a difference
        texts = [f"{float(each):.{digits}g}" for each in (want, have)]
        if texts[0] != texts[1]:
            break
    return f"{at}expected {texts[0]}{unit}, got {texts[1]}{unit}"


def check_form(expected: Any, got: Any) -> str:
    """Describe how the type or the shape of two results differs; "" if they agree."""
    want = np.asarray(expected)
    if isinstance(got, Other):
        return f"expected {_kind(want)}; got a {got.kind}{' of parts of unequal length' * got.is_uneven}"
    have = np.asarray(got)
    if have.dtype.kind not in "biuf":
        return f"expected {_kind(want)}; got a {type(got).__name__}"
    if have.shape != want.shape or (have.dtype == bool) != (want.dtype == bool):
        return f"expected {_kind(want)}; got {_kind(have)}"
    return ""


def _kind(array: Any) -> str:
    what = ("a boolean", "booleans") if array.dtype == bool else ("a number", "numbers")
    return f"{what[1]}, shape {array.shape}" if array.shape else what[0]


def show(value: Any, room: int) -> str:
    """A value to copy; only the size of one with more than `room` numbers."""
    if isinstance(value, pd.DataFrame):
        columns = value.to_dict("list") if value.size <= room else f"a table of {len(value)} rows"
        return str(columns)
    if isinstance(value, np.ndarray):
        if value.size > room:
            return _kind(value)
        numbers = value.astype(int) if value.dtype == bool else value
        text = np.array2string(numbers, separator=", ", floatmode="unique")
        return f"np.array({' '.join(text.split())}{', dtype=bool' if value.dtype == bool else ''})"
    return str(value)
