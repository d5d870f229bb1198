"""What a plan may touch, what it is to touch at its goal, and what it keeps off."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from fantoccini.arrays import Array, Indices, MaskRows
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.marionette import Marionette
from fantoccini.motion import EventRecord, Trajectory
from fantoccini.runtime import Contacts

KEEP_OFF = "keep off"
"""Nothing is touched; what :class:`fantoccini.planning.Problem` does unless told otherwise."""

Pair: TypeAlias = "tuple[str, str] | Sequence[str]"
"""Two names: of bodies, props, obstacles, ``floor``, or of a puppet for all of its bodies."""

ContactLike: TypeAlias = "str | Mapping[str, Iterable[Pair]]"
"""``"keep off"``, or ``{"touch": [("hand", "table")]}``: the pairs that may touch."""

_FAR = 100.0
"""Distance up to which gaps of asked touches are measured [m]."""


@dataclass(frozen=True)
class Meeting:
    """A touch of two parts in a run.

    Attributes:
        parts: their names.
        t: of the first touch [s].
        speed: at which they met [m/s]; of all their touches, the largest.
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
        may: (n_pairs,) bool, the pairs of ``marionette.model.contacts`` that may touch.
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
        self.asked = tuple(_pair(one) for one in asked)
        contacts = marionette.model.contacts
        names = contacts.names if contacts is not None else ()
        self.may = np.zeros(len(names), dtype=bool)
        self.touch_of = np.full(len(names), -1, dtype=np.int32)
        for pair in pairs_of(contact):
            self.may |= touching(marionette, pair)
        for k, pair in enumerate(self.asked):
            found = touching(marionette, pair)
            self.may |= found
            self.touch_of[found] = k
        for k, (a, b) in enumerate(names):
            own = bool(self._bodies & {a, b}) and not self._of_two(a, b)
            self.may[k] |= not self._bodies & {a, b} or (own and not self_collision)

    @property
    def contacts(self) -> Contacts | None:
        """The pairs of contact; None for a puppet that touches nothing."""
        return self.marionette.model.contacts

    @cached_property
    def free(self) -> frozenset[frozenset[str]]:
        """The names of pairs that may touch."""
        if self.contacts is None:
            return frozenset()
        names = [frozenset(pair) for pair in self.contacts.names]
        kept = {pair for pair, may in zip(names, self.may, strict=True) if not may}
        return frozenset(names) - kept

    @cached_property
    def expected(self) -> bool:
        """Whether anything may touch anything but bodies of one puppet each other."""
        names = () if self.contacts is None else self.contacts.names
        return any(
            may and (self._of_two(*pair) or not self._bodies & set(pair))
            for pair, may in zip(names, self.may, strict=True)
        )

    @cached_property
    def _of_touches(self) -> tuple[Contacts, Indices] | None:
        """The pairs that are asked for, and the touch that each is part of."""
        if self.contacts is None or not self.asked:
            return None
        which = self.touch_of >= 0
        return self.contacts.some(which), self.touch_of[which]

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
        model = self.marionette.model
        gaps = model.library.gaps(contacts, q_D, q_K, model.p, _FAR)
        for k in range(len(self.asked)):
            found[..., k] = np.minimum(np.min(gaps[..., touch == k], axis=-1), _FAR)
        return found

    def meetings(self, run: Trajectory) -> tuple[Meeting, ...]:
        """The pairs of parts that began to touch in a run, in order, or push at its end.

        Those of one puppet, and of parts that belong to none, are left out.
        """
        found: dict[frozenset[str], list[EventRecord]] = {}
        for event in run.events:
            if event.kind == "touch":
                found.setdefault(frozenset(event.name.split("|")), []).append(event)
        end = run.contact.at(len(run) - 1)
        for k in set(end.pair.tolist()):
            found.setdefault(frozenset(end.names[k]), [])
        made = []
        for names, events in found.items():
            a, b = (*names, *names)[:2]
            if not self._of_two(a, b):
                continue
            force = float(np.sum(end.of(a, b).normal_force)) if len(end.of(a, b)) else 0.0
            first = min((e.t for e in events), default=float(run.t[0]))
            speed = max((e.speed for e in events), default=0.0)
            parts = (a, b) if a in self._bodies else (b, a)
            made.append(Meeting(parts, first, speed, names in self.free, force))
        return tuple(sorted(made, key=lambda one: one.t))

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
    model, puppet = marionette.model, marionette.puppet
    gravity = np.array([model.number(g) for g in model.tree.gravity])
    size = float(np.linalg.norm(gravity))
    bodies = {body.name for body in puppet.expanded().bodies} - set(puppet.props)
    mass = sum(
        sum(model.number(lump.amount) * lump.volume for lump in link.lumps)
        if link.mass is None
        else model.number(link.mass)
        for link in model.tree.links
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
    return tuple(_pair(one) for one in contact["touch"])


def touching(marionette: Marionette, pair: tuple[str, str]) -> MaskRows:
    """(n_pairs,) bool, the pairs of contact of two names.

    Args:
        marionette: the puppet.
        pair: names of bodies, props, obstacles, ``floor``, or puppets.

    Raises:
        StateError: they never touch.
        UnknownNameError: nothing of a name may touch anything.
    """
    contacts, puppet = marionette.model.contacts, marionette.puppet
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


def _pair(given: Any) -> tuple[str, str]:
    if isinstance(given, Sequence) and not isinstance(given, str) and len(given) == 2:
        one, other = given
        if isinstance(one, str) and isinstance(other, str):
            return one, other
    raise StateError(f"found {given!r}; needed: a pair of names")
