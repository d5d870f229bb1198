"""Influences on a performance apart from targets: pushes on bodies, a law of the hands.

A law of the hands computes their motion from the state, as a controller does. v_D and v_K are the
dynamic and driven velocities, and n_vD, n_vK their numbers.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from fantoccini.base import Array, StateError, Vec3, VecD, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import link_inertia
from fantoccini.motion import State


class HandLaw(Protocol):
    """Law that moves the hands instead of their targets."""

    def acceleration(self, x: State) -> VecK:
        """(n_vK,) accelerations of the driven coordinates over the next tick.

        Args:
            x: state, with the time of the performance.
        """

    def stop(self) -> None:
        """Ends the law's activity outside the performance, such as a thread."""


class Push(NamedTuple):
    """A force on a point of a body.

    Attributes:
        at: (3,) point relative to the body's centre of mass, in its frame [m].
        force: (3,) force in the world [N].
    """

    at: Vec3
    force: Vec3


def make_push(marionette: Marionette, body: str, force: Vec3, at: Vec3 | None) -> Push:
    """Push on a point of a body, given in its frame [m]; at its centre of mass by default.

    Raises:
        UnknownNameError: no body has this name.
        StateError: a vector does not consist of three finite numbers.
    """
    link = marionette.tree.links[marionette.link_index(body)]
    com = link_inertia(link, marionette.number)[1]
    point = com if at is None else np.asarray(at, dtype=float)
    force_vector = np.asarray(force, dtype=float)
    if (
        point.shape != (3,)
        or force_vector.shape != (3,)
        or not np.isfinite([point, force_vector]).all()
    ):
        raise StateError(f"a push of {force!r} at {at!r}; needed: three finite numbers each")
    return Push(point - com, force_vector)


class Influences:
    """Law and pushes of a performance.

    Attributes:
        law: moves the hands instead of their targets; None if there is none.
        pushes: name of a body -> push on it.
    """

    def __init__(self) -> None:
        self.law: HandLaw | None = None
        self.pushes: dict[str, Push] = {}

    def clear(self) -> None:
        """Ends the law and all pushes."""
        self.end_law()
        self.pushes.clear()

    def end_law(self) -> None:
        """Ends the law."""
        law, self.law = self.law, None
        if law is not None:
            law.stop()

    def forces(self, marionette: Marionette, x: State) -> VecD | None:
        """(n_vD,) generalised forces of the pushes; None without any."""
        if not self.pushes:
            return None
        wrenches: dict[str, Array] = {}
        for body, push in self.pushes.items():
            arm = marionette.pose(x, body)[:3, :3] @ push.at
            wrenches[body] = np.concatenate([push.force, np.cross(arm, push.force)])
        return marionette.wrench_forces(x, wrenches)
