"""Run of one case, and its outcome.

A case is one combination of values of a sweep; its figures are the numbers that the study returned
for it.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fantoccini.base import FantocciniError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.sweeps.case import PUPPET_KEY, Case

Study = Callable[[Case], Mapping[str, Any]]

MAX_TRACE_LENGTH = 20_000
"""Largest length of a traceback, of which the end is kept [characters]."""
_compile_lock = threading.Lock()
"""Lock with which only one thread at a time compiles puppets."""


@dataclass(frozen=True)
class Failure:
    """Exception that ended a case.

    Attributes:
        error: name of the exception, or ``WorkerDied``.
        message: message of the exception.
        trace: its traceback.
    """

    error: str
    message: str
    trace: str = ""

    def __str__(self) -> str:
        return f"{self.error}: {self.message}" if self.message else self.error

    @classmethod
    def from_exception(cls, error: BaseException) -> Failure:
        """Failure for a caught exception; its traceback is without the frame that caught it."""
        inner = error.__traceback__ and error.__traceback__.tb_next
        lines = traceback.format_exception(type(error), error, inner)
        return cls(type(error).__name__, str(error), "".join(lines)[-MAX_TRACE_LENGTH:])


@dataclass(frozen=True, eq=False)
class Outcome:
    """The outcome of one case.

    Attributes:
        figures: name -> array; shape () for a number.
        seconds: duration [s].
        failure: the exception of a case without figures, or None.
    """

    figures: dict[str, np.ndarray]
    seconds: float
    failure: Failure | None = None


@dataclass
class Job:
    """Study and puppets of a sweep, for its workers.

    Attributes:
        study: the function to run.
        puppets: label -> marionette.
        names: names of all values; figures must have other names.
    """

    study: Study
    puppets: dict[str, Marionette]
    names: tuple[str, ...]
    _compiled: set[str] = field(default_factory=set)
    _errors: dict[str, FantocciniError] = field(default_factory=dict)

    def run(self, case: Case) -> Outcome:
        """Runs one case. An exception becomes its outcome."""
        start = time.perf_counter()
        try:
            label = case.values.get(PUPPET_KEY)
            case_with_puppet = case.with_marionette(
                None if label is None else self._marionette(label)
            )
            figures = as_figures(self.study(case_with_puppet), self.names)
        except BaseException as error:
            return Outcome({}, time.perf_counter() - start, Failure.from_exception(error))
        return Outcome(figures, time.perf_counter() - start)

    def _marionette(self, label: str) -> Marionette:
        """A compiled marionette; a failed compilation is not repeated for every case."""
        if label in self._compiled:
            return self.puppets[label]
        with _compile_lock:
            if label in self._errors:
                raise self._errors[label].with_traceback(None)
            try:
                self.puppets[label].compile()
            except FantocciniError as error:
                self._errors[label] = error
                raise
            self._compiled.add(label)
            return self.puppets[label]


def as_figures(returned: Any, names: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """The dict that a study returned, as arrays.

    Args:
        returned: name -> number, text or array of numbers.
        names: names of values, which figures must not have.

    Raises:
        TypeError: it is something else; the message names the figure.
    """
    if not isinstance(returned, Mapping):
        raise TypeError(
            f"the study returned {returned!r:.80}; it must return a dict: name -> number, text, "
            "array"
        )
    figures = {}
    for name, value in returned.items():
        if not isinstance(name, str) or not name or name in names:
            raise TypeError(
                f"the study returned a figure called {name!r}; the name must be a text, and "
                f"not that of a varied value ({', '.join(names) or 'there are none'})"
            )
        try:
            array = np.array(value)
        except ValueError as error:
            raise TypeError(f"the figure {name!r} is not an array of numbers: {error}") from None
        if array.dtype.kind not in "biufcU":
            raise TypeError(
                f"the figure {name!r} is {value!r:.80}; figures are numbers, texts and arrays"
            )
        figures[name] = array
    return figures
