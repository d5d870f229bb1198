"""Performance of scores: each cue begins on time, or as soon after as the bounds allow.

A score is a play with one player, whose lanes the file names.

A lane is a list of cues in order; the gestures of several lanes add up. A cue is late if a bound of
speed or acceleration keeps its gesture from beginning on time. A phrase is a part of a score that
is played like a gesture. In names, K stands for driven coordinates: ends and lengths of strings,
driven joints. A spot is the list of keys that leads to an entry of the file. Mistakes of the file
are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, did_you_mean
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Motion, MotionSequence
from fantoccini.theatre.gestures.performing import (
    CuePart,
    Hands,
    LatenessPolicy,
    PendingCue,
    PerformedScript,
    Performer,
)
from fantoccini.theatre.gestures.score import PlayedGesture
from fantoccini.theatre.script import (
    END,
    LATENESS_TOLERANCE,
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
_LATENESS_POLICY = LatenessPolicy(LATENESS_TOLERANCE)
"""Late cues of a score are reported."""

SingleAndRepeated = tuple[Gesture, Gesture]
"""Gesture of a cue, once and with its repetitions."""
GestureLookup = Callable[[PlayedCue, Spot], SingleAndRepeated | None]
"""Returns the gestures of a cue; None after a mistake."""
LaneCues = Mapping[str, tuple[Spot, tuple[ScoreCue, ...]]]
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
        changes_heading: whether a gesture changes the heading.
    """

    timeline: Timeline[ScoreCue]
    hands: Hands
    played: tuple[tuple[Cue[ScoreCue], PlayedGesture, Motion], ...]
    moments: Mapping[Spot, Moments]
    marks: Mapping[str, float]
    changes_heading: bool

    def time(self, file_time: Time, spot: Spot, log: ScriptLog) -> float:
        """Time of the file [s]; 0 after a mistake."""
        n_mistakes = len(log.mistakes)
        ref = self.timeline.time_resolver.read(file_time, spot)
        if len(log.mistakes) > n_mistakes:
            return 0.0
        return _not_before_start(self.timeline.time(ref, 0.0, self.moments), spot, log)


def place_lanes(
    lanes: LaneCues,
    marks: Mapping[str, Time],
    gestures: GestureLookup,
    bounds: Array,
    log: ScriptLog,
    is_phrase: bool = False,
) -> PlacedLanes | None:
    """Places the cues of the lanes of a score or a phrase; None after a mistake.

    Args:
        lanes: lane -> its keys in the file, and its cues.
        marks: marks of the score; empty for a phrase.
        gestures: returns the gestures of cues.
        bounds: (2, n_vK) bounds of speeds and accelerations.
        log: collects mistakes and changes.
        is_phrase: whether they are the lanes of a phrase.
    """
    cue_gestures: dict[Spot, SingleAndRepeated] = {}
    cues = _read_cues(lanes, gestures, cue_gestures, log)
    if log.mistakes:
        return None
    spots: dict[Spot, Time] = {("marks", name): time for name, time in marks.items()}
    timeline = make_timeline([cues], spots, log)
    if log.mistakes:
        return None
    verbs = _LaneVerbs(cue_gestures, tuple(lanes), log, is_phrase)
    performer = Performer(
        timeline, _LATENESS_POLICY, verbs.perform, lambda spot, t: _not_before_start(t, spot, log)
    )
    performed = performer.perform_act(
        PerformedScript(Hands(tuple(MotionSequence.empty(bounds) for _ in lanes))), 0, 0.0
    )
    lane_ends = {cue.who[0]: performed.moments[cue.spot][END] for cue in cues}
    sequences = zip(lanes, performed.state.rested().lanes, strict=True)
    parts = [(cue, part) for cue in cues for part in performed.placed[cue.spot].parts]
    return PlacedLanes(
        timeline,
        Hands(tuple(sequence.held_until(lane_ends.get(lane, 0.0)) for lane, sequence in sequences)),
        tuple(
            (
                cue,
                PlayedGesture(
                    cue.who[0], part.gesture.name, part.start, part.end, part.marks, cue.name
                ),
                part.gesture.motion,
            )
            for cue, part in parts
        ),
        performed.moments,
        {name: performed.moments["marks", name][""] for name in marks},
        any(part.gesture.changes_heading for _, part in parts),
    )


def _read_cues(
    lanes: LaneCues,
    gestures: GestureLookup,
    cue_gestures: dict[Spot, SingleAndRepeated],
    log: ScriptLog,
) -> list[Cue[ScoreCue]]:
    """Cues of lanes; their gestures are added to ``cue_gestures``."""
    cues: list[Cue[ScoreCue]] = []
    for lane, (lane_spot, entries) in lanes.items():
        previous: tuple[Cue[ScoreCue], ...] = ()
        for i, entry in enumerate(entries):
            spot, name, marks = (*lane_spot, i), entry.name or "", tuple[str, ...]()
            cue_gesture = gestures(entry, spot) if isinstance(entry, PlayedCue) else None
            if cue_gesture is not None:
                cue_gestures[spot] = single, repeated = cue_gesture
                if entry.mark and entry.mark not in single.marks:
                    text = f"{single.name} has no mark {entry.mark!r}"
                    log.mistakes.add((*spot, "on"), text + did_you_mean(entry.mark, single.marks))
                name, marks = entry.name or single.name, tuple(repeated.marks)
            cue = Cue(spot, len(cues), 0, entry, (lane,), name, (*marks, START, END), previous)
            previous = (cue,)
            cues.append(cue)
    return cues


def _not_before_start(t: float, spot: Spot, log: ScriptLog, script_name: str = "score") -> float:
    """The time, at least 0 [s]; records a mistake if it is negative."""
    if t < 0.0:
        log.mistakes.add(spot, f"comes {log.duration_in_words(-t)} before the {script_name}")
    return max(t, 0.0)


class _LaneVerbs:
    """Verbs of cues in lanes.

    Args:
        cue_gestures: keys of a cue -> its gesture, once and with its repetitions.
        lanes: names of the lanes.
        log: collects mistakes and changes.
        is_phrase: whether they are the lanes of a phrase.
    """

    def __init__(
        self,
        cue_gestures: Mapping[Spot, SingleAndRepeated],
        lanes: tuple[str, ...],
        log: ScriptLog,
        is_phrase: bool,
    ):
        self._cue_gestures, self._lanes, self._log, self._is_phrase = (
            cue_gestures,
            lanes,
            log,
            is_phrase,
        )
        self._script_name = "phrase" if is_phrase else "score"

    def perform(
        self, hands: Hands, pending: PendingCue[ScoreCue]
    ) -> tuple[Hands, tuple[CuePart, ...], Moments]:
        """Hands after a cue, its parts, and its moments."""
        lane, entry = self._lanes.index(pending.who[0]), pending.entry
        wanted_begin, previous = self._begin(pending), pending.cue.previous
        follows_hold = bool(previous) and isinstance(previous[0].entry, HoldCue)
        due = wanted_begin if pending.cue.times or follows_hold else np.inf
        end = pending.moments[previous[0].spot][END] if previous else 0.0
        if isinstance(entry, HoldCue):
            hands = hands.rested(lane)
            free_time = max(end, hands.lanes[lane].end)
            begin_time = max(wanted_begin, free_time)
            self._check_time(
                pending,
                "the hold",
                begin_time,
                due if pending.cue.times else np.inf,
                0.0,
                free_time,
            )
            # The next cue begins after it; the transition to it lies within the hold.
            return hands, (), {START: begin_time, END: begin_time + entry.hold * self._log.beat}
        repeated, free_time = self._cue_gestures[pending.spot][1], max(end, hands.lanes[lane].end)
        hands, (sequence, begin_time, lead) = hands.add(
            lane, repeated, max(wanted_begin, free_time)
        )
        self._check_time(pending, repeated.name, begin_time, due, lead, free_time)
        self._report_changes(pending)
        marks = {name: begin_time + t for name, t in repeated.marks.items()}
        part = CuePart("", lane, repeated, begin_time, sequence.end, marks)
        return hands, (part,), {START: begin_time, END: sequence.end, **marks}

    def _begin(self, pending: PendingCue[ScoreCue]) -> float:
        """Time at which a cue should begin [s]."""
        t, mark = pending.wanted_time, pending.entry.mark
        for spot, _ in pending.cue.times:
            t = _not_before_start(t, spot, self._log, self._script_name)
            if mark:
                single, _ = self._cue_gestures[pending.spot]
                t -= single.marks[mark]
                if t < 0.0:
                    early_text = self._log.duration_in_words(-t)
                    text = f"{single.name} would begin {early_text} before the {self._script_name}"
                    self._log.mistakes.add(spot, text)
        return max(t, 0.0)

    def _check_time(
        self,
        pending: PendingCue[ScoreCue],
        name: str,
        begin_time: float,
        due_time: float,
        lead: float,
        free_time: float,
    ) -> None:
        """Reports a late beginning.

        Args:
            pending: cue to be placed.
            name: name of its gesture.
            begin_time, due_time: actual and wanted beginning [s].
            lead: duration of the transition to its start [s].
            free_time: end of the previous cue [s].
        """

        def reason_text() -> str:
            previous = self._name(pending.cue.previous[0]) if pending.cue.previous else ""
            reason = f"the way there takes {self._log.duration_in_words(lead)}"
            reason += f" after {previous}" if previous else ""
            if due_time < free_time - LATENESS_TOLERANCE:
                reason = f"{previous} ends {in_words(free_time, self._is_phrase)}"
            times = in_words(begin_time, self._is_phrase), in_words(due_time, self._is_phrase)
            return f"{name} begins {times[0]} instead of {times[1]}: {reason}"

        in_words = self._log.in_words
        if text := _LATENESS_POLICY.check(begin_time - due_time, 0.0, reason_text):
            self._log.change(pending.spot, text)

    def _name(self, cue: Cue[ScoreCue]) -> str:
        return (
            "the hold" if isinstance(cue.entry, HoldCue) else self._cue_gestures[cue.spot][1].name
        )

    def _report_changes(self, pending: PendingCue[ScoreCue]) -> None:
        """Reports repetitions that take longer, and turns from a wrong heading."""
        (single, repeated), entry, spot = (
            self._cue_gestures[pending.spot],
            pending.entry,
            pending.spot,
        )
        assert isinstance(entry, PlayedCue)
        extra_time = repeated.duration - entry.repeat * single.duration
        if extra_time > LATENESS_TOLERANCE:
            words = self._log.duration_in_words
            self._log.change(
                spot,
                f"{repeated.name} takes {words(repeated.duration)} instead of "
                f"{words(repeated.duration - extra_time)}: it ends elsewhere than it begins, and "
                "returns each time",
            )
        if not repeated.changes_heading:
            return
        heading = _heading(pending.cue)
        if abs((entry.heading or 0.0) - heading) > _MAX_HEADING_ERROR:
            self._log.change(
                spot,
                f"{repeated.name} turns as for a heading of "
                f"{np.degrees(entry.heading or 0.0):.0f} deg, which pulls the strings apart: the "
                f"puppet's heading is {np.degrees(heading):.0f} deg; give "
                f"`heading: {np.degrees(heading):.0f} deg`",
            )


def _heading(cue: Cue[ScoreCue]) -> float:
    """Heading of the puppet before a cue, by the turns of its lane [rad]."""
    turns = list[float]()
    while cue.previous:
        (cue,) = cue.previous
        if isinstance(cue.entry, GestureCue):
            turns.append(cue.entry.turn or 0.0)
    return sum(reversed(turns), start=0.0)
