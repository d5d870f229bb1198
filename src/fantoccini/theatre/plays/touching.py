"""Touches of players, props, obstacles and strings in runs of a play."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from fantoccini.base import MaskRows, Times
from fantoccini.dynamics.clearance import Clearance, Path, StringDistances, StringMotion
from fantoccini.model.puppet import FLOOR
from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import Cast, Meeting, Pair

SAMPLE_STRIDE = 4
"""Stride of the measured samples of a run: 50 per second, and more as needed."""
HANDLING_DISTANCE = 0.001
"""Least distance of a prop from the players that handle it and from their strings, and of a sitter
from the seat [m]."""


@dataclass(frozen=True)
class Touch:
    """Approach of two bodies, obstacles or strings that is too near.

    Attributes:
        t: time at which it begins [s].
        what, other: names of bodies, strings (``string pierrot.head``) or obstacles.
        distance: least distance until they are apart again [m]; below 0 they overlap.
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
    cast: Cast, run: Trajectory, meetings: Sequence[Meeting] = (), every: int = SAMPLE_STRIDE
) -> list[Touch]:
    """Pairs that come nearer than the stage allows, in order of time.

    Bodies of different players, props and obstacles keep clear of one another, except for pairs
    that may touch during a cue; strings keep clear of all of them. Other pairs of a prop and the
    players that handle it may come near, but must not touch. Bodies may touch the floor, but not
    penetrate it. Strings of the same player may touch, but not cross. Leashes may touch everything.

    Args:
        cast: cast of the play.
        run: run of the stage.
        meetings: players and props that may touch, with times.
        every: stride of the measured samples.
    """
    path = Path.from_run(cast.whole, run, every)
    t, q_D, q_K = path.t, path.q_D, path.q_K
    # Props do not move by themselves: they may touch their supports at all times.
    stand = {
        (name, prop_file.on)
        for name, prop_file in cast.file.props.items()
        if prop_file.on is not None
    }
    always = {frozenset(pair) for pair in stand}
    for pair in {pair for meeting in meetings for pair in meeting.pairs}:
        if not any(cast.owner(cast.scene_name(name)) in cast.players for name in pair):
            always.add(pair)
    string_distances = StringDistances(cast.whole, own=False)
    bodies, strings = list[_Near](), dict[Pair, Touch]()
    for begin, end, present in _windows(t, meetings):
        rules, window = _Rules(cast, present, always), slice(begin, end)
        for near in rules.bodies(path.part(begin, end)):
            bodies.append(replace(near, first=begin + near.first, last=begin + near.last))
        motion = string_distances.motion(q_D[window], q_K[window], t[window])
        for touch in rules.strings(motion):
            strings.setdefault(frozenset((touch.what, touch.other)), touch)
    all_touches = [*_merged(bodies), *strings.values()]
    for crossing in string_distances.motion(q_D, q_K, t).crossings():
        names = f"string {crossing.first}", f"string {crossing.second}"
        all_touches.append(Touch(crossing.t, *names, 0.0, crosses=True))
    leashes = {f"string {name}" for name in cast.file.leashes}
    all_touches = [touch for touch in all_touches if not {touch.what, touch.other} & leashes]
    return sorted(all_touches, key=lambda touch: (touch.t, touch.what, touch.other))


def _windows(
    t: Times, meetings: Sequence[Meeting]
) -> Iterator[tuple[int, int, tuple[Meeting, ...]]]:
    """Spans of samples with the same meetings: first sample, end (exclusive), meetings.

    Between two such spans the meetings of both are allowed.
    """
    on = np.array([(t >= meeting.begin) & (t <= meeting.end) for meeting in meetings], dtype=bool)
    on = on.reshape(len(meetings), len(t))
    changes = np.flatnonzero(np.any(on[:, 1:] != on[:, :-1], axis=0)) + 1

    def selected(mask: MaskRows) -> tuple[Meeting, ...]:
        return tuple(meetings[i] for i in np.flatnonzero(mask).tolist())

    for begin, end in pairwise([0, *changes.tolist(), len(t)]):
        yield begin, end, selected(on[:, begin])
        if end < len(t):
            yield end - 1, end + 1, selected(on[:, end - 1] | on[:, end])


class _Rules:
    """Distances to keep during a time with the same meetings.

    Args:
        cast: cast of the play.
        present: meetings of that time.
        always: pairs that may touch at all times.
    """

    def __init__(self, cast: Cast, present: Sequence[Meeting], always: Iterable[Pair]):
        whole, clear = cast.whole, cast.file.stage.clear
        self._cast, self._clear = cast, clear
        self._groups = [{*meeting.players, *meeting.props, *_seat(meeting)} for meeting in present]
        names = [link.name for link in whole.tree.links]
        names += [obstacle.name for obstacle in Clearance(whole, strings=False).obstacles]
        all_pairs = {frozenset(pair) for pair in combinations(dict.fromkeys(names), 2)}
        allowed = {
            frozenset(map(cast.scene_name, pair)) for meeting in present for pair in meeting.pairs
        }
        allowed.update(always)
        floor = {pair for pair in all_pairs if FLOOR in pair}
        above_floor = floor - allowed - {frozenset((name, FLOOR)) for name in cast.props}
        handling = {pair for pair in all_pairs - floor - allowed if self._is_handling(*pair)}
        self._bodies = [(Clearance(whole, free=floor | allowed | handling), clear)]
        for pairs, distance in ((handling, HANDLING_DISTANCE), (above_floor, 0.0)):
            if pairs:
                clearance = Clearance(whole, strings=False, free=all_pairs - pairs)
                self._bodies.append((clearance, distance))

    def bodies(self, path: Path) -> Iterator[_Near]:
        """Touches of bodies with others and with obstacles, and of strings with obstacles."""
        for clearance, distance in self._bodies:
            for near in _near(clearance, path, distance):
                if not self._allowed(near.touch):
                    yield near

    def strings(self, motion: StringMotion) -> Iterator[Touch]:
        """First touches of strings with those of others, and with others' bodies."""
        for distance in (self._clear, HANDLING_DISTANCE) if self._groups else (self._clear,):
            near = motion.nearer_than(distance)
            for pair in (*near.strings, *near.bodies):
                what = f"string {pair.first}"
                other = f"string {pair.second}" if pair in near.strings else pair.second
                touch = Touch(pair.t, what, other, pair.distance)
                if not self._allowed(touch):
                    yield touch

    def _allowed(self, touch: Touch) -> bool:
        """Whether a prop and the players that handle it are near, but do not touch."""
        return touch.distance >= HANDLING_DISTANCE and self._is_handling(touch.what, touch.other)

    def _is_handling(self, first: str, second: str) -> bool:
        """Whether one of the two is handled by the other in a meeting."""
        owners = {self._cast.owner(name.removeprefix("string ")) for name in (first, second)}
        return any(owners <= group for group in self._groups)


def _seat(meeting: Meeting) -> set[str]:
    """Obstacle or prop on which a player sits; empty for other meetings."""
    names = {name for pair in meeting.pairs for name in pair if "." not in name}
    return names - {FLOOR} if meeting.kind == "sits" else set()


@dataclass(frozen=True)
class _Near:
    """Touch with the samples of its beginning and end."""

    touch: Touch
    first: int
    last: int


def _near(clearance: Clearance, path: Path, clear: float) -> Iterator[_Near]:
    """Intervals in which a part is nearer to another than the clearance."""
    for name, part in clearance.parts().items():
        at, distance = part.distances_along(path, clear)
        near = distance < clear
        for k in np.flatnonzero(near & ~np.append(False, near[:-1])):
            end = int(k) + int(np.argmin(np.append(near[k:], False)))
            worst = int(k) + int(np.argmin(distance[k:end]))
            nearest = part.pair_at(at.q_D[worst], at.q_K[worst])
            other = nearest.second if nearest.first == name else nearest.first
            touch = Touch(float(at.t[k]), name, other, float(distance[worst]))
            yield _Near(touch, int(at.piece[k]), int(at.piece[end - 1]))


def _merged(entries: Iterable[_Near]) -> list[Touch]:
    """Touches; those that continue across changes of meetings are joined."""
    merged = list[_Near]()
    for near in sorted(entries, key=lambda near: near.first):
        names = {near.touch.what, near.touch.other}
        for i, before in enumerate(merged):
            same = {before.touch.what, before.touch.other} == names
            if same and before.last >= near.first - 1:
                distance = min(before.touch.distance, near.touch.distance)
                touch = replace(before.touch, distance=distance)
                merged[i] = replace(before, touch=touch, last=max(before.last, near.last))
                break
        else:
            merged.append(near)
    return [near.touch for near in merged]
