"""Compiled play: its cues with their times, and one motion of all hands.

A cue is a line of the play: a verb with its player and time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fantoccini.base import Mistake, Times
from fantoccini.base.documents import Located
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.theatre.cast import Cast, Meeting, ResultCache, Walk
from fantoccini.theatre.gestures import Gesture, Score
from fantoccini.theatre.plays.runs import Runs, runs_of
from fantoccini.theatre.plays.shots import Shot


@dataclass(frozen=True)
class CueOfPlay:
    """Compiled cue.

    Attributes:
        number: number in the play, from 1, as in ``/cue/N/start``.
        act: name of its act.
        who: players of the cue.
        description: text such as ``pierrot: walks to centre``.
        name: name by which times refer to it.
        line: line of the file.
        wanted: wanted time of the cue, or of the mark in ``on`` [s].
        max_delay: allowed delay [s].
        start, end: beginning and end of all its motion [s].
        mark: mark of the cue's gesture (key ``on``) that should be at ``wanted``; "" for its
            beginning.
        go: whether a live show waits for GO before it.
        says: its caption.
        refused: reason why it cannot be done; "" if it can.
        passes: notes on players that it passes, and on who gives way; "" without any.
        optional: whether it may be left out.
        with_prop: whether a prop or a seat is handled.
        marks: times of the hands [s], by player and by moment: a mark, ``start`` or ``end``.
    """

    number: int
    act: str
    who: tuple[str, ...]
    description: str
    name: str
    line: int
    wanted: float
    max_delay: float
    start: float
    end: float
    mark: str = ""
    go: bool = False
    says: str = ""
    refused: str = ""
    passes: str = ""
    optional: bool = False
    with_prop: bool = False
    marks: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def action(self) -> str:
        """Description of the cue without its players."""
        return self.description.partition(": ")[2]

    @property
    def change(self) -> str:
        """Reason why the cue cannot be done or is left out, as a sentence; "" if it is done."""
        if not self.refused:
            return ""
        outcome = "is left out" if self.optional else "cannot be done"
        return f"{self.description} {outcome}: {self.refused}"


@dataclass(frozen=True, eq=False)
class Play:
    """Compiled play, from :func:`load_play`; true if every cue can be done as written.

    ::

        play = fan.load_play("bows.yaml")
        for cue in play.cues:
            print(cue.number, cue.description, cue.start, cue.refused)
        run = fan.simulate(play.marionette, play.x0, play.inputs)

    Attributes:
        name: name of the play.
        located: lines of the file.
        cast: players, alone and together.
        score: the play as one score: one motion of all hands, a lane or more for each player,
            captions, sounds and waits.
        parts: number of the cue in the play, and player, for each cue of the score.
        cues: cues in the file's order.
        changes: cues that cannot be done, with reasons, and other deviations from the file.
        acts: name -> beginning [s].
        motions: player -> motion of its hands.
        starts: player -> times at which its cues begin [s].
        meetings: players and props that may touch, with times.
        walks: player -> its walks.
        settling_pauses: number of a cue -> its pause [s], and the trunk's speeds after it without
            the pause and with it [m/s].
        shots: shots of the film's camera, in order of time.
        rounds: number of rounds in which cues were placed.
        cache: cached runs and ways, for the next version of the play.
    """

    name: str
    located: Located
    cast: Cast
    score: Score
    parts: tuple[tuple[int, str], ...]
    cues: tuple[CueOfPlay, ...]
    changes: tuple[Mistake, ...]
    acts: Mapping[str, float]
    motions: Mapping[str, Gesture] = field(repr=False)
    starts: Mapping[str, tuple[float, ...]] = field(repr=False)
    meetings: tuple[Meeting, ...]
    walks: Mapping[str, tuple[Walk, ...]]
    settling_pauses: Mapping[int, tuple[float, float, float]]
    shots: tuple[Shot, ...]
    rounds: int
    cache: ResultCache = field(repr=False)

    def __bool__(self) -> bool:
        return not self.changes

    def __repr__(self) -> str:
        players = ", ".join(self.cast.players)
        return f"<Play {self.name!r}: {players}; {self.duration:.1f} s, {self.counts}>"

    @property
    def marionette(self) -> Marionette:
        """Scene of all players and props."""
        return self.cast.marionette

    @property
    def x0(self) -> State:
        """State of everything at the start."""
        return self.cast.x0

    @property
    def inputs(self) -> Input:
        """Motion of all hands."""
        return self.score.inputs(self.x0)

    def runs(self, *, exact: bool = False) -> Runs:
        """Runs of the play, one for each company; cached.

        A company is a group of players and props that touch, so that they are simulated together.

        Args:
            exact: whether to simulate companies with method ``event`` instead of in time steps.
        """
        return runs_of(self.cast, self.motions, self.starts, self.meetings, self.cache, exact=exact)

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.score.duration

    @property
    def refused(self) -> tuple[CueOfPlay, ...]:
        """Cues that cannot be done, except optional ones."""
        return tuple(cue for cue in self.cues if cue.refused and not cue.optional)

    @property
    def deviations(self) -> tuple[Mistake, ...]:
        """Deviations from the file, except optional cues that are left out."""
        left_out = {(cue.line, cue.change) for cue in self.cues if cue.refused and cue.optional}
        return tuple(
            change for change in self.changes if (change.line, change.message) not in left_out
        )

    @property
    def remarks(self) -> tuple[Mistake, ...]:
        """Changes other than refused cues, such as touches."""
        refusals = {(cue.line, cue.change) for cue in self.cues if cue.refused}
        return tuple(
            change for change in self.changes if (change.line, change.message) not in refusals
        )

    @property
    def counts(self) -> str:
        """Numbers of cues and remarks: ``9 of 10 cues can be done, 1 left out, 2 remarks``."""
        n_done, n = sum(not cue.refused for cue in self.cues), len(self.cues)
        n_left_out, remarks = n - n_done - len(self.refused), len(self.remarks)
        text = f"{n_done} of {n} cue{'s' * (n != 1)} can be done"
        text += f", {n_left_out} left out" if n_left_out else ""
        return text + (f", {remarks} remark{'s' * (remarks != 1)}" if remarks else "")

    def when(self, t: Times | float) -> str:
        """Time in words: act, beat and second."""
        beat = self.score.beat
        begun_acts = [name for name, start in self.acts.items() if start <= float(t) + 1e-9]
        start = self.acts[begun_acts[-1]] if begun_acts else 0.0
        act_text = f"{begun_acts[-1]}, " if begun_acts else ""
        return f"{act_text}beat {(float(t) - start) / beat:.1f} ({float(t):.2f} s)"
