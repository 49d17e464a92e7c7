"""A task of an exercise sheet: it asks the learner's function for fresh cases and compares the answers.

Each case is drawn from fresh random numbers, so nobody can look up the correct answer.  Typical mistakes are
functions as well: if one of them gives the learner's answer in every case, the learner reads its message.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from szlib.errors import SzlibError

Answer = Callable[..., Any]
# The arguments for the learner's function, and the correct answer.
Case = tuple[tuple[Any, ...], Any]
# Function of the arguments, the correct answer and the learner's answer; "" accepts the answer.
Judge = Callable[[tuple[Any, ...], Any, Any], str]
Rng = np.random.Generator

_MAX_SHOWN = 6  # numbers of an array in a message


@dataclass(frozen=True)
class Verdict:
    """The result of a check.

    Attributes
    ----------
    task : name of the task.
    passed : True if the answer is correct in every case.
    message : what is correct or wrong.
    error : the exception that the learner's function raised; None if it raised none.

    Examples
    --------
    >>> from judges import Verdict
    >>> Verdict("velocity", True, "correct in 5 fresh cases")
    passed - velocity: correct in 5 fresh cases
    """

    task: str
    passed: bool
    message: str
    error: Exception | None = None

    def __repr__(self) -> str:
        return f"{'passed' if self.passed else 'not yet'} - {self.task}: {self.message}"

    def require(self) -> None:
        """Raise SzlibError with the message if the answer did not pass; graders count errors."""
        if not self.passed:
            raise SzlibError(repr(self)) from self.error


@dataclass(frozen=True)
class Task:
    """A task of an exercise sheet.

    Parameters
    ----------
    name : name of the task and of the function that the learner writes.
    minutes : time that the task takes [min].
    hints : hints in order; the last one is nearly the solution.
    case : function that draws one case from a random generator.
    mistakes : message -> function that makes this typical mistake.
    judge : function of (arguments, correct answer, learner's answer) that returns a message, "" for a correct
        answer. Without it, the answer must equal the correct answer up to `tolerance`.
    tolerance : largest allowed difference of any number [unit].
    unit : unit of the answer; "" if it has none.
    n_cases : number of cases in a check.

    Examples
    --------
    >>> import numpy as np
    >>> from judges import Task
    >>> double = Task("double", 1, (), lambda rng: ((3.0,), 6.0), {"you add 2": lambda x: x + 2}, unit="m")
    >>> double.check(lambda x: x + 2, np.random.default_rng(0))
    not yet - double: you add 2: expected 6.0 m; got 5.0 for (3.0)
    """

    name: str
    minutes: int
    hints: Sequence[str]
    case: Callable[[Rng], Case]
    mistakes: Mapping[str, Answer]
    judge: Judge | None = None
    tolerance: float = 1e-6
    unit: str = ""
    n_cases: int = 5

    def check(self, answer: Answer, rng: Rng) -> Verdict:
        """Check the function `answer` in fresh cases drawn from `rng`."""
        tried = []
        for _ in range(self.n_cases):
            args, expected = self.case(rng)
            try:
                got = answer(*deepcopy(args))
            except NotImplementedError as error:
                return Verdict(self.name, False, "no answer yet: write it, then run this cell", error)
            except Exception as error:
                stopped = f"your function stopped with {type(error).__name__} ({error}) {_arguments(args)}"
                return Verdict(self.name, False, stopped, error)
            if got is None:
                return Verdict(self.name, False, "your function returns None: does it end with `return`?")
            tried.append((args, expected, got))
        for args, expected, got in tried:
            if fault := self._fault(args, expected, got):
                mistake = self._mistake(tried)
                return Verdict(self.name, False, f"{mistake}: {fault}" if mistake else fault)
        return Verdict(self.name, True, f"correct in {self.n_cases} fresh case{'s' * (self.n_cases > 1)}")

    def _fault(self, args: tuple[Any, ...], expected: Any, got: Any) -> str:
        if self.judge:
            return self.judge(args, expected, got)
        fault = self._difference(expected, got)
        return f"{fault} {_arguments(args)}" if fault else ""

    def _difference(self, expected: Any, got: Any) -> str:
        """Describe how the numbers differ; "" if they agree."""
        want = np.asarray(expected, float)
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
        if want.size <= _MAX_SHOWN:
            return f"expected {_shown(expected)}{unit}; got {_shown(got)}"
        first = np.unravel_index(wrong[0], want.shape)
        return (
            f"{len(wrong)} of {want.size} numbers are wrong; at [{', '.join(map(str, first))}] expected "
            f"{_shown(want[first])}{unit}, got {_shown(have[first])}"
        )

    def _mistake(self, tried: list[tuple[tuple[Any, ...], Any, Any]]) -> str:
        """Message of the typical mistake that gives the same answers in every case; "" if there is none."""
        for message, mistake in self.mistakes.items():
            if not any(self._difference(mistake(*deepcopy(args)), got) for args, _, got in tried):
                return message
        return ""


def make_task(
    name: str, case: Callable[[Rng], Case], *, judge: Judge | None = None, **mistakes: Answer
) -> Task:
    """Build a task with the texts and numbers of `texts.toml`.

    Parameters
    ----------
    name : name of the task, and of its section in `texts.toml`.
    case, judge : as for `Task`.
    mistakes : key -> function that makes the mistake. `texts.toml` holds the message of each key.

    Raises
    ------
    KeyError : a task or a mistake has no text.
    """
    texts = dict(load_texts()[name])
    messages = texts.pop("mistakes", {})
    described = {messages[key]: answer for key, answer in mistakes.items()}
    return Task(name, case=case, mistakes=described, judge=judge, **texts)


@cache
def load_texts() -> dict[str, Any]:
    """Texts of all tasks, by the name of the task."""
    return tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))


def formula(draw: Callable[[Rng], tuple[Any, ...]], solution: Answer) -> Callable[[Rng], Case]:
    """Cases with arguments from `draw` and the correct answer from the function `solution`."""
    return lambda rng: ((args := draw(rng)), solution(*args))


def _arguments(args: tuple[Any, ...]) -> str:
    return f"for ({', '.join(map(_shown, args))})" if args else ""


def _kind(array: Any) -> str:
    return f"an array of shape {array.shape}" if array.shape else "a number"


def _shown(value: Any) -> str:
    """A value in a few digits; only the size of a long one."""
    if isinstance(value, pd.DataFrame):
        return f"a table of {len(value)} rows"
    if isinstance(value, np.ndarray | list | tuple) and np.size(value) > _MAX_SHOWN:
        return _kind(np.asarray(value))
    if isinstance(value, np.ndarray | list | tuple | float | int | np.number):
        return str(np.round(np.asarray(value), 4).tolist())
    return str(value)
