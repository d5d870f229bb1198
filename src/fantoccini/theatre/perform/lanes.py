"""Lanes: strings and joints with driven coordinates that gestures, takes and scores move."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from fantoccini.base import MaskRows, UnknownNameError
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import channel_names
from fantoccini.theatre.gestures import Gesture


class LanePlaces(NamedTuple):
    """Masks of some lanes.

    Attributes:
        q: (n_qK,) their driven coordinates.
        v: (n_vK,) their driven velocities.
    """

    q: MaskRows
    v: MaskRows


def lanes_of(table: CoordinateTable) -> tuple[str, ...]:
    """Names of all lanes."""
    return tuple(dict.fromkeys(map(_lane, channel_names(table))))


def places_of(table: CoordinateTable, lanes: Collection[str]) -> LanePlaces:
    """Masks of lanes.

    Raises:
        UnknownNameError: no lane has this name.
    """
    names = lanes_of(table)
    for lane in lanes:
        if lane not in names:
            raise UnknownNameError("lane", lane, list(names))
    v: MaskRows = np.zeros(table.n_vK, dtype=bool)
    for name, (_, place) in channel_names(table).items():
        v[place] |= _lane(name) in lanes
    return LanePlaces(np.array([_lane(name) in lanes for name in table.q_K], dtype=bool), v)


def without(motion: Gesture, armed: Collection[str]) -> Gesture:
    """Motion without the armed lanes.

    Raises:
        UnknownNameError: no lane has this name.
    """
    free: MaskRows = motion.named & ~places_of(motion.coordinates, armed).v
    return dataclasses.replace(
        motion, named=free, coef=motion.coef * free[:, None], travel=motion.travel * free
    )


def _lane(name: str) -> str:
    """Lane of a driven coordinate."""
    return name.rsplit(".", 1)[0]
