"""Scores: gestures of a puppet in lanes, on beats; compiled to one motion of its hands.

    q_K(t) = q_K0 + sum over lanes of d_lane(t)
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import (
    FileError,
    InputError,
    Mistake,
    StateError,
    UnknownNameError,
    nearest,
)
from fantoccini.gestures.gesture import Gesture
from fantoccini.gestures.gesture_file import bundled, gesture_names, load_gesture
from fantoccini.gestures.joining import Line, Motion
from fantoccini.gestures.score_file import CueFile, ScoreFile, Time
from fantoccini.gestures.transition import limits
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, State, pieces
from fantoccini.puppet.located import Located, read_file, validate
from fantoccini.puppet.values import NAME

_MARK = re.compile(rf"({NAME})(?: *([-+]) *(\d+\.?\d*|\.\d+))?", re.ASCII)
_LATE = 1e-6
"""Lateness that is reported [s]."""
_ROUNDING = 2e-3
"""Share of a bound by which a peak may pass it: peaks of speeds are bounds themselves."""
_STILL = 1e-9
"""Rate below which a lane is at rest [m/s or rad/s]."""
_NO_BOUNDS = {"speed": 1.0, "acceleration": 1.0}

Spot = tuple[str | int, ...]


@dataclass(frozen=True)
class Caption:
    """Words from one time to another [s]."""

    start: float
    end: float
    text: str


@dataclass(frozen=True)
class Played:
    """A gesture as it is played.

    Attributes:
        lane, gesture: names.
        start, end: [s].
        marks: of the gesture -> time [s].
    """

    lane: str
    gesture: str
    start: float
    end: float
    marks: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Score:
    """A score, compiled. Made by :func:`load_score`; true where all is as it was written.

    Attributes:
        marionette: the puppet.
        gesture: all lanes together.
        cues: what is played when.
        marks: name -> time [s].
        captions: words and their times.
        beat: duration of a beat [s]; 1 where times are in seconds.
        changes: what is not as it was written, and why, with file and line.
        name: of the score.
    """

    marionette: Marionette
    gesture: Gesture
    cues: tuple[Played, ...]
    marks: Mapping[str, float]
    captions: tuple[Caption, ...]
    beat: float
    changes: tuple[Mistake, ...] = ()
    name: str = ""
    speed: float | Mapping[str, float] = field(default=1.0, repr=False)
    acceleration: float | Mapping[str, float] = field(default=6.0, repr=False)

    def __bool__(self) -> bool:
        return not self.changes

    def __repr__(self) -> str:
        changed = f", {len(self.changes)} changes" if self.changes else ""
        return f"<Score {self.name!r}: {self.duration:g} s, {len(self.cues)} gestures{changed}>"

    @property
    def duration(self) -> float:
        """[s]."""
        return self.gesture.duration

    def inputs(self, x0: State) -> Input:
        """The motion of the hands from a state at rest on; the score's time 0 is the state's."""
        made = self.gesture.inputs(x0, speed=self.speed, acceleration=self.acceleration)
        return made.called(self.name)


def load_score(marionette: Marionette, path: str | os.PathLike[str]) -> Score:
    """Reads and compiles a score file.

    Where a gesture cannot begin in time, because the way to its start takes longer within the
    bounds, it begins late, and :attr:`Score.changes` says so. They also say where lanes together
    or gestures by themselves pass a bound.

    Args:
        marionette: who performs it.
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    located = read_file(path)
    file = validate(ScoreFile, located)
    return _Compiler(marionette, file, located).score()


def is_score(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a score: YAML with the key `score`."""
    if not os.fspath(path).lower().endswith((".yaml", ".yml")):
        return False
    try:
        data = read_file(path).data
    except (FileError, OSError):
        return False
    return isinstance(data, dict) and "score" in data


class _Compiler:
    """Compiles one score file."""

    def __init__(self, marionette: Marionette, file: ScoreFile, located: Located):
        self._marionette, self._file, self._located = marionette, file, located
        self._table, self._start = marionette.coordinates, marionette.rest()
        self._beat = 1.0 if file.tempo is None else 60.0 / file.tempo
        self._found: list[tuple[Spot, str]] = []
        self._changes: list[Mistake] = []
        self._loaded: dict[str, Gesture] = {}
        self._spots: list[Spot] = []  # of the cues
        self._motions: list[Motion] = []

    def score(self) -> Score:
        """The score.

        Raises:
            FileError: it has mistakes.
        """
        file = self._file
        most = self._bounds()
        lines, cues = [], list[Played]()
        for lane, given in file.lanes.items():
            line = self._lane(lane, given, most, cues)
            if line is not None:
                lines.append(line)
        captions = tuple(self._caption(i) for i in range(len(file.captions)))
        self._refuse()
        end = max(*(line.end for line in lines), (file.duration or 0.0) * self._beat, self._beat)
        for line in lines:
            line.hold(end)
        whole, *others = (Gesture(self._table, *line.motion) for line in lines)
        for other in others:
            whole += other
        self._check(whole, most, cues)
        marks = {name: t * self._beat for name, t in file.marks.items()}
        last: list[tuple[Spot, float]] = [(("marks", name), t) for name, t in marks.items()]
        last += [(("captions", i), one.end) for i, one in enumerate(captions)]
        for spot, t in last:
            if t > end + _LATE:
                self._change(spot, f"comes {self._said(t)}; the score ends {self._said(end)}")
        made = Score(
            self._marionette, whole.called(file.score), tuple(cues), marks, captions, self._beat,
            tuple(self._changes), file.score, file.speed, file.acceleration,
        )  # fmt: skip
        try:
            made.inputs(self._start)
        except InputError as error:
            found = [(self._mover(one.key), f"{one.key}: {one.message}") for one in error.mistakes]
            raise self._located.error(found, FileError) from None
        return made

    def _bounds(self) -> Array:
        """(2, n_vK) bounds of speeds and accelerations."""
        file, given = self._file, dict[str, Any]()
        for key in ("speed", "acceleration"):
            bound = getattr(file, key)
            for name, one in bound.items() if isinstance(bound, dict) else [("", bound)]:
                spot = (key, name) if name else (key,)
                try:
                    limits(self._table, **(_NO_BOUNDS | {key: {name: one} if name else one}))
                except (UnknownNameError, ValueError) as error:
                    self._found.append((spot, str(error)))
            given[key] = bound
        self._refuse()
        return limits(self._table, **given)

    def _mover(self, channel: str) -> Spot:
        """The cue that moves a coordinate farthest."""
        places = pieces.channel_names(self._table)
        if channel not in places:
            return ("lanes",)
        v = places[channel][1]
        sizes = [np.max(np.abs(motion.coef[:, v, 0])) for motion in self._motions]
        return self._spots[int(np.argmax(sizes))]

    def _lane(
        self, lane: str, given: tuple[CueFile, ...], most: Array, cues: list[Played]
    ) -> Line | None:
        line, before = Line(most), ""
        for i, cue in enumerate(given):
            spot: Spot = ("lanes", lane, i)
            gesture = self._gesture(cue, spot)
            wanted = None if gesture is None else self._begins(cue, gesture, spot)
            if self._found or gesture is None:
                continue
            try:
                whole = gesture.repeated(
                    cue.repeat, speed=self._file.speed, acceleration=self._file.acceleration
                )
            except StateError as error:
                self._found.append((spot, str(error)))
                continue
            lead, free = line.lead_time(whole.motion), line.end
            if wanted is not None and wanted > line.end + lead:
                if np.any(np.abs(line.rate) > _STILL):
                    line.stop()
                    lead = line.lead_time(whole.motion)
                line.hold(wanted - lead)
            begun = line.add(whole.motion)
            if wanted is not None and begun > wanted + _LATE:
                why = f"the way there takes {lead:.2f} s" + (f" after {before}" if before else "")
                if wanted < free:
                    why = f"{before} ends {self._said(free)}"
                self._change(
                    spot, f"{whole.name} begins {self._said(begun)} instead of "
                    f"{self._said(wanted)}: {why}",
                )  # fmt: skip
            more = whole.duration - cue.repeat * gesture.duration
            if more > _LATE:
                self._change(
                    spot, f"{whole.name} takes {whole.duration:.2f} s instead of "
                    f"{whole.duration - more:.2f} s: it ends elsewhere than it begins, and goes "
                    "back each time",
                )  # fmt: skip
            before = whole.name
            marks = {name: begun + t for name, t in whole.marks.items()}
            cues.append(Played(lane, whole.name, begun, line.end, marks))
            self._spots.append(spot)
            self._motions.append(whole.motion)
        if self._found:
            return None
        if np.any(np.abs(line.rate) > _STILL):
            line.stop()
        return line

    def _gesture(self, cue: CueFile, spot: Spot) -> Gesture | None:
        """The cue's gesture once, as it is changed; None after a mistake."""
        if cue.gesture not in self._loaded:
            path = self._located.beside(cue.gesture)
            if path is None and cue.gesture in gesture_names():
                path = bundled(cue.gesture)
            if path is None:
                text = "no gesture file in this one's folder, and no bundled gesture, is called "
                near = nearest(cue.gesture, gesture_names())
                self._found.append(((*spot, "gesture"), f"{text}{cue.gesture!r}{near}"))
                return None
            try:
                self._loaded[cue.gesture] = load_gesture(self._marionette, path, self._start)
            except FileError as error:
                self._found += [((*spot, "gesture"), str(one)) for one in error.mistakes]
                return None
        made = self._loaded[cue.gesture]
        try:
            made = made.mirrored() if cue.mirrored else made
        except UnknownNameError as error:
            self._found.append(((*spot, "mirrored"), str(error)))
            return None
        made = made.scaled(cue.larger).faster(cue.faster)
        return made if cue.lasts is None else made.lasting(cue.lasts * self._beat)

    def _begins(self, cue: CueFile, gesture: Gesture, spot: Spot) -> float | None:
        """When a cue is to begin [s]; None where it follows the one before."""
        if cue.at is not None:
            return self._time(cue.at, (*spot, "at"))
        if cue.on is None:
            return None
        ((mark, time),) = cue.on.items()
        at = self._time(time, (*spot, "on", mark))
        if mark not in gesture.marks:
            text = f"{gesture.name} has no mark {mark!r}{nearest(mark, gesture.marks)}"
            self._found.append(((*spot, "on"), text))
            return None
        begins = at - gesture.marks[mark]
        if begins < 0.0:
            text = f"{gesture.name} would begin {-begins:.2f} s before the score"
            self._found.append(((*spot, "on", mark), text))
        return max(begins, 0.0)

    def _time(self, given: Time, spot: Spot) -> float:
        """A time of the file [s]; 0 after a mistake."""
        if not isinstance(given, str):
            return given * self._beat
        match = _MARK.fullmatch(given.strip())
        if match is None or match[1] not in self._file.marks:
            text = f"found {given!r}; needed: a time, or a mark of this score with an offset"
            self._found.append((spot, text + nearest(given, self._file.marks)))
            return 0.0
        offset = float(match[3] or 0.0) * (-1.0 if match[2] == "-" else 1.0)
        at = (self._file.marks[match[1]] + offset) * self._beat
        if at < 0.0:
            self._found.append((spot, f"found {given!r}, {-at:.2f} s before the score"))
        return max(at, 0.0)

    def _caption(self, i: int) -> Caption:
        given = self._file.captions[i]
        start = self._time(given.at, ("captions", i, "at"))
        end = self._time(given.until, ("captions", i, "until"))
        if not end > start and not self._found:
            text = f"ends {self._said(end)} and begins {self._said(start)}"
            self._found.append((("captions", i), text))
        return Caption(start, end, given.text)

    def _check(self, whole: Gesture, most: Array, cues: list[Played]) -> None:
        """Notes where a speed or an acceleration passes its bound, once for each cue."""
        sizes, middle = whole.peaks_of_pieces, 0.5 * (whole.breaks[1:] + whole.breaks[:-1])
        over = sizes > most * (1.0 + _ROUNDING)
        worst: dict[tuple[int, int, int], int] = {}
        for piece, row, v in np.argwhere(over).tolist():
            for i in self._moving(cues, float(middle[piece]), v):
                before = worst.setdefault((i, row, v), piece)
                if sizes[piece, row, v] > sizes[before, row, v]:
                    worst[i, row, v] = piece
        for (i, row, v), piece in worst.items():
            what, unit = (("moves at", "m/s"), ("changes by", "m/s^2"))[row]
            self._change(
                self._spots[i], f"{self._table.v_K[v]} {what} {sizes[piece, row, v]:.4g} {unit} "
                f"{self._said(whole.breaks[piece])}; the bound is {most[row, v]:.4g}: play it "
                "smaller or slower",
            )  # fmt: skip

    def _moving(self, cues: list[Played], t: float, v: int) -> list[int]:
        """The cues that move a driven velocity at a time, or else the next one that does."""
        own = [i for i, motion in enumerate(self._motions) if motion.named[v]]
        now = [i for i in own if cues[i].start <= t < cues[i].end]
        later = [i for i in own if cues[i].start >= t]
        return now or [min(later, key=lambda i: cues[i].start)] if later else now or own[-1:]

    def _said(self, t: float) -> str:
        if self._file.tempo is None:
            return f"at {t:.2f} s"
        return f"on beat {t / self._beat:.2f} ({t:.2f} s)"

    def _change(self, spot: Spot, text: str) -> None:
        self._changes.append(self._located.problem(spot, text))

    def _refuse(self) -> None:
        if self._found:
            raise self._located.error(self._found, FileError)
