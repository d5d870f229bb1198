"""What acts on a performance besides targets: pushes on bodies, and a law that moves the hands."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from threading import RLock
from typing import NamedTuple, Protocol

import numpy as np

from fantoccini.arrays import Array, ConfigK, Vec3, VecD, VecK
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.gestures import Gesture
from fantoccini.marionette import Marionette, link_index
from fantoccini.motion import State
from fantoccini.motion.binding import check_same_puppet
from fantoccini.motion.pieces import channel_names
from fantoccini.perform.hands import HandBounds, Hands
from fantoccini.perform.player import Player
from fantoccini.perform.recording import Recording
from fantoccini.tree import link_inertia


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

    # -- what is played on top ---------------------------------------------------------------

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of the gestures that are played, or are about to be."""
        with self._lock:
            return self._player.playing

    def play(
        self, gesture: Gesture, *, after: float | None = None, again: bool = False
    ) -> float:
        """Plays a gesture on top of what the hands hold; returns after how long it begins [s].

        Offsets of several gestures add up. One that moves all that another moves takes over from
        it, and so does one that ends in a place of its own from another that does, as sitting from
        kneeling: position and velocity never jump. A gesture that would pass the hands' bounds is
        played slower.

        Args:
            gesture: of this puppet.
            after: time after which it is to begin, as on a beat [s]; it begins later if the way to
                its start takes longer.
            again: begin again at its end, until :meth:`play_once`.

        Raises:
            StateError: a law moves the hands.
            ValueError: it is of another puppet.
        """
        check_same_puppet([self.marionette.coordinates, gesture.coordinates])
        with self._lock:
            self._refuse_targets()
            player = self._player
            on = None if after is None else player.t + after
            return player.play(gesture, on=on, again=again) - player.t

    def play_once(self, name: str) -> None:
        """Lets a gesture end that begins again and again."""
        with self._lock:
            self._player.once(name)

    def go_home(self, duration: float = 0.5) -> None:
        """Takes back all gestures: the hands go where they hold the puppet.

        Args:
            duration: of the rest there, during which nothing else is played [s].
        """
        self.play(Gesture.rest(self.marionette, duration))

    @property
    def lanes(self) -> tuple[str, ...]:
        """What can be armed for an overdub: strings and joints with driven coordinates."""
        names = channel_names(self.marionette.coordinates)
        return tuple(dict.fromkeys(name.rsplit(".", 1)[0] for name in names))

    @property
    def take_time(self) -> float | None:
        """How far the take that is played has come [s]; None without one."""
        with self._lock:
            player = self._player
            return None if player.take is None else player.take.time(player.t)

    def play_take(
        self, take: Recording, *, armed: Collection[str] = (), again: bool = False
    ) -> None:
        """Takes the puppet to the start of a take, and moves the hands as the take does.

        With :meth:`record` this is an overdub: armed lanes are in the hands, the others repeat the
        take. At its end the hands stay where they are.

        Args:
            take: of this puppet.
            armed: lanes that the take does not move.
            again: begin again at its end, joined by state, until :meth:`stop_take`.

        Raises:
            StateError: a law moves the hands; or the take turns a driven body by nearly 180
                degrees or more.
            UnknownNameError: no lane is called that.
            ValueError: it is of another puppet.
        """
        for name in armed:
            if name not in self.lanes:
                raise UnknownNameError("lane", name, list(self.lanes))
        check_same_puppet([self.marionette.coordinates, take.marionette.coordinates])
        motion = Gesture.of_input(take.inputs, name="take")
        free = np.array(motion.named)
        for name, (_, v) in channel_names(motion.coordinates).items():
            free[v] &= name.rsplit(".", 1)[0] not in armed
        motion = dataclasses.replace(motion, named=free, coef=motion.coef * free[:, None])
        with self._lock:
            self._refuse_targets()
            self._go_to(take.start)
            self._player.play_take(motion, take.start.v_K, again)

    def stop_take(self) -> None:
        """Ends the take; the hands stop where they are."""
        with self._lock:
            self._fold(self._player.stop_take())

    @abstractmethod
    def _go_to(self, x: State) -> None:
        """Continues from another state of the puppet, with the hands there."""

    def _fold(self, d: VecK) -> None:
        """Makes offsets part of the targets."""
        if d.any():
            self._wanted = self._hands.moved(self._wanted, d)

    def _velocity(self, x: State) -> VecK:
        """(n_vK,) velocities that targets, and what is played on top of them, want."""
        player = self._player
        if player.idle:
            return self._hands.wanted_velocity(x, self._wanted, self.tick)
        velocity = self._hands.wanted_velocity(x, self._wanted, self.tick, player.step())
        self._fold(player.settle())
        return velocity

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
