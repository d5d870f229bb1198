"""Performance of a script's cues in order, as a function from state to state.

Scores and plays are performed in the same way. They differ in the verbs of their cues, and in the
treatment of a cue that would be late: see :class:`Policy`.
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
from fantoccini.theatre.gestures.joining import Continued, Line
from fantoccini.theatre.gestures.turns import check_turns
from fantoccini.theatre.script import END, Cue, CueFile, Moments, Spot, Timeline

CueT = TypeVar("CueT", bound=CueFile)
StateT = TypeVar("StateT")

_SAME_TIME = 1e-9
"""Tolerance for equal times [s]."""


class CannotBe(Exception):
    """A cue cannot be done; the message has the reason and a remedy."""


@dataclass(frozen=True)
class Policy:
    """Treatment of cues that would be late.

    Attributes:
        tolerance: largest lateness that is ignored [s].
        refusing: errors for which a cue is left out; if empty, a late cue is done and reported.
    """

    tolerance: float
    refusing: tuple[type[Exception], ...] = ()

    def check(self, late: float, patience: float, message: Callable[[], str]) -> str:
        """Message about a cue that is too late; "" if it is in time.

        Args:
            late: its lateness [s].
            patience: the lateness that the cue allows [s].
            message: returns the message.

        Raises:
            CannotBe: the cue is refused.
        """
        if late <= patience + self.tolerance:
            return ""
        if self.refusing:
            raise CannotBe(message())
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
        busy: gestures so far, for a player in a play.
    """

    lanes: tuple[Line, ...]
    busy: tuple[Busy, ...] = ()

    @property
    def end(self) -> float:
        """End of all lanes [s]."""
        return max(line.end for line in self.lanes)

    def free_lane(self, gesture: Gesture, begin: float) -> tuple[int, float]:
        """Lane for a gesture, and the time at which it can begin there [s].

        It is the first lane that is free at that time, or a new one. If other gestures move the
        same strings at that time, the gesture begins after them, in the lane of the last.
        """
        busy = [
            (end, lane)
            for lane, _, end, named in self.busy
            if end > begin + _SAME_TIME and np.any(named & gesture.named)
        ]
        if busy:
            end, lane = max(busy)
            return lane, max(end, begin)
        for i, line in enumerate(self.lanes[1:], 1):
            if line.end + line.lead_time(gesture.motion) <= begin + _SAME_TIME:
                return i, begin
        if len(self.lanes) > 1 and all(end <= begin for _, _, end, _ in self.busy):
            return 1, begin
        return len(self.lanes), begin

    def add(self, lane: int, gesture: Gesture, begin: float) -> tuple[Hands, Continued]:
        """The hands with a gesture that begins at a time or soon after, and its line.

        Args:
            lane: index of the lane; the number of lanes for a new one.
            gesture: gesture with its variations.
            begin: earliest time [s].
        """
        lanes = [*self.lanes, Line.empty(self.lanes[0].bounds)][: max(lane + 1, len(self.lanes))]
        continued = lanes[lane].add(gesture.motion, begin)
        lanes[lane] = continued.line
        return replace(self, lanes=tuple(lanes)), continued

    def add_busy(self, lane: int, gesture: Gesture, begin: float) -> tuple[Hands, float]:
        """The hands with a gesture that occupies its strings; and its beginning [s]."""
        hands, continued = self.add(lane, gesture, begin)
        start = continued.start
        busy = Busy(lane, start, start + gesture.duration, gesture.named)
        return replace(hands, busy=(*self.busy, busy)), start

    def rested(self, lane: int | None = None) -> Hands:
        """The hands with one lane brought to rest, or all."""
        lines = tuple(
            line.rested() if lane in (None, i) else line for i, line in enumerate(self.lanes)
        )
        return replace(self, lanes=lines)

    def check_turns(self, table: CoordinateTable, before: Hands) -> None:
        """Checks the turns of bodies by all lanes together, where lanes have been added.

        Args:
            table: coordinates of the puppet.
            before: the hands without what has been added.

        Raises:
            TurnError: a body turns too far.
        """
        ends = [line.end for line in before.lanes] + [0.0] * len(self.lanes)
        since = min(
            (end for line, end in zip(self.lanes, ends, strict=False) if line.end > end),
            default=self.end,
        )
        if not table.rotations or since >= self.end:
            return
        later = [line.held(self.end).after(since) for line in self.lanes]
        clock = pieces.merged_times(
            [breaks[breaks > since] for breaks, _ in later] + [np.array([since])]
        )
        coef = [
            piecewise.on(pieces.snapped_to_breaks(breaks, clock), own, clock)
            for breaks, own in later
        ]
        check_turns(table, clock, np.sum(coef, axis=0))

    def motion(
        self, table: CoordinateTable, labels: Sequence[str], until: float
    ) -> tuple[Gesture, dict[str, Gesture]]:
        """Motion of all lanes together, and of each by its label; at rest until the end.

        Args:
            table: coordinates of the puppet.
            labels: names of the lanes.
            until: end [s].
        """
        lanes = {
            label: Gesture(table, *line.held(until).motion, label)
            for label, line in zip(labels, self.lanes, strict=True)
        }
        whole, *others = lanes.values()
        for other in others:
            whole += other
        return whole, lanes


@dataclass(frozen=True)
class Part:
    """Part of one player in a cue.

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
class Turn(Generic[CueT]):
    """Cue to be placed next.

    Attributes:
        cue: cue of the file, with its players.
        wanted: wanted time of the cue, or of its mark in `on` [s].
        start: start of its act [s].
        moments: keys of a placed cue or mark -> its moments.
    """

    cue: Cue[CueT]
    wanted: float
    start: float
    moments: Mapping[Spot, Moments]

    @property
    def spot(self) -> Spot:
        """Keys of its place in the file."""
        return self.cue.spot

    @property
    def given(self) -> CueT:
        """Entry of the file."""
        return self.cue.given

    @property
    def who(self) -> tuple[str, ...]:
        """Players."""
        return self.cue.who


@dataclass(frozen=True)
class Placed(Generic[CueT]):
    """Placed cue.

    Attributes:
        cue: cue of the file, with its players.
        wanted: wanted time of the cue, or of its mark in `on` [s].
        parts: parts of the players; empty if it cannot be done.
        moments: mark, ``start`` or ``end`` -> time [s]; of several players the last.
        refused: reason why it cannot be done; "" if it can.
    """

    cue: Cue[CueT]
    wanted: float
    parts: tuple[Part, ...]
    moments: Moments
    refused: str = ""

    @property
    def spot(self) -> Spot:
        """Keys of its place in the file."""
        return self.cue.spot

    @property
    def given(self) -> CueT:
        """Entry of the file."""
        return self.cue.given


@dataclass(frozen=True, eq=False)
class Performed(Generic[CueT, StateT]):
    """Script performed up to some cue.

    Attributes:
        state: state of the performers, each at the end of its last cue.
        moments: keys of a cue or a mark -> its moments.
        placed: keys of a cue -> placed cue.
    """

    state: StateT
    moments: Mapping[Spot, Moments] = field(default_factory=dict)
    placed: Mapping[Spot, Placed[CueT]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Performer(Generic[CueT, StateT]):
    """Performer of a script's cues.

    Attributes:
        timeline: cues of the script.
        policy: treatment of cues that would be late.
        do: performs a cue: returns the next state, the parts of the players and the moments of the
            cue, from a state and the cue.
        mark: returns the time of a mark of the file, from its written time [s].
        refused: keys of a cue that is left out -> reason.
    """

    timeline: Timeline[CueT]
    policy: Policy
    do: Callable[[StateT, Turn[CueT]], tuple[StateT, tuple[Part, ...], Moments]]
    mark: Callable[[Spot, float], float] = lambda spot, t: t
    refused: Mapping[Spot, str] = field(default_factory=dict)

    def act(
        self, before: Performed[CueT, StateT], number: int, start: float
    ) -> Performed[CueT, StateT]:
        """The script with one more act performed.

        Args:
            before: script up to the act.
            number: number of the act.
            start: start of the act [s].
        """
        state, moments, placed = before.state, dict(before.moments), dict(before.placed)

        def perform(cue: Cue[CueT], t: float) -> Moments:
            nonlocal state
            state, placed[cue.spot] = self._placed(state, Turn(cue, t, start, moments))
            return placed[cue.spot].moments

        self.timeline.place(number, start, moments, perform, self.mark)
        return Performed(state, moments, placed)

    def _placed(self, state: StateT, turn: Turn[CueT]) -> tuple[StateT, Placed[CueT]]:
        """State after a cue, and the placed cue; the state is unchanged if it is refused."""
        cue, reason = turn.cue, self.refused.get(turn.spot, "")
        if not reason:
            try:
                after, parts, moments = self.do(state, turn)
                return after, Placed(cue, turn.wanted, parts, moments)
            except self.policy.refusing as error:
                reason = str(error)
        # Later cues begin as if it had been done, but not while the player is busy.
        t = max(turn.wanted, 0.0)
        end = max([t, *(turn.moments[before.spot][END] for before in cue.before)])
        moments = dict.fromkeys(cue.known, t) | {END: end}
        return state, Placed(cue, turn.wanted, (), moments, reason)
