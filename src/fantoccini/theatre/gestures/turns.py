"""Turns of driven bodies as rotation vectors from one orientation.

phi(t) = log(R(0)^T R(t)),   w = J_r(phi) phidot
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError, Times, polynomial, rotation
from fantoccini.motion import Input, pieces

_MAX_ANGLE = np.pi - 0.05
"""Largest angle between the start and any break [rad]: at pi the rotation vector jumps."""


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
        if passes or np.max(np.linalg.norm(phi, axis=-1)) > _MAX_ANGLE:
            raise StateError(
                f"{name} turns too far from where it begins; a gesture turns by "
                f"{np.degrees(_MAX_ANGLE):.0f} deg at most"
            )
        coef[:, turn] = polynomial.hermite(h[:, None], *ends)
    return coef
