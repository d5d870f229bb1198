"""Cues of lanes in time: each begins when it is to, or as soon as bounds allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, nearest
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Line, Motion
from fantoccini.theatre.gestures.score import Played
from fantoccini.theatre.script import (
    END,
    LATE,
    START,
    Cue,
    GestureCue,
    HoldCue,
    Moments,
    Notes,
    PlayedCue,
    Ref,
    ScoreCue,
    Spot,
    Time,
    Timeline,
    make_timeline,
)

_HEADING = 1e-2
"""Difference of headings that tears no strings apart [rad]."""

Made = tuple[Gesture, Gesture]
"""The gesture of a cue, once and as often as it is repeated."""
Gestures = Callable[[PlayedCue, Spot], Made | None]
"""Gives those of cues; None after a mistake."""
ScoreCues = Mapping[str, tuple[Spot, tuple[ScoreCue, ...]]]
"""Lane -> where it is written, and its cues."""


@dataclass(frozen=True, eq=False)
class PlacedLanes:
    """Lanes of a score, or of one phrase, placed in time.

    Attributes:
        timeline: the cues, in the file's order.
        lines: lane -> its motion.
        played: the gestures that are played, in the file's order.
        moments: place of a cue or a mark -> its moments.
        marks: mark of the score -> time [s].
        turns: whether a gesture turns.
    """

    timeline: Timeline[ScoreCue]
    lines: Mapping[str, Line]
    played: tuple[tuple[Cue[ScoreCue], Played, Motion], ...]
    moments: Mapping[Spot, Moments]
    marks: Mapping[str, float]
    turns: bool

    def time(self, given: Time, spot: Spot, notes: Notes) -> float:
        """A time of the file [s]; 0 after a mistake."""
        before = len(notes.found)
        ref = self.timeline.names.read(given, spot)
        if len(notes.found) > before:
            return 0.0
        return _within(self.timeline.time(ref, 0.0, self.moments), spot, notes)


def place_lanes(
    lanes: ScoreCues,
    marks: Mapping[str, Time],
    gestures: Gestures,
    most: Array,
    notes: Notes,
    phrase: bool = False,
) -> PlacedLanes | None:
    """Places the cues of the lanes of a score, or of one phrase; None after a mistake.

    Args:
        lanes: lane -> where it is written, and its cues.
        marks: of the score; none in a phrase.
        gestures: gives those of cues.
        most: (2, n_vK) bounds of speeds and accelerations.
        notes: take mistakes and changes.
        phrase: whether it is one.
    """
    made: dict[Spot, Made] = {}
    cues = _cues(lanes, gestures, made, notes)
    if notes.found:
        return None
    spots: dict[Spot, Time] = {("marks", name): time for name, time in marks.items()}
    timeline = make_timeline([cues], spots, notes)
    if notes.found:
        return None
    placing = _Placing(timeline, made, {lane: _Lane(Line(most)) for lane in lanes}, notes, phrase)
    timeline.place(0, 0.0, placing.moments, placing.place, lambda spot, t: _within(t, spot, notes))
    for lane in placing.lanes.values():
        lane.line.rest()
        lane.line.hold(lane.free)
    times = {name: placing.moments["marks", name][""] for name in marks}
    played = [(cue, placing.played[cue.spot]) for cue in cues if cue.spot in placing.played]
    return PlacedLanes(
        timeline,
        {name: lane.line for name, lane in placing.lanes.items()},
        tuple((cue, one, made[cue.spot][1].motion) for cue, one in played),
        placing.moments,
        times,
        any(whole.turns for _, whole in made.values()),
    )


def _cues(
    lanes: ScoreCues, gestures: Gestures, made: dict[Spot, Made], notes: Notes
) -> list[Cue[ScoreCue]]:
    """The cues of lanes, and their gestures by place."""
    cues: list[Cue[ScoreCue]] = []
    for lane, (start, written) in lanes.items():
        before: tuple[Cue[ScoreCue], ...] = ()
        for i, given in enumerate(written):
            spot, name, marks = (*start, i), given.name or "", tuple[str, ...]()
            found = gestures(given, spot) if isinstance(given, PlayedCue) else None
            if found is not None:
                made[spot] = found
                mark, own = given.mark, found[0].marks
                if mark and mark not in own:
                    text = f"{found[0].name} has no mark {mark!r}{nearest(mark, own)}"
                    notes.mistake((*spot, "on"), text)
                name, marks = given.name or found[0].name, tuple(found[1].marks)
            cue = Cue(spot, len(cues), 0, given, (lane,), name, (*marks, START, END), before)
            before = (cue,)
            cues.append(cue)
    return cues


def _within(t: float, spot: Spot, notes: Notes, of: str = "score") -> float:
    """A time, at least 0; notes a mistake where it is earlier [s]."""
    if t < 0.0:
        notes.mistake(spot, f"comes {-t:.2f} s before the {of}")
    return max(t, 0.0)


@dataclass
class _Lane:
    """A lane so far: its motion, when the next cue may begin, what came last, where it looks."""

    line: Line
    free: float = 0.0
    before: str = ""
    heading: float = 0.0


class _Placing:
    """Lanes while cues are placed, one after the other."""

    def __init__(
        self,
        timeline: Timeline[ScoreCue],
        made: Mapping[Spot, Made],
        lanes: Mapping[str, _Lane],
        notes: Notes,
        phrase: bool,
    ):
        self.lanes, self._made, self._timeline = lanes, made, timeline
        self._notes, self._phrase = notes, phrase
        self._of = "phrase" if phrase else "score"
        self.moments: dict[Spot, Moments] = {}
        self.played: dict[Spot, Played] = {}

    def _begins(self, cue: Cue[ScoreCue]) -> float | None:
        """Time at which a cue is to begin [s]; None where it follows the one before."""
        for spot, _ in cue.times:
            ref: Ref = self._timeline.refs[spot]
            t = _within(self._timeline.time(ref, 0.0, self.moments), spot, self._notes, self._of)
            if not cue.given.mark:
                return t
            once, _ = self._made[cue.spot]
            begins = t - once.marks[cue.given.mark]
            if begins < 0.0:
                text = f"{once.name} would begin {-begins:.2f} s before the {self._of}"
                self._notes.mistake(spot, text)
            return max(begins, 0.0)
        return None

    def place(self, cue: Cue[ScoreCue], _: float) -> Moments:
        """Places a cue; its moments."""
        lane, wanted, given = self.lanes[cue.who[0]], self._begins(cue), cue.given
        if isinstance(given, HoldCue):
            return self._rest(cue, given, lane, wanted)
        assert isinstance(given, PlayedCue)
        once, whole = self._made[cue.spot]
        line, free, earliest = lane.line, max(lane.free, lane.line.end), wanted
        if lane.free > line.end:  # after a hold
            earliest = max(lane.free, wanted or 0.0)
        lead = line.lead_time(whole.motion)
        if earliest is not None:
            lead = line.wait(whole.motion, earliest)
        begun = line.add(whole.motion)
        due = wanted if wanted is not None else lane.free if lane.free > 0.0 else None
        if due is not None and begun > due + LATE:
            self._late(cue.spot, whole.name, begun, due, lane.before, lead, free)
        more = whole.duration - given.repeat * once.duration
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
        self.played[cue.spot] = Played(cue.who[0], whole.name, begun, line.end, marks, cue.name)
        return {START: begun, END: line.end, **marks}

    def _rest(
        self, cue: Cue[ScoreCue], given: HoldCue, lane: _Lane, wanted: float | None
    ) -> Moments:
        """A hold: the next cue begins after it, and is led to within it."""
        lane.line.rest()
        free = max(lane.free, lane.line.end)
        begun = free if wanted is None else max(wanted, free)
        if wanted is not None and begun > wanted + LATE:
            self._late(cue.spot, "the hold", begun, wanted, lane.before, 0.0, free)
        lane.free = begun + given.hold * self._notes.beat
        lane.before = "the hold"
        return {START: begun, END: lane.free}

    def _late(
        self, spot: Spot, name: str, begun: float, due: float, before: str, lead: float, free: float
    ) -> None:
        why = f"the way there takes {lead:.2f} s" + (f" after {before}" if before else "")
        if due < free - LATE:
            why = f"{before} ends {self._notes.said(free, self._phrase)}"
        said = self._notes.said(begun, self._phrase), self._notes.said(due, self._phrase)
        self._notes.change(spot, f"{name} begins {said[0]} instead of {said[1]}: {why}")
