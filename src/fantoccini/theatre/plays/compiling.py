"""Plays compiled: cues placed, simulated company by company, and placed anew until all holds."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence

from fantoccini.base import OnProgress, Progress, StateError
from fantoccini.theatre.cast import WITH_PROPS, Cast, Cue, Kept, OutOfTime, Part, said, settled
from fantoccini.theatre.gestures import END, START, Notes, Spot
from fantoccini.theatre.plays.handled import failures
from fantoccini.theatre.plays.handling import APPROACHES
from fantoccini.theatre.plays.placing import IN_TIME
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.reading import read_script
from fantoccini.theatre.plays.rounds import Round, Rounds
from fantoccini.theatre.plays.stage_run import SAMPLE, together
from fantoccini.theatre.plays.touching import EVERY, Touch, touches
from fantoccini.theatre.plays.whole import whole_score

PATIENT = 10
"""Rounds in which free cues may still be let wait; later they are refused at once."""
_WAIT = 0.4
"""What a free cue waits longer where something touches [s]."""
_SMALLER = (0.75, 0.5)
"""Sizes that are tried where something touches."""
_MOST_TRIED = 3
"""Cues for which smaller sizes are tried."""
"""Called with what is being done, and the share that is done."""


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
    script = read_script(path)
    kept = before.kept if before is not None else Kept()
    script.repertory.kept = kept
    try:
        cast = settled(script.cast, kept)
    except StateError as error:
        script.notes.mistake(("props",), f"what is held does not hang there: {error}")
        script.notes.refuse()
        raise
    rounds = Rounds(cast, script.timeline, script.repertory, script.places, script.notes, kept)
    return _Compiler(cast, rounds, script.notes, kept, tell).play(until)


class _Compiler:
    """Compiles one play."""

    def __init__(self, cast: Cast, rounds: Rounds, notes: Notes, kept: Kept, tell: OnProgress):
        self._cast, self._rounds, self._notes = cast, rounds, notes
        self._kept, self._tell = kept, tell
        self._touching: list[Cue] = []
        self._count = 0

    def play(self, until: float = math.inf) -> Play:
        """The play, after as many rounds as needed, or as fit before a time [s].

        Every round refuses or moves a cue, and no cue is moved without end. The first round is
        always completed.
        """
        self._next_round()
        self._kept.until = until
        try:
            found = self._settled()
        except OutOfTime:
            self._kept.until = math.inf
            return self._stopped()
        finally:
            self._kept.until = math.inf
        self._tell(Progress("compiled", 1.0, 1.0))
        return self._made(found)

    def _next_round(self) -> None:
        """Makes a round, and keeps what it was made from."""
        rounds = self._rounds
        self._tell(Progress("rehearsing", 0.9 * (1.0 - 0.8 ** (self._count + 1)), 1.0))
        before = rounds.wishes.copied(), dict(rounds.settled)
        self._round, self._before = rounds.made(), before
        self._count += 1

    def _settled(self) -> list[Touch]:
        """Makes rounds until no cue moves any more; returns the touches of the last round.

        Raises:
            OutOfTime: the time is over.
        """
        rounds, paused = self._rounds, False
        while True:
            made = self._round
            moved = rounds.refuse_fast(made) or rounds.refuse_stopped(made)
            moved = moved or rounds.look(made) or rounds.refuse_failures(made)
            if not (moved or paused):
                paused, moved = True, rounds.settle(made)
            if not (moved or rounds.hurry(made) or rounds.refuse_late()):
                found = self._touches(made)
                if not self._mend(found, patient=self._count < PATIENT):
                    break
            self._kept.check()
            self._next_round()
        if self._touching and not found:
            self._try_again()
            self._next_round()
            found = self._touches(self._round)
        return found

    def _stopped(self) -> Play:
        """The play of the last complete round, with a list of what is not corrected."""
        wishes, self._rounds.settled = self._before
        self._rounds.back(wishes)
        self._round = self._rounds.made()
        self._notes.change(
            ("acts",),
            f"compiling was stopped after {_rounds(self._count)}: cues may be late, too "
            "fast or swing; with more time (`within`) they are mended or refused",
        )
        return self._made(self._touches(self._round))

    # -- touches -----------------------------------------------------------------------------

    def _touches(self, made: Round) -> list[Touch]:
        self._tell(Progress("looking for what touches", 0.97, 1.0))
        # Only the samples that are measured.
        run = together(self._cast, made.runs, EVERY * SAMPLE)
        return touches(self._cast, run, made.meetings, every=1)

    def _mend(self, found: list[Touch], patient: bool) -> bool:
        """Lets the cues in which something touches first wait, or refuses them; whether any.

        Args:
            found: what touches.
            patient: whether cues may wait.
        """
        rounds, seen, mended = self._rounds, set[str](), False
        for touch in found:
            owners = {self._cast.owner(_plain(one)) for one in (touch.what, touch.other)}
            if seen & owners or touch.t <= 0.0:
                continue
            cue = rounds.blamed(touch.t, owners & {*self._cast.players})
            if cue is None:
                continue
            waits = rounds.wishes.pauses.get(cue.spot, 0.0) + _WAIT
            tried = rounds.wishes.approaches.get(cue.spot, 0) + 1
            if patient and cue.given.sits_on and tried < len(APPROACHES):
                rounds.wishes.approaches[cue.spot] = tried
            elif patient and waits <= rounds.most_pause(cue):
                rounds.wishes.pauses[cue.spot] = waits
            elif rounds.refuse(cue, f"{touch} {self._rounds.said(touch.t)}"):
                self._touching.append(cue)
            else:
                continue
            mended = True
            seen |= owners
        return mended

    def _try_again(self) -> None:
        """Tries what was refused because something would touch.

        Once what comes later is refused as well, it may be done after all; otherwise a smaller
        gesture may be, which the reason then says.
        """
        rounds = self._rounds
        for cue in self._touching[:_MOST_TRIED]:
            sizes = _SMALLER if cue.given.does is not None else ()
            if cue is not self._touching[-1]:
                sizes = (1.0, *sizes)
            before = rounds.wishes.copied()
            for size in sizes:
                self._tell(Progress("looking for what can be done", 0.95, 1.0))
                del rounds.wishes.refused[cue.spot]
                rounds.wishes.smaller[cue.spot] = size
                holds = self._holds(cue)
                if holds and size == 1.0:
                    del rounds.wishes.smaller[cue.spot]
                    break
                rounds.back(before.copied())
                if holds:
                    larger = f"; it can be done with larger: {size * cue.given.larger:.2g}"
                    rounds.wishes.refused[cue.spot] += larger
                    break

    def _holds(self, cue: Cue) -> bool:
        """Whether a cue can be done beside all others, in time and without touching."""
        rounds = self._rounds
        made = rounds.made()
        while rounds.hurry(made) or rounds.look(made):
            made = rounds.made()
        in_time = all(abs(late) <= IN_TIME for late in rounds.late.values())
        right = not made.runs.stops and not cue.refused and in_time
        right = right and not failures(self._cast, made.meetings, made.runs)
        return right and not self._touches(made)

    # -- the result --------------------------------------------------------------------------

    def _made(self, found: list[Touch]) -> Play:
        notes, file, made = self._notes, self._cast.file, self._round
        cues = tuple(self._cue(i, cue) for i, cue in enumerate(self._rounds.timeline.cues))
        for cue, given in zip(cues, self._rounds.timeline.cues, strict=True):
            if cue.refused:
                notes.change(given.spot, cue.change)
        at_once: set[frozenset[str]] = set()
        for touch in found:
            owners = frozenset(self._cast.owner(_plain(x)) for x in (touch.what, touch.other))
            if touch.t <= 0.0 and owners in at_once:
                continue
            at_once |= {owners} if touch.t <= 0.0 else set()
            spot: Spot = ("acts",) if touch.t > 0.0 else ("cast",)
            notes.change(spot, f"{touch} {self._rounds.said(touch.t)}")
        for failure in failures(self._cast, made.meetings, made.runs):
            notes.change(("acts",), f"{failure.text} {self._rounds.said(failure.t)}")
        for stop in made.runs.stops:
            blamed = self._rounds.blamed(stop.t, {*stop.players})
            spot = ("cast", stop.players[0]) if blamed is None else blamed.spot
            during = "" if blamed is None else f"{described(blamed)}: "
            notes.change(spot, during + stop.told(self._rounds.said(stop.t)))
        score = whole_score(self._cast, made.motions, made.lanes, self._rounds.timeline, notes)
        parts = tuple(
            (number, part.who)
            for number, cue in enumerate(self._rounds.timeline.cues, 1)
            for part in cue.parts
        )
        acts = {
            act.act: start for act, start in zip(file.acts, made.placing.act_starts, strict=True)
        }
        ways = {name: tuple(actor.ways) for name, actor in made.placing.actors.items()}
        return Play(
            file.play,
            notes.located,
            self._cast,
            score,
            parts,
            cues,
            tuple(notes.changes),
            acts,
            made.motions,
            made.starts,
            made.meetings,
            ways,
            self._rounds.settled,
            self._count,
            self._kept,
        )

    def _cue(self, i: int, cue: Cue) -> CueOfPlay:
        given = cue.given
        parts = cue.parts
        start = min((part.start for part in parts), default=cue.wanted)
        end = max((part.end for part in parts), default=cue.wanted)
        return CueOfPlay(
            i + 1,
            self._cast.file.acts[cue.act].act,
            cue.who,
            described(cue),
            cue.name,
            self._notes.located.line(cue.spot) or 0,
            cue.wanted,
            cue.give(self._notes.beat),
            start,
            end,
            next(iter(given.on)) if given.on is not None else "",
            given.go,
            given.says or "",
            cue.refused,
            given.optional,
            given.verb in WITH_PROPS,
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


def described(cue: Cue) -> str:
    """A cue in words: ``columbine and pierrot: walks to centre``."""
    given, verb = cue.given, cue.given.verb
    what = getattr(given, verb)
    if verb == "does":
        return f"{' and '.join(cue.who)}: {what}"
    if verb in WITH_PROPS:
        (who,), to = given.who, given.to or given.onto
        with_what = f" {'to' if given.to else 'onto'} {to}" if to else ""
        return f"{who}: {said(verb)} {what}{with_what}"
    if not isinstance(what, (str, float)):
        what = [round(float(x), 3) for x in what]
    return f"{' and '.join(cue.who)}: {said(verb)} {what}"


def _plain(name: str) -> str:
    return name.removeprefix("string ")
