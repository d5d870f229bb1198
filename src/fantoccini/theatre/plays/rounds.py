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
from fantoccini.theatre.plays.handled import failures, handle_seen, stands_seen
from fantoccini.theatre.plays.placing import Placement, place_cues
from fantoccini.theatre.plays.reading import Script
from fantoccini.theatre.plays.runs import Runs, excerpt, runs_of
from fantoccini.theatre.plays.settling import PAUSE, pause
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import LATE, VERBS, PlayCue, Spot, walks

T = TypeVar("T")

_LOCATED = {verb.meets: verb.located for verb in VERBS.values()}
"""Kind of meeting -> property of a prop that is measured before it."""

PEAKS = 2e-3
"""Tolerance of a bound, relative to it: computed peaks of speeds are upper bounds."""
_MARGIN_TIME = 0.6
"""Time before and after a part of a cue in which a fault is attributed to it [s]."""
_MAX_LOCATES = 3
"""Number of times that a handled prop is located again."""
_MAX_CALMINGS = 6
"""Number of times that the motion against swing before a cue is computed again."""
_MAX_PLACE_ERROR = 1e-3
"""Error of a place above which cues are placed again [m]."""
_JUST_BEFORE = 1e-6
"""Time before a prop is handled at which it is located [s]."""


@dataclass(frozen=True)
class Results:
    """Results of the rounds so far.

    Attributes:
        corrections: corrections of cues.
        hand_tries: (cue, player) -> number of times that its hands were moved in time.
        locate_counts: cue -> number of times that its prop was located.
        calm_counts: (cue, player) -> number of times that the motion against swing was computed.
        settled: number of a cue -> its pause, and the trunk's speeds after it without the pause
            and with it [s, m/s, m/s].
        touching: cues that are refused because something would touch.
    """

    corrections: Corrections = field(default_factory=Corrections)
    hand_tries: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    locate_counts: Mapping[Spot, int] = field(default_factory=dict)
    calm_counts: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    settled: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    touching: tuple[Spot, ...] = ()

    def refusing(self, placed: Placed[PlayCue] | None, why: str) -> Results | None:
        """The results with a cue refused and the retry counts reset.

        None if there is no such cue, or it is refused already.
        """
        if placed is None or placed.spot in self.corrections.refused:
            return None
        corrections = self.corrections.setting("refused", placed.spot, why).setting(
            "pauses", placed.spot, None
        )
        return replace(
            self, corrections=corrections, hand_tries={}, locate_counts={}, calm_counts={}
        )

    def back(self, corrections: Corrections) -> Results:
        """The results with earlier corrections; props and swing are measured again."""
        return replace(self, corrections=corrections, locate_counts={}, calm_counts={})


@dataclass(frozen=True, eq=False)
class Stage:
    """A play, with the data shared by all rounds of compiling it.

    Attributes:
        script: script of the play; props hang in equilibrium.
        walks: stage seen from above.
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
    """One placement of all cues, and its simulation.

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
            without = results.refusing(first, str(error))
            if without is None:
                script.log.mistakes.add(("cast", error.stop.players[0]), str(error))
                script.log.mistakes.refuse()
                raise
            results = without
        else:
            return Round(results, placement, runs, stage.beat)


def refuse_stopped(_: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the cues in which a run stops early."""
    before = results
    for stop in this_round.runs.stops:
        cue = this_round.cue_during(stop.t, {*stop.players})
        results = results.refusing(cue, stop.sentence(this_round.in_words(stop.t))) or results
    return results, results is not before


def refuse_failures(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the first cue that fails to bring a prop to its place."""
    of_spot = {placed.spot: placed for placed in this_round.placement.cues}
    for failure in failures(stage.script.cast, this_round.placement.meetings, this_round.runs):
        cue = (
            of_spot.get(failure.cue)
            if failure.cue
            else this_round.cue_during(failure.t, {*failure.players})
        )
        # Without it, later cues may succeed.
        after = results.refusing(cue, f"{failure.text} {this_round.in_words(failure.t)}")
        if after is not None:
            return after, True
    return results, False


def refuse_fast(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the cues in which hands pass their bounds."""
    bounds, before = stage.script.cast.file.stage, results
    for name, motion in this_round.placement.motions.items():
        table, sizes = motion.coordinates, motion.peaks_of_pieces
        largest = limits(table, bounds.speed, bounds.acceleration)
        for row, what, per in ((0, "moves at", "s"), (1, "changes by", "s^2")):
            passed = sizes[:, row] / largest[row]
            piece, v = np.unravel_index(int(np.argmax(passed)), passed.shape)
            peak, bound = float(sizes[piece, row, v]), float(largest[row, v])
            name_K, unit = names_and_units(table)[v]
            if peak <= bound * (1.0 + PEAKS):
                continue
            t = 0.5 * float(motion.breaks[piece] + motion.breaks[piece + 1])
            slower = (peak / bound) ** (1.0 / (row + 1))
            text = f"{name_K} {what} {peak:.3g} {unit}/{per}, and the bound is "
            text += f"{bound:g}; {1.02 * slower:.2g} times slower it can be done"
            results = results.refusing(this_round.cue_during(t, {name}), text) or results
    return results, results is not before


def locate_and_calm(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Locates the props that are handled, and computes motions that damp swing."""
    results, changed = _calm(stage, results, this_round)
    for meeting in this_round.placement.meetings:
        spot, located = meeting.cue, _LOCATED.get(meeting.kind)
        if spot is None or not located or not meeting.props:
            continue
        (prop,) = meeting.props
        if results.locate_counts.get(spot, 0) >= _MAX_LOCATES:
            continue
        corrections, cast = results.corrections, stage.script.cast
        if located == "place":
            there = stands_seen(cast, this_round.runs, prop, meeting.begin)
            moved = _place_changed(corrections.stands.get(spot), there)
            corrections = corrections.setting("stands", spot, there)
        else:
            seen = handle_seen(cast, this_round.runs, meeting, meeting.begin - _JUST_BEFORE)
            moved = _handle_changed(corrections.handles.get(spot), seen)
            corrections = corrections.setting("handles", spot, seen)
        looked = {**results.locate_counts, spot: results.locate_counts.get(spot, 0) + moved}
        results, changed = (
            replace(results, corrections=corrections, locate_counts=looked),
            changed or moved,
        )
    return results, changed


def _place_changed(before: Footing | None, there: Footing | None) -> bool:
    """Whether a prop does not stand at the place for which the cue was placed."""
    if before is None or there is None:
        return before is not there
    return abs(there.place - before.place) > _MAX_PLACE_ERROR


def _handle_changed(before: tuple[float, float] | None, seen: tuple[float, float] | None) -> bool:
    """Whether a prop does not hang at the place for which the cue was placed."""
    if before is None or seen is None:
        return before is not seen
    return not np.allclose(seen, before, rtol=0.0, atol=_MAX_PLACE_ERROR)


def _calm(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Computes motions that damp swing."""
    jobs: dict[str, Callable[[], tuple[float, ...]]] = {}
    keys: dict[str, tuple[Spot, str]] = {}
    for (spot, name), start in this_round.placement.calmed.items():
        run, player = this_round.runs.players[name], stage.script.cast.players[name]
        if start >= float(run.t[-1]) or results.calm_counts.get((spot, name), 0) >= _MAX_CALMINGS:
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
        calmed = {**results.calm_counts, who: results.calm_counts.get(who, 0) + moved}
        corrections = results.corrections.setting("calms", who, offsets)
        results, changed = (
            replace(results, corrections=corrections, calm_counts=calmed),
            changed or moved,
        )
    return results, changed


def settle(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Computes pauses in which swing settles before cues that may be delayed."""
    jobs: dict[str, Callable[[], tuple[float, float, float]]] = {}
    cues: dict[str, tuple[int, Placed[PlayCue]]] = {}
    for number, cue in enumerate(this_round.placement.cues, 1):
        longest = most_pause(cue.given, stage.beat)
        if len(cue.parts) != 1 or longest <= 0.0:
            continue
        (part,) = cue.parts
        motion = _alone(this_round.placement, part)
        if motion is None:
            continue
        begun, own = motion
        run, player = this_round.runs.players[part.who], stage.script.cast.players[part.who]
        x, marionette = run.at(begun), player.marionette
        key = digest(x, Gesture(marionette.coordinates, *own), longest, "pause", player.content)
        job = partial(_or, (0.0, 0.0, 0.0), partial(pause, marionette, x, own, longest))
        jobs[f"{number}"] = partial(stage.cache.get, key, job, NUMBERS)
        cues[f"{number}"] = number, cue
    pauses = stage.cache.in_parallel(jobs, default_threads())
    for label, (number, cue) in cues.items():
        settled = {**results.settled, number: pauses[label]}
        corrections = results.corrections.setting("pauses", cue.spot, pauses[label][0])
        results = replace(results, corrections=corrections, settled=settled)
    return results, any(p > 0.0 for p, _, _ in pauses.values())


def most_pause(given: PlayCue, beat: float) -> float:
    """Longest delay of a cue for swing to settle [s]."""
    if given.may_wait is not None:
        return given.may_wait * beat
    return PAUSE if given.is_free else 0.0


def _alone(placement: Placement, part: Part) -> tuple[float, Motion] | None:
    """Earliest start of a part [s], and its motion from then; None if other parts overlap it."""
    others = [
        own
        for cue in placement.cues
        for own in cue.parts
        if own.who == part.who and own is not part
    ]
    if any(own.end > part.start and own.start < part.end for own in others):
        return None
    begun = max([0.0, *(own.end for own in others if own.end <= part.start)])
    whole = placement.motions[part.who]
    if np.max(np.abs(whole.offsets(begun)[1])) > LATE or part.end - begun < LATE:
        return None
    return begun, excerpt(whole, begun, part.end)


def _in_words(placement: Placement, t: float, beat: float) -> str:
    start = max(act for act in (0.0, *placement.act_starts) if act <= t + LATE)
    return act_time_in_words(t, start, beat)


def _cue_during(
    cues: Sequence[Placed[PlayCue]], t: float, owners: set[str]
) -> Placed[PlayCue] | None:
    """Last of the cues that go on at a time; a gesture takes precedence over a walk."""
    now = [
        (not walks(cue.given), part.start, -i, cue)
        for i, cue in enumerate(cues)
        for part in cue.parts
        if part.who in owners and part.start - _MARGIN_TIME <= t <= part.end + _MARGIN_TIME
    ]
    if not now:
        now = [
            (True, part.start, -i, cue)
            for i, cue in enumerate(cues)
            for part in cue.parts
            if part.who in owners and part.start <= t
        ]
    return max(now, key=lambda entry: entry[:3])[3] if now else None


def _or(otherwise: T, job: Callable[[], T]) -> T:
    """Result of a search, or ``otherwise`` if its rollouts stop; the run gives the reason."""
    try:
        return job()
    except ERRORS:
        return otherwise
