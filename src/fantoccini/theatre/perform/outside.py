"""What acts on a performance besides targets: pushes on bodies, and a law that moves the hands."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from threading import RLock
from typing import NamedTuple, Protocol

import numpy as np

from fantoccini.base import Array, ConfigK, StateError, Vec3, VecD, VecK
from fantoccini.dynamics.compiled import link_index
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import link_inertia
from fantoccini.motion import State
from fantoccini.theatre.perform.hands import HandBounds, Hands
from fantoccini.theatre.perform.player import Player


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
    model = marionette.model
    link = model.tree.links[link_index(model, body)]
    com = link_inertia(link, model.number)[1]
    where = com if at is None else np.asarray(at, dtype=float)
    push = np.asarray(force, dtype=float)
    if where.shape != (3,) or push.shape != (3,) or not np.isfinite([where, push]).all():
        raise StateError(f"a push of {force!r} at {at!r}; needed: three finite numbers each")
    return Push(where - com, push)


def forces_of(marionette: Marionette, x: State, pushes: Mapping[str, Push]) -> VecD | None:
    """(n_vD,) generalised forces of pushes; None without any."""
    if not pushes:
        return None
    wrenches: dict[str, Array] = {}
    for body, push in pushes.items():
        arm = marionette.pose(x, body)[:3, :3] @ push.at
        wrenches[body] = np.concatenate([push.force, np.cross(arm, push.force)])
    return marionette.wrench_forces(x, wrenches)


class Steered(ABC):
    """A performance as what acts on it from outside sees it."""

    marionette: Marionette
    tick: float
    _lock: RLock
    _hands: Hands
    _wanted: ConfigK
    _player: Player
    _law: HandLaw | None
    _pushes: dict[str, Push]

    @property
    @abstractmethod
    def recording(self) -> bool:
        """Whether what happens is recorded."""

    @property
    def bounds(self) -> HandBounds:
        """Bounds of the driven coordinates, one by one."""
        return self._hands.each()

    @property
    def law(self) -> HandLaw | None:
        """What moves the hands instead of their targets."""
        return self._law

    def let(self, law: HandLaw | None) -> None:
        """Lets a law move the hands, such as a :class:`Balance`, within their bounds and grip.

        None gives them back to their targets, which are where they are. So does a reset, and
        another puppet.
        """
        before, self._law = self._law, None
        if before is not None:
            before.stop()  # without the lock, which its thread may wait for
        with self._lock:
            if law is not None:
                self._player.clear()
            self._law = law

    @property
    def pushes(self) -> dict[str, Push]:
        """The pushes on bodies, by name."""
        with self._lock:
            return dict(self._pushes)

    def push(self, body: str, force: Vec3 | None, at: Vec3 | None = None) -> None:
        """Pushes a body until further notice.

        Args:
            body: its name.
            force: (3,) in the world [N]; None ends the push.
            at: (3,) where, in the body's frame [m]; at its centre of mass when not given.

        Raises:
            UnknownNameError: no body is called that.
            StateError: numbers that are none; or there is a recording, which keeps no pushes.
        """
        made = push_on(self.marionette, body, np.zeros(3) if force is None else force, at)
        with self._lock:
            if force is None:
                self._pushes.pop(body, None)
                return
            if self.recording:
                raise StateError("a recording keeps no pushes; stop it first")
            self._pushes[body] = made

    def _refuse_targets(self) -> None:
        if self._law is not None:
            raise StateError("a law moves the hands; they take no targets until let(None)")
