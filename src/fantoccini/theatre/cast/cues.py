"""Cues of a play: who does what, and the times by which they begin."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from fantoccini.base import nearest
from fantoccini.base.documents import NAME
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.script import (
    END,
    START,
    VERBS,
    EntersToCue,
    ExitsToCue,
    GivesCue,
    Notes,
    PlayCue,
    PlayFile,
    Reference,
    Spot,
    Time,
    Times,
    in_order,
)

_LONGEST = 1800.0
"""How long an act lasts at most [s]."""
_OF_PLAYER = re.compile(rf"({NAME}) +(arrives|is done)(?: *([-+]) *(\d+\.?\d*|\.\d+))?", re.ASCII)


@dataclass
class Part:
    """What one player does in a cue.

    Attributes:
        who: the player.
        lane: of the player.
        gesture: as it is played, from the player's heading.
        start, end: [s].
        marks: of the gesture -> time [s].
    """

    who: str
    lane: int
    gesture: Gesture
    start: float
    end: float
    marks: Mapping[str, float]


def said_in_act(t: float, start: float, beat: float) -> str:
    """A time in words: ``on beat 4.0 of the act (12.40 s)``."""
    return f"on beat {(t - start) / beat:.1f} of the act ({t:.2f} s)"


def lane_name(who: str, lane: int) -> str:
    """The name of a lane: the player's, and from the second lane on a number."""
    return who if lane == 0 else f"{who} {lane + 1}"


@dataclass
class Cue:
    """A cue before and after it is placed in time.

    Attributes:
        spot: where it is written.
        index: its place in the file's order.
        act: number of its act.
        given: what is written.
        who: the players.
        name: by which times refer to it.
        known: its moments, by name.
        before: for each player, the cue that it does before.
        wanted: when it, or its mark of `on`, is to be [s].
        parts: what the players do; none where it cannot be done.
        refused: why it cannot be done; "" where it can.
        moments: mark, ``start`` or ``end`` -> time [s], of several players the last.
    """

    spot: Spot
    index: int
    act: int
    given: PlayCue
    who: tuple[str, ...]
    name: str
    known: tuple[str, ...]
    before: dict[str, Cue | None] = field(default_factory=dict)
    wanted: float = 0.0
    parts: list[Part] = field(default_factory=list)
    refused: str = ""
    moments: dict[str, float] = field(default_factory=dict)

    @property
    def is_named(self) -> bool:
        """Whether the file gives it a name of its own."""
        return self.given.name is not None

    def give(self, beat: float) -> float:
        """By how much later it may be [s]; as long as it likes, where the play has no time."""
        given = self.given
        if given.may_wait is None and given.is_free:
            return float("inf")
        return (given.may_wait or 0.0) * beat

    @property
    def walks(self) -> bool:
        """Whether it carries the players."""
        return VERBS[self.given.verb].moves == "player"


Ref = tuple[str, Cue | None, float]
"""A moment of a player's cue before: its kind, the cue, and the offset [beats]."""


class Timeline:
    """All cues of a play, and what their times mean.

    Attributes:
        cues: in the file's order.
        acts: (n,) numbers of the first cues of the acts, and of one after the last.

    Args:
        file: the play.
        marks: gives the marks of what a cue does, () after a mistake.
        notes: take mistakes.
    """

    def __init__(
        self, file: PlayFile, marks: Callable[[PlayCue, Spot], Iterable[str]], notes: Notes
    ):
        self._file, self._notes = file, notes
        self.cues: list[Cue] = []
        self.acts = [0]
        last: dict[str, Cue] = {}
        for a, act in enumerate(file.acts):
            for i, given in enumerate(act.cues):
                spot: Spot = ("acts", a, "cues", i)
                who = self._who(given, spot)
                if isinstance(given, GivesCue) and given.to in file.cast and given.to not in who:
                    who = (*who, given.to)
                name = given.name or VERBS[given.verb].called or str(given.what)
                name = name.rsplit("/", 1)[-1].rsplit(".", 1)[0]
                known = (*marks(given, spot), START, END)
                cue = Cue(spot, len(self.cues), a, given, who, name, known)
                cue.before = {one: last.get(one) for one in who}
                last.update(dict.fromkeys(who, cue))
                self.cues.append(cue)
            self.acts.append(len(self.cues))
        beats = {name: float(beat) for name, beat in file.times.items()}
        self._times = Times(beats, self.cues, notes.located)
        self._refs: dict[Spot, float | Reference | Ref | None] = {}
        for cue in self.cues:
            for spot, given_time in self.times_of(cue):
                self._refs[spot] = self._read(given_time, spot, cue)
            mark = cue.given.mark
            if mark and mark not in cue.known:
                text = f"{cue.name} has no mark {mark!r}{nearest(mark, cue.known)}"
                notes.mistake((*cue.spot, "on"), text)
        notes.found += self._times.mistakes
        self._times.mistakes.clear()
        self._check_order()
        self._check_entrances()

    def of_act(self, act: int) -> list[Cue]:
        """The cues of an act."""
        return self.cues[self.acts[act] : self.acts[act + 1]]

    @staticmethod
    def times_of(cue: Cue) -> list[tuple[Spot, Time]]:
        """The times that a cue begins by, with their places."""
        return [((*cue.spot, *keys), time) for keys, time in cue.given.begins]

    def last_go(self, cue: Cue) -> Cue | None:
        """The cue before it in its act that waits for GO."""
        before = self.cues[self.acts[cue.act] : cue.index]
        return next((one for one in reversed(before) if one.given.go), None)

    def needs(self, cue: Cue) -> list[Cue]:
        """The cues that must be placed before it."""
        found = [one for one in cue.before.values() if one is not None]
        if cue.given.go:
            found += self.cues[self.acts[cue.act] : cue.index]
        elif (go := self.last_go(cue)) is not None:
            found.append(go)
        for spot, _ in self.times_of(cue):
            found += self._referred(spot)
        return found

    def time(self, spot: Spot, act_start: float) -> float:
        """What is written somewhere, once what it refers to is placed [s]."""
        ref, beat = self._refs[spot], self._notes.beat
        if isinstance(ref, Reference):
            if isinstance(ref.target, str):
                return (self._file.times[ref.target] + ref.offset) * beat
            return ref.target.moments[ref.moment] + ref.offset * beat
        if isinstance(ref, tuple):
            moment, cue, offset = ref
            assert cue is not None  # one that is not is a mistake
            # What has happened in an act before has happened when this one begins.
            return max(cue.moments[moment], act_start) + offset * beat
        return act_start + (ref or 0.0) * beat

    def _check_order(self) -> None:
        """Notes cues that wait for those of a later act, or for themselves."""
        for cue in self.cues:
            for spot, _ in self.times_of(cue):
                for one in self._referred(spot):
                    if one.act > cue.act:
                        line = self._notes.located.line(one.spot)
                        text = f"waits for {one.name} on line {line}, a cue of a later act"
                        self._notes.mistake(spot, text)
        needs = {cue.spot: [one.spot for one in self.needs(cue)] for cue in self.cues}
        _, mistake = in_order(needs, self._notes.located)
        if mistake is not None:
            self._notes.mistake(*mistake)

    def _check_entrances(self) -> None:
        """Notes entrances of those who are on the stage, and waits beyond all measure."""
        away: dict[str, bool] = dict.fromkeys(self._file.cast, True)
        for cue in self.cues:
            for who in cue.who:
                if isinstance(cue.given, EntersToCue) and not away[who]:
                    text = f"{who} is on the stage already; needed: `walks to`"
                    self._notes.mistake((*cue.spot, "enters to"), text)
                away[who] = isinstance(cue.given, ExitsToCue)
            for spot, given in self.times_of(cue):
                if isinstance(given, float) and given * self._notes.beat > _LONGEST:
                    text = f"found beat {given:g}; an act lasts {_LONGEST / 60:g} minutes at most"
                    self._notes.mistake(spot, text)

    def _referred(self, spot: Spot) -> list[Cue]:
        """The cue that a time refers to, if it does."""
        ref = self._refs[spot]
        if isinstance(ref, Reference) and isinstance(ref.target, Cue):
            return [ref.target]
        return [ref[1]] if isinstance(ref, tuple) and ref[1] is not None else []

    def _who(self, given: PlayCue, spot: Spot) -> tuple[str, ...]:
        cast = list(self._file.cast)
        found = []
        for name in given.who:
            if name == "all":
                found += cast
            elif name not in cast:
                text = f"no player is called {name!r}{nearest(name, cast)}"
                self._notes.mistake((*spot, "who"), text)
            else:
                found.append(name)
        return tuple(dict.fromkeys(found))

    def _read(self, given: Time, spot: Spot, cue: Cue) -> float | Reference | Ref | None:
        match = _OF_PLAYER.fullmatch(given.strip()) if isinstance(given, str) else None
        if match is not None and match[1] in self._file.cast:
            offset = float(match[4] or 0.0) * (-1.0 if match[3] == "-" else 1.0)
            last = self._last(match[1], cue, match[2] == "arrives")
            if last is None:
                what = "walk" if match[2] == "arrives" else "cue"
                self._notes.mistake(spot, f"{match[1]} has no {what} before this one")
                return None
            return END, last, offset
        return self._times.read(given, spot)

    def _last(self, who: str, cue: Cue, walks: bool) -> Cue | None:
        """The cue, or the walk, that a player does last before a cue, in the file's order."""
        for one in reversed(self.cues[: cue.index]):
            if who in one.who and (one.walks or not walks):
                return one
        return None
