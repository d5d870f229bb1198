"""Touches of players, props, obstacles and strings in runs of a play.

A touch is a distance below the one that the play allows. q_D are dynamic coordinates, q_K driven
ones (ends and lengths of strings).
"""

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
        first, second: names of bodies, strings (``string pierrot.head``) or obstacles.
        distance: least distance until they are apart again [m]; below 0 they overlap.
        crosses: whether two strings pass through each other.
    """

    t: float
    first: str
    second: str
    distance: float
    crosses: bool = False

    def __str__(self) -> str:
        if self.crosses:
            return f"{self.first} would cross {self.second}"
        if self.distance < 0.0:
            return f"{self.first} would be {-1e3 * self.distance:.0f} mm inside {self.second}"
        return f"{self.first} would come within {1e3 * self.distance:.0f} mm of {self.second}"


def find_touches(
    cast: Cast, run: Trajectory, meetings: Sequence[Meeting] = (), stride: int = SAMPLE_STRIDE
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
        stride: stride of the measured samples.
    """
    path = Path.from_run(cast.marionette, run, stride)
    t, q_D, q_K = path.t, path.q_D, path.q_K
    # Props do not move by themselves: they may touch their supports at all times.
    supported = {
        (name, prop_file.on)
        for name, prop_file in cast.file.props.items()
        if prop_file.on is not None
    }
    always_allowed = {frozenset(pair) for pair in supported}
    for pair in {pair for meeting in meetings for pair in meeting.pairs}:
        if not any(cast.owner(cast.scene_name(name)) in cast.players for name in pair):
            always_allowed.add(pair)
    string_distances = StringDistances(cast.marionette, own=False)
    body_intervals, string_touches = list[_TouchInterval](), dict[Pair, Touch]()
    for begin, end, present_meetings in _windows(t, meetings):
        rules, window = _DistanceRules(cast, present_meetings, always_allowed), slice(begin, end)
        for interval in rules.bodies(path.part(begin, end)):
            body_intervals.append(
                replace(interval, first=begin + interval.first, last=begin + interval.last)
            )
        motion = string_distances.motion(q_D[window], q_K[window], t[window])
        for touch in rules.strings(motion):
            string_touches.setdefault(frozenset((touch.first, touch.second)), touch)
    all_touches = [*_merge_touches(body_intervals), *string_touches.values()]
    for crossing in string_distances.motion(q_D, q_K, t).crossings():
        names = f"string {crossing.first}", f"string {crossing.second}"
        all_touches.append(Touch(crossing.t, *names, 0.0, crosses=True))
    leashes = {f"string {name}" for name in cast.file.leashes}
    all_touches = [touch for touch in all_touches if not {touch.first, touch.second} & leashes]
    return sorted(all_touches, key=lambda touch: (touch.t, touch.first, touch.second))


def _windows(
    t: Times, meetings: Sequence[Meeting]
) -> Iterator[tuple[int, int, tuple[Meeting, ...]]]:
    """Spans of samples with the same meetings: first sample, end (exclusive), meetings.

    Between two such spans the meetings of both are allowed.
    """
    is_present = np.array(
        [(t >= meeting.begin) & (t <= meeting.end) for meeting in meetings], dtype=bool
    )
    is_present = is_present.reshape(len(meetings), len(t))
    changes = np.flatnonzero(np.any(is_present[:, 1:] != is_present[:, :-1], axis=0)) + 1

    def selected(mask: MaskRows) -> tuple[Meeting, ...]:
        return tuple(meetings[i] for i in np.flatnonzero(mask).tolist())

    for begin, end in pairwise([0, *changes.tolist(), len(t)]):
        yield begin, end, selected(is_present[:, begin])
        if end < len(t):
            yield end - 1, end + 1, selected(is_present[:, end - 1] | is_present[:, end])


class _DistanceRules:
    """Distances to keep during a time with the same meetings.

    Args:
        cast: cast of the play.
        present_meetings: meetings of that time.
        always_allowed: pairs that may touch at all times.
    """

    def __init__(
        self, cast: Cast, present_meetings: Sequence[Meeting], always_allowed: Iterable[Pair]
    ):
        marionette, min_distance = cast.marionette, cast.file.stage.clear
        self._cast, self._min_distance = cast, min_distance
        self._groups = [
            {*meeting.players, *meeting.props, *_seat(meeting)}
            for meeting in present_meetings
            if meeting.kind != "walks"
        ]
        part_names = [link.name for link in marionette.tree.links]
        part_names += [obstacle.name for obstacle in Clearance(marionette, strings=False).obstacles]
        all_pairs = {frozenset(pair) for pair in combinations(dict.fromkeys(part_names), 2)}
        allowed_pairs = {
            frozenset(map(cast.scene_name, pair))
            for meeting in present_meetings
            for pair in meeting.pairs
        }
        allowed_pairs.update(always_allowed)
        floor_pairs = {pair for pair in all_pairs if FLOOR in pair}
        above_floor_pairs = (
            floor_pairs - allowed_pairs - {frozenset((name, FLOOR)) for name in cast.props}
        )
        handling_pairs = {
            pair for pair in all_pairs - floor_pairs - allowed_pairs if self._is_handling(*pair)
        }
        self._bodies = [
            (Clearance(marionette, free=floor_pairs | allowed_pairs | handling_pairs), min_distance)
        ]
        for pairs, distance in ((handling_pairs, HANDLING_DISTANCE), (above_floor_pairs, 0.0)):
            if pairs:
                clearance = Clearance(marionette, strings=False, free=all_pairs - pairs)
                self._bodies.append((clearance, distance))

    def bodies(self, path: Path) -> Iterator[_TouchInterval]:
        """Touches of bodies with others and with obstacles, and of strings with obstacles."""
        for clearance, distance in self._bodies:
            for interval in _near_intervals(clearance, path, distance):
                if not self._is_allowed(interval.touch):
                    yield interval

    def strings(self, motion: StringMotion) -> Iterator[Touch]:
        """First touches of strings with those of others, and with others' bodies."""
        for distance in (
            (self._min_distance, HANDLING_DISTANCE) if self._groups else (self._min_distance,)
        ):
            approaches = motion.nearer_than(distance)
            for pair in (*approaches.strings, *approaches.bodies):
                first = f"string {pair.first}"
                second = f"string {pair.second}" if pair in approaches.strings else pair.second
                touch = Touch(pair.t, first, second, pair.distance)
                if not self._is_allowed(touch):
                    yield touch

    def _is_allowed(self, touch: Touch) -> bool:
        """Whether a prop and the players that handle it are near, but do not touch."""
        return touch.distance >= HANDLING_DISTANCE and self._is_handling(touch.first, touch.second)

    def _is_handling(self, first: str, second: str) -> bool:
        """Whether one of the two is handled by the other in a meeting."""
        owners = {self._cast.owner(name.removeprefix("string ")) for name in (first, second)}
        return any(owners <= group for group in self._groups)


def _seat(meeting: Meeting) -> set[str]:
    """Obstacle or prop on which a player sits; empty for other meetings."""
    names = {name for pair in meeting.pairs for name in pair if "." not in name}
    return names - {FLOOR} if meeting.kind == "sits" else set()


@dataclass(frozen=True)
class _TouchInterval:
    """Touch with the samples of its beginning and end."""

    touch: Touch
    first: int
    last: int


def _near_intervals(
    clearance: Clearance, path: Path, min_distance: float
) -> Iterator[_TouchInterval]:
    """Intervals in which a part is nearer to another than the clearance."""
    for name, part in clearance.parts().items():
        samples, distance = part.distances_along(path, min_distance)
        is_near = distance < min_distance
        for k in np.flatnonzero(is_near & ~np.append(False, is_near[:-1])):
            end = int(k) + int(np.argmin(np.append(is_near[k:], False)))
            closest = int(k) + int(np.argmin(distance[k:end]))
            nearest_pair = part.pair_at(samples.q_D[closest], samples.q_K[closest])
            other_name = nearest_pair.second if nearest_pair.first == name else nearest_pair.first
            touch = Touch(float(samples.t[k]), name, other_name, float(distance[closest]))
            yield _TouchInterval(touch, int(samples.piece[k]), int(samples.piece[end - 1]))


def _merge_touches(entries: Iterable[_TouchInterval]) -> list[Touch]:
    """Touches; those that continue across changes of meetings are joined."""
    merged = list[_TouchInterval]()
    for interval in sorted(entries, key=lambda interval: interval.first):
        names = {interval.touch.first, interval.touch.second}
        for i, earlier in enumerate(merged):
            is_same = {earlier.touch.first, earlier.touch.second} == names
            if is_same and earlier.last >= interval.first - 1:
                distance = min(earlier.touch.distance, interval.touch.distance)
                touch = replace(earlier.touch, distance=distance)
                merged[i] = replace(earlier, touch=touch, last=max(earlier.last, interval.last))
                break
        else:
            merged.append(interval)
    return [interval.touch for interval in merged]
