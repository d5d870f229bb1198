"""Lanes: strings and joints with driven coordinates that gestures, takes and scores move.

A lane is here a string or joint with its driven coordinates q_K; a lane is armed if it is recorded
while a take moves the others. n_vK is the number of driven velocities.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from fantoccini.base import MaskRows, UnknownNameError
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import channel_names
from fantoccini.theatre.gestures import Gesture


class LaneMasks(NamedTuple):
    """Masks of some lanes.

    Attributes:
        q: (n_qK,) their driven coordinates.
        v: (n_vK,) their driven velocities.
    """

    q: MaskRows
    v: MaskRows


def lane_names(table: CoordinateTable) -> tuple[str, ...]:
    """Names of all lanes."""
    return tuple(dict.fromkeys(map(_lane, channel_names(table))))


def lane_masks(table: CoordinateTable, lanes: Collection[str]) -> LaneMasks:
    """Masks of lanes.

    Raises:
        UnknownNameError: no lane has this name.
    """
    names = lane_names(table)
    for lane in lanes:
        if lane not in names:
            raise UnknownNameError("lane", lane, list(names))
    v: MaskRows = np.zeros(table.n_vK, dtype=bool)
    for name, (_, indices) in channel_names(table).items():
        v[indices] |= _lane(name) in lanes
    return LaneMasks(np.array([_lane(name) in lanes for name in table.q_K], dtype=bool), v)


def without_lanes(motion: Gesture, armed: Collection[str]) -> Gesture:
    """Motion without the armed lanes.

    Raises:
        UnknownNameError: no lane has this name.
    """
    keeps: MaskRows = motion.named & ~lane_masks(motion.coordinates, armed).v
    return dataclasses.replace(
        motion, named=keeps, coef=motion.coef * keeps[:, None], travel=motion.travel * keeps
    )


def _lane(name: str) -> str:
    """Lane of a driven coordinate."""
    return name.rsplit(".", 1)[0]
