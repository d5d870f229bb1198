"""Plays compiled: cues placed, simulated player by player, and placed anew until all holds."""

from __future__ import annotations

import os
from collections.abc import Callable

from fantoccini.errors import Status
from fantoccini.gestures.notes import Notes
from fantoccini.gestures.timing import END, START, Spot
from fantoccini.plays.acting import Style
from fantoccini.plays.casting import Cast
from fantoccini.plays.cues import Cue
from fantoccini.plays.kept import Kept
from fantoccini.plays.placing import IN_TIME
from fantoccini.plays.play import CueOfPlay, Play
from fantoccini.plays.play_file import said
from fantoccini.plays.reading import read_script
from fantoccini.plays.rounds import TRIES, Round, Rounds
from fantoccini.plays.together import together
from fantoccini.plays.touching import Touch, touches
from fantoccini.plays.whole import whole_score

ROUNDS = 12
"""Most rounds of placing and simulating."""
_WAIT = 0.4
"""What a free cue waits longer where something touches [s]."""
_SMALLER = (0.75, 0.5)
"""Sizes that are tried where something touches."""
_MOST_TRIED = 3
"""Cues for which smaller sizes are tried."""
Progress = Callable[[str, float], None]
"""Called with what is being done, and the share that is done."""


def load_play(
    path: str | os.PathLike[str], *, progress: Progress | None = None, before: Play | None = None
) -> Play:
    """Reads and compiles a play.

    What cannot be done is left out, and :attr:`Play.changes` says why, with the line and the
    nearest thing that can be done; the rest is compiled.

    Args:
        path: of the file, or the name of a bundled play: ``trio``.
        progress: called with what is being done and the share of it, as for a progress bar.
        before: an earlier version of the play, whose runs are used where nothing has changed.

    Raises:
        FileError: with every mistake found and its location.
    """
    tell = progress or (lambda what, share: None)
    tell("casting", 0.0)
    script = read_script(path, before)
    kept = before.kept if before is not None else Kept()
    rounds = Rounds(
        script.cast, script.timeline, script.repertory, script.places, script.notes, kept
    )
    return _Compiler(script.cast, rounds, script.notes, kept, tell).play()


class _Compiler:
    """Compiles one play."""

    def __init__(self, cast: Cast, rounds: Rounds, notes: Notes, kept: Kept, tell: Progress):
        self._cast, self._rounds, self._notes = cast, rounds, notes
        self._kept, self._tell = kept, tell
        self._touching: list[Cue] = []

    def play(self) -> Play:
        """The play, after as many rounds as it takes."""
        count = 0
        while True:
            count += 1
            self._tell("rehearsing", min(0.95, count / ROUNDS))
            made, last = self._rounds.made(), count >= ROUNDS
            if self._rounds.refuse_stopped(made) and not last:
                continue
            if count == 1 and self._rounds.settle(made):
                continue
            if (self._rounds.hurry(made) or self._rounds.refuse_late()) and not last:
                continue
            found = self._touches(made)
            if last or not self._mend(found):
                break
        if self._touching and not found:
            self._try_again()
            made = self._rounds.made()
            found = self._touches(made)
        self._tell("compiled", 1.0)
        return self._made(made, found, count)

    # -- touches -----------------------------------------------------------------------------

    def _touches(self, made: Round) -> list[Touch]:
        self._tell("looking for what touches", 0.97)
        return touches(self._cast, together(self._cast, made.runs))

    def _mend(self, found: list[Touch]) -> bool:
        """Lets the cues in which something touches first wait, or refuses them; whether any."""
        seen: set[str] = set()
        mended = False
        for touch in found:
            owners = {self._cast.owner(_plain(one)) for one in (touch.what, touch.other)}
            if seen & owners:
                continue
            seen |= owners
            cue = self._rounds.blamed(touch.t, owners & {*self._cast.players})
            if cue is None or cue.spot in self._rounds.wishes.refused:
                continue
            mended = True
            waits = self._rounds.wishes.pauses.get(cue.spot, 0.0) + _WAIT
            if waits <= self._rounds.most_pause(cue):
                self._rounds.wishes.pauses[cue.spot] = waits
            else:
                self._rounds.wishes.pauses.pop(cue.spot, None)
                self._rounds.wishes.refused[cue.spot] = f"{touch} {self._notes.said(touch.t)}"
                self._touching.append(cue)
        return mended

    def _try_again(self) -> None:
        """Tries what was refused because something would touch.

        Once what comes later is refused as well, it may be done after all; otherwise a smaller
        gesture may be, which the reason then says.
        """
        wishes = self._rounds.wishes
        for cue in self._touching[:_MOST_TRIED]:
            sizes = _SMALLER if cue.given.does is not None else ()
            if cue is not self._touching[-1]:
                sizes = (1.0, *sizes)
            why = wishes.refused.pop(cue.spot)
            for size in sizes:
                self._tell("looking for what can be done", 0.98)
                wishes.smaller[cue.spot] = size
                if not self._holds(cue):
                    continue
                if size < 1.0:
                    larger = size * Style.of(cue.given).larger
                    why += f"; it can be done with larger: {larger:.2g}"
                    wishes.refused[cue.spot] = why
                break
            else:
                wishes.refused[cue.spot] = why
            wishes.smaller.pop(cue.spot, None)

    def _holds(self, cue: Cue) -> bool:
        """Whether a cue can be done beside all others, in time and without touching."""
        made = self._rounds.made()
        for _ in range(TRIES):
            if not self._rounds.hurry(made):
                break
            made = self._rounds.made()
        done = all(run.status is Status.DONE for run in made.runs.values())
        in_time = all(abs(late) <= IN_TIME for late in self._rounds.late.values())
        return done and not cue.refused and in_time and not self._touches(made)

    # -- the result --------------------------------------------------------------------------

    def _made(self, made: Round, found: list[Touch], rounds: int) -> Play:
        notes, file = self._notes, self._cast.file
        for cue in self._rounds.timeline.cues:
            self._note(cue)
        for touch in found:
            spot: Spot = ("acts",) if touch.t > 0.0 else ("cast",)
            notes.change(spot, f"{touch} {notes.said(touch.t)}")
        cues = tuple(self._cue(i, cue) for i, cue in enumerate(self._rounds.timeline.cues))
        score = whole_score(self._cast, made.motions, made.lanes, self._rounds.timeline, notes)
        parts = tuple(
            (number, part.who)
            for number, cue in enumerate(self._rounds.timeline.cues, 1) for part in cue.parts
        )  # fmt: skip
        acts = {
            act.act: start for act, start in zip(file.acts, made.placing.act_starts, strict=True)
        }
        ways = {name: tuple(actor.ways) for name, actor in made.placing.actors.items()}
        return Play(
            file.play, notes.located, self._cast, score, parts, cues, tuple(notes.changes), acts,
            made.motions, made.starts, ways, self._rounds.settled, rounds, self._kept,
        )  # fmt: skip

    def _note(self, cue: Cue) -> None:
        """Says what cannot be done."""
        notes = self._notes
        if cue.refused:
            left = "is left out: " if cue.given.optional else "cannot be done: "
            notes.change(cue.spot, f"{described(cue)} {left}{cue.refused}")

    def _cue(self, i: int, cue: Cue) -> CueOfPlay:
        given = cue.given
        parts = cue.parts
        start = min((part.start for part in parts), default=cue.wanted)
        end = max((part.end for part in parts), default=cue.wanted)
        return CueOfPlay(
            i + 1, self._cast.file.acts[cue.act].act, cue.who, described(cue), cue.name,
            self._notes.located.line(cue.spot) or 0, cue.wanted, cue.give(self._notes.beat), start,
            end, next(iter(given.on)) if given.on is not None else "", given.go, given.says or "",
            cue.refused, given.optional,
            {part.who: {**part.marks, START: part.start, END: part.end} for part in parts},
        )  # fmt: skip


def described(cue: Cue) -> str:
    """A cue in words: ``columbine and pierrot: walks to centre``."""
    given, verb = cue.given, cue.given.verb
    what = getattr(given, verb)
    if verb == "does":
        return f"{' and '.join(cue.who)}: {what}"
    if not isinstance(what, (str, float)):
        what = [round(float(x), 3) for x in what]
    return f"{' and '.join(cue.who)}: {said(verb)} {what}"


def _plain(name: str) -> str:
    return name.removeprefix("string ")
