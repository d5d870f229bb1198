"""Rounds of compiling a play: all cues are placed, all players simulated, and faults corrected.

A rule takes the results so far and a round. It returns the new results, and whether any cue
must be placed again.

A cue is a line of the play, and a footing a place with a heading. Swing is the motion of a hanging
puppet that outlasts the motion of its hands. A spot is the list of keys that leads to an entry of
the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from fantoccini.kernel.runtime import default_threads
from fantoccini.theatre.cast import (
    NUMBERS_FORMAT,
    SIMULATION_ERRORS,
    CannotBegin,
    Corrections,
    Footing,
    ResultCache,
    act_time_in_words,
    digest,
)
from fantoccini.theatre.gestures import (
    CuePart,
    Gesture,
    Motion,
    PlacedCue,
    motion_bounds,
    names_and_units,
)
from fantoccini.theatre.plays.calming import NO_OFFSETS, calm_gesture, calming_offsets
from fantoccini.theatre.plays.failures import find_failures, handle_position, standing_place
from fantoccini.theatre.plays.placing import Placement, place_cues
from fantoccini.theatre.plays.reading import Script
from fantoccini.theatre.plays.runs import Runs, excerpt, runs_of
from fantoccini.theatre.plays.settling import MAX_FREE_PAUSE, best_pause
from fantoccini.theatre.plays.walk_planner import WalkPlanner
from fantoccini.theatre.script import LATENESS_TOLERANCE, VERBS, PlayCue, Spot, is_walk

T = TypeVar("T")

_MEASURED_PROPERTY = {verb.meeting: verb.measured_property for verb in VERBS.values()}
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
        refused_by_touch: cues that are refused because something would touch.
    """

    corrections: Corrections = field(default_factory=Corrections)
    hand_tries: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    locate_counts: Mapping[Spot, int] = field(default_factory=dict)
    calm_counts: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    settling_pauses: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    refused_by_touch: tuple[Spot, ...] = ()

    def with_refusal(self, placed: PlacedCue[PlayCue] | None, reason: str) -> Results | None:
        """The results with a cue refused and the retry counts reset.

        None if there is no such cue, or it is refused already.
        """
        if placed is None or placed.spot in self.corrections.refusals:
            return None
        corrections = self.corrections.with_entry("refusals", placed.spot, reason).with_entry(
            "pauses", placed.spot, None
        )
        return replace(
            self, corrections=corrections, hand_tries={}, locate_counts={}, calm_counts={}
        )

    def with_corrections(self, corrections: Corrections) -> Results:
        """The results with other corrections; props and swing are measured again."""
        return replace(self, corrections=corrections, locate_counts={}, calm_counts={})


@dataclass(frozen=True, eq=False)
class CompileContext:
    """Play with the data shared by all rounds of compiling it.

    Attributes:
        script: script of the play; props hang in equilibrium.
        planner: planner of walks.
        cache: cached results.
    """

    script: Script
    planner: WalkPlanner
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

    def cue_during(self, t: float, owners: set[str]) -> PlacedCue[PlayCue] | None:
        """Cue of some players to which a time [s] belongs; None without one."""
        return _cue_during(self.placement.cues, t, owners)


RuleResult = tuple[Results, bool]
"""Results after a rule, and whether it moves cues."""


def make_round(context: CompileContext, results: Results) -> Round:
    """Round in which all cues are placed and simulated.

    Raises:
        FileError: the run of a player cannot begin, even with all its cues refused.
    """
    script = context.script
    while True:
        placement = place_cues(
            script.cast,
            script.timeline,
            script.gestures,
            script.places,
            context.planner,
            results.corrections,
            script.log,
        )
        try:
            runs = runs_of(
                script.cast,
                placement.motions,
                placement.cue_starts,
                placement.meetings,
                context.cache,
            )
        except CannotBegin as error:
            first_cue = _cue_during(placement.cues, 0.0, {*error.stop.players})
            fewer = results.with_refusal(first_cue, str(error))
            if fewer is None:
                script.log.mistakes.add(("cast", error.stop.players[0]), str(error))
                script.log.mistakes.raise_if_any()
                raise
            results = fewer
        else:
            return Round(results, placement, runs, context.beat)


def refuse_stopped(_: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Refuses the cues in which a run stops early."""
    before = results
    for stop in this_round.runs.stops:
        cue = this_round.cue_during(stop.t, {*stop.players})
        results = results.with_refusal(cue, stop.sentence(this_round.in_words(stop.t))) or results
    return results, results is not before


def refuse_failures(context: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Refuses the first cue that fails to bring a prop to its place."""
    cue_of = {placed.spot: placed for placed in this_round.placement.cues}
    for failure in find_failures(
        context.script.cast, this_round.placement.meetings, this_round.runs
    ):
        cue = (
            cue_of.get(failure.cue)
            if failure.cue
            else this_round.cue_during(failure.t, {*failure.players})
        )
        # Without it, later cues may succeed.
        refused = results.with_refusal(cue, f"{failure.text} {this_round.in_words(failure.t)}")
        if refused is not None:
            return refused, True
    return results, False


def refuse_fast(context: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Refuses the cues in which hands pass their bounds."""
    stage_bounds, before = context.script.cast.file.stage, results
    for name, motion in this_round.placement.motions.items():
        table, peaks = motion.coordinates, motion.peaks_of_pieces
        bounds_of_hands = motion_bounds(table, stage_bounds.speed, stage_bounds.acceleration)
        for order, verb, time_unit in ((0, "moves at", "s"), (1, "changes by", "s^2")):
            ratios = peaks[:, order] / bounds_of_hands[order]
            piece, v = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
            peak, bound = float(peaks[piece, order, v]), float(bounds_of_hands[order, v])
            name_K, unit = names_and_units(table)[v]
            if peak <= bound * (1.0 + PEAK_TOLERANCE):
                continue
            t = 0.5 * float(motion.breaks[piece] + motion.breaks[piece + 1])
            factor = (peak / bound) ** (1.0 / (order + 1))
            text = f"{name_K} {verb} {peak:.3g} {unit}/{time_unit}, and the bound is "
            text += f"{bound:g}; {1.02 * factor:.2g} times slower it can be done"
            results = results.with_refusal(this_round.cue_during(t, {name}), text) or results
    return results, results is not before


def locate_and_calm(context: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Locates the props that are handled, and computes motions that damp swing."""
    results, has_changed = _damp_swing(context, results, this_round)
    for meeting in this_round.placement.meetings:
        spot, measured_property = meeting.cue, _MEASURED_PROPERTY.get(meeting.kind)
        if spot is None or not measured_property or not meeting.props:
            continue
        (prop,) = meeting.props
        if results.locate_counts.get(spot, 0) >= _MAX_LOCATE_COUNT:
            continue
        corrections, cast = results.corrections, context.script.cast
        if measured_property == "place":
            footing = standing_place(cast, this_round.runs, prop, meeting.begin)
            has_moved = _place_changed(corrections.prop_footings.get(spot), footing)
            corrections = corrections.with_entry("prop_footings", spot, footing)
        else:
            handle = handle_position(cast, this_round.runs, meeting, meeting.begin - _LOCATE_LEAD)
            has_moved = _handle_changed(corrections.handle_positions.get(spot), handle)
            corrections = corrections.with_entry("handle_positions", spot, handle)
        counts = {**results.locate_counts, spot: results.locate_counts.get(spot, 0) + has_moved}
        results = replace(results, corrections=corrections, locate_counts=counts)
        has_changed = has_changed or has_moved
    return results, has_changed


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


def _damp_swing(context: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Computes motions that damp swing."""
    jobs: dict[str, Callable[[], tuple[float, ...]]] = {}
    keys: dict[str, tuple[Spot, str]] = {}
    for (spot, name), start in this_round.placement.damping_times.items():
        run, player = this_round.runs.players[name], context.script.cast.players[name]
        if start >= float(run.t[-1]) or results.calm_counts.get((spot, name), 0) >= _MAX_CALM_COUNT:
            continue
        state, label = run.at(start), f"calm {spot} {name}"
        key = digest(
            state, calm_gesture(player.marionette, NO_OFFSETS), "calm", player.content_hash
        )
        job = partial(_result_or, NO_OFFSETS, partial(calming_offsets, player.marionette, state))
        jobs[label] = partial(context.cache.get, key, job, NUMBERS_FORMAT)
        keys[label] = spot, name
    has_changed = False
    for label, offsets in context.cache.in_parallel(jobs, default_threads()).items():
        cue_and_player = keys[label]
        previous = results.corrections.damping_offsets.get(cue_and_player, NO_OFFSETS)
        has_moved = not np.allclose(previous, offsets, rtol=0.0, atol=_MAX_PLACE_ERROR)
        counts = {
            **results.calm_counts,
            cue_and_player: results.calm_counts.get(cue_and_player, 0) + has_moved,
        }
        corrections = results.corrections.with_entry("damping_offsets", cue_and_player, offsets)
        results = replace(results, corrections=corrections, calm_counts=counts)
        has_changed = has_changed or has_moved
    return results, has_changed


def add_settling_pauses(context: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Computes pauses in which swing decays before cues that may be delayed."""
    jobs: dict[str, Callable[[], tuple[float, float, float]]] = {}
    cues: dict[str, tuple[int, PlacedCue[PlayCue]]] = {}
    for number, cue in enumerate(this_round.placement.cues, 1):
        max_duration = max_pause(cue.entry, context.beat)
        if len(cue.parts) != 1 or max_duration <= 0.0:
            continue
        (part,) = cue.parts
        if _walks_on_floor(this_round.placement, part):
            continue  # swing is simulated without contact
        start_and_motion = _separate_motion(this_round.placement, part)
        if start_and_motion is None:
            continue
        start, motion = start_and_motion
        run, player = this_round.runs.players[part.who], context.script.cast.players[part.who]
        x, marionette = run.at(start), player.marionette
        key = digest(
            x, Gesture(marionette.coordinates, *motion), max_duration, "pause", player.content_hash
        )
        job = partial(
            _result_or, (0.0, 0.0, 0.0), partial(best_pause, marionette, x, motion, max_duration)
        )
        jobs[f"{number}"] = partial(context.cache.get, key, job, NUMBERS_FORMAT)
        cues[f"{number}"] = number, cue
    pauses = context.cache.in_parallel(jobs, default_threads())
    for label, (number, cue) in cues.items():
        settling_pauses = {**results.settling_pauses, number: pauses[label]}
        corrections = results.corrections.with_entry("pauses", cue.spot, pauses[label][0])
        results = replace(results, corrections=corrections, settling_pauses=settling_pauses)
    return results, any(p > 0.0 for p, _, _ in pauses.values())


def max_pause(entry: PlayCue, beat: float) -> float:
    """Longest delay of a cue in which swing may decay [s]."""
    if entry.may_wait is not None:
        return entry.may_wait * beat
    return MAX_FREE_PAUSE if entry.is_free else 0.0


def _walks_on_floor(placement: Placement, part: CuePart) -> bool:
    """Whether the player of a part walks on the floor in it."""
    return any(
        meeting.kind == "walks"
        and part.who in meeting.players
        and meeting.begin < part.end
        and part.start < meeting.end
        for meeting in placement.meetings
    )


def _separate_motion(placement: Placement, part: CuePart) -> tuple[float, Motion] | None:
    """Earliest start of a part [s], and its motion from then; None if other parts overlap it."""
    other_parts = [
        other_part
        for cue in placement.cues
        for other_part in cue.parts
        if other_part.who == part.who and other_part is not part
    ]
    if any(
        other_part.end > part.start and other_part.start < part.end for other_part in other_parts
    ):
        return None
    start = max(
        [0.0, *(other_part.end for other_part in other_parts if other_part.end <= part.start)]
    )
    motion = placement.motions[part.who]
    if (
        np.max(np.abs(motion.offsets(start)[1])) > LATENESS_TOLERANCE
        or part.end - start < LATENESS_TOLERANCE
    ):
        return None
    return start, excerpt(motion, start, part.end)


def _in_words(placement: Placement, t: float, beat: float) -> str:
    """Time in words, in beats of its act."""
    start = max(act for act in (0.0, *placement.act_starts) if act <= t + LATENESS_TOLERANCE)
    return act_time_in_words(t, start, beat)


def _cue_during(
    cues: Sequence[PlacedCue[PlayCue]], t: float, owners: set[str]
) -> PlacedCue[PlayCue] | None:
    """Last of the cues in progress at a time [s]; a gesture takes precedence over a walk."""
    candidates = [
        (not is_walk(cue.entry), part.start, -i, cue)
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


def _result_or(default: T, job: Callable[[], T]) -> T:
    """Result of a search, or a default if its rollouts stop; the run then has the reason."""
    try:
        return job()
    except SIMULATION_ERRORS:
        return default
