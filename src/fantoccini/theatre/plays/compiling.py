"""Plays compiled: cues placed, simulated company by company, and placed anew until all holds."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from fantoccini.base import OnProgress, Progress, StateError
from fantoccini.theatre.cast import Kept, OutOfTime, Part, Placed, settled
from fantoccini.theatre.plays.handled import failures
from fantoccini.theatre.plays.handling import APPROACHES
from fantoccini.theatre.plays.placing import IN_TIME
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.reading import read_play
from fantoccini.theatre.plays.rounds import (
    Known,
    Round,
    Rule,
    Stage,
    hurry,
    lates,
    look,
    make_round,
    most_pause,
    refuse_failures,
    refuse_fast,
    refuse_late,
    refuse_stopped,
    settle,
)
from fantoccini.theatre.plays.stage_run import SAMPLE, together
from fantoccini.theatre.plays.touching import EVERY, Touch, touches
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
    said,
)

PATIENT = 10
"""Rounds in which free cues may still be let wait; later they are refused at once."""
_WAIT = 0.4
"""Extra wait of a free cue where something touches [s]."""
_SMALLER = (0.75, 0.5)
"""Sizes that are tried where something touches."""
_MOST_TRIED = 3
"""Cues for which smaller sizes are tried."""


def load_play(
    path: str | os.PathLike[str],
    *,
    progress: OnProgress | None = None,
    before: Play | None = None,
    within: float | None = None,
) -> Play:
    """Reads and compiles a play.

    What cannot be done is left out, and :attr:`Play.changes` says why, with the line and the
    nearest thing that can be done; the rest is compiled.

    Args:
        path: of the file, or the name of a bundled play: ``trio``, ``chase`` or ``duet``.
        progress: called with what is being done and the share of it, as for a progress bar.
        before: an earlier version of the play, whose runs are used where nothing has changed.
        within: time after which compiling stops [s], but not before the first round is complete.
            The play is then that of the last complete round, and its changes list the stop and
            what is not corrected yet. No limit by default.

    Raises:
        FileError: with every mistake found and its location.
    """
    until = math.inf if within is None else time.monotonic() + within
    tell = progress or (lambda progress: None)
    tell(Progress("casting", 0.0, 1.0))
    kept = before.kept if before is not None else Kept()
    script = read_play(path, kept)
    try:
        script = replace(script, cast=settled(script.cast, kept))
    except StateError as error:
        script.notes.mistake(("props",), f"what is held does not hang there: {error}")
        script.notes.refuse()
        raise
    stage = Stage(script, Walks(script.cast, script.notes), kept)
    tell(Progress("rehearsing", _share(1), 1.0))
    # The first round is always completed.
    rounds = [make_round(stage, Known())]
    try:
        with kept.limited(until):
            known, found = _improve(stage, rounds, tell)
    except OutOfTime:
        script.notes.change(
            ("acts",),
            f"compiling was stopped after {_rounds(len(rounds))}: cues may be late, too "
            "fast or swing; with more time (`within`) they are mended or refused",
        )
        known, found = rounds[-1].known, _touches(stage, rounds[-1], tell)
    else:
        tell(Progress("compiled", 1.0, 1.0))
    return _play(stage, known, rounds[-1], found, len(rounds))


def _share(count: int) -> float:
    """Share of the work that is done when a round begins."""
    return 0.9 * (1.0 - 0.8**count)


def _improve(stage: Stage, rounds: list[Round], tell: OnProgress) -> tuple[Known, list[Touch]]:
    """Adds rounds until no cue moves; each added round follows from a cue moved or refused.

    Returns:
        The results of all rounds, and the touches of the last one.

    Raises:
        OutOfTime: the time is over; all rounds are complete.
    """
    paused = False
    while True:
        made = rounds[-1]
        known = made.known
        known, moved = _first(
            stage, known, made, refuse_fast, refuse_stopped, look, refuse_failures
        )
        if not (moved or paused):
            known, moved = settle(stage, known, made)
            paused = True
        if not moved:
            late = lates(stage, made)
            known, moved = hurry(known, late)
            if not moved:
                known, moved = refuse_late(known, made, late)
        if not moved:
            found = _touches(stage, made, tell)
            known, moved = _mend(stage, known, made, found, patient=len(rounds) < PATIENT)
            if not moved:
                break
        stage.kept.check()
        tell(Progress("rehearsing", _share(len(rounds) + 1), 1.0))
        rounds.append(make_round(stage, known))
    if known.touching and not found:
        known = _try_again(stage, known, tell)
        tell(Progress("rehearsing", _share(len(rounds) + 1), 1.0))
        rounds.append(make_round(stage, known))
        found = _touches(stage, rounds[-1], tell)
    return known, found


def _first(
    stage: Stage, known: Known, made: Round, *rules: Callable[[Stage, Known, Round], Rule]
) -> Rule:
    """Results after the first rule by which cues move, or after all of them."""
    for rule in rules:
        known, moved = rule(stage, known, made)
        if moved:
            return known, True
    return known, False


# -- touches ---------------------------------------------------------------------------------


def _touches(stage: Stage, made: Round, tell: OnProgress) -> list[Touch]:
    tell(Progress("looking for what touches", 0.97, 1.0))
    # Only the samples that are measured.
    run = together(stage.script.cast, made.runs, EVERY * SAMPLE)
    return touches(stage.script.cast, run, made.placement.meetings, every=1)


def _mend(stage: Stage, known: Known, made: Round, found: list[Touch], patient: bool) -> Rule:
    """Delays or refuses the cues in which the first touches occur.

    Args:
        stage: of the play.
        known: so far.
        made: the round.
        found: what touches.
        patient: whether cues may wait.
    """
    cast, seen, mended = stage.script.cast, set[str](), False
    for touch in found:
        owners = {cast.owner(_plain(one)) for one in (touch.what, touch.other)}
        if seen & owners or touch.t <= 0.0:
            continue
        cue = made.blamed(touch.t, owners & {*cast.players})
        if cue is None:
            continue
        wishes, given = known.wishes, cue.given
        waits = wishes.pauses.get(cue.spot, 0.0) + _WAIT
        tried = wishes.approaches.get(cue.spot, 0) + 1
        if patient and isinstance(given, SitsOnCue) and tried < len(APPROACHES):
            known = replace(known, wishes=wishes.setting("approaches", cue.spot, tried))
        elif patient and waits <= most_pause(given, stage.beat):
            known = replace(known, wishes=wishes.setting("pauses", cue.spot, waits))
        else:
            after = known.refusing(cue, f"{touch} {made.said(touch.t)}")
            if after is None:
                continue
            known = replace(after, touching=(*after.touching, cue.spot))
        mended = True
        seen |= owners
    return known, mended


def _try_again(stage: Stage, known: Known, tell: OnProgress) -> Known:
    """Tries what was refused because something would touch.

    A refused cue is tried again when a later one is refused, otherwise with a smaller gesture; the
    reason then says whether that can be done.
    """
    givens = {cue.spot: cue.given for cue in stage.script.timeline.cues}
    for spot in known.touching[:_MOST_TRIED]:
        given = givens[spot]
        sizes = _SMALLER if isinstance(given, DoesCue) else ()
        if spot != known.touching[-1]:
            sizes = (1.0, *sizes)
        before = known.wishes
        for size in sizes:
            tell(Progress("looking for what can be done", 0.95, 1.0))
            wishes = before.setting("refused", spot, None).setting("smaller", spot, size)
            tried, holds = _holds(stage, replace(known, wishes=wishes), spot, tell)
            if holds and size == 1.0:
                known = replace(tried, wishes=tried.wishes.setting("smaller", spot, None))
                break
            known = tried.back(before)
            if holds and isinstance(given, DoesCue):
                larger = f"; it can be done with larger: {size * given.larger:.2g}"
                why = before.refused[spot] + larger
                known = replace(known, wishes=before.setting("refused", spot, why))
                break
    return known


def _holds(stage: Stage, known: Known, spot: Spot, tell: OnProgress) -> Rule:
    """Results of trying a cue beside all others, and whether it can be done."""
    while True:
        made = make_round(stage, known)
        late = lates(stage, made)
        known, moved = hurry(made.known, late)
        if not moved:
            known, moved = look(stage, known, made)
        if not moved:
            break
    refused = any(cue.refused for cue in made.placement.cues if cue.spot == spot)
    in_time = all(abs(seconds) <= IN_TIME for seconds in late.values())
    right = not made.runs.stops and not refused and in_time
    right = right and not failures(stage.script.cast, made.placement.meetings, made.runs)
    return known, right and not _touches(stage, made, tell)


# -- the result ------------------------------------------------------------------------------


def _play(stage: Stage, known: Known, made: Round, found: list[Touch], count: int) -> Play:
    """The play of a round, with a list of what is not as it was written."""
    script, placement = stage.script, made.placement
    cast, notes, file = script.cast, script.notes, script.cast.file
    cues = tuple(_cue(stage, cue) for cue in placement.cues)
    for cue, placed in zip(cues, placement.cues, strict=True):
        if cue.refused:
            notes.change(placed.spot, cue.change)
    at_once: set[frozenset[str]] = set()
    for touch in found:
        owners = frozenset(cast.owner(_plain(x)) for x in (touch.what, touch.other))
        if touch.t <= 0.0 and owners in at_once:
            continue
        at_once |= {owners} if touch.t <= 0.0 else set()
        spot: Spot = ("acts",) if touch.t > 0.0 else ("cast",)
        notes.change(spot, f"{touch} {made.said(touch.t)}")
    for failure in failures(cast, placement.meetings, made.runs):
        notes.change(("acts",), f"{failure.text} {made.said(failure.t)}")
    for stop in made.runs.stops:
        blamed = made.blamed(stop.t, {*stop.players})
        spot = ("cast", stop.players[0]) if blamed is None else blamed.spot
        during = "" if blamed is None else f"{described(blamed.cue)}: "
        notes.change(spot, during + stop.told(made.said(stop.t)))
    score = whole_score(cast, placement.motions, placement.lanes, placement.cues, notes)
    return Play(
        file.play,
        notes.located,
        cast,
        score,
        tuple(
            (number, part.who) for number, cue in enumerate(placement.cues, 1) for part in cue.parts
        ),
        cues,
        tuple(notes.changes),
        {act.act: start for act, start in zip(file.acts, placement.act_starts, strict=True)},
        placement.motions,
        placement.starts,
        placement.meetings,
        placement.ways,
        known.settled,
        count,
        stage.kept,
    )


def _cue(stage: Stage, placed: Placed) -> CueOfPlay:
    cue, given, parts = placed.cue, placed.given, placed.parts
    return CueOfPlay(
        cue.index + 1,
        stage.script.cast.file.acts[cue.act].act,
        cue.who,
        described(cue),
        cue.name,
        stage.script.notes.located.line(cue.spot) or 0,
        placed.wanted,
        given.patience * stage.beat,
        min((part.start for part in parts), default=placed.wanted),
        max((part.end for part in parts), default=placed.wanted),
        given.mark,
        given.go,
        given.says or "",
        placed.refused,
        given.optional,
        isinstance(given, PropCue),
        {who: _marks_of(parts, who) for who in dict.fromkeys(part.who for part in parts)},
    )


def _marks_of(parts: Sequence[Part], who: str) -> dict[str, float]:
    """The marks of a player in a cue, its beginning and its end [s]."""
    own = [part for part in parts if part.who == who]
    marks = {mark: t for part in own for mark, t in part.marks.items()}
    ends = {START: min(part.start for part in own), END: max(part.end for part in own)}
    return marks | ends


def _rounds(n: int) -> str:
    return f"{n} round{'' if n == 1 else 's'}"


def described(cue: Cue[PlayCue]) -> str:
    """A cue in words: ``columbine and pierrot: walks to centre``."""
    given, verb, what = cue.given, cue.given.verb, cue.given.what
    if isinstance(given, DoesCue):
        return f"{' and '.join(cue.who)}: {what}"
    if isinstance(given, PropCue):
        others = [key for key in VERBS[verb].names if key != verb]
        return " ".join(
            [
                f"{given.who[0]}: {said(verb)} {what}",
                *(f"{key} {getattr(given, key)}" for key in others),
            ]
        )
    if not isinstance(what, (str, float)):
        what = [round(float(x), 3) for x in what]
    return f"{' and '.join(cue.who)}: {said(verb)} {what}"


def _plain(name: str) -> str:
    return name.removeprefix("string ")
