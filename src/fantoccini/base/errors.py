"""All exceptions, and the statuses with which a run ends.

Errors compose their message from their arguments: subject, place, value found, values allowed, what
to do. A run that stops early returns a result with a :class:`Status`, or raises a
:class:`SimulationError`, which carries the trajectory up to the last accepted step.

A mistake is an error in a user's file, with its line; an outcome is the status of a search. A drive
is a motor that moves a coordinate, and redundant strings are more than the motion needs.
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
        # Exception.__reduce__ calls the class with its message; subclasses have other arguments.
        return _restored, (type(self), self.args, dict(self.__dict__))


def _restored(
    cls: type[FantocciniError], args: tuple[object, ...], attributes: dict[str, Any]
) -> FantocciniError:
    """Rebuilds an error from the result of :meth:`FantocciniError.__reduce__`."""
    error = cls.__new__(cls, *args)
    built_in = next(base for base in cls.__mro__ if base.__module__ == "builtins")
    built_in.__init__(error, *args)  # type: ignore[misc]  # the class is known at run time only
    error.__dict__.update(attributes)
    return error


@dataclass(frozen=True)
class Mistake:
    """One mistake in a user's file.

    Attributes:
        file: name of the file as the user gave it.
        line: 1-based line; None for a mistake of the whole file.
        key: path of the key, for example ``bodies[2].joint.axis``.
        message: value found and values allowed.
    """

    file: str
    line: int | None
    key: str
    message: str

    def __str__(self) -> str:
        location = self.file if self.line is None else f"{self.file}:{self.line}"
        return (
            f"{location}: {self.key}: {self.message}" if self.key else f"{location}: {self.message}"
        )


class FileError(FantocciniError):
    """A user's file contains mistakes; all are listed, in the order of the file."""

    def __init__(self, mistakes: Iterable[Mistake]):
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        return "\n".join(str(mistake) for mistake in self.mistakes)


class PuppetError(FileError):
    """A puppet file, or a puppet built in Python, is not valid."""


class InputError(FileError):
    """An inputs file, or inputs built in Python, cannot drive this puppet."""


class ExchangeError(FileError):
    """A puppet contains something that the format of another program cannot express."""


class MissingLibraryError(FantocciniError, ImportError):
    """An optional library is needed and not installed.

    Args:
        feature: feature that needs it.
        library: name of the library.
        extra: extra of fantoccini that installs it.
    """

    def __init__(self, feature: str, library: str, extra: str):
        super().__init__(
            f"{feature} needs {library}, which is not installed: pip install 'fantoccini[{extra}]'"
        )


class UnknownNameError(FantocciniError, KeyError):
    """A name that does not exist in the puppet.

    Args:
        kind: kind of thing that was looked up ("coordinate", "string", "body").
        found: the name that was given.
        allowed: the names that exist.
    """

    def __init__(self, kind: str, found: object, allowed: Iterable[str]):
        self.allowed = tuple(allowed)
        self.message = f"no {kind} is called {found!r}{did_you_mean(str(found), self.allowed)}"
        super().__init__(self.message)

    def __str__(self) -> str:
        return self.message


class StateError(FantocciniError, ValueError):
    """A state or value that the puppet cannot have, such as an overstretched string."""


class BuildError(FantocciniError):
    """The compiled model could not be built, cached or loaded."""


class StandError(FantocciniError):
    """A stand (motors and motion controllers that move the strings) cannot execute a request."""


class StreamError(StandError):
    """A controller refused a line of G-code, restarted, stopped answering, or was disconnected.

    Args:
        line: number of the line in the program, from 1.
        text: text of the line.
        reason: answer of the controller, or cause.
        controller: name of the controller, if the stand has several.
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
    STEP_TOO_SMALL = 4, "the step size fell below the rounding error of the time"
    TOO_MANY_EVENTS = 5, "strings came taut and slack more often than the limit on events"
    TOO_MANY_STEPS = 6, "the bound on the number of steps was reached"
    NOT_FINITE = 7, "a state or a force is no longer a finite number"
    COLLAPSED = 8, "two neighbouring points of a taut string came together"
    LENGTH_NOT_POSITIVE = 9, "a string's length was driven to zero or below"
    PROJECTION_FAILED = 10, "the strings could not be brought back to their lengths"
    STOPPED = 11, "the run was stopped from outside"
    SINGULAR_MASS = 12, "the mass matrix is singular: a joint moves no mass"
    NOT_SETTLED = 13, "the solution of a step's equations did not converge"
    LOST_STEPS = 14, "a stepper motor lost steps; the run continued to its end"
    RUNAWAY = (
        15,
        (
            "a load moved a drive against the full torque of its motor or controller; the run ends "
            "early if the drive moved too far"
        ),
    )
    TOO_MANY_SAMPLES = 16, "the samples of the run reached the bound on memory"
    REDUNDANT_STRINGS = 17, "the lengths of redundant strings are inconsistent"
    OVERSTEPPED = 18, "the run went on, but strings, limits or contacts were violated"
    GAINED_ENERGY = 19, "the run went on, but the fixed step made energy out of nothing"
    TOO_MANY_CONTACTS = 20, "more points touched at once than a step has room for"
    NO_UNIQUE_MOTION = 21, "friction jams (Painlevé): no finite contact force, or several"
    UNBALANCED = 22, "the run went on, but the energy balance of the fixed steps has a residual"
    OUT_OF_TIME = 23, "the time limit on computing ended the run"


class Outcome(enum.Enum):
    """Base of the outcomes of searches; each value is a message."""

    @property
    def message(self) -> str:
        """The outcome as a sentence."""
        return str(self.value)


ARRIVED = (Status.DONE, Status.LOST_STEPS, Status.RUNAWAY)
"""Statuses of compiled runs that reached their end; with ``RUNAWAY`` some end early.

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
        trajectory: run up to the last accepted step; None if no step was accepted. None also for a
            :class:`Stepper`, which keeps the last state itself.
    """

    def __init__(self, status: Status, detail: str = "", trajectory: Any = None):
        self.status = status
        self.trajectory = trajectory
        super().__init__(f"{status.message}{': ' + detail if detail else ''}")


class PictureError(FantocciniError):
    """A picture could not be written."""


class StoreError(FantocciniError):
    """A sweep's cases cannot be stored: the folder is another sweep's or user's, or is full."""


class SweepStopped(FantocciniError):
    """A sweep was stopped from outside, for example by Ctrl-C.

    Attributes:
        result: result with the finished cases.
    """

    def __init__(self, message: str, result: Any):
        self.result = result
        super().__init__(message)


def did_you_mean(found: str, allowed: Iterable[str]) -> str:
    """Clause that ends a message about a wrong name: "; did you mean 'x'?", or the valid names.

    Args:
        found: invalid name.
        allowed: valid names.
    """
    names = sorted(set(allowed))
    most_similar = difflib.get_close_matches(found, names, n=1)
    if most_similar:
        return f"; did you mean {most_similar[0]!r}?"
    if not names:
        return "; there are none"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"; the names are {shown}"
