"""Performance of scores: each cue begins on time, or as soon after as the bounds allow.

A score is a play with one player, whose lanes the file names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, did_you_mean
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Line, Motion
from fantoccini.theatre.gestures.performing import Hands, Part, Performed, Performer, Policy, Turn
from fantoccini.theatre.gestures.score import Played
from fantoccini.theatre.script import (
    END,
    LATE,
    START,
    Cue,
    GestureCue,
    HoldCue,
    Moments,
    PlayedCue,
    ScoreCue,
    ScriptLog,
    Spot,
    Time,
    Timeline,
    make_timeline,
)

_MAX_HEADING_ERROR = 1e-2
"""Largest error of the heading for which a turn keeps strings together [rad]."""
_POLICY = Policy(LATE)
"""Late cues of a score are reported."""

CueGestures = tuple[Gesture, Gesture]
"""Gesture of a cue, once and with its repetitions."""
Gestures = Callable[[PlayedCue, Spot], CueGestures | None]
"""Returns the gestures of a cue; None after a mistake."""
ScoreCues = Mapping[str, tuple[Spot, tuple[ScoreCue, ...]]]
"""Lane -> its keys in the file, and its cues."""


@dataclass(frozen=True, eq=False)
class PlacedLanes:
    """Lanes of a score or a phrase, placed in time.

    Attributes:
        timeline: cues in the file's order.
        hands: motion of each lane.
        played: gestures that are played, in the file's order.
        moments: keys of a cue or a mark -> its moments.
        marks: mark of the score -> time [s].
        turns: whether a gesture turns.
    """

    timeline: Timeline[ScoreCue]
    hands: Hands
    played: tuple[tuple[Cue[ScoreCue], Played, Motion], ...]
    moments: Mapping[Spot, Moments]
    marks: Mapping[str, float]
    turns: bool

    def time(self, given: Time, spot: Spot, log: ScriptLog) -> float:
        """Time of the file [s]; 0 after a mistake."""
        before = len(log.mistakes)
        ref = self.timeline.names.read(given, spot)
        if len(log.mistakes) > before:
            return 0.0
        return _within(self.timeline.time(ref, 0.0, self.moments), spot, log)


def place_lanes(
    lanes: ScoreCues,
    marks: Mapping[str, Time],
    gestures: Gestures,
    bounds: Array,
    log: ScriptLog,
    phrase: bool = False,
) -> PlacedLanes | None:
    """Places the cues of the lanes of a score or a phrase; None after a mistake.

    Args:
        lanes: lane -> its keys in the file, and its cues.
        marks: marks of the score; empty for a phrase.
        gestures: returns the gestures of cues.
        bounds: (2, n_vK) bounds of speeds and accelerations.
        log: collects mistakes and changes.
        phrase: whether they are the lanes of a phrase.
    """
    cue_gestures: dict[Spot, CueGestures] = {}
    cues = _cues(lanes, gestures, cue_gestures, log)
    if log.mistakes:
        return None
    spots: dict[Spot, Time] = {("marks", name): time for name, time in marks.items()}
    timeline = make_timeline([cues], spots, log)
    if log.mistakes:
        return None
    verbs = _Verbs(cue_gestures, tuple(lanes), log, phrase)
    performer = Performer(timeline, _POLICY, verbs.do, lambda spot, t: _within(t, spot, log))
    whole = performer.act(Performed(Hands(tuple(Line.empty(bounds) for _ in lanes))), 0, 0.0)
    ends = {cue.who[0]: whole.moments[cue.spot][END] for cue in cues}
    lines = zip(lanes, whole.state.rested().lanes, strict=True)
    parts = [(cue, part) for cue in cues for part in whole.placed[cue.spot].parts]
    return PlacedLanes(
        timeline,
        Hands(tuple(line.held(ends.get(lane, 0.0)) for lane, line in lines)),
        tuple(
            (
                cue,
                Played(cue.who[0], part.gesture.name, part.start, part.end, part.marks, cue.name),
                part.gesture.motion,
            )
            for cue, part in parts
        ),
        whole.moments,
        {name: whole.moments["marks", name][""] for name in marks},
        any(part.gesture.turns for _, part in parts),
    )


def _cues(
    lanes: ScoreCues, gestures: Gestures, cue_gestures: dict[Spot, CueGestures], log: ScriptLog
) -> list[Cue[ScoreCue]]:
    """Cues of lanes; their gestures are added to ``cue_gestures``."""
    cues: list[Cue[ScoreCue]] = []
    for lane, (start, written) in lanes.items():
        before: tuple[Cue[ScoreCue], ...] = ()
        for i, entry in enumerate(written):
            spot, name, marks = (*start, i), entry.name or "", tuple[str, ...]()
            own = gestures(entry, spot) if isinstance(entry, PlayedCue) else None
            if own is not None:
                cue_gestures[spot] = once, whole = own
                if entry.mark and entry.mark not in once.marks:
                    text = f"{once.name} has no mark {entry.mark!r}"
                    log.mistakes.add((*spot, "on"), text + did_you_mean(entry.mark, once.marks))
                name, marks = entry.name or once.name, tuple(whole.marks)
            cue = Cue(spot, len(cues), 0, entry, (lane,), name, (*marks, START, END), before)
            before = (cue,)
            cues.append(cue)
    return cues


def _within(t: float, spot: Spot, log: ScriptLog, of: str = "score") -> float:
    """The time, at least 0 [s]; records a mistake if it is negative."""
    if t < 0.0:
        log.mistakes.add(spot, f"comes {log.duration_in_words(-t)} before the {of}")
    return max(t, 0.0)


class _Verbs:
    """Verbs of cues in lanes.

    Args:
        cue_gestures: keys of a cue -> its gesture, once and with its repetitions.
        lanes: names of the lanes.
        log: collects mistakes and changes.
        phrase: whether they are the lanes of a phrase.
    """

    def __init__(
        self,
        cue_gestures: Mapping[Spot, CueGestures],
        lanes: tuple[str, ...],
        log: ScriptLog,
        phrase: bool,
    ):
        self._cue_gestures, self._lanes, self._log, self._phrase = cue_gestures, lanes, log, phrase
        self._of = "phrase" if phrase else "score"

    def do(self, hands: Hands, turn: Turn[ScoreCue]) -> tuple[Hands, tuple[Part, ...], Moments]:
        """Hands after a cue, its parts, and its moments."""
        lane, entry = self._lanes.index(turn.who[0]), turn.given
        begin, before = self._begin(turn), turn.cue.before
        held = bool(before) and isinstance(before[0].given, HoldCue)
        due = begin if turn.cue.times or held else np.inf
        end = turn.moments[before[0].spot][END] if before else 0.0
        if isinstance(entry, HoldCue):
            hands = hands.rested(lane)
            free = max(end, hands.lanes[lane].end)
            begun = max(begin, free)
            self._check_time(turn, "the hold", begun, due if turn.cue.times else np.inf, 0.0, free)
            # The next cue begins after it; the transition to it lies within the hold.
            return hands, (), {START: begun, END: begun + entry.hold * self._log.beat}
        whole, free = self._cue_gestures[turn.spot][1], max(end, hands.lanes[lane].end)
        hands, (line, begun, lead) = hands.add(lane, whole, max(begin, free))
        self._check_time(turn, whole.name, begun, due, lead, free)
        self._note_changed(turn)
        marks = {name: begun + t for name, t in whole.marks.items()}
        part = Part("", lane, whole, begun, line.end, marks)
        return hands, (part,), {START: begun, END: line.end, **marks}

    def _begin(self, turn: Turn[ScoreCue]) -> float:
        """Time at which a cue should begin [s]."""
        t, mark = turn.wanted, turn.given.mark
        for spot, _ in turn.cue.times:
            t = _within(t, spot, self._log, self._of)
            if mark:
                once, _ = self._cue_gestures[turn.spot]
                t -= once.marks[mark]
                if t < 0.0:
                    early = self._log.duration_in_words(-t)
                    text = f"{once.name} would begin {early} before the {self._of}"
                    self._log.mistakes.add(spot, text)
        return max(t, 0.0)

    def _check_time(
        self, turn: Turn[ScoreCue], name: str, begun: float, due: float, lead: float, free: float
    ) -> None:
        """Reports a late beginning.

        Args:
            turn: turn of the cue.
            name: name of its gesture.
            begun, due: actual and wanted beginning [s].
            lead: duration of the transition to its start [s].
            free: end of the previous cue [s].
        """

        def why() -> str:
            before = self._name(turn.cue.before[0]) if turn.cue.before else ""
            reason = f"the way there takes {self._log.duration_in_words(lead)}"
            reason += f" after {before}" if before else ""
            if due < free - LATE:
                reason = f"{before} ends {in_words(free, self._phrase)}"
            times = in_words(begun, self._phrase), in_words(due, self._phrase)
            return f"{name} begins {times[0]} instead of {times[1]}: {reason}"

        in_words = self._log.in_words
        if text := _POLICY.check(begun - due, 0.0, why):
            self._log.change(turn.spot, text)

    def _name(self, cue: Cue[ScoreCue]) -> str:
        return (
            "the hold" if isinstance(cue.given, HoldCue) else self._cue_gestures[cue.spot][1].name
        )

    def _note_changed(self, turn: Turn[ScoreCue]) -> None:
        """Reports repetitions that take longer, and turns from a wrong heading."""
        (once, whole), entry, spot = self._cue_gestures[turn.spot], turn.given, turn.spot
        assert isinstance(entry, PlayedCue)
        longer = whole.duration - entry.repeat * once.duration
        if longer > LATE:
            words = self._log.duration_in_words
            self._log.change(
                spot,
                f"{whole.name} takes {words(whole.duration)} instead of "
                f"{words(whole.duration - longer)}: it ends elsewhere than it begins, and returns "
                "each time",
            )
        if not whole.turns:
            return
        heading = _heading(turn.cue)
        if abs((entry.heading or 0.0) - heading) > _MAX_HEADING_ERROR:
            self._log.change(
                spot,
                f"{whole.name} turns as for a heading of "
                f"{np.degrees(entry.heading or 0.0):.0f} deg, which pulls the strings apart: the "
                f"puppet's heading is {np.degrees(heading):.0f} deg; give "
                f"`heading: {np.degrees(heading):.0f} deg`",
            )


def _heading(cue: Cue[ScoreCue]) -> float:
    """Heading of the puppet before a cue, by the turns of its lane [rad]."""
    turns = list[float]()
    while cue.before:
        (cue,) = cue.before
        if isinstance(cue.given, GestureCue):
            turns.append(cue.given.turn or 0.0)
    return sum(reversed(turns), start=0.0)
