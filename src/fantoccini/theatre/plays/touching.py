"""Where players, props, obstacles and strings come too near to each other in runs of players."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from fantoccini.base import MaskRows, Times
from fantoccini.dynamics.clearance import Clearance, Path, StringMotion, StringsApart
from fantoccini.model.puppet import FLOOR
from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import Cast, Meeting, Pair

EVERY = 4
"""Stride of the measured samples of a run: 50 a second, and in between as needed."""
AT_HAND = 0.001
"""Distance between the players that handle a prop, the prop and their strings, and between a sitter
and the seat [m]."""


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
    path = Path.of(cast.whole, run, every)
    t, q_D, q_K = path.t, path.q_D, path.q_K
    # Props do not move by themselves: what they stand on they may touch at all times.
    stand = {(name, one.on) for name, one in cast.file.props.items() if one.on is not None}
    always = {frozenset(pair) for pair in stand}
    for pair in {pair for meeting in meetings for pair in meeting.pairs}:
        if not any(cast.owner(cast.named(name)) in cast.players for name in pair):
            always.add(pair)
    apart = StringsApart(cast.whole, own=False)
    bodies, strings = list[_Near](), dict[Pair, Touch]()
    for begin, end, now in _windows(t, meetings):
        rules, own = _Rules(cast, now, always), slice(begin, end)
        for near in rules.bodies(path.part(begin, end)):
            bodies.append(replace(near, first=begin + near.first, last=begin + near.last))
        for touch in rules.strings(apart.over(q_D[own], q_K[own], t[own])):
            strings.setdefault(frozenset((touch.what, touch.other)), touch)
    found = [*_merged(bodies), *strings.values()]
    for crossing in apart.over(q_D, q_K, t).crossings():
        names = f"string {crossing.what}", f"string {crossing.other}"
        found.append(Touch(crossing.t, *names, 0.0, crosses=True))
    return sorted(found, key=lambda one: (one.t, one.what, one.other))


def _windows(
    t: Times, meetings: Sequence[Meeting]
) -> Iterator[tuple[int, int, tuple[Meeting, ...]]]:
    """Spans of samples with the same meetings: first sample, end (exclusive), meetings.

    Between two such spans the meetings of both may touch.
    """
    on = np.array([(t >= meeting.begin) & (t <= meeting.end) for meeting in meetings], dtype=bool)
    on = on.reshape(len(meetings), len(t))
    changes = np.flatnonzero(np.any(on[:, 1:] != on[:, :-1], axis=0)) + 1

    def those(which: MaskRows) -> tuple[Meeting, ...]:
        return tuple(meetings[i] for i in np.flatnonzero(which).tolist())

    for begin, end in pairwise([0, *changes.tolist(), len(t)]):
        yield begin, end, those(on[:, begin])
        if end < len(t):
            yield end - 1, end + 1, those(on[:, end - 1] | on[:, end])


class _Rules:
    """Distances to keep while the same meetings go on.

    Args:
        cast: of the play.
        now: the meetings.
        always: what may touch at all times.
    """

    def __init__(self, cast: Cast, now: Sequence[Meeting], always: Iterable[Pair]):
        whole, clear = cast.whole, cast.file.stage.clear
        self._cast, self._clear = cast, clear
        self._groups = [{*one.players, *one.props, *_seat(one)} for one in now]
        names = [link.name for link in whole.tree.links]
        names += [obstacle.name for obstacle in Clearance(whole, strings=False).obstacles]
        every = {frozenset(pair) for pair in combinations(dict.fromkeys(names), 2)}
        asked = {frozenset(map(cast.named, pair)) for one in now for pair in one.pairs}
        asked.update(always)
        floor = {pair for pair in every if FLOOR in pair}
        kept = floor - asked - {frozenset((name, FLOOR)) for name in cast.props}
        at_hand = {pair for pair in every - floor - asked if self._at_hand(*pair)}
        self._bodies = [(Clearance(whole, free=floor | asked | at_hand), clear)]
        for pairs, distance in ((at_hand, AT_HAND), (kept, 0.0)):
            if pairs:
                self._bodies.append((Clearance(whole, strings=False, free=every - pairs), distance))

    def bodies(self, path: Path) -> Iterator[_Near]:
        """Where bodies come too near to others and to obstacles, and strings to obstacles."""
        for clearance, distance in self._bodies:
            for near in _near(clearance, path, distance):
                if not self._allowed(near.touch):
                    yield near

    def strings(self, motion: StringMotion) -> Iterator[Touch]:
        """Where strings come too near to those of others, and to others' bodies, first."""
        for distance in (self._clear, AT_HAND) if self._groups else (self._clear,):
            near = motion.nearer_than(distance)
            for pair in (*near.strings, *near.bodies):
                what = f"string {pair.what}"
                other = f"string {pair.other}" if pair in near.strings else pair.other
                touch = Touch(pair.t, what, other, pair.distance)
                if not self._allowed(touch):
                    yield touch

    def _allowed(self, touch: Touch) -> bool:
        """Whether who handles a prop, and the prop, are near, but do not touch."""
        return touch.distance >= AT_HAND and self._at_hand(touch.what, touch.other)

    def _at_hand(self, what: str, other: str) -> bool:
        """Whether a cue lets the one handle the other."""
        owners = {self._cast.owner(name.removeprefix("string ")) for name in (what, other)}
        return any(owners <= group for group in self._groups)


def _seat(meeting: Meeting) -> set[str]:
    """The obstacle or prop on which a player sits; none in other meetings."""
    names = {name for pair in meeting.pairs for name in pair if "." not in name}
    return names - {FLOOR} if meeting.kind == "sits" else set()


@dataclass(frozen=True)
class _Near:
    """A touch, from one sample to another."""

    touch: Touch
    first: int
    last: int


def _near(clearance: Clearance, path: Path, clear: float) -> Iterator[_Near]:
    """Where each part is nearer to another than it is to be."""
    for name, one in clearance.parts().items():
        at, distance = one.along(path, clear)
        near = distance < clear
        for k in np.flatnonzero(near & ~np.append(False, near[:-1])):
            end = int(k) + int(np.argmin(np.append(near[k:], False)))
            worst = int(k) + int(np.argmin(distance[k:end]))
            nearest = one.pair_at(at.q_D[worst], at.q_K[worst])
            other = nearest.other if nearest.what == name else nearest.what
            touch = Touch(float(at.t[k]), name, other, float(distance[worst]))
            yield _Near(touch, int(at.piece[k]), int(at.piece[end - 1]))


def _merged(found: Iterable[_Near]) -> list[Touch]:
    """Touches that go on while meetings begin or end, as one each."""
    merged = list[_Near]()
    for one in sorted(found, key=lambda one: one.first):
        names = {one.touch.what, one.touch.other}
        for i, before in enumerate(merged):
            same = {before.touch.what, before.touch.other} == names
            if same and before.last >= one.first - 1:
                distance = min(before.touch.distance, one.touch.distance)
                touch = replace(before.touch, distance=distance)
                merged[i] = replace(before, touch=touch, last=max(before.last, one.last))
                break
        else:
            merged.append(one)
    return [one.touch for one in merged]
