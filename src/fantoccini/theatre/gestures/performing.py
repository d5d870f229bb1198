"""Performance of a script's cues in order, each from one state of the stage to the next.

Scores and plays are performed in the same way. They differ in the verbs of their cues, and in the
treatment of a cue that would be late: see :class:`LatenessPolicy`.

A script is the list of cues of a score or a play, and a cue a verb with its player and time. A lane
is a list of gestures in order; the offsets of all lanes add up. In names, K stands for driven
coordinates: ends and lengths of strings, driven joints. A spot is the list of keys that leads to an
entry of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from fantoccini.base import MaskRows
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import pieces
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import AddedMotion, MotionSequence
from fantoccini.theatre.gestures.turns import check_turns
from fantoccini.theatre.script import END, Cue, CueFile, Moments, Spot, Timeline

CueT = TypeVar("CueT", bound=CueFile)
StateT = TypeVar("StateT")

_SAME_TIME = 1e-9
"""Tolerance for equal times [s]."""


class CueError(Exception):
    """A cue cannot be done; the message has the reason and a remedy."""


@dataclass(frozen=True)
class LatenessPolicy:
    """Treatment of cues that would be late.

    Attributes:
        tolerance: largest lateness that is ignored [s].
        refusal_errors: errors for which a cue is left out; if empty, a late cue is done and
            reported.
    """

    tolerance: float
    refusal_errors: tuple[type[Exception], ...] = ()

    def check(self, lateness: float, patience: float, message: Callable[[], str]) -> str:
        """Message about a cue that is too late; "" if it is in time.

        Args:
            lateness: its lateness [s].
            patience: the lateness that the cue allows [s].
            message: returns the message.

        Raises:
            CueError: the cue is refused.
        """
        if lateness <= patience + self.tolerance:
            return ""
        if self.refusal_errors:
            raise CueError(message())
        return message()


class Busy(NamedTuple):
    """Time in which a gesture occupies coordinates.

    Attributes:
        lane: index of its lane.
        start, end: beginning and end [s].
        named: (n_vK,) bool, whether it moves a coordinate.
    """

    lane: int
    start: float
    end: float
    named: MaskRows


@dataclass(frozen=True, eq=False)
class Hands:
    """Motion of a player's hands: the sum of lanes.

    Attributes:
        lanes: lanes of a score, or of a player in a play, with the walks in the first.
        busy: times of the gestures so far, for a player in a play.
    """

    lanes: tuple[MotionSequence, ...]
    busy: tuple[Busy, ...] = ()

    @property
    def end(self) -> float:
        """End of all lanes [s]."""
        return max(sequence.end for sequence in self.lanes)

    def free_lane(self, gesture: Gesture, begin: float) -> tuple[int, float]:
        """Lane for a gesture, and the time at which it can begin there [s].

        It is the first lane that is free at that time, or a new one. If other gestures move the
        same strings at that time, the gesture begins after them, in the lane of the last.
        """
        conflicts = [
            (end, lane)
            for lane, _, end, named in self.busy
            if end > begin + _SAME_TIME and np.any(named & gesture.named)
        ]
        if conflicts:
            end, lane = max(conflicts)
            return lane, max(end, begin)
        for i, sequence in enumerate(self.lanes[1:], 1):
            if sequence.end + sequence.lead_time(gesture.motion) <= begin + _SAME_TIME:
                return i, begin
        if len(self.lanes) > 1 and all(end <= begin for _, _, end, _ in self.busy):
            return 1, begin
        return len(self.lanes), begin

    def add(self, lane: int, gesture: Gesture, begin: float) -> tuple[Hands, AddedMotion]:
        """The hands with a gesture that begins at a time or soon after, and its motion in the lane.

        Args:
            lane: index of the lane; the number of lanes for a new one.
            gesture: gesture with its variations.
            begin: earliest time [s].
        """
        lanes = [*self.lanes, MotionSequence.empty(self.lanes[0].bounds)][
            : max(lane + 1, len(self.lanes))
        ]
        addition = lanes[lane].add(gesture.motion, begin)
        lanes[lane] = addition.sequence
        return replace(self, lanes=tuple(lanes)), addition

    def add_busy(self, lane: int, gesture: Gesture, begin: float) -> tuple[Hands, float]:
        """The hands with a gesture that keeps others off its strings; and its beginning [s]."""
        hands, addition = self.add(lane, gesture, begin)
        start = addition.start
        busy = Busy(lane, start, start + gesture.duration, gesture.named)
        return replace(hands, busy=(*self.busy, busy)), start

    def rested(self, lane: int | None = None) -> Hands:
        """The hands with one lane brought to rest, or all."""
        lanes = tuple(
            sequence.stopped_if_moving() if lane in (None, i) else sequence
            for i, sequence in enumerate(self.lanes)
        )
        return replace(self, lanes=lanes)

    def check_turns(self, table: CoordinateTable, before: Hands) -> None:
        """Checks that all lanes together turn no body too far, where lanes have been added.

        Args:
            table: coordinates of the puppet.
            before: the hands without what has been added.

        Raises:
            TurnError: a body turns too far.
        """
        lane_ends = [sequence.end for sequence in before.lanes] + [0.0] * len(self.lanes)
        changed_from = min(
            (
                lane_end
                for sequence, lane_end in zip(self.lanes, lane_ends, strict=False)
                if sequence.end > lane_end
            ),
            default=self.end,
        )
        if not table.rotations or changed_from >= self.end:
            return
        added_pieces = [
            sequence.held_until(self.end).pieces_after(changed_from) for sequence in self.lanes
        ]
        common_breaks = pieces.merged_times(
            [breaks[breaks > changed_from] for breaks, _ in added_pieces]
            + [np.array([changed_from])]
        )
        coef = [
            piecewise.refine(
                pieces.snapped_to_breaks(breaks, common_breaks), lane_coef, common_breaks
            )
            for breaks, lane_coef in added_pieces
        ]
        check_turns(table, common_breaks, np.sum(coef, axis=0))

    def motion(
        self, table: CoordinateTable, labels: Sequence[str], end: float
    ) -> tuple[Gesture, dict[str, Gesture]]:
        """Motion of all lanes together, and of each by its label; at rest until the end.

        Args:
            table: coordinates of the puppet.
            labels: names of the lanes.
            end: end [s].
        """
        gestures = {
            label: Gesture(table, *sequence.held_until(end).motion, label)
            for label, sequence in zip(labels, self.lanes, strict=True)
        }
        total, *others = gestures.values()
        for other in others:
            total += other
        return total, gestures


@dataclass(frozen=True)
class CuePart:
    """Part of one player in a cue: its gesture, with the times.

    Attributes:
        who: player; "" in a score.
        lane: index of the player's lane.
        gesture: gesture with its variations, turned to the player's heading.
        start, end: beginning and end [s].
        marks: mark of the gesture -> time [s].
    """

    who: str
    lane: int
    gesture: Gesture
    start: float
    end: float
    marks: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class PendingCue(Generic[CueT]):
    """Cue whose time and gesture are to be determined next.

    Attributes:
        cue: cue of the file, with its players.
        wanted_time: time that the file demands for the cue, or for its mark in `on` [s].
        start: start of its act [s].
        moments: keys of a placed cue or mark -> its moments.
    """

    cue: Cue[CueT]
    wanted_time: float
    start: float
    moments: Mapping[Spot, Moments]

    @property
    def spot(self) -> Spot:
        """Keys of its place in the file."""
        return self.cue.spot

    @property
    def entry(self) -> CueT:
        """Entry of the file."""
        return self.cue.entry

    @property
    def who(self) -> tuple[str, ...]:
        """Players."""
        return self.cue.who


@dataclass(frozen=True)
class PlacedCue(Generic[CueT]):
    """Cue whose time and gestures are determined, or that is refused.

    Attributes:
        cue: cue of the file, with its players.
        wanted_time: time that the file demands for the cue, or for its mark in `on` [s].
        parts: parts of the players in it; empty if it cannot be done.
        moments: mark, ``start`` or ``end`` -> time [s]; of several players the last.
        refused: reason why it cannot be done; "" if it can.
    """

    cue: Cue[CueT]
    wanted_time: float
    parts: tuple[CuePart, ...]
    moments: Moments
    refused: str = ""

    @property
    def spot(self) -> Spot:
        """Keys of its place in the file."""
        return self.cue.spot

    @property
    def entry(self) -> CueT:
        """Entry of the file."""
        return self.cue.entry


@dataclass(frozen=True, eq=False)
class PerformedScript(Generic[CueT, StateT]):
    """Script performed up to some cue.

    Attributes:
        state: state of the performers, each at the end of its last cue.
        moments: keys of a cue or a mark -> its moments.
        placed: keys of a cue -> placed cue.
    """

    state: StateT
    moments: Mapping[Spot, Moments] = field(default_factory=dict)
    placed: Mapping[Spot, PlacedCue[CueT]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Performer(Generic[CueT, StateT]):
    """Performer of a script's cues.

    Attributes:
        timeline: cues of the script.
        policy: treatment of cues that would be late.
        perform: returns the next state, the parts of the players and the moments of the
            cue, from a state and the cue.
        time_of_mark: returns the time of a mark of the file, from its written time [s].
        refused: keys of a cue that is left out -> reason.
    """

    timeline: Timeline[CueT]
    policy: LatenessPolicy
    perform: Callable[[StateT, PendingCue[CueT]], tuple[StateT, tuple[CuePart, ...], Moments]]
    time_of_mark: Callable[[Spot, float], float] = lambda spot, t: t
    refused: Mapping[Spot, str] = field(default_factory=dict)

    def perform_act(
        self, performed: PerformedScript[CueT, StateT], act: int, start: float
    ) -> PerformedScript[CueT, StateT]:
        """The script with one more act performed.

        Args:
            performed: script up to the act.
            act: number of the act.
            start: start of the act [s].
        """
        state, moments, placed = performed.state, dict(performed.moments), dict(performed.placed)

        def place_cue(cue: Cue[CueT], t: float) -> Moments:
            nonlocal state
            state, placed[cue.spot] = self._perform_cue(state, PendingCue(cue, t, start, moments))
            return placed[cue.spot].moments

        self.timeline.place(act, start, moments, place_cue, self.time_of_mark)
        return PerformedScript(state, moments, placed)

    def _perform_cue(
        self, state: StateT, pending: PendingCue[CueT]
    ) -> tuple[StateT, PlacedCue[CueT]]:
        """State after a cue, and the placed cue; the state is unchanged if it is refused."""
        cue, reason = pending.cue, self.refused.get(pending.spot, "")
        if not reason:
            try:
                next_state, parts, moments = self.perform(state, pending)
                return next_state, PlacedCue(cue, pending.wanted_time, parts, moments)
            except self.policy.refusal_errors as error:
                reason = str(error)
        # Later cues begin as if it had been done, but not while the player is busy.
        t = max(pending.wanted_time, 0.0)
        end_time = max([t, *(pending.moments[previous.spot][END] for previous in cue.previous)])
        moments = dict.fromkeys(cue.moment_names, t) | {END: end_time}
        return state, PlacedCue(cue, pending.wanted_time, (), moments, reason)
