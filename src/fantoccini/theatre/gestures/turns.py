"""Rotations of driven bodies, as rotation vectors relative to their orientation at the start.

phi(t) = log(R(0)^T R(t)),   w = J_r(phi) phidot

J_r is the right Jacobian of SO(3), w the angular velocity in body axes [rad/s].

phi is a rotation vector: axis times angle. A motion has the coefficients `coef` between the times
`breaks`, for each of the n_vK driven velocities.
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

_ROUNDING = 1e-9
"""Tolerance of the largest turn [rad]."""
_SAMPLES = 17
"""Number of times in a piece at which a turn is measured."""
_MAX_END_TURN = 1e-6
"""Turn at the end of a gesture below which a body counts as turned back [rad]."""


class TurnError(StateError):
    """A gesture turns a body too far.

    Args:
        channel: name of the rotation, such as ``bar.rotation``.
        angle: its largest angle from the start [rad].
        t: time of it [s].
    """

    def __init__(self, channel: str, angle: float, t: float):
        self.channel, self.t = channel, t
        super().__init__(
            f"{channel} turns by {np.degrees(angle):.0f} deg from rest at {t:.2f} s; a gesture, "
            f"and the sum of several at a time, turns a body by at most "
            f"{np.degrees(MAX_TURN):.0f} deg"
        )


def check_turns(table: CoordinateTable, breaks: Times, coef: Array) -> None:
    """Checks that rotation vectors stay below ``MAX_TURN``, beyond which they are not unique.

    Args:
        table: names of the coordinates.
        breaks: (n + 1,) times of the pieces [s].
        coef: (n, n_vK, 6) offsets.

    Raises:
        TurnError: a body turns farther.
    """
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    for name, (_, v) in table.rotations.items():
        turn_coef = coef[:, v : v + 3]
        if not turn_coef.any():
            continue
        s = np.diff(breaks)[:, None] * shares
        phi = polynomial.evaluate(turn_coef[:, None], s[..., None])[0]
        angle = np.linalg.norm(phi, axis=-1)
        piece, k = np.unravel_index(int(np.argmax(angle)), angle.shape)
        if angle[piece, k] > MAX_TURN + _ROUNDING:
            raise TurnError(name, float(angle[piece, k]), float(breaks[piece] + s[piece, k]))


def relative_to_start(inputs: Input, durations: Times) -> Array:
    """(n, n_vK, 6) coefficients with rotation vectors relative to the first orientation.

    They agree with the input in orientation, angular velocity and its rate at the ends of all
    pieces.

    Args:
        inputs: motion.
        durations: (n,) durations of its pieces [s].

    Raises:
        StateError: a body turns by nearly 180 degrees or more.
    """
    table, coef = inputs.coordinates, np.array(inputs.coef)
    if not table.rotations:
        return coef
    start_state = pieces.evaluate(table, inputs.coef, inputs.base, np.zeros(len(durations)))
    end_state = pieces.evaluate(table, inputs.coef, inputs.base, durations)
    for name, (q, v) in table.rotations.items():
        first_orientation, turn = start_state[0][0, q : q + 4], slice(v, v + 3)
        end_motions = []
        for q_K, w, wdot in (start_state, end_state):
            phi = rotation.between(first_orientation, q_K[:, q : q + 4])
            end_motions.append((phi, *rotation.tangent_motion(phi, w[:, turn], wdot[:, turn])))
        phi = np.array([end_motion[0] for end_motion in end_motions])
        # A piece that passes pi comes back on the other side.
        passes = np.max(np.linalg.norm(phi[1] - phi[0], axis=-1)) > np.pi
        if passes or np.max(np.linalg.norm(phi, axis=-1)) > MAX_TURN:
            raise StateError(
                f"{name} turns too far from where it begins; a gesture turns by "
                f"{np.degrees(MAX_TURN):.0f} deg at most"
            )
        coef[:, turn] = polynomial.hermite(durations[:, None], *end_motions)
    return coef


def join_rotations(table: CoordinateTable, channels: Mapping[str, Channel]) -> dict[str, Channel]:
    """Channels in which the parts of each rotation vector are one channel; others stay.

    Args:
        table: names of the coordinates.
        channels: scalar coordinate, or part of a rotation vector (``bar.wy``) -> offsets.
    """
    joined, identity = dict(channels), np.array([1.0, 0.0, 0.0, 0.0])
    for name, (_, v) in table.rotations.items():
        components = [
            (i, joined.pop(component))
            for i, component in enumerate(table.v_K[v : v + 3])
            if component in joined
        ]
        if not components:
            continue
        breaks = pieces.merged_times([component.times for _, component in components])
        coef = np.zeros((len(breaks) - 1, 3, polynomial.N_COEF))
        end_coef = np.zeros((2, 3, polynomial.N_COEF))
        for i, component in components:
            coef[:, i] = component.on(breaks)[0][:, 0]
            end_coef[:, i] = component.before[0][0], component.after[0][0]
        base = np.tile(identity, (len(coef), 1))
        joined[name] = Channel(breaks, coef, base, (end_coef[0], identity), (end_coef[1], identity))
    return joined


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
