"""Plays compiled: cues placed, simulated player by player, and placed anew until all holds."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from fantoccini.errors import Status
from fantoccini.gestures import Gesture, Played, Score, lateness, piecewise
from fantoccini.gestures.joining import Motion
from fantoccini.gestures.notes import LATE
from fantoccini.gestures.timing import END, START, Spot
from fantoccini.motion import Trajectory
from fantoccini.plays.alone import runs_alone
from fantoccini.plays.cues import Cue, Part
from fantoccini.plays.kept import Kept, digest
from fantoccini.plays.placing import Placing, Wishes
from fantoccini.plays.play import CueOfPlay, Play
from fantoccini.plays.reading import Script, read_script
from fantoccini.plays.settling import PAUSE, pause
from fantoccini.plays.together import together
from fantoccini.plays.touching import Touch, touches
from fantoccini.plays.walks import Walks
from fantoccini.plays.whole import whole_score
from fantoccini.runtime import default_threads

ROUNDS = 12
"""Most rounds of placing and simulating."""
IN_TIME = 1.0 / 60.0
"""So near to its time a cue is in time [s]."""
_ENOUGH = 0.25 * IN_TIME
"""Lateness that is not mended [s]."""
_RINGS = 1.0
"""After the last cue, in which the puppets still swing [s]."""
_SLACK = 0.6
"""After a cue, in which what touches is still its own doing [s]."""
_TRIES = 4
"""How often a cue's hands are moved in time."""
_MOST_EARLY = 0.6
"""By how much hands lead limbs at most [s]."""

Progress = Callable[[str, float], None]
"""Called with what is being done, and the share that is done."""


def load_play(
    path: str | os.PathLike[str], *, progress: Progress | None = None, before: Play | None = None
) -> Play:
    """Reads and compiles a play.

    What cannot be done is left out, and :attr:`Play.changes` says why, with the line and the
    nearest thing that can be done; the rest is compiled.

    Args:
        path: of the file.
        progress: called with what is being done and the share of it, as for a progress bar.
        before: an earlier version of the play, whose runs are used where nothing has changed.

    Raises:
        FileError: with every mistake found and its location.
    """
    tell = progress or (lambda what, share: None)
    tell("casting", 0.0)
    kept = before.kept if before is not None else Kept()
    return _Compiler(read_script(path, before), kept, tell).play()


@dataclass
class _Round:
    """What a round has led to."""

    placing: Placing
    motions: Mapping[str, Gesture]
    lanes: Mapping[str, Mapping[str, Gesture]]
    runs: Mapping[str, Trajectory]
    late: dict[tuple[int, str], float] = field(default_factory=dict)


class _Compiler:
    """Compiles one play."""

    def __init__(self, script: Script, kept: Kept, tell: Progress):
        self._cast, self._timeline, self._repertory = (
            script.cast, script.timeline, script.repertory,
        )  # fmt: skip
        self._places, self._notes, self._kept, self._tell = (
            script.places, script.notes, kept, tell,
        )  # fmt: skip
        self._walks = Walks(self._cast, self._notes)
        self._wishes = Wishes()
        self._settled: dict[int, tuple[float, float, float]] = {}
        self._tried: dict[tuple[Spot, str], int] = {}

    def play(self) -> Play:
        """The play, after as many rounds as it takes."""
        rounds = 0
        while True:
            rounds += 1
            self._tell("rehearsing", min(0.95, rounds / ROUNDS))
            made = self._round()
            last = rounds >= ROUNDS
            if self._refuse_stopped(made) and not last:
                continue
            if rounds == 1 and self._settle(made):
                continue
            if self._hurry(made) and not last:
                continue
            found = self._touches(made)
            if last or not self._refuse(found, made):
                break
        self._tell("compiled", 1.0)
        return self._made(made, found, rounds)

    # -- rounds ------------------------------------------------------------------------------

    def _round(self) -> _Round:
        placing = Placing(
            self._cast, self._timeline, self._repertory, self._places, self._walks,
            self._wishes, self._notes,
        )  # fmt: skip
        end = max(placing.end, *(a.done for a in placing.actors.values())) + _RINGS
        both = {name: placing.motion(name, end) for name in self._cast.players}
        motions = {name: whole for name, (whole, _) in both.items()}
        lanes = {name: own for name, (_, own) in both.items()}
        return _Round(placing, motions, lanes, self._runs(motions))

    def _runs(self, motions: Mapping[str, Gesture]) -> dict[str, Trajectory]:
        """The event-driven run of every player alone."""
        self._kept.next_round()
        return runs_alone(self._cast, motions, self._kept)

    def _refuse_stopped(self, made: _Round) -> bool:
        """Refuses the cues in which a run stopped before its end."""
        changed = False
        for name, run in made.runs.items():
            if run.status is Status.DONE:
                continue
            cue = self._blamed(float(run.t[-1]), {name}, made)
            if cue is not None and cue.spot not in self._wishes.refused:
                self._wishes.refused[cue.spot] = f"{name}'s run stops there: {run.status}"
                changed = True
        return changed

    def _settle(self, made: _Round) -> bool:
        """Finds pauses of the cues that begin when they like."""
        jobs: dict[str, Callable[[], tuple[float, float, float]]] = {}
        cues: dict[str, tuple[int, Cue]] = {}
        for number, cue in enumerate(self._timeline.cues):
            if not _is_free(cue) or len(cue.parts) != 1:
                continue
            (part,) = cue.parts
            motion = self._alone(made, part)
            wait = cue.given.may_wait
            most = PAUSE if wait is None else wait * self._notes.beat
            if motion is None or most <= 0.0:
                continue
            begun, own = motion
            run, alone = made.runs[part.who], self._cast.players[part.who].alone
            x = run.at(begun)
            key = digest(x, Gesture(alone.coordinates, *own), most, "pause")
            jobs[key] = partial(pause, alone, x, own, most)
            cues[key] = number, cue
        found = self._kept.all(jobs, default_threads())
        for key, (number, cue) in cues.items():
            self._settled[number + 1] = found[key]
            self._wishes.pauses[cue.spot] = found[key][0]
        return any(p > 0.0 for p, _, _ in found.values())

    def _alone(self, made: _Round, part: Part) -> tuple[float, Motion] | None:
        """When a part may begin, and its motion from then on; None where others go on meanwhile."""
        mine = [
            one for cue in self._timeline.cues for one in cue.parts
            if one.who == part.who and one is not part
        ]  # fmt: skip
        if any(one.end > part.start and one.start < part.end for one in mine):
            return None
        begun = max([0.0, *(one.end for one in mine if one.end <= part.start)])
        whole = made.motions[part.who]
        if np.max(np.abs(whole.offsets(begun)[1])) > LATE or part.end - begun < LATE:
            return None
        return begun, excerpt(whole, begun, part.end)

    def _hurry(self, made: _Round) -> bool:
        """Lets hands begin earlier, where limbs are late on the marks that cues are timed by."""
        changed = False
        for name, run in made.runs.items():
            for late, number, cue in self._late(name, run, made):
                made.late[number, name] = late
                key = cue.spot, name
                tried = self._tried.get(key, 0)
                if abs(late) < _ENOUGH or tried >= _TRIES:
                    continue
                before = self._wishes.earlier.get(key, 0.0)
                after = float(np.clip(before + late, -_MOST_EARLY, _MOST_EARLY))
                self._tried[key] = tried + 1
                self._wishes.earlier[key] = after
                changed = changed or after != before
        return changed

    def _late(self, name: str, run: Trajectory, made: _Round) -> list[tuple[float, int, Cue]]:
        """How late a player's limbs are on the marks of `on`, with the cues and their numbers."""
        timed: dict[int, tuple[int, Cue, str]] = {}
        played = []
        for number, cue in enumerate(self._timeline.cues):
            for part in cue.parts:
                if part.who != name or cue.walks:
                    continue
                lane = name if part.lane == 0 else f"{name} {part.lane + 1}"
                one = Played(lane, cue.name, part.start, part.end, part.marks, cue.name)
                played.append(one)
                if cue.given.on is not None:
                    timed[id(one)] = number, cue, next(iter(cue.given.on))
        if not timed:
            return []
        alone = self._cast.players[name].alone
        lanes = dict(made.lanes[name])
        score = Score(
            alone, made.motions[name], tuple(played), {}, (), self._notes.beat, lanes=lanes
        )
        found: dict[int, list[float]] = {}
        for late in lateness(score, run):
            if id(late.cue) in timed and late.mark == timed[id(late.cue)][2]:
                found.setdefault(timed[id(late.cue)][0], []).append(late.seconds)
        cues = {number: cue for number, cue, _ in timed.values()}
        return [
            (float(np.mean(found.get(number, [0.0]))) + _of_hands(cue, name), number, cue)
            for number, cue in cues.items()
        ]

    # -- touches -----------------------------------------------------------------------------

    def _touches(self, made: _Round) -> list[Touch]:
        self._tell("looking for what touches", 0.97)
        return touches(self._cast, together(self._cast, made.runs))

    def _refuse(self, found: list[Touch], made: _Round) -> bool:
        """Refuses the cues in which something touches first; whether there are any."""
        seen: set[str] = set()
        refused = False
        for touch in found:
            owners = {self._cast.owner(_plain(one)) for one in (touch.what, touch.other)}
            if seen & owners:
                continue
            seen |= owners
            cue = self._blamed(touch.t, owners & {*self._cast.players}, made)
            if cue is not None and cue.spot not in self._wishes.refused:
                self._wishes.refused[cue.spot] = f"{touch} {self._notes.said(touch.t)}"
                refused = True
        return refused

    def _blamed(self, t: float, owners: set[str], made: _Round) -> Cue | None:
        """The cue that has begun last of those that go on at a time; a gesture before a walk."""
        now = [
            (not cue.walks, part.start, -i, cue)
            for i, cue in enumerate(self._timeline.cues)
            for part in cue.parts
            if part.who in owners and part.start - _SLACK <= t <= part.end + _SLACK
        ]
        if not now:
            now = [
                (True, part.start, -i, cue)
                for i, cue in enumerate(self._timeline.cues)
                for part in cue.parts
                if part.who in owners and part.start <= t
            ]
        return max(now, key=lambda one: one[:3])[3] if now else None

    # -- the result --------------------------------------------------------------------------

    def _made(self, made: _Round, found: list[Touch], rounds: int) -> Play:
        notes, file = self._notes, self._cast.file
        for cue in self._timeline.cues:
            self._note(cue, made)
        for touch in found:
            notes.change(("acts",), f"{touch} {notes.said(touch.t)}")
        cues = tuple(self._cue(i, cue) for i, cue in enumerate(self._timeline.cues))
        score = whole_score(self._cast, made.motions, made.lanes, self._timeline, notes)
        parts = tuple(
            (number, part.who)
            for number, cue in enumerate(self._timeline.cues, 1) for part in cue.parts
        )  # fmt: skip
        acts = {
            act.act: start for act, start in zip(file.acts, made.placing.act_starts, strict=True)
        }
        ways = {name: tuple(actor.ways) for name, actor in made.placing.actors.items()}
        return Play(
            file.play, notes.located, self._cast, score, parts, cues, tuple(notes.changes), acts,
            made.motions, ways, self._settled, rounds, self._kept,
        )  # fmt: skip

    def _note(self, cue: Cue, made: _Round) -> None:
        """Says what cannot be done, and what begins late."""
        notes = self._notes
        if cue.refused:
            left = "is left out: " if cue.given.optional else "cannot be done: "
            notes.change(cue.spot, f"{described(cue)} {left}{cue.refused}")
            return
        for part in cue.parts:
            mark = next(iter(cue.given.on)) if cue.given.on is not None else ""
            seen = part.marks[mark] if mark else part.start
            early = self._wishes.earlier.get((cue.spot, part.who), 0.0)
            late = seen + early - cue.wanted
            if late > self._give(cue) + IN_TIME:
                what = mark or "begins"
                notes.change(
                    cue.spot, f"{described(cue)}: {what} {notes.said(seen)} instead of "
                    f"{notes.said(cue.wanted)}; {part.who} is not free before",
                )  # fmt: skip
                return

    def _give(self, cue: Cue) -> float:
        """By how much later a cue may be [s]; as long as it likes, where the play has no time."""
        given = cue.given
        if given.when is None and given.on is None and not given.go:
            return np.inf
        return max((given.may_wait or 0.0) * self._notes.beat, 0.0)

    def _cue(self, i: int, cue: Cue) -> CueOfPlay:
        given = cue.given
        parts = cue.parts
        start = min((part.start for part in parts), default=cue.wanted)
        end = max((part.end for part in parts), default=cue.wanted)
        return CueOfPlay(
            i + 1, self._cast.file.acts[cue.act].act, cue.who, described(cue), cue.name,
            self._notes.located.line(cue.spot) or 0, cue.wanted, self._give(cue), start, end,
            next(iter(given.on)) if given.on is not None else "", given.go, given.says or "",
            cue.refused, given.optional,
            {part.who: {**part.marks, START: part.start, END: part.end} for part in parts},
        )  # fmt: skip


def _of_hands(cue: Cue, name: str) -> float:
    """How late a player's hands are on the mark of `on` [s]."""
    (mark,) = cue.given.on or ("",)
    part = next(part for part in cue.parts if part.who == name)
    return part.marks[mark] - cue.wanted


def _is_free(cue: Cue) -> bool:
    """Whether a cue may begin later than it is written."""
    given = cue.given
    if given.may_wait is not None:
        return given.may_wait > 0.0
    return given.when is None and given.on is None and not given.go


def described(cue: Cue) -> str:
    """A cue in words: ``columbine and pierrot: walks to centre``."""
    given, verb = cue.given, cue.given.verb
    said = verb.replace("_", " ")
    what = getattr(given, verb)
    if verb == "does":
        said = str(what)
    elif what is not True:
        said = f"{said} {what if isinstance(what, str) else [round(float(x), 3) for x in what]}"
    if given.to is not None:
        said += f" to {given.to}"
    return f"{' and '.join(cue.who)}: {said}"


def _plain(name: str) -> str:
    return name.removeprefix("string ")


def excerpt(whole: Gesture, begun: float, end: float) -> Motion:
    """A motion from one time to another, from offsets of 0 at its beginning."""
    clock = np.union1d(whole.breaks, [begun, end])
    coef = piecewise.on(whole.breaks, whole.coef, clock)
    inside = (clock[:-1] >= begun) & (clock[:-1] < end)
    breaks = np.append(clock[:-1][inside], end)
    own = coef[inside]
    first, _ = piecewise.at(breaks, own, begun)
    own[:, :, 0] -= first
    return Motion(breaks - begun, own, whole.named, np.zeros_like(whole.travel))
