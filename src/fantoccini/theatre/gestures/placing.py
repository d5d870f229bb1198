"""Cues of lanes in time: each begins when it is to, or as soon as bounds allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Line, Motion
from fantoccini.theatre.gestures.score import Played
from fantoccini.theatre.script import (
    END,
    LATE,
    START,
    GestureCue,
    HoldCue,
    Notes,
    PlayedCue,
    Reference,
    ScoreCue,
    Spot,
    Time,
    Times,
    in_order,
)

_HEADING = 1e-2
"""Difference of headings that tears no strings apart [rad]."""
_STILL = 1e-9
"""Rate below which a lane is at rest [m/s or rad/s]."""


@dataclass
class Cue:
    """A cue before and after it is placed in time.

    Attributes:
        spot, lane, given: where it is written, and what.
        once, whole: its gesture once and as often as it is repeated; None for a hold.
        name: by which times refer to it; "" where nothing can.
        moments: mark, ``start`` or ``end`` -> time [s], once it is placed.
    """

    spot: Spot
    lane: str
    given: ScoreCue
    once: Gesture | None
    whole: Gesture | None
    name: str
    played: Played | None = None
    moments: dict[str, float] = field(default_factory=dict)

    @property
    def is_named(self) -> bool:
        """Whether the file gives it a name of its own."""
        return self.given.name is not None

    @property
    def times(self) -> list[tuple[Spot, Time]]:
        """The times that it begins by, with their places."""
        return [((*self.spot, *keys), time) for keys, time in self.given.begins]

    @property
    def known(self) -> tuple[str, ...]:
        """Its moments, by name."""
        marks = self.whole.marks if self.whole is not None else ()
        return (*marks, START, END)


Gestures = Callable[[PlayedCue, Spot], tuple[Gesture, Gesture] | None]
"""The gesture of a cue, once and as often as it is repeated; None after a mistake."""


@dataclass
class _Lane:
    """A lane so far: its motion, when the next cue may begin, what came last, where it looks."""

    line: Line
    free: float = 0.0
    before: str = ""
    heading: float = 0.0


class Placing:
    """Cues of the lanes of a score, or of one phrase, placed in time.

    Attributes:
        cues: in the file's order; placed are those that have moments.
        lines: lane -> its motion.
        marks: name -> time [s].

    Args:
        lanes: lane -> where it is written, and its cues.
        marks: of the score; none in a phrase.
        gestures: gives those of cues.
        most: (2, n_vK) bounds of speeds and accelerations.
        notes: take mistakes and changes.
        phrase: whether it is one.
    """

    def __init__(
        self,
        lanes: Mapping[str, tuple[Spot, tuple[ScoreCue, ...]]],
        marks: Mapping[str, Time],
        gestures: Gestures,
        most: Array,
        notes: Notes,
        phrase: bool = False,
    ):
        self._notes, self._phrase = notes, phrase
        self.cues = [
            self._cue((*spot, i), lane, given, gestures)
            for lane, (spot, cues) in lanes.items()
            for i, given in enumerate(cues)
        ]
        self._lanes = {lane: _Lane(Line(most)) for lane in lanes}
        self.marks: dict[str, float] = {}
        if notes.found:
            return
        self.times = Times(marks, self.cues, notes.located)
        self._read: dict[Spot, float | Reference | None] = {}
        order = self._order(marks)
        notes.found += self.times.mistakes
        self.times.mistakes.clear()
        if notes.found:
            return
        places = {cue.spot: cue for cue in self.cues}
        for spot in order:
            if spot in places:
                self._place(places[spot])
            else:
                self.marks[str(spot[-1])] = self._time(spot)
        for one in self._lanes.values():
            if np.any(np.abs(one.line.rate) > _STILL):
                one.line.stop()
            one.line.hold(one.free)

    @property
    def lines(self) -> list[Line]:
        """The lanes' motions."""
        return [lane.line for lane in self._lanes.values()]

    @property
    def played(self) -> list[tuple[Cue, Played, Motion]]:
        """The gestures that are played, in the file's order."""
        return [
            (cue, cue.played, cue.whole.motion)
            for cue in self.cues
            if cue.played is not None and cue.whole is not None
        ]

    def time(self, given: Time, spot: Spot) -> float:
        """A time of the file [s]; 0 after a mistake."""
        self._read[spot] = self.times.read(given, spot)
        self._notes.found += self.times.mistakes
        self.times.mistakes.clear()
        return self._time(spot)

    def _cue(self, spot: Spot, lane: str, given: ScoreCue, gestures: Gestures) -> Cue:
        made = gestures(given, spot) if isinstance(given, PlayedCue) else None
        once, whole = made or (None, None)
        name = given.name or ("" if once is None else once.name)
        return Cue(spot, lane, given, once, whole, name)

    def _order(self, marks: Mapping[str, Time]) -> list[Spot]:
        """Places of marks and cues, each after those that it needs."""
        needs: dict[Spot, list[Spot]] = {}
        for name, given in marks.items():
            needs["marks", name] = self._needed(given, ("marks", name))
        before: dict[str, Spot] = {}
        for cue in self.cues:
            own = [before[cue.lane]] if cue.lane in before else []
            before[cue.lane] = cue.spot
            for spot, given in cue.times:
                own += self._needed(given, spot)
            needs[cue.spot] = own
        order, mistake = in_order(needs, self._notes.located)
        if mistake is not None:
            self._notes.mistake(*mistake)
        return order

    def _needed(self, given: Time, spot: Spot) -> list[Spot]:
        self._read[spot] = found = self.times.read(given, spot)
        return [found.spot] if isinstance(found, Reference) else []

    def _time(self, spot: Spot) -> float:
        """A time that has been read [s]."""
        found, beat = self._read[spot], self._notes.beat
        if not isinstance(found, Reference):
            return (found or 0.0) * beat
        if isinstance(found.target, str):
            base = self.marks[found.target]
        else:
            base = found.target.moments[found.moment]
        t = base + found.offset * beat
        if t < 0.0:
            self._notes.mistake(spot, f"comes {-t:.2f} s before the {self._of}")
        return max(t, 0.0)

    @property
    def _of(self) -> str:
        return "phrase" if self._phrase else "score"

    def _begins(self, cue: Cue) -> float | None:
        """When a cue is to begin [s]; None where it follows the one before."""
        for spot, _ in cue.times:
            t = self._time(spot)
            if not cue.given.mark or cue.once is None:
                return t
            begins = t - cue.once.marks[str(spot[-1])]
            if begins < 0.0:
                text = f"{cue.once.name} would begin {-begins:.2f} s before the {self._of}"
                self._notes.mistake(spot, text)
            return max(begins, 0.0)
        return None

    def _place(self, cue: Cue) -> None:
        lane, wanted, given = self._lanes[cue.lane], self._begins(cue), cue.given
        if isinstance(given, HoldCue):
            self._rest(cue, given, lane, wanted)
            return
        assert isinstance(given, PlayedCue) and cue.whole is not None and cue.once is not None
        line, whole, free = lane.line, cue.whole, max(lane.free, lane.line.end)
        lead, earliest = line.lead_time(whole.motion), wanted
        if lane.free > line.end:  # after a hold
            earliest = max(lane.free, wanted or 0.0)
        if earliest is not None and earliest > line.end + lead:
            if np.any(np.abs(line.rate) > _STILL):
                line.stop()
                lead = line.lead_time(whole.motion)
            line.hold(earliest - lead)
        begun = line.add(whole.motion)
        due = wanted if wanted is not None else lane.free if lane.free > 0.0 else None
        if due is not None and begun > due + LATE:
            self._late(cue.spot, whole.name, begun, due, lane.before, lead, free)
        more = whole.duration - given.repeat * cue.once.duration
        if more > LATE:
            self._notes.change(
                cue.spot,
                f"{whole.name} takes {whole.duration:.2f} s instead of "
                f"{whole.duration - more:.2f} s: it ends elsewhere than it begins, and goes back "
                "each time",
            )
        if whole.turns and abs((given.heading or 0.0) - lane.heading) > _HEADING:
            self._notes.change(
                cue.spot,
                f"{whole.name} turns as if the puppet looked "
                f"{np.degrees(given.heading or 0.0):.0f} deg to the left, and tears its "
                f"strings apart: it looks {np.degrees(lane.heading):.0f} deg; give "
                f"`heading: {np.degrees(lane.heading):.0f} deg`",
            )
        if isinstance(given, GestureCue):
            lane.heading += given.turn or 0.0
        lane.before, lane.free = whole.name, 0.0
        marks = {name: begun + t for name, t in whole.marks.items()}
        cue.played = Played(cue.lane, whole.name, begun, line.end, marks, cue.name)
        cue.moments = {START: begun, END: line.end, **marks}

    def _rest(self, cue: Cue, given: HoldCue, lane: _Lane, wanted: float | None) -> None:
        """A hold: the next cue begins after it, and is led to within it."""
        if np.any(np.abs(lane.line.rate) > _STILL):
            lane.line.stop()
        free = max(lane.free, lane.line.end)
        begun = free if wanted is None else max(wanted, free)
        if wanted is not None and begun > wanted + LATE:
            self._late(cue.spot, "the hold", begun, wanted, lane.before, 0.0, free)
        lane.free = begun + given.hold * self._notes.beat
        lane.before = "the hold"
        cue.moments = {START: begun, END: lane.free}

    def _late(
        self, spot: Spot, name: str, begun: float, due: float, before: str, lead: float, free: float
    ) -> None:
        why = f"the way there takes {lead:.2f} s" + (f" after {before}" if before else "")
        if due < free - LATE:
            why = f"{before} ends {self._notes.said(free, self._phrase)}"
        said = self._notes.said(begun, self._phrase), self._notes.said(due, self._phrase)
        self._notes.change(spot, f"{name} begins {said[0]} instead of {said[1]}: {why}")
