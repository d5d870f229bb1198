"""Compiler of plays: cues are placed, simulated by company, and placed again until all succeed.

A cue is a line of a play: a verb with its player and time. It is refused if it cannot be done. A
spot is the list of keys that leads to an entry of the file. Mistakes of the file are recorded in a
log.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence, Set
from dataclasses import replace

from fantoccini.base import OnProgress, Progress, StateError
from fantoccini.theatre.cast import OutOfTime, ResultCache, with_settled_props
from fantoccini.theatre.gestures import CuePart, PlacedCue
from fantoccini.theatre.plays.failures import find_failures
from fantoccini.theatre.plays.handling import APPROACHES
from fantoccini.theatre.plays.lateness_rules import advance_hands, mark_lateness, refuse_late
from fantoccini.theatre.plays.leashes import refuse_stretched, stretches_in
from fantoccini.theatre.plays.placing import IN_TIME, Placement
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.reading import play_path, read_play
from fantoccini.theatre.plays.rounds import (
    CompileContext,
    Results,
    Round,
    RuleResult,
    add_settling_pauses,
    locate_and_calm,
    make_round,
    max_pause,
    refuse_failures,
    refuse_fast,
    refuse_stopped,
)
from fantoccini.theatre.plays.shots import shots_of
from fantoccini.theatre.plays.stage_run import SAMPLE_INTERVAL, combine_runs
from fantoccini.theatre.plays.stage_score import stage_score
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE, Touch, find_touches
from fantoccini.theatre.plays.walk_planner import WalkPlanner
from fantoccini.theatre.script import (
    END,
    START,
    VERBS,
    Cue,
    DoesCue,
    PlayCue,
    PropCue,
    SitsOnCue,
    Spot,
    file_key,
)

MAX_DELAY_ROUNDS = 10
"""Number of rounds in which free cues may be delayed; afterwards they are refused at once."""
_EXTRA_DELAY = 0.4
"""Additional delay of a free cue in which something touches [s]."""
_SMALLER_SIZE_FACTORS = (0.75, 0.5)
"""Sizes to try if something touches, relative to that of the file."""
_MAX_RETRIED_CUES = 3
"""Largest number of cues for which smaller sizes are tried."""


def load_play(
    path: str | os.PathLike[str],
    *,
    progress: OnProgress | None = None,
    before: Play | None = None,
    within: float | None = None,
    on_disk: bool | None = None,
) -> Play:
    """Play of a file.

    A cue that cannot be done is left out, and :attr:`Play.changes` gives the reason, the line and
    the nearest alternative; the rest is compiled.

    Args:
        path: path of the file, or the name of a bundled play: ``trio``, ``chase``, ``duet`` or
            ``park``.
        progress: called with a name of the present work, and its completed share.
        before: earlier version of the play, whose runs are used for all unchanged parts.
        within: time limit [s]; the first round is always completed. If the limit passes, the play
            is that of the last complete round, and its changes list the stop and the remaining
            faults. No limit by default.
        on_disk: whether runs are read from the cache folder, and kept there for the next process;
            the play is the same. By default as for ``before``, or not.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    deadline = math.inf if within is None else time.monotonic() + within
    report = progress or (lambda progress: None)
    path = play_path(path)
    report(Progress("casting", 0.0, 1.0))
    cache = before.cache if before is not None else ResultCache()
    if on_disk is not None:
        cache.on_disk = on_disk
    script = read_play(path, cache)
    try:
        script = replace(script, cast=with_settled_props(script.cast, cache))
    except StateError as error:
        script.log.mistakes.add(("props",), f"held props do not hang at rest: {error}")
        script.log.mistakes.raise_if_any()
        raise
    context = CompileContext(script, WalkPlanner(script.cast, script.log), cache)
    report(Progress("rehearsing", _share(1), 1.0))
    # The first round is always completed.
    rounds = [make_round(context, Results())]
    try:
        with cache.time_limit(deadline):
            results, touches = _improve(context, rounds, report)
    except OutOfTime:
        script.log.change(
            ("acts",),
            f"compiling was stopped after {_rounds_in_words(len(rounds))}: cues may be late, too "
            "fast or swing; with more time (`within`) they are corrected or refused",
        )
        results, touches = rounds[-1].results, _touches(context, rounds[-1], report)
    else:
        report(Progress("compiled", 1.0, 1.0))
    return _play(context, results, rounds[-1], touches, len(rounds))


def _share(count: int) -> float:
    """Completed share of the work at the beginning of a round."""
    return 0.9 * (1.0 - 0.8**count)


def _improve(
    context: CompileContext, rounds: list[Round], report: OnProgress
) -> tuple[Results, list[Touch]]:
    """Adds rounds, each after a cue was moved or refused, until no cue moves.

    Returns:
        Results of all rounds, and the touches of the last one.

    Raises:
        OutOfTime: the time limit has passed; all rounds are complete.
    """
    has_paused = False
    while True:
        this_round = rounds[-1]
        results = this_round.results
        results, has_moved = _apply_rules(
            context,
            results,
            this_round,
            refuse_fast,
            refuse_stopped,
            locate_and_calm,
            refuse_failures,
            refuse_stretched,
        )
        if not (has_moved or has_paused):
            results, has_moved = add_settling_pauses(context, results, this_round)
            has_paused = True
        if not has_moved:
            lateness = mark_lateness(context, this_round)
            results, has_moved = advance_hands(results, lateness)
            if not has_moved:
                results, has_moved = refuse_late(results, this_round, lateness)
        if not has_moved:
            touches = _touches(context, this_round, report)
            results, has_moved = _correct_touches(
                context, results, this_round, touches, may_delay=len(rounds) < MAX_DELAY_ROUNDS
            )
            if not has_moved:
                break
        context.cache.check()
        report(Progress("rehearsing", _share(len(rounds) + 1), 1.0))
        rounds.append(make_round(context, results))
    if results.refused_by_touch and not touches:
        results = _retry_touching(context, results, report)
        report(Progress("rehearsing", _share(len(rounds) + 1), 1.0))
        rounds.append(make_round(context, results))
        touches = _touches(context, rounds[-1], report)
    return results, touches


def _apply_rules(
    context: CompileContext,
    results: Results,
    this_round: Round,
    *rules: Callable[[CompileContext, Results, Round], RuleResult],
) -> RuleResult:
    """Results after the first rule that moves cues, or after all rules."""
    for rule in rules:
        results, has_moved = rule(context, results, this_round)
        if has_moved:
            return results, True
    return results, False


# -- touches ---------------------------------------------------------------------------------


def _touches(context: CompileContext, this_round: Round, report: OnProgress) -> list[Touch]:
    """Forbidden touches in the whole run of a round."""
    report(Progress("looking for touches", 0.97, 1.0))
    # The run has only the samples that are measured.
    run = combine_runs(context.script.cast, this_round.runs, SAMPLE_STRIDE * SAMPLE_INTERVAL)
    return find_touches(context.script.cast, run, this_round.placement.meetings, stride=1)


def _correct_touches(
    context: CompileContext,
    results: Results,
    this_round: Round,
    touches: list[Touch],
    may_delay: bool,
) -> RuleResult:
    """Delays or refuses the cues in which the first touches occur.

    Args:
        context: play and its stage.
        results: results so far.
        this_round: last round.
        touches: touches in the last round.
        may_delay: whether cues may be delayed.
    """
    cast, corrected_owners, has_moved = context.script.cast, set[str](), False
    for touch in touches:
        owners = {cast.owner(_without_string_prefix(name)) for name in (touch.first, touch.second)}
        if corrected_owners & owners or touch.t <= 0.0:
            continue
        cue = this_round.cue_during(touch.t, owners & {*cast.players})
        if cue is None:
            continue
        corrections, entry = results.corrections, cue.entry
        delay = corrections.pauses.get(cue.spot, 0.0) + _EXTRA_DELAY
        approach = corrections.approach_indices.get(cue.spot, 0) + 1
        if may_delay and isinstance(entry, SitsOnCue) and approach < len(APPROACHES):
            results = replace(
                results, corrections=corrections.with_entry("approach_indices", cue.spot, approach)
            )
        elif may_delay and delay <= max_pause(entry, context.beat):
            results = replace(
                results, corrections=corrections.with_entry("pauses", cue.spot, delay)
            )
        else:
            after = results.with_refusal(cue, f"{touch} {this_round.in_words(touch.t)}")
            if after is None:
                continue
            results = replace(after, refused_by_touch=(*after.refused_by_touch, cue.spot))
        has_moved = True
        corrected_owners |= owners
    return results, has_moved


def _retry_touching(context: CompileContext, results: Results, report: OnProgress) -> Results:
    """Tries again the cues that were refused because something would touch.

    A refused cue is tried unchanged if a later one is refused, otherwise with a smaller gesture;
    the reason then contains a size that can be done.
    """
    entry_of_cue = {cue.spot: cue.entry for cue in context.script.timeline.cues}
    for spot in results.refused_by_touch[:_MAX_RETRIED_CUES]:
        entry = entry_of_cue[spot]
        sizes = _SMALLER_SIZE_FACTORS if isinstance(entry, DoesCue) else ()
        if spot != results.refused_by_touch[-1]:
            sizes = (1.0, *sizes)
        corrections_before = results.corrections
        for size in sizes:
            report(Progress("trying smaller sizes", 0.95, 1.0))
            corrections = corrections_before.with_entry("refusals", spot, None).with_entry(
                "size_factors", spot, size
            )
            trial = replace(results, corrections=corrections)
            trial_results, succeeds = _try_cue(context, trial, spot, report)
            if succeeds and size == 1.0:
                results = replace(
                    trial_results,
                    corrections=trial_results.corrections.with_entry("size_factors", spot, None),
                )
                break
            results = trial_results.with_corrections(corrections_before)
            if succeeds and isinstance(entry, DoesCue):
                remedy = f"; it can be done with larger: {size * entry.larger:.2g}"
                reason = corrections_before.refusals[spot] + remedy
                results = replace(
                    results, corrections=corrections_before.with_entry("refusals", spot, reason)
                )
                break
    return results


def _try_cue(
    context: CompileContext, results: Results, spot: Spot, report: OnProgress
) -> RuleResult:
    """Results of a trial of a cue with all others, and whether it can be done."""
    while True:
        this_round = make_round(context, results)
        lateness = mark_lateness(context, this_round)
        results, has_moved = advance_hands(this_round.results, lateness)
        if not has_moved:
            results, has_moved = locate_and_calm(context, results, this_round)
        if not has_moved:
            break
    refused = any(cue.refused for cue in this_round.placement.cues if cue.spot == spot)
    in_time = all(abs(seconds) <= IN_TIME for seconds in lateness.values())
    succeeds = not this_round.runs.stops and not refused and in_time
    succeeds = succeeds and not find_failures(
        context.script.cast, this_round.placement.meetings, this_round.runs
    )
    succeeds = succeeds and not stretches_in(context, this_round)
    return results, succeeds and not _touches(context, this_round, report)


# -- the result ------------------------------------------------------------------------------


def _play(
    context: CompileContext,
    results: Results,
    this_round: Round,
    touches: list[Touch],
    n_rounds: int,
) -> Play:
    """Play of a round, with a list of deviations from the file."""
    script, placement = context.script, this_round.placement
    cast, log, file = script.cast, script.log, script.cast.file
    refused = {cue.spot for cue in placement.cues if cue.refused}
    cues = tuple(
        _cue(context, cue, _passes(placement, cue.spot, refused)) for cue in placement.cues
    )
    for cue, placed in zip(cues, placement.cues, strict=True):
        if cue.refused:
            log.change(placed.spot, cue.change)
    owners_at_start: set[frozenset[str]] = set()
    for touch in touches:
        owners = frozenset(
            cast.owner(_without_string_prefix(x)) for x in (touch.first, touch.second)
        )
        if touch.t <= 0.0 and owners in owners_at_start:
            continue
        owners_at_start |= {owners} if touch.t <= 0.0 else set()
        spot: Spot = ("acts",) if touch.t > 0.0 else ("cast",)
        log.change(spot, f"{touch} {this_round.in_words(touch.t)}")
    for stretch in stretches_in(context, this_round):
        log.change(("acts",), f"{stretch} {this_round.in_words(stretch.t)}")
    for failure in find_failures(cast, placement.meetings, this_round.runs):
        log.change(("acts",), f"{failure.text} {this_round.in_words(failure.t)}")
    for stop in this_round.runs.stops:
        stopped_cue = this_round.cue_during(stop.t, {*stop.players})
        spot = ("cast", stop.players[0]) if stopped_cue is None else stopped_cue.spot
        during = "" if stopped_cue is None else f"{described(stopped_cue.cue)}: "
        log.change(spot, during + stop.sentence(this_round.in_words(stop.t)))
    score = stage_score(cast, placement.motions, placement.lane_motions, placement.cues, log)
    return Play(
        file.play,
        log.located,
        cast,
        score,
        tuple(
            (number, part.who) for number, cue in enumerate(placement.cues, 1) for part in cue.parts
        ),
        cues,
        tuple(log.changes),
        {act.act: start for act, start in zip(file.acts, placement.act_starts, strict=True)},
        placement.motions,
        placement.cue_starts,
        placement.meetings,
        placement.walks,
        results.settling_pauses,
        shots_of(cast, script.timeline, placement, script.places, context.beat),
        n_rounds,
        context.cache,
    )


def _passes(placement: Placement, spot: Spot, refused: Set[Spot]) -> str:
    """Notes of a cue on players that it passes, without those whose own cue is refused."""
    notes = placement.pass_notes.get(spot, ())
    return "; ".join(note for partner, note in notes if partner not in refused)


def _cue(context: CompileContext, placed: PlacedCue[PlayCue], passes: str) -> CueOfPlay:
    """Compiled cue of a placed one, with its notes on players that it passes."""
    cue, entry, parts = placed.cue, placed.entry, placed.parts
    return CueOfPlay(
        cue.index + 1,
        context.script.cast.file.acts[cue.act].act,
        cue.who,
        described(cue),
        cue.name,
        context.script.log.located.line(cue.spot) or 0,
        placed.wanted_time,
        entry.patience * context.beat,
        min((part.start for part in parts), default=placed.wanted_time),
        max((part.end for part in parts), default=placed.wanted_time),
        entry.mark,
        entry.go,
        entry.says or "",
        placed.refused,
        "" if placed.refused else passes,
        entry.optional,
        isinstance(entry, PropCue),
        {who: _marks_of(parts, who) for who in dict.fromkeys(part.who for part in parts)},
    )


def _marks_of(parts: Sequence[CuePart], who: str) -> dict[str, float]:
    """Marks of a player in a cue, its beginning and its end [s]."""
    parts = [part for part in parts if part.who == who]
    marks = {mark: t for part in parts for mark, t in part.marks.items()}
    start_and_end = {START: min(part.start for part in parts), END: max(part.end for part in parts)}
    return marks | start_and_end


def _rounds_in_words(n: int) -> str:
    return f"{n} round{'' if n == 1 else 's'}"


def described(cue: Cue[PlayCue]) -> str:
    """Description of a cue: ``columbine and pierrot: walks to centre``."""
    entry, verb, value = cue.entry, cue.entry.verb, cue.entry.verb_value
    if isinstance(entry, DoesCue):
        return f"{' and '.join(cue.who)}: {value}"
    if isinstance(entry, PropCue):
        other_keys = [key for key in VERBS[verb].name_kinds if key != verb]
        return " ".join(
            [
                f"{entry.who[0]}: {file_key(verb)} {value}",
                *(f"{key} {getattr(entry, key)}" for key in other_keys),
            ]
        )
    if not isinstance(value, (str, float)):
        value = [round(float(x), 3) for x in value]
    return f"{' and '.join(cue.who)}: {file_key(verb)} {value}"


def _without_string_prefix(name: str) -> str:
    """Name of a string or body without the word ``string``."""
    return name.removeprefix("string ")
