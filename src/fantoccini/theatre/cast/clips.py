"""Clips of motion capture that cues do, as gestures on the spot."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fantoccini.base import FileError, Mistake, StateError
from fantoccini.base.documents import has_key
from fantoccini.theatre.cast.casting import Player
from fantoccini.theatre.cast.kept import Kept
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.retarget import (
    BEGINS,
    OVER,
    ClipGesture,
    Placed,
    clip_gesture,
    load_mapping,
    place_on_spot,
)
from fantoccini.theatre.script import StageFile

_FAR = 0.05
"""Share of the puppet's height by which a part may be farther from the clip than where it hangs."""
_SLOWER = (0.8, 0.64, 0.5)
"""Speeds that are tried where a clip is too fast."""


def is_clip(path: Path) -> bool:
    """Whether a file is a clip, by its name."""
    return path.suffix.lower() == ".bvh"


@dataclass(frozen=True, eq=False)
class Clip:
    """A clip that a player can do.

    Attributes:
        placed: where the player's parts are to be in it.
        content: a hash of the player, the clip and its mapping.
    """

    placed: Placed
    content: str

    @property
    def marks(self) -> Mapping[str, float]:
        """The marks of its gesture; their times are known once it is made."""
        return dict.fromkeys((BEGINS, OVER), 0.0)

    def gesture(
        self,
        larger: float,
        faster: float,
        lasts: float | None,
        stage: StageFile,
        beat: float,
        kept: Kept,
    ) -> Gesture:
        """Motion of the hands for it, before it is scaled.

        Args:
            larger: by how much it will be scaled, which bounds are to allow for.
            faster: speed of the clip.
            lasts: how long all of it takes instead [s].
            stage: has the bounds.
            beat: [s], for messages.
            kept: has the gestures that were made before.

        Raises:
            StateError: the player cannot follow it; says at what speed it can.
        """
        size = max(1.0, larger)
        bounds = stage.speed / size, stage.acceleration / size

        def made(faster: float, lasts: float | None) -> ClipGesture:
            key = repr((self.content, "clip", faster, lasts, *bounds))
            job = partial(
                clip_gesture, self.placed, faster, lasts, speed=bounds[0], acceleration=bounds[1]
            )
            return kept.get(key, job)

        first = made(faster, lasts)
        why = _lacks(first)
        if not why:
            return first.gesture
        text = f"within {bounds[0]:.3g} m/s and {bounds[1]:.3g} m/s^2 {why}"
        for share in _SLOWER:
            try:
                one = made(share * faster, None if lasts is None else lasts / share)
            except StateError:
                continue
            if not _lacks(one):
                can = f"`faster: {share * faster:.2g}`"
                if lasts is not None:
                    can = f"`lasts: {one.gesture.duration / beat:.3g}`"
                raise StateError(f"{text}; with {can} it can be done")
        raise StateError(f"{text}, and at half its speed as well")


def read_clip(player: Player, path: Path) -> Clip:
    """Reads a clip, and finds where a player's parts are to be in it.

    A file of the same name that ends in ``.yaml`` is its mapping, if it is one.

    Args:
        player: who is to do it.
        path: of the BVH file.

    Raises:
        FileError: files with mistakes, or joints that are not found.
        StateError: the player has not the bodies of a person.
    """
    own = path.with_suffix(".yaml")
    mapping = load_mapping(own) if os.path.isfile(own) and has_key(own, "mapping") else None
    try:
        placed = place_on_spot(player.alone, path, mapping, player.hangs)
    except FileError as error:
        if mapping is not None:
            raise
        raise FileError([_hinted(mistake, own.name) for mistake in error.mistakes]) from None
    h = hashlib.blake2b(player.content.encode())
    h.update(path.read_bytes())
    h.update(b"" if mapping is None else own.read_bytes())
    return Clip(placed, h.hexdigest())


def _hinted(one: Mistake, own: str) -> Mistake:
    """A mistake that says where a mapping file of a clip would be."""
    text = one.message.replace("give a mapping file", f"give a mapping file {own} beside it")
    return Mistake(one.file, one.line, one.key, text)


def _lacks(made: ClipGesture) -> str:
    """Differences of a player from its clip in words; "" if it follows it."""
    if not made.arrived:
        return f"the puppet's run of the clip stops: {made.run.status}"
    worst = max(made.report, key=lambda one: one.above)
    if worst.above <= _FAR:
        return ""
    return (
        f"the {worst.name} would be {100 * worst.above:.0f} % of the puppet's height farther from "
        "the clip than where it hangs"
    )
