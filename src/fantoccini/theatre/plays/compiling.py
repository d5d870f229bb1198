"""Compiler of plays: cues are placed, simulated by company, and placed again until all succeed."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence, Set
from dataclasses import replace

from fantoccini.base import OnProgress, Progress, StateError
from fantoccini.theatre.cast import OutOfTime, ResultCache, with_settled_props
from fantoccini.theatre.gestures import Part, Placed
from fantoccini.theatre.plays.handled import failures
from fantoccini.theatre.plays.handling import APPROACHES
from fantoccini.theatre.plays.lateness_rules import advance_hands, mark_lateness, refuse_late
from fantoccini.theatre.plays.leashes import refuse_stretched, stretches_in
from fantoccini.theatre.plays.placing import IN_TIME, Placement
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.reading import read_play
from fantoccini.theatre.plays.rounds import (
    Results,
    Round,
    Rule,
    Stage,
    locate_and_calm,
    make_round,
    max_pause,
    refuse_failures,
    refuse_fast,
    refuse_stopped,
    settle,
)
from fantoccini.theatre.plays.shots import shots_of
from fantoccini.theatre.plays.stage_run import SAMPLE, together
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE, Touch, touches
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.plays.whole import whole_score
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
    spelled,
)

MAX_DELAY_ROUNDS = 10
"""Number of rounds in which free cues may be delayed; afterwards they are refused at once."""
_EXTRA_DELAY = 0.4
"""Additional delay of a free cue in which something touches [s]."""
_SMALLER_SIZES = (0.75, 0.5)
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
    until = math.inf if within is None else time.monotonic() + within
    report = progress or (lambda progress: None)
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
    stage = Stage(script, Walks(script.cast, script.log), cache)
    report(Progress("rehearsing", _share(1), 1.0))
    # The first round is always completed.
    rounds = [make_round(stage, Results())]
    try:
        with cache.time_limit(until):
            results, touching = _improve(stage, rounds, report)
    except OutOfTime:
        script.log.change(
            ("acts",),
            f"compiling was stopped after {_rounds(len(rounds))}: cues may be late, too "
            "fast or swing; with more time (`within`) they are corrected or refused",
        )
        results, touching = rounds[-1].results, _touches(stage, rounds[-1], report)
    else:
        report(Progress("compiled", 1.0, 1.0))
    return _play(stage, results, rounds[-1], touching, len(rounds))


def _share(count: int) -> float:
    """Completed share of the work at the beginning of a round."""
    return 0.9 * (1.0 - 0.8**count)


def _improve(stage: Stage, rounds: list[Round], report: OnProgress) -> tuple[Results, list[Touch]]:
    """Adds rounds, each after a cue was moved or refused, until no cue moves.

    Returns:
        Results of all rounds, and the touches of the last one.

    Raises:
        OutOfTime: the time limit has passed; all rounds are complete.
    """
    paused = False
    while True:
        this_round = rounds[-1]
        results = this_round.results
        results, moved = _first(
            stage,
            results,
            this_round,
            refuse_fast,
            refuse_stopped,
            locate_and_calm,
            refuse_failures,
            refuse_stretched,
        )
        if not (moved or paused):
            results, moved = settle(stage, results, this_round)
            paused = True
        if not moved:
            late = mark_lateness(stage, this_round)
            results, moved = advance_hands(results, late)
            if not moved:
                results, moved = refuse_late(results, this_round, late)
        if not moved:
            touching = _touches(stage, this_round, report)
            results, moved = _correct_touches(
                stage, results, this_round, touching, may_delay=len(rounds) < MAX_DELAY_ROUNDS
            )
            if not moved:
                break
        stage.cache.check()
        report(Progress("rehearsing", _share(len(rounds) + 1), 1.0))
        rounds.append(make_round(stage, results))
    if results.touching and not touching:
        results = _retry_touching(stage, results, report)
        report(Progress("rehearsing", _share(len(rounds) + 1), 1.0))
        rounds.append(make_round(stage, results))
        touching = _touches(stage, rounds[-1], report)
    return results, touching


def _first(
    stage: Stage,
    results: Results,
    this_round: Round,
    *rules: Callable[[Stage, Results, Round], Rule],
) -> Rule:
    """Results after the first rule that moves cues, or after all rules."""
    for rule in rules:
        results, moved = rule(stage, results, this_round)
        if moved:
            return results, True
    return results, False


# -- touches ---------------------------------------------------------------------------------


def _touches(stage: Stage, this_round: Round, report: OnProgress) -> list[Touch]:
    """Forbidden touches in the whole run of a round."""
    report(Progress("looking for touches", 0.97, 1.0))
    # The run has only the samples that are measured.
    run = together(stage.script.cast, this_round.runs, SAMPLE_STRIDE * SAMPLE)
    return touches(stage.script.cast, run, this_round.placement.meetings, every=1)


def _correct_touches(
    stage: Stage, results: Results, this_round: Round, touching: list[Touch], may_delay: bool
) -> Rule:
    """Delays or refuses the cues in which the first touches occur.

    Args:
        stage: play and its stage.
        results: results so far.
        this_round: last round.
        touching: touches in the last round.
        may_delay: whether cues may be delayed.
    """
    cast, corrected, moved = stage.script.cast, set[str](), False
    for touch in touching:
        owners = {cast.owner(_plain(name)) for name in (touch.what, touch.other)}
        if corrected & owners or touch.t <= 0.0:
            continue
        cue = this_round.cue_during(touch.t, owners & {*cast.players})
        if cue is None:
            continue
        corrections, entry = results.corrections, cue.given
        delay = corrections.pauses.get(cue.spot, 0.0) + _EXTRA_DELAY
        approach = corrections.approaches.get(cue.spot, 0) + 1
        if may_delay and isinstance(entry, SitsOnCue) and approach < len(APPROACHES):
            results = replace(
                results, corrections=corrections.setting("approaches", cue.spot, approach)
            )
        elif may_delay and delay <= max_pause(entry, stage.beat):
            results = replace(results, corrections=corrections.setting("pauses", cue.spot, delay))
        else:
            after = results.with_refusal(cue, f"{touch} {this_round.in_words(touch.t)}")
            if after is None:
                continue
            results = replace(after, touching=(*after.touching, cue.spot))
        moved = True
        corrected |= owners
    return results, moved


def _retry_touching(stage: Stage, results: Results, report: OnProgress) -> Results:
    """Tries again the cues that were refused because something would touch.

    A refused cue is tried unchanged if a later one is refused, otherwise with a smaller gesture;
    the reason then contains a size that can be done.
    """
    entries = {cue.spot: cue.given for cue in stage.script.timeline.cues}
    for spot in results.touching[:_MAX_RETRIED_CUES]:
        entry = entries[spot]
        sizes = _SMALLER_SIZES if isinstance(entry, DoesCue) else ()
        if spot != results.touching[-1]:
            sizes = (1.0, *sizes)
        before = results.corrections
        for size in sizes:
            report(Progress("trying smaller sizes", 0.95, 1.0))
            corrections = before.setting("refused", spot, None).setting("smaller", spot, size)
            trial = replace(results, corrections=corrections)
            tried, succeeds = _try_cue(stage, trial, spot, report)
            if succeeds and size == 1.0:
                results = replace(
                    tried, corrections=tried.corrections.setting("smaller", spot, None)
                )
                break
            results = tried.with_corrections(before)
            if succeeds and isinstance(entry, DoesCue):
                remedy = f"; it can be done with larger: {size * entry.larger:.2g}"
                reason = before.refused[spot] + remedy
                results = replace(results, corrections=before.setting("refused", spot, reason))
                break
    return results


def _try_cue(stage: Stage, results: Results, spot: Spot, report: OnProgress) -> Rule:
    """Results of a trial of a cue with all others, and whether it can be done."""
    while True:
        this_round = make_round(stage, results)
        late = mark_lateness(stage, this_round)
        results, moved = advance_hands(this_round.results, late)
        if not moved:
            results, moved = locate_and_calm(stage, results, this_round)
        if not moved:
            break
    refused = any(cue.refused for cue in this_round.placement.cues if cue.spot == spot)
    in_time = all(abs(seconds) <= IN_TIME for seconds in late.values())
    succeeds = not this_round.runs.stops and not refused and in_time
    succeeds = succeeds and not failures(
        stage.script.cast, this_round.placement.meetings, this_round.runs
    )
    succeeds = succeeds and not stretches_in(stage, this_round)
    return results, succeeds and not _touches(stage, this_round, report)


# -- the result ------------------------------------------------------------------------------


def _play(
    stage: Stage, results: Results, this_round: Round, touching: list[Touch], count: int
) -> Play:
    """Play of a round, with a list of deviations from the file."""
    script, placement = stage.script, this_round.placement
    cast, log, file = script.cast, script.log, script.cast.file
    refused = {cue.spot for cue in placement.cues if cue.refused}
    cues = tuple(_cue(stage, cue, _passes(placement, cue.spot, refused)) for cue in placement.cues)
    for cue, placed in zip(cues, placement.cues, strict=True):
        if cue.refused:
            log.change(placed.spot, cue.change)
    touch_at_start: set[frozenset[str]] = set()
    for touch in touching:
        owners = frozenset(cast.owner(_plain(x)) for x in (touch.what, touch.other))
        if touch.t <= 0.0 and owners in touch_at_start:
            continue
        touch_at_start |= {owners} if touch.t <= 0.0 else set()
        spot: Spot = ("acts",) if touch.t > 0.0 else ("cast",)
        log.change(spot, f"{touch} {this_round.in_words(touch.t)}")
    for stretch in stretches_in(stage, this_round):
        log.change(("acts",), f"{stretch} {this_round.in_words(stretch.t)}")
    for failure in failures(cast, placement.meetings, this_round.runs):
        log.change(("acts",), f"{failure.text} {this_round.in_words(failure.t)}")
    for stop in this_round.runs.stops:
        stopped = this_round.cue_during(stop.t, {*stop.players})
        spot = ("cast", stop.players[0]) if stopped is None else stopped.spot
        during = "" if stopped is None else f"{described(stopped.cue)}: "
        log.change(spot, during + stop.sentence(this_round.in_words(stop.t)))
    score = whole_score(cast, placement.motions, placement.lanes, placement.cues, log)
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
        placement.starts,
        placement.meetings,
        placement.ways,
        results.settling_pauses,
        shots_of(cast, script.timeline, placement, script.places, stage.beat),
        count,
        stage.cache,
    )


def _passes(placement: Placement, spot: Spot, refused: Set[Spot]) -> str:
    """Notes of a cue on players that it passes, without those whose own cue is refused."""
    notes = placement.passes.get(spot, ())
    return "; ".join(note for partner, note in notes if partner not in refused)


def _cue(stage: Stage, placed: Placed[PlayCue], passes: str) -> CueOfPlay:
    """Compiled cue of a placed one, with its notes on players that it passes."""
    cue, entry, parts = placed.cue, placed.given, placed.parts
    return CueOfPlay(
        cue.index + 1,
        stage.script.cast.file.acts[cue.act].act,
        cue.who,
        described(cue),
        cue.name,
        stage.script.log.located.line(cue.spot) or 0,
        placed.wanted,
        entry.patience * stage.beat,
        min((part.start for part in parts), default=placed.wanted),
        max((part.end for part in parts), default=placed.wanted),
        entry.mark,
        entry.go,
        entry.says or "",
        placed.refused,
        "" if placed.refused else passes,
        entry.optional,
        isinstance(entry, PropCue),
        {who: _marks_of(parts, who) for who in dict.fromkeys(part.who for part in parts)},
    )


def _marks_of(parts: Sequence[Part], who: str) -> dict[str, float]:
    """Marks of a player in a cue, its beginning and its end [s]."""
    parts = [part for part in parts if part.who == who]
    marks = {mark: t for part in parts for mark, t in part.marks.items()}
    ends = {START: min(part.start for part in parts), END: max(part.end for part in parts)}
    return marks | ends


def _rounds(n: int) -> str:
    return f"{n} round{'' if n == 1 else 's'}"


def described(cue: Cue[PlayCue]) -> str:
    """Description of a cue: ``columbine and pierrot: walks to centre``."""
    entry, verb, what = cue.given, cue.given.verb, cue.given.verb_value
    if isinstance(entry, DoesCue):
        return f"{' and '.join(cue.who)}: {what}"
    if isinstance(entry, PropCue):
        others = [key for key in VERBS[verb].names if key != verb]
        return " ".join(
            [
                f"{entry.who[0]}: {spelled(verb)} {what}",
                *(f"{key} {getattr(entry, key)}" for key in others),
            ]
        )
    if not isinstance(what, (str, float)):
        what = [round(float(x), 3) for x in what]
    return f"{' and '.join(cue.who)}: {spelled(verb)} {what}"


def _plain(name: str) -> str:
    """Name of a string or body without the word ``string``."""
    return name.removeprefix("string ")
