"""What one case gave, and how a case is run."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fantoccini.errors import FantocciniError
from fantoccini.marionette import Marionette
from fantoccini.sweeps.case import PUPPET, Case

Study = Callable[[Case], Mapping[str, Any]]

_LONGEST = 20_000
"""Most that is kept of a traceback [characters]."""
_building = threading.Lock()
"""Equations are derived by one thread at a time."""


@dataclass(frozen=True)
class Failure:
    """Why a case has no figures.

    Attributes:
        error: name of the exception, or ``WorkerDied``.
        message: its words.
        trace: its traceback.
    """

    error: str
    message: str
    trace: str = ""

    def __str__(self) -> str:
        return f"{self.error}: {self.message}" if self.message else self.error

    @classmethod
    def of(cls, error: BaseException) -> Failure:
        """The failure of an exception that was just caught; our own frame is left out."""
        inner = error.__traceback__ and error.__traceback__.tb_next
        lines = traceback.format_exception(type(error), error, inner)
        return cls(type(error).__name__, str(error), "".join(lines)[-_LONGEST:])


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one case gave.

    Attributes:
        figures: name -> array, () for a number.
        seconds: how long it took [s].
        failure: why there are no figures, or None.
    """

    figures: dict[str, np.ndarray]
    seconds: float
    failure: Failure | None = None


@dataclass
class Job:
    """What every worker of a sweep needs.

    Attributes:
        study: the function to run.
        puppets: label -> marionette.
        names: of all values; figures have other names.
    """

    study: Study
    puppets: dict[str, Marionette]
    names: tuple[str, ...]
    _unusable: dict[str, FantocciniError] = field(default_factory=dict)

    def perform(self, case: Case) -> Outcome:
        """Runs one case. Whatever goes wrong in it is its outcome."""
        start = time.perf_counter()
        try:
            label = case.values.get(PUPPET)
            ready = case.on(None if label is None else self._ready(label))
            figures = figures_of(self.study(ready), self.names)
        except BaseException as error:
            return Outcome({}, time.perf_counter() - start, Failure.of(error))
        return Outcome(figures, time.perf_counter() - start)

    def _ready(self, label: str) -> Marionette:
        """A marionette that is compiled; one that cannot be is not tried for every case anew."""
        if "library" in vars(self.puppets[label]):
            return self.puppets[label]
        with _building:
            if label in self._unusable:
                raise self._unusable[label].with_traceback(None)
            try:
                self.puppets[label].compile()  # once, not by every case
            except FantocciniError as error:
                self._unusable[label] = error
                raise
            return self.puppets[label]


def figures_of(found: Any, names: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """What a study returned, as arrays.

    Args:
        found: name -> number, text or array of numbers.
        names: that figures cannot have.

    Raises:
        TypeError: it is something else, naming the figure.
    """
    if not isinstance(found, Mapping):
        raise TypeError(
            f"the study returned {found!r:.80}; it must return a dict: name -> number, text, array"
        )
    figures = {}
    for name, value in found.items():
        if not isinstance(name, str) or not name or name in names:
            raise TypeError(
                f"the study returned a figure called {name!r}; figures are named by texts other "
                f"than those of what is varied ({', '.join(names) or 'nothing'})"
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
