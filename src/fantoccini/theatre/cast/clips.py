"""Clips of motion capture that cues perform, as gestures on the spot.

A clip is a captured motion of a person. On the spot means that its motion over the floor is left
out. The stage is the scene with all players, props and obstacles.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fantoccini.base import Array, FileError, Mistake, StateError, Status
from fantoccini.base.documents import has_key
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.cast.players import Player
from fantoccini.theatre.cast.result_cache import (
    DiskFormat,
    ResultCache,
    gesture_format,
    text_array,
    text_in,
)
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.retarget import (
    CLIP_END_MARK,
    CLIP_START_MARK,
    DOUBTFUL,
    ClipGesture,
    PlacedClip,
    TooShortError,
    clip_gesture,
    load_mapping,
    place_on_spot,
)
from fantoccini.theatre.script import StageFile

_MAX_EXCESS_DISTANCE = 0.05
"""Largest excess of a part's distance from the clip over that at rest, relative to the height."""
_SPEED_FACTORS = (0.8, 0.64, 0.5)
"""Factors of the speed that are tried if a clip is too fast."""


CLIP_SUFFIX = ".bvh"
"""Ending of the name of a clip."""


def is_clip(path: Path) -> bool:
    """Whether a file's name is that of a clip."""
    return path.suffix.lower() == CLIP_SUFFIX


@dataclass(frozen=True, eq=False)
class Clip:
    """A clip that a player can perform.

    Attributes:
        placed: targets of the player's parts.
        content_hash: hash of the player, the clip and its mapping.
    """

    placed: PlacedClip
    content_hash: str

    @property
    def marks(self) -> Mapping[str, float]:
        """Marks of its gesture; their times are known once it is computed."""
        return dict.fromkeys((CLIP_START_MARK, CLIP_END_MARK), 0.0)

    def gesture(
        self,
        larger: float,
        faster: float,
        lasts: float | None,
        stage: StageFile,
        beat: float,
        cache: ResultCache,
    ) -> Gesture:
        """Motion of the hands that follows the clip, before it is scaled.

        Args:
            larger: factor by which it will be scaled, for which the bounds leave a margin.
            faster: speed of the clip.
            lasts: duration instead of the clip's [s].
            stage: stage with the bounds.
            beat: duration of a beat [s], for messages.
            cache: cached gestures.

        Raises:
            StateError: the player cannot follow it; the message gives a possible speed.
        """
        scale = max(1.0, larger)
        bounds = stage.speed / scale, stage.acceleration / scale

        disk_format = _disk_format(self.placed.figure.marionette)

        def followed_gesture(faster: float, lasts: float | None) -> tuple[Gesture, str]:
            key = repr((self.content_hash, "clip", faster, lasts, *bounds))
            job = partial(_followed, self.placed, faster, lasts, bounds)
            return cache.get(key, job, disk_format)

        try:
            gesture, deviation = followed_gesture(faster, lasts)
        except TooShortError as error:
            raise TooShortError(error.name, error.lasts, error.leads, beat) from None
        if not deviation:
            return gesture
        text = f"within {bounds[0]:.3g} m/s and {bounds[1]:.3g} m/s^2 {deviation}"
        for factor in _SPEED_FACTORS:
            try:
                slower_gesture, deviation = followed_gesture(
                    factor * faster, None if lasts is None else lasts / factor
                )
            except StateError:
                continue
            if not deviation:
                remedy = f"`faster: {factor * faster:.2g}`"
                if lasts is not None:
                    remedy = f"`lasts: {slower_gesture.duration / beat:.3g}`"
                raise StateError(f"{text}; with {remedy} it can be done")
        raise StateError(f"{text}, and at half its speed as well")


def _followed(
    placed: PlacedClip, faster: float, lasts: float | None, bounds: tuple[float, float]
) -> tuple[Gesture, str]:
    """Gesture of a clip, and its deviation from the clip in words."""
    clip = clip_gesture(placed, faster, lasts, speed=bounds[0], acceleration=bounds[1])
    if clip.run.status is Status.STOPPED:  # by Ctrl-C, which is no property of the clip
        raise KeyboardInterrupt
    return clip.gesture, _deviation_in_words(clip)


def _disk_format(marionette: Marionette) -> DiskFormat[tuple[Gesture, str]]:
    """Disk format of a puppet's gestures with their deviations in words."""
    of_gesture = gesture_format(marionette)

    def pack(followed: tuple[Gesture, str]) -> list[Array]:
        gesture, deviation = followed
        return [text_array(deviation), *of_gesture.pack(gesture)]

    def unpack(arrays: Sequence[Array]) -> tuple[Gesture, str]:
        return of_gesture.unpack(arrays[1:]), str(text_in(arrays[0]))

    return DiskFormat(pack, unpack)


def read_clip(player: Player, path: Path) -> Clip:
    """Clip of a file, with the targets of a player's parts.

    A file with the same stem and the suffix ``.yaml`` is its mapping, if it is one. Joints that are
    doubtful are warnings.

    Args:
        player: player that performs it.
        path: path of the BVH file.

    Raises:
        FileError: mistakes in the files, or missing joints.
        StateError: the player does not have the bodies of a person.
    """
    mapping_path = path.with_suffix(".yaml")
    mapping = (
        load_mapping(mapping_path)
        if os.path.isfile(mapping_path) and has_key(mapping_path, "mapping")
        else None
    )
    try:
        placed = place_on_spot(player.marionette, path, mapping, player.rest_state)
    except FileError as error:
        if mapping is not None:
            raise
        raise FileError(
            [_hinted(mistake, mapping_path.name) for mistake in error.mistakes]
        ) from None
    for note in placed.clip.notes:
        if DOUBTFUL in note:
            warnings.warn(note, stacklevel=2)
    hasher = hashlib.blake2b(player.content_hash.encode())
    hasher.update(path.read_bytes())
    hasher.update(b"" if mapping is None else mapping_path.read_bytes())
    return Clip(placed, hasher.hexdigest())


def _hinted(mistake: Mistake, mapping_name: str) -> Mistake:
    """A mistake with the name that a mapping file of the clip would have."""
    text = mistake.message.replace(
        "give a mapping file", f"give a mapping file {mapping_name} beside it"
    )
    return Mistake(mistake.file, mistake.line, mistake.key, text)


def _deviation_in_words(clip: ClipGesture) -> str:
    """Deviation of a player from its clip in words; "" if it is acceptable."""
    if not clip.arrived:
        return f"the puppet's run of the clip stops: {clip.run.status}"
    worst = max(clip.report, key=lambda part: part.excess)
    if worst.excess <= _MAX_EXCESS_DISTANCE:
        return ""
    return (
        f"the {worst.name} would be {100 * worst.excess:.0f} % of the puppet's height farther from "
        "the clip than where it hangs"
    )
