"""All exceptions, and the statuses with which a run ends.

An error takes facts and writes the sentence: subject, place, value found, values allowed, remedy.
A run that stops early returns a result with a :class:`Status`, or raises a
:class:`SimulationError`, which carries the trajectory up to the last accepted step.
"""

from __future__ import annotations

import difflib
import enum
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


class FantocciniError(Exception):
    """Base of all exceptions of fantoccini. Copies and pickles keep all attributes."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Exception.__reduce__ calls the class with `args`, the sentence; subclasses take facts.
        return _restored, (type(self), self.args, dict(self.__dict__))


def _restored(
    cls: type[FantocciniError], args: tuple[object, ...], facts: dict[str, Any]
) -> FantocciniError:
    """Rebuilds an error from the result of :meth:`FantocciniError.__reduce__`."""
    error = cls.__new__(cls, *args)
    built_in = next(base for base in cls.__mro__ if base.__module__ == "builtins")
    built_in.__init__(error, *args)  # type: ignore[misc]  # the class is known at run time only
    error.__dict__.update(facts)
    return error


@dataclass(frozen=True)
class Mistake:
    """One mistake in a user's file.

    Attributes:
        file: name of the file as the user gave it.
        line: 1-based line; None for a mistake of the whole file.
        key: path of the key, for example ``bodies[2].joint.axis``.
        message: value found, values allowed.
    """

    file: str
    line: int | None
    key: str
    message: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.key}: {self.message}" if self.key else f"{place}: {self.message}"


class FileError(FantocciniError):
    """A user's file contains mistakes; all are listed, in the order of the file."""

    def __init__(self, mistakes: Iterable[Mistake]):
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        return "\n".join(str(p) for p in self.mistakes)


class PuppetError(FileError):
    """A puppet file, or a puppet built in Python, is not valid."""


class InputError(FileError):
    """An inputs file, or inputs built in Python, cannot drive this puppet."""


class ExchangeError(FileError):
    """A puppet contains something that the format of another program cannot express."""


class MissingLibraryError(FantocciniError, ImportError):
    """An optional library is needed and not installed.

    Args:
        what: feature that needs it.
        library: name of the library.
        extra: extra of fantoccini that installs it.
    """

    def __init__(self, what: str, library: str, extra: str):
        super().__init__(
            f"{what} needs {library}, which is not installed: pip install 'fantoccini[{extra}]'"
        )


class UnknownNameError(FantocciniError, KeyError):
    """A name that does not exist in the puppet.

    Args:
        what: kind of thing that was looked up ("coordinate", "string", "body").
        found: the name that was given.
        allowed: the names that exist.
    """

    def __init__(self, what: str, found: object, allowed: Iterable[str]):
        self.allowed = tuple(allowed)
        self.message = f"no {what} is called {found!r}{nearest(str(found), self.allowed)}"
        super().__init__(self.message)

    def __str__(self) -> str:
        return self.message


class StateError(FantocciniError, ValueError):
    """A state or value that the puppet cannot have, such as a string longer than its length."""


class BuildError(FantocciniError):
    """The compiled model could not be built, cached or loaded."""


class StandError(FantocciniError):
    """A stand or its controller cannot execute a request."""


class StreamError(StandError):
    """A controller refused a line, restarted, does not answer, or is no longer connected.

    Args:
        line: number of the line in the file, from 1.
        text: text of the line.
        reason: answer of the controller, or cause.
        controller: name of the controller among several.
    """

    def __init__(self, line: int, text: str, reason: str, controller: str = ""):
        self.line, self.text, self.reason, self.controller = line, text, reason, controller
        name = f"{controller}: " if controller else ""
        super().__init__(f"{name}line {line}: {text!r}: {reason}")


class PacketError(StandError):
    """Set points no longer reach a controller on a network.

    Args:
        t: time of the last set points [s].
        reason: cause.
    """

    def __init__(self, t: float, reason: str):
        self.t, self.reason = t, reason
        super().__init__(f"t = {t:.3f} s: {reason}")


class Status(enum.IntEnum):
    """End of a run, with a message. Compiled code has the same numbers (``contract.hpp``)."""

    def __new__(cls, value: int, message: str = "") -> Status:
        member = int.__new__(cls, value)
        member._value_ = value
        member.message = message
        return member

    message: str

    def __str__(self) -> str:
        return self.message

    DONE = 0, "the run reached its end"
    RUNNING = 1, "the run has not reached its end yet"
    IMPOSSIBLE_INPUT = 2, "the inputs ask for a motion that no puppet on these strings can follow"
    TENSION_CAP = 3, "a tension exceeded the largest one that a string may have"
    STEP_TOO_SMALL = 4, "the step size fell below what the clock can resolve"
    TOO_MANY_EVENTS = 5, "strings caught and released more often than the bound on events"
    TOO_MANY_STEPS = 6, "the bound on the number of steps was reached"
    NOT_FINITE = 7, "a state or a force is no longer a finite number"
    COLLAPSED = 8, "two neighbouring points of a taut string came together"
    LENGTH_NOT_POSITIVE = 9, "a string's length was driven to zero or below"
    PROJECTION_FAILED = 10, "the strings could not be brought back to their lengths"
    STOPPED = 11, "the run was stopped from outside"
    SINGULAR_MASS = 12, "the mass matrix is singular: a joint moves no mass"
    NOT_SETTLED = 13, "the equations of a step could not be solved"
    LOST_STEPS = 14, "a stepper lost steps on the way; the run went on to its end"
    RUNAWAY = (
        15,
        (
            "a load dragged a drive away although its motor or controller gave all it can; the run "
            "ends early where it is gone too far"
        ),
    )
    TOO_MANY_SAMPLES = 16, "the samples of the run reached the bound on memory"
    REDUNDANT_STRINGS = 17, "redundant strings contradict one another"
    OVERSTEPPED = 18, "the run went on, but strings, limits or contacts were overstepped"
    GAINED_ENERGY = 19, "the run went on, but the fixed step made energy out of nothing"
    TOO_MANY_CONTACTS = 20, "more points touched at once than a step has room for"
    NO_UNIQUE_MOTION = 21, "friction jams what slides (Painlevé): no finite force, or several"
    UNBALANCED = 22, "the run went on, but the ledger of the fixed steps does not balance"
    OUT_OF_TIME = 23, "the time limit on computing ended the run"


class Outcome(enum.Enum):
    """Base of the outcomes of searches; each value is a message."""

    @property
    def message(self) -> str:
        """The outcome as a sentence."""
        return str(self.value)


ARRIVED = (Status.DONE, Status.LOST_STEPS, Status.RUNAWAY)
"""Statuses of compiled runs that may have reached their end; ``RUNAWAY`` may end early.

Only ``DONE`` means success.
"""

UNSOUND = (Status.OVERSTEPPED, Status.GAINED_ENERGY, Status.UNBALANCED)
"""Statuses of runs in fixed steps that went on, with wrong results.

They are assigned later, by checks of the results.
"""


class SimulationError(FantocciniError):
    """A run stopped before its end.

    Attributes:
        status: reason.
        trajectory: run up to the last accepted step; None if no step was accepted, and for
            steppers, whose ``state`` is the last one.
    """

    def __init__(self, status: Status, detail: str = "", trajectory: Any = None):
        self.status = status
        self.trajectory = trajectory
        super().__init__(f"{status.message}{': ' + detail if detail else ''}")


class PictureError(FantocciniError):
    """A picture could not be written."""


class StoreError(FantocciniError):
    """A folder that cannot store a sweep's cases: another sweep's, another user's, or full."""


class SweepStopped(FantocciniError):
    """A sweep was stopped from outside, for example by Ctrl-C.

    Attributes:
        result: result with the finished cases.
    """

    def __init__(self, message: str, result: Any):
        self.result = result
        super().__init__(message)


def nearest(found: str, allowed: Iterable[str]) -> str:
    """The end of a message: the most similar valid name, or a list of the valid names.

    Args:
        found: invalid name.
        allowed: valid names.
    """
    names = sorted(set(allowed))
    close = difflib.get_close_matches(found, names, n=1)
    if close:
        return f"; did you mean {close[0]!r}?"
    if not names:
        return "; there are none"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"; the names are {shown}"
