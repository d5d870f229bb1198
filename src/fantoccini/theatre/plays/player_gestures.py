"""Gestures of players in cues: from files, and made for a place or a way."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, FileError, InputError, StateError, UnknownNameError, nearest
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.capture import bundled_clip, clip_names
from fantoccini.theatre.cast import (
    Cast,
    Clip,
    Footing,
    Kept,
    Player,
    is_clip,
    prop_gestures,
    read_clip,
)
from fantoccini.theatre.gestures import (
    MADE,
    STEP_TIME,
    Gesture,
    Step,
    bundled,
    check_parts,
    gesture_names,
    load_gesture,
    steps,
)
from fantoccini.theatre.script import (
    HOW,
    VERBS,
    DoesCue,
    LooksAtCue,
    PlayCue,
    PointsAtCue,
    ScriptLog,
    Spot,
    spelled,
)

_STEP_TIMES = 0.5, 0.8
"""Briefest and longest step [s]."""
_PARTS = (1.0, 0.5, 2.0, 1.5, 1.0 / 3.0, 3.0)
"""Beats of a step, those that are liked best first."""


@dataclass(frozen=True)
class Style:
    """Variation of a gesture: factors of size and speed, mirrored, repetitions."""

    larger: float = 1.0
    faster: float = 1.0
    mirrored: bool = False
    repeat: int = 1

    @classmethod
    def of(cls, given: DoesCue) -> Style:
        """The style that a cue asks for, words and numbers together."""
        larger, faster = given.larger, given.faster
        mirrored, repeat = given.mirrored, given.repeat
        for word in given.how:
            changes: dict[str, Any] = HOW[word]
            larger *= changes.get("larger", 1.0)
            faster *= changes.get("faster", 1.0)
            mirrored = mirrored != changes.get("mirrored", False)
            repeat *= changes.get("repeat", 1)
        return cls(larger, faster, mirrored, repeat)


class PlayerGestures:
    """Gestures of players, each read or made once.

    Attributes:
        cast: of the play.
        kept: takes clips that were made into gestures, for the next time.

    Args:
        cast: of the play.
        log: collects mistakes.
        kept: takes clips that were made into gestures, for the next time.
    """

    def __init__(self, cast: Cast, log: ScriptLog, kept: Kept):
        self.cast, self.kept, self._log = cast, kept, log
        self._files: dict[tuple[Marionette, str], Gesture | Clip | str] = {}
        self._kept: dict[tuple[Any, ...], Gesture | str] = {}
        self._wrong: set[tuple[str, str]] = set()

    def marks(self, given: PlayCue, spot: Spot) -> Iterable[str]:
        """The marks of what a cue does; reads the files that it needs, for their mistakes."""
        if not isinstance(given, DoesCue):
            return VERBS[given.verb].marks
        marks: dict[str, None] = {}
        for name in given.who:
            player = self.cast.players.get(name)
            if name == "all":
                player = next(iter(self.cast.players.values()))
            if player is None:
                continue
            found = self._read(player, given.does)
            if isinstance(found, str):
                if (player.name, given.does) not in self._wrong:
                    self._log.mistakes.add((*spot, "does"), found)
                self._wrong.add((player.name, given.does))
                continue
            whole = _repeated_marks(found.marks, Style.of(given).repeat)
            marks.update(dict.fromkeys(whole))
        return tuple(marks)

    def gesture(self, player: Player, given: DoesCue, style: Style, heading: float) -> Gesture:
        """The gesture of `does` for a player with a heading [rad].

        Raises:
            StateError: it cannot be done so.
        """
        key = (player.alone, player.name, given.does, style, given.lasts, round(heading, 9))
        if key not in self._kept:
            self._kept[key] = self._styled(player, given, style, heading)
        return _or_raise(self._kept[key])

    def aimed(self, player: Player, name: str, place: Array, stands: Footing) -> Gesture:
        """A look or a pointing hand, by name, towards a place (3,) of the stage.

        Raises:
            StateError: no hanging pose does that.
        """
        own = player.own(place, stands)
        heading = stands.heading
        key = (name, player.alone, player.name, *np.round(own, 6), round(heading, 9))
        if key not in self._kept:
            try:
                made = load_gesture(player.alone, name, player.hangs, to=own.tolist())
                self._kept[key] = made.turned(heading)
            except InputError as error:
                self._kept[key] = "; ".join(mistake.message for mistake in error.mistakes)
            except (UnknownNameError, StateError) as error:
                self._kept[key] = str(error)
        return _or_raise(self._kept[key])

    def walk(
        self, player: Player, way: tuple[Step, ...], step_time: float, carries: str = ""
    ) -> Gesture:
        """Steps of a player, from the heading at the start of the play on.

        Args:
            player: who walks.
            way: the steps.
            step_time: of each [s].
            carries: the forearm on which something hangs.

        Raises:
            UnknownNameError: it has other strings than the bundled marionette.
        """
        key = (player.alone, "walk", way, step_time, carries)
        if key not in self._kept:
            if carries:
                pose = self.pose(player, carries)
                made = prop_gestures.steps_carrying(pose, player.hangs, "", way, step_time)
            else:
                made = steps(player.ends(), way, step_time)
            self._kept[key] = made
        return _or_raise(self._kept[key])

    def pose(self, player: Player, side: str) -> Gesture:
        """The gesture that takes up the pose in which something is carried.

        Raises:
            UnknownNameError: it has other strings than the bundled marionette.
        """
        key = (player.alone, "pose", side)
        if key not in self._kept:
            player.ends()
            self._kept[key] = prop_gestures.carry(player.alone, "", side=side)
        return _or_raise(self._kept[key])

    def reason_unable(self, player: Player, given: PlayCue) -> str:
        """The reason why a player can never do a cue, wherever it stands; "" if it may be able to.

        Nothing is simulated: clips, and targets to look and point at, are not tested.
        """
        if isinstance(given, DoesCue):
            if not isinstance(self._read(player, given.does), Gesture):
                return ""
            made = self._styled(player, given, Style.of(given), player.start.heading)
            return made if isinstance(made, str) else ""
        try:
            if isinstance(given, LooksAtCue | PointsAtCue):
                check_parts(player.alone, player.hangs, VERBS[given.verb].called)
            else:
                player.ends()
        except UnknownNameError as error:
            what = f"do `{spelled(given.verb)}`"
            return f"{player.name} cannot {what}: {error}"
        return ""

    def _read(self, player: Player, name: str) -> Gesture | Clip | str:
        """A gesture file, take, clip or bundled gesture; the mistake where there is none."""
        key = (player.alone, name)
        if key not in self._files:
            self._files[key] = self._loaded(player, name)
        return self._files[key]

    def _loaded(self, player: Player, name: str) -> Gesture | Clip | str:
        path: Path | None = self._log.located.beside(name)
        if path is None and name in gesture_names():
            if not bundled(name).is_file():
                say = {"walk": "walks to"}.get(name, name)
                return f"{name} needs a place: use `{say}:`"
            path = bundled(name)
        if path is None and name in clip_names():
            path = bundled_clip(name)
        if path is None:
            text = f"no file beside this one, and no bundled gesture or clip, is called {name!r}"
            return text + nearest(name, sorted({*gesture_names(), *clip_names()} - {*MADE}))
        try:
            if is_clip(path):
                return read_clip(player, path)
            return load_gesture(player.alone, path, player.hangs)
        except (FileError, InputError) as error:
            return "; ".join(str(mistake) for mistake in error.mistakes)
        except (UnknownNameError, StateError) as error:
            return str(error)

    def _styled(
        self, player: Player, given: DoesCue, style: Style, heading: float
    ) -> Gesture | str:
        found = self._read(player, given.does)
        if isinstance(found, str):
            return found
        stage = self.cast.file.stage
        lasts = None if given.lasts is None else given.lasts * self._log.beat
        try:
            if isinstance(found, Clip):
                beat = self._log.beat
                found = found.gesture(style.larger, style.faster, lasts, stage, beat, self.kept)
            else:
                found = found.faster(style.faster)
                found = found if lasts is None else found.lasting(lasts)
            made = (found.mirrored() if style.mirrored else found).scaled(style.larger)
            made = made.repeated(style.repeat, speed=stage.speed, acceleration=stage.acceleration)
            return made.turned(heading)
        except (UnknownNameError, StateError) as error:
            return str(error)


def _repeated_marks(marks: Iterable[str], times: int) -> list[str]:
    return [*marks, *(f"{name} {k}" for k in range(2, times + 1) for name in marks)]


def _or_raise(found: Gesture | str) -> Gesture:
    if isinstance(found, str):
        raise StateError(found)
    return found


def step_time(beat: float) -> float:
    """The duration of a step: beats or a part of one, near the usual one and within bounds [s].

    Quicker steps set the legs swinging, whose own period is near a second.
    """
    low, high = _STEP_TIMES
    found = [beat * part for part in _PARTS if low <= beat * part <= high]
    return min(found, key=lambda t: abs(t - STEP_TIME), default=STEP_TIME)
