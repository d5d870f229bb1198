"""Rounds of compiling a play: all cues are placed, all players simulated, and faults corrected.

A rule takes the results so far and a round. It returns the new results, and whether any cue
must be placed again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from fantoccini.kernel.runtime import default_threads
from fantoccini.theatre.cast import (
    ERRORS,
    NUMBERS,
    CannotBegin,
    Corrections,
    Footing,
    ResultCache,
    act_time_in_words,
    digest,
)
from fantoccini.theatre.gestures import Gesture, Motion, Part, Placed, limits, names_and_units
from fantoccini.theatre.plays.calming import NONE, calm_gesture, calming
from fantoccini.theatre.plays.handled import failures, handle_position, standing_place
from fantoccini.theatre.plays.placing import Placement, place_cues
from fantoccini.theatre.plays.reading import Script
from fantoccini.theatre.plays.runs import Runs, excerpt, runs_of
from fantoccini.theatre.plays.settling import PAUSE, pause
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import LATE, VERBS, PlayCue, Spot, walks

T = TypeVar("T")

_LOCATED = {verb.meets: verb.located for verb in VERBS.values()}
"""Kind of meeting -> property of a prop that is measured before it."""

PEAK_TOLERANCE = 2e-3
"""Relative tolerance of bounds: computed peaks of speeds are overestimates."""
_MARGIN_TIME = 0.6
"""Time before and after a part of a cue in which a fault is attributed to it [s]."""
_MAX_LOCATE_COUNT = 3
"""Largest number of times that a handled prop is located again."""
_MAX_CALM_COUNT = 6
"""Largest number of times that the motion against swing before a cue is computed again."""
_MAX_PLACE_ERROR = 1e-3
"""Error of a place above which cues are placed again [m]."""
_LOCATE_LEAD = 1e-6
"""Time before a prop is handled at which it is located [s]."""


@dataclass(frozen=True)
class Results:
    """Results of the rounds so far.

    Attributes:
        corrections: corrections of cues.
        hand_tries: (cue, player) -> number of times that its hands were moved in time.
        locate_counts: cue -> number of times that its prop was located.
        calm_counts: (cue, player) -> number of times that the motion against swing was computed.
        settling_pauses: number of a cue -> its pause, and the trunk's speeds after it without the
            pause and with it [s, m/s, m/s].
        touching: cues that are refused because something would touch.
    """

    corrections: Corrections = field(default_factory=Corrections)
    hand_tries: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    locate_counts: Mapping[Spot, int] = field(default_factory=dict)
    calm_counts: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    settling_pauses: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    touching: tuple[Spot, ...] = ()

    def with_refusal(self, placed: Placed[PlayCue] | None, reason: str) -> Results | None:
        """The results with a cue refused and the retry counts reset.

        None if there is no such cue, or it is refused already.
        """
        if placed is None or placed.spot in self.corrections.refused:
            return None
        corrections = self.corrections.setting("refused", placed.spot, reason).setting(
            "pauses", placed.spot, None
        )
        return replace(
            self, corrections=corrections, hand_tries={}, locate_counts={}, calm_counts={}
        )

    def with_corrections(self, corrections: Corrections) -> Results:
        """The results with other corrections; props and swing are measured again."""
        return replace(self, corrections=corrections, locate_counts={}, calm_counts={})


@dataclass(frozen=True, eq=False)
class Stage:
    """Play with the data shared by all rounds of compiling it.

    Attributes:
        script: script of the play; props hang in equilibrium.
        walks: planner of walks.
        cache: cached results.
    """

    script: Script
    walks: Walks
    cache: ResultCache

    @property
    def beat(self) -> float:
        """Duration of a beat [s]."""
        return self.script.log.beat


@dataclass(frozen=True, eq=False)
class Round:
    """Placement of all cues, and its simulation.

    Attributes:
        results: results from which the cues were placed.
        placement: the placed cues.
        runs: runs of all players and props.
        beat: duration of a beat [s].
    """

    results: Results
    placement: Placement
    runs: Runs
    beat: float

    def in_words(self, t: float) -> str:
        """Time in words, in beats of its act."""
        return _in_words(self.placement, t, self.beat)

    def cue_during(self, t: float, owners: set[str]) -> Placed[PlayCue] | None:
        """Cue of some players to which a time [s] belongs; None without one."""
        return _cue_during(self.placement.cues, t, owners)


Rule = tuple[Results, bool]
"""Results after a rule, and whether it moves cues."""


def make_round(stage: Stage, results: Results) -> Round:
    """Round in which all cues are placed and simulated.

    Raises:
        FileError: the run of a player cannot begin, even with all its cues refused.
    """
    script = stage.script
    while True:
        placement = place_cues(
            script.cast,
            script.timeline,
            script.gestures,
            script.places,
            stage.walks,
            results.corrections,
            script.log,
        )
        try:
            runs = runs_of(
                script.cast, placement.motions, placement.starts, placement.meetings, stage.cache
            )
        except CannotBegin as error:
            first = _cue_during(placement.cues, 0.0, {*error.stop.players})
            without = results.with_refusal(first, str(error))
            if without is None:
                script.log.mistakes.add(("cast", error.stop.players[0]), str(error))
                script.log.mistakes.raise_if_any()
                raise
            results = without
        else:
            return Round(results, placement, runs, stage.beat)


def refuse_stopped(_: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the cues in which a run stops early."""
    before = results
    for stop in this_round.runs.stops:
        cue = this_round.cue_during(stop.t, {*stop.players})
        results = results.with_refusal(cue, stop.sentence(this_round.in_words(stop.t))) or results
    return results, results is not before


def refuse_failures(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the first cue that fails to bring a prop to its place."""
    cue_at = {placed.spot: placed for placed in this_round.placement.cues}
    for failure in failures(stage.script.cast, this_round.placement.meetings, this_round.runs):
        cue = (
            cue_at.get(failure.cue)
            if failure.cue
            else this_round.cue_during(failure.t, {*failure.players})
        )
        # Without it, later cues may succeed.
        after = results.with_refusal(cue, f"{failure.text} {this_round.in_words(failure.t)}")
        if after is not None:
            return after, True
    return results, False


def refuse_fast(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the cues in which hands pass their bounds."""
    bounds, before = stage.script.cast.file.stage, results
    for name, motion in this_round.placement.motions.items():
        table, sizes = motion.coordinates, motion.peaks_of_pieces
        largest = limits(table, bounds.speed, bounds.acceleration)
        for row, verb, per in ((0, "moves at", "s"), (1, "changes by", "s^2")):
            ratios = sizes[:, row] / largest[row]
            piece, v = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
            peak, bound = float(sizes[piece, row, v]), float(largest[row, v])
            name_K, unit = names_and_units(table)[v]
            if peak <= bound * (1.0 + PEAK_TOLERANCE):
                continue
            t = 0.5 * float(motion.breaks[piece] + motion.breaks[piece + 1])
            slower = (peak / bound) ** (1.0 / (row + 1))
            text = f"{name_K} {verb} {peak:.3g} {unit}/{per}, and the bound is "
            text += f"{bound:g}; {1.02 * slower:.2g} times slower it can be done"
            results = results.with_refusal(this_round.cue_during(t, {name}), text) or results
    return results, results is not before


def locate_and_calm(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Locates the props that are handled, and computes motions that damp swing."""
    results, changed = _calm(stage, results, this_round)
    for meeting in this_round.placement.meetings:
        spot, located = meeting.cue, _LOCATED.get(meeting.kind)
        if spot is None or not located or not meeting.props:
            continue
        (prop,) = meeting.props
        if results.locate_counts.get(spot, 0) >= _MAX_LOCATE_COUNT:
            continue
        corrections, cast = results.corrections, stage.script.cast
        if located == "place":
            stands = standing_place(cast, this_round.runs, prop, meeting.begin)
            moved = _place_changed(corrections.stands.get(spot), stands)
            corrections = corrections.setting("stands", spot, stands)
        else:
            handle = handle_position(cast, this_round.runs, meeting, meeting.begin - _LOCATE_LEAD)
            moved = _handle_changed(corrections.handles.get(spot), handle)
            corrections = corrections.setting("handles", spot, handle)
        counts = {**results.locate_counts, spot: results.locate_counts.get(spot, 0) + moved}
        results = replace(results, corrections=corrections, locate_counts=counts)
        changed = changed or moved
    return results, changed


def _place_changed(assumed: Footing | None, measured: Footing | None) -> bool:
    """Whether a prop does not stand at the place for which the cue was placed."""
    if assumed is None or measured is None:
        return assumed is not measured
    return abs(measured.place - assumed.place) > _MAX_PLACE_ERROR


def _handle_changed(
    assumed: tuple[float, float] | None, measured: tuple[float, float] | None
) -> bool:
    """Whether a prop does not hang at the place for which the cue was placed."""
    if assumed is None or measured is None:
        return assumed is not measured
    return not np.allclose(measured, assumed, rtol=0.0, atol=_MAX_PLACE_ERROR)


def _calm(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Computes motions that damp swing."""
    jobs: dict[str, Callable[[], tuple[float, ...]]] = {}
    keys: dict[str, tuple[Spot, str]] = {}
    for (spot, name), start in this_round.placement.calmed.items():
        run, player = this_round.runs.players[name], stage.script.cast.players[name]
        if start >= float(run.t[-1]) or results.calm_counts.get((spot, name), 0) >= _MAX_CALM_COUNT:
            continue
        x, label = run.at(start), f"calm {spot} {name}"
        key = digest(x, calm_gesture(player.marionette, NONE), "calm", player.content)
        job = partial(_or, NONE, partial(calming, player.marionette, x))
        jobs[label] = partial(stage.cache.get, key, job, NUMBERS)
        keys[label] = spot, name
    changed = False
    for label, offsets in stage.cache.in_parallel(jobs, default_threads()).items():
        who = keys[label]
        before = results.corrections.calms.get(who, NONE)
        moved = not np.allclose(before, offsets, rtol=0.0, atol=_MAX_PLACE_ERROR)
        counts = {**results.calm_counts, who: results.calm_counts.get(who, 0) + moved}
        corrections = results.corrections.setting("calms", who, offsets)
        results = replace(results, corrections=corrections, calm_counts=counts)
        changed = changed or moved
    return results, changed


def settle(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Computes pauses in which swing decays before cues that may be delayed."""
    jobs: dict[str, Callable[[], tuple[float, float, float]]] = {}
    cues: dict[str, tuple[int, Placed[PlayCue]]] = {}
    for number, cue in enumerate(this_round.placement.cues, 1):
        longest = max_pause(cue.given, stage.beat)
        if len(cue.parts) != 1 or longest <= 0.0:
            continue
        (part,) = cue.parts
        separate = _separate_motion(this_round.placement, part)
        if separate is None:
            continue
        start, motion = separate
        run, player = this_round.runs.players[part.who], stage.script.cast.players[part.who]
        x, marionette = run.at(start), player.marionette
        key = digest(x, Gesture(marionette.coordinates, *motion), longest, "pause", player.content)
        job = partial(_or, (0.0, 0.0, 0.0), partial(pause, marionette, x, motion, longest))
        jobs[f"{number}"] = partial(stage.cache.get, key, job, NUMBERS)
        cues[f"{number}"] = number, cue
    pauses = stage.cache.in_parallel(jobs, default_threads())
    for label, (number, cue) in cues.items():
        settling_pauses = {**results.settling_pauses, number: pauses[label]}
        corrections = results.corrections.setting("pauses", cue.spot, pauses[label][0])
        results = replace(results, corrections=corrections, settling_pauses=settling_pauses)
    return results, any(p > 0.0 for p, _, _ in pauses.values())


def max_pause(given: PlayCue, beat: float) -> float:
    """Longest delay of a cue in which swing may decay [s]."""
    if given.may_wait is not None:
        return given.may_wait * beat
    return PAUSE if given.is_free else 0.0


def _separate_motion(placement: Placement, part: Part) -> tuple[float, Motion] | None:
    """Earliest start of a part [s], and its motion from then; None if other parts overlap it."""
    others = [
        other
        for cue in placement.cues
        for other in cue.parts
        if other.who == part.who and other is not part
    ]
    if any(other.end > part.start and other.start < part.end for other in others):
        return None
    start = max([0.0, *(other.end for other in others if other.end <= part.start)])
    whole = placement.motions[part.who]
    if np.max(np.abs(whole.offsets(start)[1])) > LATE or part.end - start < LATE:
        return None
    return start, excerpt(whole, start, part.end)


def _in_words(placement: Placement, t: float, beat: float) -> str:
    """Time in words, in beats of its act."""
    start = max(act for act in (0.0, *placement.act_starts) if act <= t + LATE)
    return act_time_in_words(t, start, beat)


def _cue_during(
    cues: Sequence[Placed[PlayCue]], t: float, owners: set[str]
) -> Placed[PlayCue] | None:
    """Last of the cues in progress at a time [s]; a gesture takes precedence over a walk."""
    candidates = [
        (not walks(cue.given), part.start, -i, cue)
        for i, cue in enumerate(cues)
        for part in cue.parts
        if part.who in owners and part.start - _MARGIN_TIME <= t <= part.end + _MARGIN_TIME
    ]
    if not candidates:
        candidates = [
            (True, part.start, -i, cue)
            for i, cue in enumerate(cues)
            for part in cue.parts
            if part.who in owners and part.start <= t
        ]
    return max(candidates, key=lambda entry: entry[:3])[3] if candidates else None


def _or(default: T, job: Callable[[], T]) -> T:
    """Result of a search, or a default if its rollouts stop; the run then has the reason."""
    try:
        return job()
    except ERRORS:
        return default
