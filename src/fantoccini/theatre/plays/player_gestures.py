"""Gestures of players in cues: from files, or computed for a place or a walk.

A mark is a named time of a gesture, and a footing a place with a heading. A spot is the list of
keys that leads to an entry of the file. Mistakes of the file are recorded in a log. The stage is
the scene with all players, props and obstacles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fantoccini.base import Array, FileError, InputError, StateError, UnknownNameError, did_you_mean
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.capture import bundled_clip_path, clip_names
from fantoccini.theatre.cast import (
    CLIP_SUFFIX,
    Cast,
    Clip,
    Footing,
    Player,
    ResultCache,
    Walk,
    gesture_format,
    is_clip,
    prop_gestures,
    read_clip,
)
from fantoccini.theatre.gestures import (
    COMPUTED_GESTURES,
    STEP_TIME,
    Gesture,
    Style,
    bundled_gesture_path,
    check_parts,
    find_gesture_file,
    gesture_names,
    load_gesture,
    step_gesture,
)
from fantoccini.theatre.plays.floor_walks import floor_walk
from fantoccini.theatre.script import (
    VERBS,
    DoesCue,
    LooksAtCue,
    PlayCue,
    PointsAtCue,
    ScriptLog,
    Spot,
    file_key,
)

_STEP_TIME_RANGE = 0.5, 0.8
"""Shortest and longest duration of a step [s]."""
_STEP_BEATS = (1.0, 0.5, 2.0, 1.5, 1.0 / 3.0, 3.0)
"""Durations of a step, in order of preference [beats]."""


class PlayerGestures:
    """Gestures of players, each read or computed once.

    Attributes:
        cast: cast of the play.
        cache: cached gestures of clips, and of looks and pointing hands, for the next version.

    Args:
        cast: cast of the play.
        log: collects mistakes.
        cache: see above.
    """

    def __init__(self, cast: Cast, log: ScriptLog, cache: ResultCache):
        self.cast, self.cache, self._log = cast, cache, log
        self._loaded_files: dict[tuple[Marionette, str], Gesture | Clip | str] = {}
        self._cache: dict[tuple[Any, ...], Gesture | str] = {}
        self._reported: set[tuple[str, str]] = set()

    def marks(self, entry: PlayCue, spot: Spot) -> Iterable[str]:
        """Marks of a cue's gesture; reads the files that it needs, for their mistakes."""
        if not isinstance(entry, DoesCue):
            return VERBS[entry.verb].marks
        marks: dict[str, None] = {}
        for name in entry.who:
            player = self.cast.players.get(name)
            if name == "all":
                player = next(iter(self.cast.players.values()))
            if player is None:
                continue
            gesture = self._read(player, entry.does)
            if isinstance(gesture, str):
                if (player.name, entry.does) not in self._reported:
                    self._log.mistakes.add((*spot, "does"), gesture)
                self._reported.add((player.name, entry.does))
                continue
            repeated = _repeated_marks(gesture.marks, self.style(entry).repeat)
            marks.update(dict.fromkeys(repeated))
        return tuple(marks)

    def style(self, entry: DoesCue) -> Style:
        """Style of a cue."""
        return Style.from_cue(entry, self._log.beat)

    def gesture(self, player: Player, entry: DoesCue, style: Style, heading: float) -> Gesture:
        """Gesture of `does` for a player with a heading [rad].

        Raises:
            StateError: it cannot be done in this style.
        """
        key = (player.marionette, player.name, entry.does, style, round(heading, 9))
        if key not in self._cache:
            self._cache[key] = self._styled(player, entry, style, heading)
        return _or_raise(self._cache[key])

    def aimed(self, player: Player, name: str, place: Array, footing: Footing) -> Gesture:
        """Look or pointing hand, by name, towards a place (3,) of the stage.

        Raises:
            StateError: no hanging pose is aimed at the place.
        """
        target = player.in_own_frame(place, footing)
        heading = footing.heading
        key = (name, player.marionette, player.name, *np.round(target, 6), round(heading, 9))
        if key not in self._cache:
            target_list = target.tolist()
            job = partial(load_gesture, player.marionette, name, player.rest_state, to=target_list)
            try:
                gesture = self.cache.get(
                    repr((player.content_hash, "aimed", name, target_list)),
                    job,
                    gesture_format(player.marionette),
                )
                self._cache[key] = player.turned(gesture, heading)
            except InputError as error:
                self._cache[key] = "; ".join(mistake.message for mistake in error.mistakes)
            except (UnknownNameError, StateError) as error:
                self._cache[key] = str(error)
        return _or_raise(self._cache[key])

    def walk(self, player: Player, walk: Walk, carrying_side: str = "") -> Gesture:
        """Steps of a player, with the heading of its file.

        Args:
            player: player that walks.
            walk: its steps.
            carrying_side: side of the forearm on which something hangs.

        Raises:
            StateError: the puppet lacks a part that the gesture moves, or cannot walk on the floor.
        """
        steps, step_time = walk.steps, walk.step_time
        key = (player.marionette, "walk", steps, step_time, carrying_side, any(walk.pauses))
        if key not in self._cache:
            if carrying_side:
                pose = self.pose(player, carrying_side)
                gesture = prop_gestures.steps_carrying(
                    player.marionette, pose, player.rest_state, "", steps, step_time
                )
            elif any(walk.pauses):
                gesture = floor_walk(player, walk)
            else:
                gesture = step_gesture(player.ends(), steps, step_time)
            self._cache[key] = gesture
        return _or_raise(self._cache[key])

    def pose(self, player: Player, side: str) -> Gesture:
        """Gesture that takes up the pose for carrying something.

        Raises:
            StateError: the puppet lacks a part that the gesture moves.
        """
        key = (player.marionette, "pose", side)
        if key not in self._cache:
            player.ends()
            self._cache[key] = prop_gestures.carry(player.marionette, "", side=side)
        return _or_raise(self._cache[key])

    def reason_unable(self, player: Player, entry: PlayCue) -> str:
        """Reason why a player can never do a cue, wherever it stands; "" if there is none.

        Nothing is simulated: clips, and targets to look and point at, are not tested.
        """
        if isinstance(entry, DoesCue):
            if not isinstance(self._read(player, entry.does), Gesture):
                return ""
            gesture = self._styled(player, entry, self.style(entry), player.start.heading)
            return gesture if isinstance(gesture, str) else ""
        try:
            if isinstance(entry, LooksAtCue | PointsAtCue):
                check_parts(player.marionette, player.rest_state, VERBS[entry.verb].default_name)
            else:
                player.ends()
        except (StateError, UnknownNameError) as error:
            return f"{player.name} cannot do `{file_key(entry.verb)}`: {error}"
        return ""

    def _read(self, player: Player, name: str) -> Gesture | Clip | str:
        """Gesture of a file, a take, a clip or a bundled gesture; after a mistake its text."""
        key = (player.marionette, name)
        if key not in self._loaded_files:
            self._loaded_files[key] = self._loaded(player, name)
        return self._loaded_files[key]

    def _loaded(self, player: Player, name: str) -> Gesture | Clip | str:
        """Result of :meth:`_read`, without the cache."""
        known_names = (*gesture_names(), *clip_names())
        try:
            path = find_gesture_file(self._log.located, name, known_names, (CLIP_SUFFIX,))
        except StateError as error:
            return str(error)
        if path is None and name in gesture_names():
            if not bundled_gesture_path(name).is_file():
                verb = {"walk": "walks to"}.get(name, name)
                return f"{name} needs a place: use `{verb}:`"
            path = bundled_gesture_path(name)
        if path is None and name in clip_names():
            path = bundled_clip_path(name)
        if path is None:
            text = f"no file beside this one, and no bundled gesture or clip, is called {name!r}"
            return text + did_you_mean(name, sorted({*known_names} - {*COMPUTED_GESTURES}))
        try:
            if is_clip(path):
                return read_clip(player, path)
            return load_gesture(player.marionette, path, player.rest_state)
        except (FileError, InputError) as error:
            return "; ".join(str(mistake) for mistake in error.mistakes)
        except (UnknownNameError, StateError) as error:
            return str(error)

    def _styled(
        self, player: Player, entry: DoesCue, style: Style, heading: float
    ) -> Gesture | str:
        """Gesture of a cue in a style, turned to a heading [rad]; after a mistake its text."""
        loaded = self._read(player, entry.does)
        if isinstance(loaded, str):
            return loaded
        stage = self.cast.file.stage
        try:
            if isinstance(loaded, Clip):
                larger, faster, lasts = style.larger, style.faster, style.lasts
                loaded = loaded.gesture(larger, faster, lasts, stage, self._log.beat, self.cache)
                style = replace(style, faster=1.0, lasts=None)  # which are those of the clip
            angle = heading - player.facing
            _, varied = style.apply(
                loaded,
                player.marionette,
                heading=angle,
                speed=stage.speed,
                acceleration=stage.acceleration,
            )
            return varied
        except StateError as error:
            return str(error)


def _repeated_marks(marks: Iterable[str], times: int) -> list[str]:
    """Marks of a gesture that is repeated."""
    return [*marks, *(f"{name} {k}" for k in range(2, times + 1) for name in marks)]


def _or_raise(gesture: Gesture | str) -> Gesture:
    if isinstance(gesture, str):
        raise StateError(gesture)
    return gesture


def step_time(beat: float) -> float:
    """Duration of a step [s]: beats or a part of one, near the default and within bounds.

    Faster steps make the legs swing, whose period is about a second.
    """
    min_duration, max_duration = _STEP_TIME_RANGE
    durations = [
        beat * beats for beats in _STEP_BEATS if min_duration <= beat * beats <= max_duration
    ]
    return min(durations, key=lambda t: abs(t - STEP_TIME), default=STEP_TIME)
