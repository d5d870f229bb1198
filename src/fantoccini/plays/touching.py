"""Where players, props, obstacles and strings come too near to each other in runs of players."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.clearance import Clearance, StringsApart
from fantoccini.motion import Trajectory
from fantoccini.plays.casting import Cast
from fantoccini.plays.companies import Meeting
from fantoccini.plays.contacts import Pair
from fantoccini.puppet.contact import FLOOR
from fantoccini.runtime import default_threads

EVERY = 4
"""So many samples of a run are one that is measured: 50 a second."""
AT_HAND = 0.001
"""Who handles a prop, the prop, and who is given it, with their strings, keep this distance, and
who sits and the seat [m]."""


@dataclass(frozen=True)
class Touch:
    """Two things that come too near to each other.

    Attributes:
        t: when they first do [s].
        what, other: names of bodies, strings (``string pierrot.head``) or obstacles.
        distance: the least one from then on, until they are apart again [m]; below 0 they overlap.
        crosses: whether two strings pass through each other.
    """

    t: float
    what: str
    other: str
    distance: float
    crosses: bool = False

    def __str__(self) -> str:
        if self.crosses:
            return f"{self.what} would cross {self.other}"
        if self.distance < 0.0:
            return f"{self.what} would be {-1e3 * self.distance:.0f} mm inside {self.other}"
        return f"{self.what} would come within {1e3 * self.distance:.0f} mm of {self.other}"


def touches(
    cast: Cast, run: Trajectory, meetings: Sequence[Meeting] = (), every: int = EVERY
) -> list[Touch]:
    """Where two things come nearer than the stage says, in order of time.

    Bodies of different players, props and obstacles keep clear of one another, but for what a cue
    lets touch, and then only while it does; strings keep clear of all of them. Who handles a prop,
    and the prop, only need not touch otherwise. The floor is only not to be passed. Strings of one
    player only do not cross.

    Args:
        cast: of the play.
        run: of the stage.
        meetings: what may touch, and when.
        every: so many samples of the run are one that is measured.
    """
    t, q_D, q_K = run.t[::every], run.q_D[::every], run.q_K[::every]
    clear = cast.file.stage.clear
    links = [link.name for link in cast.whole.tree.links]
    on_floor = [frozenset((name, FLOOR)) for name in links]
    pairs = {pair for one in meetings for pair in one.pairs}
    asked = {pair: frozenset(map(cast.named, pair)) for pair in sorted(pairs, key=sorted)}
    lie_on = [
        frozenset((name, one.on)) for name, one in cast.file.props.items() if one.on is not None
    ]
    free = [*on_floor, *lie_on, *asked.values()]
    found = _bodies(Clearance(cast.whole, free=free), t, q_D, q_K, clear)
    found = [one for one in found if not _at_hand(cast, one, meetings)]
    if cast.whole.puppet.floor is not None:
        stand = [*(frozenset((name, FLOOR)) for name in cast.things), *asked.values()]
        found += [one for one in _bodies(Clearance(cast.whole, free=stand), t, q_D, q_K, 0.0)
                  if FLOOR in (one.what, one.other)]  # fmt: skip
    found += _unasked(cast, t, q_D, q_K, meetings, asked)
    strings = StringsApart(cast.whole).over(q_D, q_K, t)
    near = strings.nearer_than(clear)
    for one in (*near.strings, *near.bodies):
        if cast.owner(one.what) != cast.owner(one.other):
            what = f"string {one.what}"
            other = f"string {one.other}" if one in near.strings else one.other
            touch = Touch(one.t, what, other, one.distance)
            if not _at_hand(cast, touch, meetings):
                found.append(touch)
    for crossing in strings.crossings():
        names = f"string {crossing.what}", f"string {crossing.other}"
        found.append(Touch(crossing.t, *names, 0.0, crosses=True))
    return sorted(found, key=lambda one: (one.t, one.what, one.other))


def _at_hand(cast: Cast, touch: Touch, meetings: Sequence[Meeting]) -> bool:
    """Whether two are near, but not touching, of whom a cue lets the one handle the other."""
    if touch.distance < AT_HAND:
        return False
    owners = {cast.owner(one.removeprefix("string ")) for one in (touch.what, touch.other)}
    return any(
        owners <= {*one.players, *one.props, *_seat(one)} for one in meetings
        if one.begin <= touch.t <= one.end
    )  # fmt: skip


def _seat(meeting: Meeting) -> set[str]:
    """The obstacle or prop on which a player sits; none in other meetings."""
    names = {name for pair in meeting.pairs for name in pair if "." not in name}
    return names - {FLOOR} if meeting.kind == "sits" else set()


def _unasked(
    cast: Cast, t: Times, q_D: Array, q_K: Array, meetings: Sequence[Meeting],
    asked: Mapping[Pair, Pair],
) -> list[Touch]:  # fmt: skip
    """What may touch for a while, at other times."""
    found: list[Touch] = []
    clearance = Clearance(cast.whole, strings=False)
    names = [link.name for link in cast.whole.tree.links]
    names += [one.name for one in clearance.obstacles]
    pairs = [frozenset(pair) for pair in combinations(dict.fromkeys(names), 2)]
    for pair, own in asked.items():
        # Props do not move by themselves: what they stand on they may touch at all times.
        if not any(cast.owner(name) in cast.players for name in own):
            continue
        other = np.ones(len(t), dtype=bool)
        for one in meetings:
            if pair in one.pairs:
                other &= (t < one.begin) | (t > one.end)
        if not np.any(other):
            continue
        alone = Clearance(cast.whole, strings=False, free=[p for p in pairs if p != own])
        clear = 0.0 if FLOOR in own else cast.file.stage.clear
        found += _bodies(alone, t[other], q_D[other], q_K[other], clear)
    return found


def _bodies(
    clearance: Clearance, t: Times, q_D: Array, q_K: Array, clear: float
) -> list[Touch]:
    found = []
    for name, one in clearance.parts().items():
        distance = one.at(q_D, q_K, threads=default_threads())
        near = distance < clear
        for k in np.flatnonzero(near & ~np.append(False, near[:-1])):
            end = int(k) + int(np.argmin(np.append(near[k:], False)))
            worst = int(k) + int(np.argmin(distance[k:end]))
            nearest = one.pair_at(q_D[worst], q_K[worst])
            other = nearest.other if nearest.what == name else nearest.what
            found.append(Touch(float(t[k]), name, other, float(distance[worst])))
    return found
