"""Rotations of driven bodies, as rotation vectors relative to their orientation at the start.

phi(t) = log(R(0)^T R(t)),   w = J_r(phi) phidot

J_r is the right Jacobian of SO(3), w the angular velocity in body axes [rad/s].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array, StateError, Times, VecK, polynomial, rotation
from fantoccini.motion import Channel, Input, pieces
from fantoccini.theatre.gestures.moves import MAX_TURN

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

_MAX_END_TURN = 1e-6
"""Turn at the end of a gesture below which a body counts as turned back [rad]."""


def from_start(inputs: Input, h: Times) -> Array:
    """(n, n_vK, 6) coefficients with rotation vectors relative to the first orientation.

    They agree with the input in orientation, angular velocity and its rate at the ends of all
    pieces.

    Args:
        inputs: motion.
        h: (n,) durations of its pieces [s].

    Raises:
        StateError: a body turns by nearly 180 degrees or more.
    """
    table, coef = inputs.coordinates, np.array(inputs.coef)
    if not table.rotations:
        return coef
    first = pieces.evaluate(table, inputs.coef, inputs.base, np.zeros(len(h)))
    last = pieces.evaluate(table, inputs.coef, inputs.base, h)
    for name, (q, v) in table.rotations.items():
        start, turn = first[0][0, q : q + 4], slice(v, v + 3)
        ends = []
        for place, w, wdot in (first, last):
            phi = rotation.between(start, place[:, q : q + 4])
            ends.append((phi, *rotation.tangent_motion(phi, w[:, turn], wdot[:, turn])))
        phi = np.array([end[0] for end in ends])
        # A piece that passes pi comes back on the other side.
        passes = np.max(np.linalg.norm(phi[1] - phi[0], axis=-1)) > np.pi
        if passes or np.max(np.linalg.norm(phi, axis=-1)) > MAX_TURN:
            raise StateError(
                f"{name} turns too far from where it begins; a gesture turns by "
                f"{np.degrees(MAX_TURN):.0f} deg at most"
            )
        coef[:, turn] = polynomial.hermite(h[:, None], *ends)
    return coef


def with_rotations(table: CoordinateTable, channels: Mapping[str, Channel]) -> dict[str, Channel]:
    """Channels in which the parts of each rotation vector are one channel; others stay.

    Args:
        table: names of the coordinates.
        channels: scalar coordinate, or part of a rotation vector (``bar.wy``) -> offsets.
    """
    whole, upright = dict(channels), np.array([1.0, 0.0, 0.0, 0.0])
    for name, (_, v) in table.rotations.items():
        own = [(i, whole.pop(part)) for i, part in enumerate(table.v_K[v : v + 3]) if part in whole]
        if not own:
            continue
        clock = pieces.clock([part.times for _, part in own])
        coef = np.zeros((len(clock) - 1, 3, polynomial.N_COEF))
        ends = np.zeros((2, 3, polynomial.N_COEF))
        for i, part in own:
            coef[:, i] = part.on(clock)[0][:, 0]
            ends[:, i] = part.before[0][0], part.after[0][0]
        base = np.tile(upright, (len(coef), 1))
        whole[name] = Channel(clock, coef, base, (ends[0], upright), (ends[1], upright))
    return whole


def end_shift(table: CoordinateTable, end: VecK) -> VecK:
    """(n_vK,) offsets at the end of a travelling gesture, from which the next gesture begins.

    Raises:
        StateError: a driven body ends turned: later offsets are not relative to turned axes.
    """
    shift = np.array(end)
    for name, (_, v) in table.rotations.items():
        if np.linalg.norm(end[v : v + 3]) > _MAX_END_TURN:
            raise StateError(f"a gesture that ends with {name} turned cannot travel")
        shift[v : v + 3] = 0.0
    return shift


def turned_axes(table: CoordinateTable, angle: float) -> list[tuple[slice, Array]]:
    """Slice in v_K of each rotation vector, and the matrix (3, 3) that turns it by ``angle`` [rad].

        phi' = R_0^T R_z(angle) R_0 phi

    R_0 is the orientation of the body in the file's pose.
    """
    turn = rotation.matrix(rotation.exp(np.array([0.0, 0.0, angle])))
    matrices = []
    for q, v in table.rotations.values():
        R = rotation.matrix(table.start_K[q : q + 4])
        matrices.append((slice(v, v + 3), R.T @ turn @ R))
    return matrices
