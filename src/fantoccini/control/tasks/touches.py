"""Touches of a plan: allowed pairs, required pairs at the goal, and pairs that must stay apart.

A touch is here a contact of two parts; the gap is the distance between them. q_D are dynamic and
q_K driven coordinates. A marionette is a puppet with its compiled equations; `marionette.puppet` is
the description in its file. A link is a body on its joint.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import Contacts
from fantoccini.motion import EventRecord, Trajectory

KEEP_OFF = "keep off"
"""Nothing is touched: the default of :class:`fantoccini.control.Problem`."""

Pair: TypeAlias = "tuple[str, str] | Sequence[str]"
"""Two names: of bodies, props, obstacles, ``floor``, or of a puppet for all of its bodies."""

ContactLike: TypeAlias = "str | Mapping[str, Iterable[Pair]]"
"""``"keep off"``, or ``{"touch": [("hand", "table")]}``: the pairs that may touch."""

_SPEED_STEPS = 3
"""Time steps before a touch over which its speed is measured."""
_MAX_TOUCHING_GAP = 1e-6
"""Largest gap at which parts that must stay apart count as touching [m]."""
_MAX_GAP = 100.0
"""Largest gap of a required touch that is measured [m]."""


@dataclass(frozen=True)
class TouchEvent:
    """A touch of two parts in a run.

    Attributes:
        parts: their names.
        t: time of the first touch [s].
        speed: closing speed at the first touch [m/s].
        allowed: whether the plan may touch there.
        force: force between them at the end of the run [N].
    """

    parts: tuple[str, str]
    t: float
    speed: float
    allowed: bool
    force: float

    def __str__(self) -> str:
        return f"{' touches '.join(self.parts)} at {self.t:.3g} s with {self.speed:.2g} m/s"


class TouchRules:
    """The contact pairs of a puppet, sorted into those that may touch and those kept apart.

    Parts that belong to no puppet, such as props and the floor, may always touch one another. So
    may bodies of one puppet, unless `self_collision` is set.

    Attributes:
        marionette: the puppet.
        required: pairs that must touch at the goal.
        may_touch: (n_pairs,) bool, the pairs of ``marionette.contacts`` that may touch.
        touch_index: (n_pairs,) index in ``required`` of every pair; -1 for other pairs.

    Args:
        marionette: the puppet.
        contact: the pairs that may touch.
        required: pairs that must touch at the goal; they may touch before.
        self_collision: whether bodies of one puppet are kept apart.

    Raises:
        StateError: required touch that the puppet's rules of contact exclude.
        UnknownNameError: name of a part that cannot touch anything.
    """

    def __init__(
        self,
        marionette: Marionette,
        contact: ContactLike = KEEP_OFF,
        required: Iterable[Pair] = (),
        self_collision: bool = False,
    ):
        self.marionette = marionette
        self.required = tuple(pair_of(names) for names in required)
        self.may_touch = np.zeros(len(self.names), dtype=bool)
        self.touch_index = np.full(len(self.names), -1, dtype=np.int32)
        for pair in pairs_of(contact):
            self.may_touch |= touching(marionette, pair)
        for k, pair in enumerate(self.required):
            is_selected = touching(marionette, pair)
            self.may_touch |= is_selected
            self.touch_index[is_selected] = k
        for k, (first, second) in enumerate(self.names):
            same_puppet = bool(self._bodies & {first, second}) and not self._is_foreign(
                first, second
            )
            self.may_touch[k] |= not self._bodies & {first, second} or (
                same_puppet and not self_collision
            )

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """The names of all contact pairs."""
        return () if self.contacts is None else self.contacts.names

    @property
    def contacts(self) -> Contacts | None:
        """The contact pairs; None for a puppet without contact."""
        return self.marionette.contacts

    @cached_property
    def allowed_pairs(self) -> frozenset[frozenset[str]]:
        """The names of pairs that may touch."""
        names = [frozenset(pair) for pair in self.names]
        forbidden = {
            pair for pair, is_allowed in zip(names, self.may_touch, strict=True) if not is_allowed
        }
        return frozenset(names) - forbidden

    @cached_property
    def expected(self) -> bool:
        """Whether any pair may touch, other than two bodies of one puppet."""
        return any(
            is_allowed and (self._is_foreign(*pair) or not self._bodies & set(pair))
            for pair, is_allowed in zip(self.names, self.may_touch, strict=True)
        )

    def partners(self, prop: str) -> tuple[str, ...]:
        """The bodies of puppets that may touch a prop."""
        names = {name for pair in self.allowed_pairs if prop in pair for name in pair}
        return tuple(sorted(names & self._bodies))

    @cached_property
    def _required_contacts(self) -> tuple[Contacts, Indices] | None:
        """The required contact pairs, and the index of the touch that each belongs to."""
        if self.contacts is None or not self.required:
            return None
        is_selected = self.touch_index >= 0
        return self.contacts.subset(is_selected), self.touch_index[is_selected]

    def forbidden_touch(self, q_D: Array, q_K: Array) -> tuple[str, str] | None:
        """Two parts that touch at a configuration although they must not; None without any."""
        if self.contacts is None or np.all(self.may_touch):
            return None
        forbidden, marionette = self.contacts.subset(~self.may_touch), self.marionette
        gaps = marionette.library.gaps(forbidden, q_D, q_K, marionette.p)
        nearest = int(np.argmin(gaps))
        return forbidden.names[nearest] if gaps[nearest] <= _MAX_TOUCHING_GAP else None

    def gaps(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_required) gaps of the required touches; negative where parts overlap [m].

        Args:
            q_D, q_K: (..., n_qD) dynamic and (..., n_qK) driven (kinematic) configurations.
        """
        shape = q_D.shape[:-1]
        touch_gaps = np.full((*shape, len(self.required)), _MAX_GAP)
        if self._required_contacts is None:
            return touch_gaps
        contacts, touch = self._required_contacts
        q_K = np.broadcast_to(q_K, (*shape, q_K.shape[-1]))
        marionette = self.marionette
        gaps = marionette.library.gaps(contacts, q_D, q_K, marionette.p, _MAX_GAP)
        for k in range(len(self.required)):
            touch_gaps[..., k] = np.minimum(np.min(gaps[..., touch == k], axis=-1), _MAX_GAP)
        return touch_gaps

    def touch_events(self, run: Trajectory) -> tuple[TouchEvent, ...]:
        """The pairs of parts that began to touch in a run or push at its end, in order of time.

        Pairs within one puppet, and pairs without a puppet, are left out.
        """
        events: dict[frozenset[str], EventRecord | None] = {}
        for record in run.events:
            if record.kind == "touch":
                events.setdefault(frozenset(record.name.split("|")), record)
        if run.contact is None:
            return ()
        last_contacts = run.contact.at_sample(len(run) - 1)
        for k in set(last_contacts.pair.tolist()):
            events.setdefault(frozenset(last_contacts.names[k]), None)
        touch_events = []
        for names, event in events.items():
            first, second = (*names, *names)[:2]
            if not self._is_foreign(first, second):
                continue
            force = float(np.sum(last_contacts.involving(first, second).normal_force))
            t = float(run.t[0]) if event is None else event.t
            speed = 0.0 if event is None else event.speed or self._speed(run, names, event.t)
            parts = (first, second) if first in self._bodies else (second, first)
            touch_events.append(TouchEvent(parts, t, speed, names in self.allowed_pairs, force))
        return tuple(sorted(touch_events, key=lambda touch: touch.t))

    def _speed(self, run: Trajectory, names: frozenset[str], t: float) -> float:
        """The closing speed of two parts by time-stepping, from their gaps in the steps before.

        The step of the touch and the one before it are already slowed down.
        """
        assert self.contacts is not None  # or nothing touches
        last = int(np.searchsorted(run.t, t))
        steps = np.arange(max(0, last - _SPEED_STEPS), last + 1)
        contacts = self.contacts.subset(np.array([frozenset(n) == names for n in self.names]))
        q_D, q_K, marionette = run.q_D[steps], run.q_K[steps], self.marionette
        gaps = np.min(marionette.library.gaps(contacts, q_D, q_K, marionette.p, _MAX_GAP), axis=-1)
        return float(np.max(-np.diff(gaps) / np.diff(run.t[steps]), initial=0.0))

    @cached_property
    def _bodies(self) -> set[str]:
        puppet = self.marionette.puppet
        return {body.name for body in puppet.expanded().bodies} - set(puppet.props)

    def _is_foreign(self, first: str, second: str) -> bool:
        """Whether a body of a puppet meets a part that is not its own."""
        puppet = self.marionette.puppet
        if not self._bodies & {first, second}:
            return False
        return not (
            self._bodies >= {first, second} and puppet.member_of(first) == puppet.member_of(second)
        )


def carried_share(marionette: Marionette, run: Trajectory) -> float:
    """Share of the puppets' weight that other parts carry at the end of a run.

    Forces between bodies of one puppet cancel out; forces between puppets are not counted.
    """
    puppet = marionette.puppet
    gravity = np.array([marionette.number(g) for g in marionette.tree.gravity])
    gravity_norm = float(np.linalg.norm(gravity))
    bodies = {body.name for body in puppet.expanded().bodies} - set(puppet.props)
    mass = sum(
        sum(marionette.number(share.amount) * share.volume for share in link.mass_shares)
        if link.mass is None
        else marionette.number(link.mass)
        for link in marionette.tree.links
        if link.name in bodies
    )
    if run.contact is None or not mass * gravity_norm:
        return 0.0
    last_contacts, up = run.contact.at_sample(len(run) - 1), -gravity / gravity_norm
    sides = np.array(
        [[name in bodies for name in names] for names in last_contacts.names], dtype=int
    )
    sign = (sides[:, 0] - sides[:, 1])[last_contacts.pair] if len(last_contacts) else np.zeros(0)
    return float(np.sum(sign * (last_contacts.force @ up)) / (mass * gravity_norm))


def pairs_of(contact: ContactLike) -> tuple[tuple[str, str], ...]:
    """The pairs that may touch.

    Raises:
        StateError: value of ``contact`` other than ``"keep off"`` or ``{"touch": pairs}``.
    """
    if contact == KEEP_OFF:
        return ()
    if not isinstance(contact, Mapping) or set(contact) != {"touch"}:
        raise StateError(
            f"contact is {contact!r}; it must be 'keep off', or {{'touch': pairs of names}}"
        )
    return tuple(pair_of(pair) for pair in contact["touch"])


def touching(marionette: Marionette, pair: tuple[str, str]) -> MaskRows:
    """(n_pairs,) bool, the contact pairs of two names.

    Args:
        marionette: the puppet.
        pair: names of bodies, props, obstacles, ``floor``, or puppets.

    Raises:
        StateError: names that never touch.
        UnknownNameError: name of a part that cannot touch anything.
    """
    contacts, puppet = marionette.contacts, marionette.puppet
    if contacts is None:
        raise StateError(
            f"{' and '.join(pair)} are to touch, but {puppet.name} says nothing of contact; give "
            "its file contact: true"
        )
    owners = [[{name, puppet.member_of(name)} - {""} for name in names] for names in contacts.names]
    all_names = {name for names in owners for part in names for name in part}
    for name in pair:
        if name not in all_names:
            raise UnknownNameError("part that may touch", name, sorted(all_names))
    first, second = pair
    is_selected = np.array(
        [
            (first in sides_a and second in sides_b) or (first in sides_b and second in sides_a)
            for sides_a, sides_b in owners
        ],
        dtype=bool,
    )
    if not np.any(is_selected):
        raise StateError(
            f"{first} and {second} never touch, by the rules of contact of {puppet.name}"
        )
    return is_selected


def pair_of(value: Any) -> tuple[str, str]:
    """A pair of names, checked.

    Raises:
        StateError: value that is not a pair of names.
    """
    if isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2:
        first, second = value
        if isinstance(first, str) and isinstance(second, str):
            return first, second
    raise StateError(f"found {value!r}; needed: a pair of names")
