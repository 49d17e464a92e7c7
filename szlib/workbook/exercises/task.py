"""One task: the learner's answer is a function, asked for cases that nobody has seen before.

Each case is drawn from fresh random numbers, so its truth cannot be looked up. A wrong answer is compared
with typical mistakes, functions as well: if one gives the same in every case, the learner is told which.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ...errors import SzlibError

Answer = Callable[..., Any]
Case = tuple[tuple[Any, ...], Any]
"""The arguments of the answer, and the truth."""
Rng = np.random.Generator

_LONGEST, _DIGITS = 6, 4  # of an array that is shown


@dataclass(frozen=True)
class Verdict:
    """What is said of an answer: whether it passed, and what is right or wrong with it, in words.

    `error` is what the answer's function raised, None if it did not.
    """

    task: str
    passed: bool
    message: str
    error: Exception | None = None

    def __repr__(self) -> str:
        return f"{'passed' if self.passed else 'not yet'} - {self.task}: {self.message}"

    def require(self) -> None:
        """Raise SzlibError with the message unless it passed: for graders, which count errors."""
        if not self.passed:
            raise SzlibError(repr(self)) from self.error


@dataclass(frozen=True)
class Task:
    """A task of an exercise sheet.

    Parameters
    ----------
    name : of the task, and of the function that the learner writes.
    minutes : that it takes [min].
    hints : from a nudge to nearly the solution.
    case : draws one case from a generator.
    mistakes : typical wrong answers, by what is said of them.
    judge : (arguments, truth, what the answer gave) -> what is wrong in words, "" for nothing; by default
        the answer must be the truth up to `tolerance`.  A judge finds the mistakes by itself.
    tolerance : greatest difference of any number from the truth [unit].
    unit : of the answer, "" where it has none.
    cases : how many are drawn for a check.
    """

    name: str
    minutes: int
    hints: tuple[str, ...]
    case: Callable[[Rng], Case]
    mistakes: Mapping[str, Answer]
    judge: Callable[[tuple[Any, ...], Any, Any], str] | None = None
    tolerance: float = 1e-6
    unit: str = ""
    cases: int = 5

    def check(self, answer: Answer, rng: Rng) -> Verdict:
        """Ask the answer for fresh cases, and say what came of it."""
        tried = []
        for _ in range(self.cases):
            args, truth = self.case(rng)
            try:
                got = answer(*deepcopy(args))
            except NotImplementedError as error:
                return Verdict(self.name, False, "no answer yet: write it, then run this cell", error)
            except Exception as error:
                told = f"your function stopped with {type(error).__name__} ({error}) {_asked(args)}"
                return Verdict(self.name, False, told, error)
            if got is None:
                told = "your function gives None: does it end with `return`?"
                return Verdict(self.name, False, told)
            tried.append((args, truth, got, self._fault(args, truth, got)))
        faults = [(args, fault) for args, _, _, fault in tried if fault]
        if not faults:
            return Verdict(self.name, True, f"right in {self.cases} fresh case{'s' * (self.cases > 1)}")
        args, fault = faults[0]
        named = "" if self.judge else self._mistake([(args, got) for args, _, got, _ in tried])
        return Verdict(self.name, False, f"{named}: {fault}" if named else fault)

    def _fault(self, args: tuple[Any, ...], truth: Any, got: Any) -> str:
        if self.judge:
            return self.judge(args, truth, got)
        fault = self._difference(truth, got)
        return f"{fault} {_asked(args)}" if fault else ""

    def _difference(self, truth: Any, got: Any) -> str:
        """How the numbers differ, "" if they do not."""
        want = np.asarray(truth, float)
        try:
            have = np.asarray(got, float)
        except (TypeError, ValueError):
            return f"expected {_kind(want)}; got {type(got).__name__}"
        if have.shape != want.shape:
            return f"expected {_kind(want)}; got {_kind(have)}"
        wrong = np.flatnonzero(~np.isclose(have, want, rtol=0, atol=self.tolerance))
        if not len(wrong):
            return ""
        unit = f" {self.unit}" if self.unit else ""
        if want.size <= _LONGEST:
            return f"expected {_shown(truth)}{unit}; got {_shown(got)}"
        first = np.unravel_index(wrong[0], want.shape)
        return (
            f"{len(wrong)} of {want.size} numbers are wrong; at [{', '.join(map(str, first))}] expected "
            f"{_shown(want[first])}{unit}, got {_shown(have[first])}"
        )

    def _mistake(self, tried: list[tuple[tuple[Any, ...], Any]]) -> str:
        """What is said of the mistake that gives the same in every case, "" where none does."""
        for told, mistake in self.mistakes.items():
            if not any(self._difference(mistake(*deepcopy(args)), got) for args, got in tried):
                return told
        return ""


def formula(draw: Callable[[Rng], tuple[Any, ...]], truth: Answer) -> Callable[[Rng], Case]:
    """Cases whose truth is a function of the arguments."""

    def case(rng: Rng) -> Case:
        """Arguments, and what the formula gives for them."""
        args = draw(rng)
        return args, truth(*args)

    return case


def _asked(args: tuple[Any, ...]) -> str:
    return f"for ({', '.join(map(_shown, args))})" if args else ""


def _kind(array: Any) -> str:
    return f"an array of shape {array.shape}" if array.shape else "a number"


def _shown(value: Any) -> str:
    """A value in a few digits; of long ones only the size."""
    if isinstance(value, pd.DataFrame):
        return f"a table of {len(value)} rows"
    if isinstance(value, np.ndarray | list | tuple) and np.size(value) > _LONGEST:
        return _kind(np.asarray(value))
    if isinstance(value, np.ndarray | list | tuple | float | int | np.number):
        return str(np.round(np.asarray(value), _DIGITS).tolist())
    return str(value)
