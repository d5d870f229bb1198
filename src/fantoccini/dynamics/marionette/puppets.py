"""The puppets and scenes that come with fantoccini: ``fan.puppets.arm2d()`` is a marionette.

Every function has the arguments of :func:`fantoccini.load` except the path.

A scene may contain several puppets.
"""

from __future__ import annotations

from fantoccini.base import OnProgress
from fantoccini.dynamics.marionette.loading import StringModel, load
from fantoccini.dynamics.marionette.marionette import Marionette
from fantoccini.model.puppet import (
    names as names,
    path as path,
    performance as performance,
    performances as performances,
    scenes as scenes,
)


def airplane(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The full marionette on an airplane control: main bar, rocking leg bar and hand bar."""
    return load(path("airplane"), progress, string_model=string_model)


def arm2d(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The planar arm of the paper's Fig. 2: two links whose tip hangs on one string."""
    return load(path("arm2d"), progress, string_model=string_model)


def arm3d(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The arm of the paper's Fig. 4: ball joint, hinge and one string to the hand."""
    return load(path("arm3d"), progress, string_model=string_model)


def crane(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A gantry crane: a driven trolley, a winch on it and the load."""
    return load(path("crane"), progress, string_model=string_model)


def dachshund(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A dachshund on eight strings: four legs, a waist and a tail."""
    return load(path("dachshund"), progress, string_model=string_model)


def dragon(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A dragon on eleven strings: four legs, two wings, a long neck and tail."""
    return load(path("dragon"), progress, string_model=string_model)


def hans(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A boy on eight strings: another build than the marionette, with a waist."""
    return load(path("hans"), progress, string_model=string_model)


def heron(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A heron on eight strings: two long legs, two wings and a neck that bends."""
    return load(path("heron"), progress, string_model=string_model)


def marionette(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The full marionette of the paper's Fig. 3: 25 DOF on seven strings."""
    return load(path("marionette"), progress, string_model=string_model)


def marionette_bar(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The full marionette on a control bar, which is its only input."""
    return load(path("marionette_bar"), progress, string_model=string_model)


def promenade(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A scene: the marionette on a floor that carries it."""
    return load(path("promenade"), progress, string_model=string_model)


def stand6(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The paper's prototype stand of Fig. 1: six winches at fixed places."""
    return load(path("stand6"), progress, string_model=string_model)


def string_pendulum(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A point mass on a string, which flies when the string is slack."""
    return load(path("string_pendulum"), progress, string_model=string_model)


def stroll(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A scene: the marionette on its control bar, on a floor that carries it."""
    return load(path("stroll"), progress, string_model=string_model)


def visit(
    progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """A scene: two marionettes, a table with a ball, and a chair."""
    return load(path("visit"), progress, string_model=string_model)
