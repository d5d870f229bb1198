"""Influences on a performance besides targets: pushes on bodies, a law that moves the hands."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from fantoccini.base import Array, StateError, Vec3, VecD, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import link_inertia
from fantoccini.motion import State


class HandLaw(Protocol):
    """Moves the hands instead of their targets."""

    def acceleration(self, x: State) -> VecK:
        """(n_vK,) accelerations of the driven coordinates over the next tick.

        Args:
            x: the state, with the time of the performance.
        """

    def stop(self) -> None:
        """Ends what the law does beside the performance."""


class Push(NamedTuple):
    """A force on a point of a body.

    Attributes:
        at: (3,) from the body's centre of mass, in its frame [m].
        force: (3,) in the world [N].
    """

    at: Vec3
    force: Vec3


def push_on(marionette: Marionette, body: str, force: Vec3, at: Vec3 | None) -> Push:
    """A push on a point of a body, given in its frame [m]; its centre of mass when not given.

    Raises:
        UnknownNameError: no body is called that.
        StateError: numbers that are none.
    """
    link = marionette.tree.links[marionette.link_index(body)]
    com = link_inertia(link, marionette.number)[1]
    where = com if at is None else np.asarray(at, dtype=float)
    push = np.asarray(force, dtype=float)
    if where.shape != (3,) or push.shape != (3,) or not np.isfinite([where, push]).all():
        raise StateError(f"a push of {force!r} at {at!r}; needed: three finite numbers each")
    return Push(where - com, push)


class Influences:
    """A law and pushes, as a performance has them.

    Attributes:
        law: moves the hands instead of their targets; None where there is none.
        pushes: name of a body -> what pushes it.
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
        before, self.law = self.law, None
        if before is not None:
            before.stop()

    def forces(self, marionette: Marionette, x: State) -> VecD | None:
        """(n_vD,) generalised forces of the pushes; None without any."""
        if not self.pushes:
            return None
        wrenches: dict[str, Array] = {}
        for body, push in self.pushes.items():
            arm = marionette.pose(x, body)[:3, :3] @ push.at
            wrenches[body] = np.concatenate([push.force, np.cross(arm, push.force)])
        return marionette.wrench_forces(x, wrenches)
