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
    Cue,
    EntersToCue,
    ExitsToCue,
    GivesCue,
    Moments,
    Notes,
    PlayCue,
    PlayFile,
    Reference,
    Spot,
    Time,
    Timeline,
    make_timeline,
    walks,
)

_LONGEST = 1800.0
"""Longest act [s]."""
_OF_PLAYER = re.compile(rf"({NAME}) +(arrives|is done)(?: *([-+]) *(\d+\.?\d*|\.\d+))?", re.ASCII)


@dataclass(frozen=True)
class Part:
    """The part of one player in a cue.

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


@dataclass(eq=False)
class Turn:
    """A cue while it is placed.

    Attributes:
        cue: which.
        wanted: when it, or its mark of `on`, is to be [s].
        parts: what the players do so far.
    """

    cue: Cue[PlayCue]
    wanted: float
    parts: list[Part] = field(default_factory=list)

    @property
    def spot(self) -> Spot:
        """Keys that lead to it."""
        return self.cue.spot

    @property
    def given(self) -> PlayCue:
        """The cue as it is written."""
        return self.cue.given

    @property
    def who(self) -> tuple[str, ...]:
        """The players."""
        return self.cue.who


@dataclass(frozen=True)
class Placed:
    """A cue as it is placed.

    Attributes:
        cue: which.
        wanted: when it, or its mark of `on`, is to be [s].
        parts: what the players do; none where it cannot be done.
        moments: mark, ``start`` or ``end`` -> time [s], of several players the last.
        refused: why it cannot be done; "" where it can.
    """

    cue: Cue[PlayCue]
    wanted: float
    parts: tuple[Part, ...]
    moments: Moments
    refused: str = ""

    @property
    def spot(self) -> Spot:
        """Keys that lead to it."""
        return self.cue.spot

    @property
    def given(self) -> PlayCue:
        """The cue as it is written."""
        return self.cue.given


def play_timeline(
    file: PlayFile, marks: Callable[[PlayCue, Spot], Iterable[str]], notes: Notes
) -> Timeline[PlayCue]:
    """The cues of a play and what their times mean.

    Args:
        file: the play.
        marks: gives the marks of what a cue does, () after a mistake.
        notes: take mistakes.
    """
    acts: list[list[Cue[PlayCue]]] = []
    last: dict[str, Cue[PlayCue]] = {}
    cues: list[Cue[PlayCue]] = []
    for a, act in enumerate(file.acts):
        acts.append([])
        for i, given in enumerate(act.cues):
            spot: Spot = ("acts", a, "cues", i)
            who = _who(file, given, spot, notes)
            if isinstance(given, GivesCue) and given.to in file.cast and given.to not in who:
                who = (*who, given.to)
            name = given.name or VERBS[given.verb].called or str(given.what)
            name = name.rsplit("/", 1)[-1].rsplit(".", 1)[0]
            known = (*marks(given, spot), START, END)
            before = tuple(last[one] for one in who if one in last)
            cue = Cue(spot, len(cues), a, given, who, name, known, before)
            last.update(dict.fromkeys(who, cue))
            acts[-1].append(cue)
            cues.append(cue)

    def special(cue: Cue[PlayCue], spot: Spot, given: Time) -> Reference | float | None:
        match = _OF_PLAYER.fullmatch(given.strip()) if isinstance(given, str) else None
        if match is None or match[1] not in file.cast:
            return None
        offset = float(match[4] or 0.0) * (-1.0 if match[3] == "-" else 1.0)
        walk = match[2] == "arrives"
        for one in reversed(cues[: cue.index]):
            if match[1] in one.who and (walks(one.given) or not walk):
                # What has happened in an act before has happened when this one begins.
                return Reference(one.spot, END, offset, in_act=True)
        notes.mistake(spot, f"{match[1]} has no {'walk' if walk else 'cue'} before this one")
        return 0.0

    times: dict[Spot, Time] = {("times", name): float(beat) for name, beat in file.times.items()}
    made = make_timeline(acts, times, notes, special)
    _check_order(made, notes)
    _check_entrances(file, made, notes)
    return made


def _check_order(made: Timeline[PlayCue], notes: Notes) -> None:
    """Notes cues that wait for those of a later act."""
    of_spot = {cue.spot: cue for cue in made.cues}
    for cue in made.cues:
        for spot, _ in cue.times:
            ref = made.refs[spot]
            other = of_spot.get(ref.spot) if isinstance(ref, Reference) else None
            if other is not None and other.act > cue.act:
                line = notes.located.line(other.spot)
                text = f"waits for {other.name} on line {line}, a cue of a later act"
                notes.mistake(spot, text)


def _check_entrances(file: PlayFile, made: Timeline[PlayCue], notes: Notes) -> None:
    """Notes entrances of those who are on the stage, and waits beyond all measure."""
    away: dict[str, bool] = dict.fromkeys(file.cast, True)
    for cue in made.cues:
        for who in cue.who:
            if isinstance(cue.given, EntersToCue) and not away[who]:
                text = f"{who} is on the stage already; needed: `walks to`"
                notes.mistake((*cue.spot, "enters to"), text)
            away[who] = isinstance(cue.given, ExitsToCue)
        for spot, given in cue.times:
            if isinstance(given, float) and given * notes.beat > _LONGEST:
                text = f"found beat {given:g}; an act lasts {_LONGEST / 60:g} minutes at most"
                notes.mistake(spot, text)


def _who(file: PlayFile, given: PlayCue, spot: Spot, notes: Notes) -> tuple[str, ...]:
    """The players of a cue; notes those that are none."""
    cast, found = list(file.cast), list[str]()
    for name in given.who:
        if name == "all":
            found += cast
        elif name not in cast:
            notes.mistake((*spot, "who"), f"no player is called {name!r}{nearest(name, cast)}")
        else:
            found.append(name)
    return tuple(dict.fromkeys(found))
