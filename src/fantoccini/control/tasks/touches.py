"""What a plan may touch, what it is to touch at its goal, and what it keeps off."""

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

_STEPS_BEFORE = 3
"""Time steps before a touch from which its speed is taken."""
_TOUCHING = 1e-6
"""Gap up to which parts touch that are kept off [m]."""
_FAR = 100.0
"""Distance up to which gaps of asked touches are measured [m]."""


@dataclass(frozen=True)
class Meeting:
    """A touch of two parts in a run.

    Attributes:
        parts: their names.
        t: of the first touch [s].
        speed: at which they met first [m/s].
        asked: whether the plan may touch there.
        force: between them at the end of the run [N].
    """

    parts: tuple[str, str]
    t: float
    speed: float
    asked: bool
    force: float

    def __str__(self) -> str:
        return f"{' touches '.join(self.parts)} at {self.t:.3g} s with {self.speed:.2g} m/s"


class Touches:
    """The pairs of contact of a puppet, sorted into those that may touch and those kept off.

    Parts that belong to no puppet, as props and floor, may always touch one another. So may bodies
    of one puppet, unless these are kept clear of one another.

    Attributes:
        marionette: the puppet.
        asked: the pairs that are to touch at the goal.
        may: (n_pairs,) bool, the pairs of ``marionette.contacts`` that may touch.
        touch_of: (n_pairs,) the place in ``asked`` of every pair; -1 where it is not asked for.

    Args:
        marionette: the puppet.
        contact: the pairs that may touch.
        asked: those that are to touch at the goal; they may touch before.
        self_collision: whether bodies of one puppet are kept off one another.

    Raises:
        StateError: what is to touch never does, by the puppet's rules of contact.
        UnknownNameError: nothing of this name may touch anything.
    """

    def __init__(
        self,
        marionette: Marionette,
        contact: ContactLike = KEEP_OFF,
        asked: Iterable[Pair] = (),
        self_collision: bool = False,
    ):
        self.marionette = marionette
        self.asked = tuple(pair_of(one) for one in asked)
        self.may = np.zeros(len(self.names), dtype=bool)
        self.touch_of = np.full(len(self.names), -1, dtype=np.int32)
        for pair in pairs_of(contact):
            self.may |= touching(marionette, pair)
        for k, pair in enumerate(self.asked):
            found = touching(marionette, pair)
            self.may |= found
            self.touch_of[found] = k
        for k, (a, b) in enumerate(self.names):
            own = bool(self._bodies & {a, b}) and not self._of_two(a, b)
            self.may[k] |= not self._bodies & {a, b} or (own and not self_collision)

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """The names of all pairs of contact."""
        return () if self.contacts is None else self.contacts.names

    @property
    def contacts(self) -> Contacts | None:
        """The pairs of contact; None for a puppet that touches nothing."""
        return self.marionette.contacts

    @cached_property
    def free(self) -> frozenset[frozenset[str]]:
        """The names of pairs that may touch."""
        names = [frozenset(pair) for pair in self.names]
        kept = {pair for pair, may in zip(names, self.may, strict=True) if not may}
        return frozenset(names) - kept

    @cached_property
    def expected(self) -> bool:
        """Whether anything may touch anything but bodies of one puppet each other."""
        return any(
            may and (self._of_two(*pair) or not self._bodies & set(pair))
            for pair, may in zip(self.names, self.may, strict=True)
        )

    def partners(self, prop: str) -> tuple[str, ...]:
        """The bodies of puppets that may touch a prop."""
        met = {name for pair in self.free if prop in pair for name in pair}
        return tuple(sorted(met & self._bodies))

    @cached_property
    def _of_touches(self) -> tuple[Contacts, Indices] | None:
        """The pairs that are asked for, and the touch that each is part of."""
        if self.contacts is None or not self.asked:
            return None
        which = self.touch_of >= 0
        return self.contacts.some(which), self.touch_of[which]

    def broken(self, q_D: Array, q_K: Array) -> tuple[str, str] | None:
        """Two parts that touch at a configuration, though they are kept off; None without any."""
        if self.contacts is None or np.all(self.may):
            return None
        kept, marionette = self.contacts.some(~self.may), self.marionette
        gaps = marionette.library.gaps(kept, q_D, q_K, marionette.p)
        nearest = int(np.argmin(gaps))
        return kept.names[nearest] if gaps[nearest] <= _TOUCHING else None

    def gaps(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_asked) gaps of the touches that are asked for; negative where parts overlap [m].

        Args:
            q_D, q_K: (..., n_qD), (..., n_qK).
        """
        lead = q_D.shape[:-1]
        found = np.full((*lead, len(self.asked)), _FAR)
        if self._of_touches is None:
            return found
        contacts, touch = self._of_touches
        q_K = np.broadcast_to(q_K, (*lead, q_K.shape[-1]))
        marionette = self.marionette
        gaps = marionette.library.gaps(contacts, q_D, q_K, marionette.p, _FAR)
        for k in range(len(self.asked)):
            found[..., k] = np.minimum(np.min(gaps[..., touch == k], axis=-1), _FAR)
        return found

    def meetings(self, run: Trajectory) -> tuple[Meeting, ...]:
        """The pairs of parts that began to touch in a run, in order, or push at its end.

        Those of one puppet, and of parts that belong to none, are left out.
        """
        found: dict[frozenset[str], EventRecord | None] = {}
        for one in run.events:
            if one.kind == "touch":
                found.setdefault(frozenset(one.name.split("|")), one)
        if run.contact is None:
            return ()
        end = run.contact.at(len(run) - 1)
        for k in set(end.pair.tolist()):
            found.setdefault(frozenset(end.names[k]), None)
        made = []
        for names, event in found.items():
            a, b = (*names, *names)[:2]
            if not self._of_two(a, b):
                continue
            force = float(np.sum(end.of(a, b).normal_force))
            t = float(run.t[0]) if event is None else event.t
            speed = 0.0 if event is None else event.speed or self._speed(run, names, event.t)
            parts = (a, b) if a in self._bodies else (b, a)
            made.append(Meeting(parts, t, speed, names in self.free, force))
        return tuple(sorted(made, key=lambda one: one.t))

    def _speed(self, run: Trajectory, names: frozenset[str], t: float) -> float:
        """The speed at which two parts met by time-stepping, from their gaps in the steps before.

        The step in which they meet and the one before it slow them down already.
        """
        assert self.contacts is not None  # or nothing touches
        at = int(np.searchsorted(run.t, t))
        before = np.arange(max(0, at - _STEPS_BEFORE), at + 1)
        some = self.contacts.some(np.array([frozenset(n) == names for n in self.names]))
        q_D, q_K, marionette = run.q_D[before], run.q_K[before], self.marionette
        gaps = np.min(marionette.library.gaps(some, q_D, q_K, marionette.p, _FAR), axis=-1)
        return float(np.max(-np.diff(gaps) / np.diff(run.t[before]), initial=0.0))

    @cached_property
    def _bodies(self) -> set[str]:
        puppet = self.marionette.puppet
        return {body.name for body in puppet.expanded().bodies} - set(puppet.props)

    def _of_two(self, a: str, b: str) -> bool:
        """Whether a body of a puppet meets what is not its own."""
        puppet = self.marionette.puppet
        if not self._bodies & {a, b}:
            return False
        return not (self._bodies >= {a, b} and puppet.member_of(a) == puppet.member_of(b))


def carried(marionette: Marionette, run: Trajectory) -> float:
    """The part of the puppets' weight that rests on what they touch at the end of a run.

    Forces between bodies of one puppet cancel out; those between puppets count as none.
    """
    puppet = marionette.puppet
    gravity = np.array([marionette.number(g) for g in marionette.tree.gravity])
    size = float(np.linalg.norm(gravity))
    bodies = {body.name for body in puppet.expanded().bodies} - set(puppet.props)
    mass = sum(
        sum(marionette.number(lump.amount) * lump.volume for lump in link.lumps)
        if link.mass is None
        else marionette.number(link.mass)
        for link in marionette.tree.links
        if link.name in bodies
    )
    if run.contact is None or not mass * size:
        return 0.0
    end, up = run.contact.at(len(run) - 1), -gravity / size
    sides = np.array([[name in bodies for name in names] for names in end.names], dtype=int)
    sign = (sides[:, 0] - sides[:, 1])[end.pair] if len(end) else np.zeros(0)
    return float(np.sum(sign * (end.force @ up)) / (mass * size))


def pairs_of(contact: ContactLike) -> tuple[tuple[str, str], ...]:
    """The pairs that may touch.

    Raises:
        StateError: ``contact`` is neither ``"keep off"`` nor ``{"touch": pairs}``.
    """
    if contact == KEEP_OFF:
        return ()
    if not isinstance(contact, Mapping) or set(contact) != {"touch"}:
        raise StateError(
            f"contact is {contact!r}; it must be 'keep off', or {{'touch': pairs of names}}"
        )
    return tuple(pair_of(one) for one in contact["touch"])


def touching(marionette: Marionette, pair: tuple[str, str]) -> MaskRows:
    """(n_pairs,) bool, the pairs of contact of two names.

    Args:
        marionette: the puppet.
        pair: names of bodies, props, obstacles, ``floor``, or puppets.

    Raises:
        StateError: they never touch.
        UnknownNameError: nothing of a name may touch anything.
    """
    contacts, puppet = marionette.contacts, marionette.puppet
    if contacts is None:
        raise StateError(
            f"{' and '.join(pair)} are to touch, but {puppet.name} says nothing of contact; give "
            "its file contact: true"
        )
    owned = [[{name, puppet.member_of(name)} - {""} for name in names] for names in contacts.names]
    known = {name for names in owned for some in names for name in some}
    for name in pair:
        if name not in known:
            raise UnknownNameError("part that may touch", name, sorted(known))
    one, other = pair
    found = np.array(
        [(one in x and other in y) or (one in y and other in x) for x, y in owned], dtype=bool
    )
    if not np.any(found):
        raise StateError(f"{one} and {other} never touch, by the rules of contact of {puppet.name}")
    return found


def pair_of(given: Any) -> tuple[str, str]:
    """Two names.

    Raises:
        StateError: it is no pair of names.
    """
    if isinstance(given, Sequence) and not isinstance(given, str) and len(given) == 2:
        one, other = given
        if isinstance(one, str) and isinstance(other, str):
            return one, other
    raise StateError(f"found {given!r}; needed: a pair of names")
