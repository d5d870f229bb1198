"""Cues of a script performed one after the other, as a function from state to state.

Scores and plays are performed alike. They differ in the verbs of their cues, and in the treatment
of a cue that cannot be in time: see :class:`Policy`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from fantoccini.base import MaskRows
from fantoccini.model.tree import CoordinateTable
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Continued, Line
from fantoccini.theatre.script import END, Cue, CueFile, Moments, Spot, Timeline

CueT = TypeVar("CueT", bound=CueFile)
StateT = TypeVar("StateT")

_SAME_TIME = 1e-9
"""Difference of times that counts as none [s]."""


class CannotBe(Exception):
    """A cue cannot be done; the text says why, and what can."""


@dataclass(frozen=True)
class Policy:
    """Treatment of cues that cannot be in time.

    Attributes:
        tolerance: lateness that counts as none [s].
        refusing: errors that leave a cue out. Without any, a cue begins late and is reported.
    """

    tolerance: float
    refusing: tuple[type[Exception], ...] = ()

    def check(self, late: float, patience: float, why: Callable[[], str]) -> str:
        """The message to report of a cue that is too late; "" if it is in time.

        Args:
            late: its lateness [s].
            patience: the lateness that the cue allows [s].
            why: gives the message.

        Raises:
            CannotBe: it is refused.
        """
        if late <= patience + self.tolerance:
            return ""
        if self.refusing:
            raise CannotBe(why())
        return why()


class Busy(NamedTuple):
    """A gesture in a lane.

    Attributes:
        lane: its number.
        start, end: [s].
        named: (n_vK,) bool, the coordinates that it moves.
    """

    lane: int
    start: float
    end: float
    named: MaskRows


@dataclass(frozen=True, eq=False)
class Hands:
    """The hands of a player: lanes whose motions add up.

    Attributes:
        lanes: of a score, or of a player of a play, whose walks are in the first.
        busy: the gestures of a player of a play so far.
    """

    lanes: tuple[Line, ...]
    busy: tuple[Busy, ...] = ()

    @property
    def end(self) -> float:
        """The end of all lanes [s]."""
        return max(line.end for line in self.lanes)

    def free_lane(self, gesture: Gesture, begin: float) -> tuple[int, float]:
        """The lane of a gesture, and when it can begin there [s].

        It is the first lane that is free then, or a new one. Where other gestures move the same
        strings then, it begins after them, in the lane of the last.
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
        """The hands with a gesture that begins at a time, or soon after [s], and its line.

        Args:
            lane: its number; the number of lanes for a new one.
            gesture: as it is played.
            begin: earliest time [s].
        """
        lanes = [*self.lanes, Line.empty(self.lanes[0].most)][: max(lane + 1, len(self.lanes))]
        continued = lanes[lane].add(gesture.motion, begin)
        lanes[lane] = continued.line
        return replace(self, lanes=tuple(lanes)), continued

    def add_busy(self, lane: int, gesture: Gesture, begin: float) -> tuple[Hands, float]:
        """Likewise, for gestures that occupy their strings; when it begins [s]."""
        hands, continued = self.add(lane, gesture, begin)
        begun = continued.begun
        busy = Busy(lane, begun, begun + gesture.duration, gesture.named)
        return replace(hands, busy=(*self.busy, busy)), begun

    def rested(self, lane: int | None = None) -> Hands:
        """The hands with a lane brought to rest, or with all."""
        own = range(len(self.lanes)) if lane is None else (lane,)
        return replace(
            self,
            lanes=tuple(line.rested() if i in own else line for i, line in enumerate(self.lanes)),
        )

    def motion(
        self, table: CoordinateTable, labels: Sequence[str], until: float
    ) -> tuple[Gesture, dict[str, Gesture]]:
        """All that they do, and each lane by its label; both hold still at the end.

        Args:
            table: of the puppet.
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
    """The part of one player in a cue.

    Attributes:
        who: the player; "" in a score.
        lane: of the player.
        gesture: as it is played, from the player's heading.
        start, end: [s].
        marks: of the gesture -> time [s].
    """

    who: str
    lane: int
    gesture: Gesture
    start: float
    end: float
    marks: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Turn(Generic[CueT]):
    """A cue that is to be placed.

    Attributes:
        cue: as it is written, with its players.
        wanted: when it, or its mark of `on`, is to be [s].
        start: of its act [s].
        moments: place of a cue or a mark -> its moments, of all that is placed.
    """

    cue: Cue[CueT]
    wanted: float
    start: float
    moments: Mapping[Spot, Moments]

    @property
    def spot(self) -> Spot:
        """Keys that lead to it."""
        return self.cue.spot

    @property
    def given(self) -> CueT:
        """The cue as it is written."""
        return self.cue.given

    @property
    def who(self) -> tuple[str, ...]:
        """The players."""
        return self.cue.who


@dataclass(frozen=True)
class Placed(Generic[CueT]):
    """A cue as it is placed.

    Attributes:
        cue: as it is written, with its players.
        wanted: when it, or its mark of `on`, is to be [s].
        parts: of the players; none where it cannot be done.
        moments: mark, ``start`` or ``end`` -> time [s], of several players the last.
        refused: why it cannot be done; "" where it can.
    """

    cue: Cue[CueT]
    wanted: float
    parts: tuple[Part, ...]
    moments: Moments
    refused: str = ""

    @property
    def spot(self) -> Spot:
        """Keys that lead to it."""
        return self.cue.spot

    @property
    def given(self) -> CueT:
        """The cue as it is written."""
        return self.cue.given


@dataclass(frozen=True, eq=False)
class Performed(Generic[CueT, StateT]):
    """A script as far as it is performed.

    Attributes:
        state: of the performers, at the end of each one's last cue.
        moments: place of a cue or a mark -> its moments.
        placed: place of a cue -> the cue as it is placed.
    """

    state: StateT
    moments: Mapping[Spot, Moments] = field(default_factory=dict)
    placed: Mapping[Spot, Placed[CueT]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Performer(Generic[CueT, StateT]):
    """Performs the cues of a script.

    Attributes:
        timeline: the cues.
        policy: treatment of cues that cannot be in time.
        do: does what a cue says: from a state and a cue to the next state, the parts of the players
            and the moments of the cue.
        mark: gives the time of a mark of the file, from the one that is written [s].
        refused: place of a cue that is left out -> why.
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
            before: as far as it is performed.
            number: of the act.
            start: of the act [s].
        """
        state, moments, placed = before.state, dict(before.moments), dict(before.placed)

        def perform(cue: Cue[CueT], t: float) -> Moments:
            nonlocal state
            state, placed[cue.spot] = self._placed(state, Turn(cue, t, start, moments))
            return placed[cue.spot].moments

        self.timeline.place(number, start, moments, perform, self.mark)
        return Performed(state, moments, placed)

    def _placed(self, state: StateT, turn: Turn[CueT]) -> tuple[StateT, Placed[CueT]]:
        """The state after a cue, and the cue as it is placed; the same state if it is refused."""
        cue, why = turn.cue, self.refused.get(turn.spot, "")
        if not why:
            try:
                after, parts, moments = self.do(state, turn)
                return after, Placed(cue, turn.wanted, parts, moments)
            except self.policy.refusing as error:
                why = str(error)
        # What follows begins when it would have, but not while the player is busy.
        t = max(turn.wanted, 0.0)
        end = max([t, *(turn.moments[before.spot][END] for before in cue.before)])
        return state, Placed(cue, turn.wanted, (), dict.fromkeys(cue.known, t) | {END: end}, why)
