"""Channels: the motion of one driven coordinate, with its own breaks.

A scalar channel is a piecewise quintic q(t). A rotation channel is a rotation vector phi(t) in the
tangent space of a base quaternion: R(t) = R(base) exp([phi(t)]x).

A driven coordinate is given as a function of time: an end or length of a string, or a driven joint.
Breaks are the times at which pieces meet, and `coef` are the coefficients of a piece.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base import Array, Quaternion, ShortRepr, Times, polynomial, rotation

SAME_TIME = 1e-9
"""Largest difference of equal times [s]."""

Points = tuple[Times, Array]
"""Times (n,) [s] and values (n,) or, for a rotation, unit quaternions (n, 4)."""

_MAX_ITERATIONS, _MAX_CHANGE = 20, 1e-13
"""Ends of the iteration for rotation splines; the change is relative to 1 rad/s + the speed."""


@dataclass(frozen=True, eq=False, repr=False)
class Channel(ShortRepr):
    """Pieces of one coordinate (or of several), and its constant values before and after them.

    Attributes:
        times: (n + 1,) starts of the pieces, and the end of the last [s].
        coef: (n, k, 6) coefficients in the time since the piece began.
        base: (n, width) configuration of reference: the start value of a scalar, the unit
            quaternion of a rotation.
        before, after: constant pieces ((k, 6), (width,)) before and after ``times``.
        scalars: indices (in width, in k) of coordinates that are not part of a rotation.
    """

    times: Times
    coef: Array
    base: Array
    before: tuple[Array, Array]
    after: tuple[Array, Array]
    scalars: tuple[tuple[int, int], ...] = ()

    def on(self, breaks: Times) -> tuple[Array, Array]:
        """The channel's pieces on finer breaks.

        Args:
            breaks: (m + 1,) increasing; contains all ``times`` in its range.

        Returns:
            coef (m, k, 6) and base (m, width). The parts of a rotation's piece have the base of
            the whole piece, so that the division is exact; phi does not begin at 0 in them.
        """
        starts = breaks[:-1]
        piece = np.searchsorted(self.times, starts, side="right") - 1
        is_inside = (piece >= 0) & (piece < len(self.coef))
        coef = np.where((piece < 0)[:, None, None], self.before[0], self.after[0])
        base = np.where((piece < 0)[:, None], self.before[1], self.after[1])
        source = piece[is_inside]
        coef[is_inside] = polynomial.shifted(
            self.coef[source], starts[is_inside] - self.times[source]
        )
        base[is_inside] = self.base[source]
        for q, row in self.scalars:
            base[is_inside, q] = coef[is_inside, row, 0]
        return coef, base


def constant_scalars(values: ArrayLike) -> tuple[Array, Array]:
    """The constant piece of scalar coordinates: ((k, 6), (k,))."""
    values = np.atleast_1d(np.asarray(values, dtype=float))
    coef = np.zeros((len(values), polynomial.N_COEF))
    coef[:, 0] = values
    return coef, values


def constant_rotation(q: Quaternion) -> tuple[Array, Array]:
    """The constant piece of a rotation: ((3, 6), (4,))."""
    return np.zeros((3, polynomial.N_COEF)), np.asarray(q, dtype=float)


def scalar(t: Times, coef: Array, first: float, last: float) -> Channel:
    """A channel of a scalar coordinate, from its (n, 6) coefficients."""
    return Channel(
        t, coef[:, None, :], coef[:, :1], constant_scalars(first), constant_scalars(last), ((0, 0),)
    )


def scalar_waypoints(t: Times, values: Array) -> Channel:
    """Quintics through waypoints, without overshoot, at rest at both ends.

    Two points give the minimum-jerk move. The acceleration vanishes at every waypoint.

    Args:
        t: (n,) times [s].
        values: (n,) values [m or rad].
    """
    slopes, zero = polynomial.monotone_slopes(t, values), np.zeros(len(t) - 1)
    coef = polynomial.hermite(
        np.diff(t), (values[:-1], slopes[:-1], zero), (values[1:], slopes[1:], zero)
    )
    return scalar(t, coef, values[0], values[-1])


def scalar_waypoints_along(t: Times, values: Array, change: Array) -> tuple[Channel, bool]:
    """d/ds of :func:`scalar_waypoints` at values + s change, for s -> 0 from above.

    Args:
        t: (n,) times [s].
        values, change: (n,) values, and their direction of change [m or rad].

    Returns:
        The channel, and whether it is linear in the change.
    """
    slopes, smooth = polynomial.monotone_slopes_along(t, values, change)
    zero = np.zeros(len(t) - 1)
    coef = polynomial.hermite(
        np.diff(t), (change[:-1], slopes[:-1], zero), (change[1:], slopes[1:], zero)
    )
    return scalar(t, coef, change[0], change[-1]), smooth


def rotation_waypoints(t: Times, q: Quaternion) -> Channel:
    """Quintics through rotations, with C^1 angular velocity, at rest at both ends.

    At a waypoint the angular velocity bisects the directions of the two neighbouring turns; its
    size is the harmonic mean of their speeds times the cosine between them (0 when they point
    away from each other). Turns about one axis reduce to the scalar rule.

    Args:
        t: (n,) times [s].
        q: (n, 4) unit quaternions, neighbours less than 180 deg apart.
    """
    q, h = rotation.continuous(q), np.diff(t)
    turn = rotation.between(q[:-1], q[1:])
    speed = np.linalg.norm(turn, axis=-1) / h
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    direction = turn / np.where(angle > 0, angle, 1.0)
    bisector = direction[:-1] + direction[1:]
    length = np.linalg.norm(bisector, axis=-1, keepdims=True)
    cosine = np.maximum(np.sum(direction[:-1] * direction[1:], axis=-1), 0.0)
    w = np.zeros((len(t), 3))
    speed_at_points = polynomial.mean_speed(h, speed) * cosine
    w[1:-1] = speed_at_points[:, None] * bisector / np.where(length > 0, length, 1.0)
    return _rotation_quintics(t, q, turn, w, np.zeros_like(w))


def _rotation_quintics(t: Times, q: Quaternion, turn: Array, w: Array, wdot: Array) -> Channel:
    """Quintic rotation vectors with given angular velocity and acceleration at the points."""
    rate, rate_derivative = rotation.tangent_motion(turn, w[1:], wdot[1:])
    coef = polynomial.hermite(
        np.diff(t)[:, None], (np.zeros_like(turn), w[:-1], wdot[:-1]), (turn, rate, rate_derivative)
    )
    return Channel(t, coef, q[:-1], constant_rotation(q[0]), constant_rotation(q[-1]))


def scalar_samples(t: Times, values: Array, rest: bool) -> Channel:
    """The cubic spline (C^2) through samples.

    Args:
        t: (n,) times [s].
        values: (n,) values [m or rad].
        rest: whether to start and end at rest; otherwise the ends are not-a-knot.
    """
    from scipy.interpolate import CubicSpline  # slow to import; only samples need it

    if len(t) == 1:
        return scalar(t, np.zeros((0, polynomial.N_COEF)), values[0], values[0])
    spline = CubicSpline(t, values, bc_type="clamped" if rest else "not-a-knot")
    coef = np.zeros((len(t) - 1, polynomial.N_COEF))
    coef[:, :4] = spline.c[::-1].T
    return scalar(t, coef, values[0], values[-1])


def rotation_samples(t: Times, q: Quaternion, rest: bool) -> Channel:
    """Cubic rotation vectors through samples with C^1 angular velocity and acceleration.

    Args:
        t: (n,) times [s].
        q: (n, 4) unit quaternions, neighbours less than 180 deg apart.
        rest: whether to start and end at rest; otherwise the ends have no angular acceleration.
    """
    q = rotation.continuous(q)
    if len(t) == 1:
        empty = np.zeros((0, 3, polynomial.N_COEF))
        return Channel(t, empty, np.zeros((0, 4)), constant_rotation(q[0]), constant_rotation(q[0]))
    h = np.diff(t)[:, None]
    turn = rotation.between(q[:-1], q[1:])
    w = _spline_velocities(h, turn, rest)
    rate = rotation.apply(rotation.right_jacobian_inverse(turn), w[1:])
    coef = np.zeros((len(turn), 3, polynomial.N_COEF))
    coef[..., 1] = w[:-1]
    coef[..., 2] = (3 * turn / h - 2 * w[:-1] - rate) / h
    coef[..., 3] = (w[:-1] + rate - 2 * turn / h) / h**2
    return Channel(t, coef, q[:-1], constant_rotation(q[0]), constant_rotation(q[-1]))


def _spline_velocities(h: Array, turn: Array, rest: bool) -> Array:
    """Angular velocities (n, 3) for which the angular acceleration is continuous.

    With cubic phi on each piece, J_r phiddot + (dJ_r/dt) phidot at its end equals phiddot at the
    start of the next. The term with dJ_r/dt is small, and is iterated on the right-hand side.
    """
    from scipy.sparse import bsr_array  # slow to import, as above
    from scipy.sparse.linalg import spsolve

    n = len(turn) + 1
    jacobian, inverse = rotation.right_jacobian(turn), rotation.right_jacobian_inverse(turn)
    eye, h_blocks = np.eye(3), h[:, :, None]
    blocks: list[Array] = []
    columns: list[int] = []
    row_starts = [0]
    for i in range(n):
        row: dict[int, Array] = {}
        if rest and i in (0, n - 1):
            row[i] = eye
        else:
            row[i] = np.zeros((3, 3))
            if i > 0:
                row[i - 1] = 2 * jacobian[i - 1] / h_blocks[i - 1]
                row[i] = row[i] + 4 * eye / h_blocks[i - 1]
            if i < n - 1:
                row[i] = row[i] + 4 * eye / h_blocks[i]
                row[i + 1] = 2 * inverse[i] / h_blocks[i]
        for column in sorted(row):
            blocks.append(row[column])
            columns.append(column)
        row_starts.append(len(columns))
    system = bsr_array((np.array(blocks), columns, row_starts), shape=(3 * n, 3 * n)).tocsc()
    secants = 6 * turn / h**2
    right_side = np.zeros((n, 3))
    right_side[1:] += secants
    right_side[:-1] += secants
    w = np.zeros((n, 3))
    for _ in range(_MAX_ITERATIONS):
        rate = rotation.apply(inverse, w[1:])
        convective = rotation.apply(rotation.right_jacobian_rate(turn, rate), rate)
        iterate_side = right_side.copy()
        iterate_side[1:] -= convective
        if rest:
            iterate_side[0] = iterate_side[-1] = 0.0
        new_w = spsolve(system, iterate_side.ravel()).reshape(n, 3)
        change, w = np.max(np.abs(new_w - w)), new_w
        if change <= _MAX_CHANGE * (1 + np.max(np.abs(w))):
            break
    return w


def linear(t: Times, values: Array) -> Channel:
    """A piecewise linear channel, 0 outside; two points at one time are a step, as in a force.

    Args:
        t: (n,) times [s], not decreasing.
        values: (n,) forces [N or N m].
    """
    h = np.diff(t)
    has_duration = h > 0
    coef = np.zeros((np.count_nonzero(has_duration), polynomial.N_COEF))
    coef[:, 0] = values[:-1][has_duration]
    coef[:, 1] = (np.diff(values) / np.where(has_duration, h, 1.0))[has_duration]
    breaks = np.append(t[:-1][has_duration], t[-1])
    return scalar(breaks, coef, 0.0, 0.0)
