"""Pieces of all driven coordinates at once: coef (n, n_vK, 6) and base (n, n_qK).

Driven coordinates q_K are ends and lengths of strings and driven joints, n_qK in number, with n_vK
velocities. The n pieces meet at the times `breaks`, and `coef` are the coefficients of their
polynomials. For a scalar, ``base`` is the polynomial's start value. The three entries of a rotation
are its rotation vector: R = R(base) exp([phi]x).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array, ConfigK, Indices, Mask, MaskRows, Times, polynomial, rotation
from fantoccini.base.documents import Mistakes
from fantoccini.motion import channel, joints
from fantoccini.motion.channel import SAME_TIME, Channel, Points

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

LENGTH_SAMPLES = 17
"""Number of points of a piece at which a length is checked to be positive."""


def channel_names(table: CoordinateTable) -> dict[str, tuple[slice, slice]]:
    """Names that inputs may drive -> their slices in q_K and v_K."""
    names = {table.q_K[q]: (slice(q, q + 1), slice(v, v + 1)) for q, v in table.scalars_K}
    for name, (q, v) in table.rotations.items():
        names[name] = (slice(q, q + 4), slice(v, v + 3))
    return names


def evaluate(
    table: CoordinateTable, coef: Array, base: Array, s: Array
) -> tuple[Array, Array, Array]:
    """Configuration, velocity and acceleration at ``s`` (n,) seconds into each piece.

    Returns:
        q_K (n, n_qK), v_K (n, n_vK), acc_K (n, n_vK).
    """
    p, first, second = polynomial.evaluate(coef, s[:, None])
    q_K = np.empty((len(coef), table.n_qK))
    for q, v in table.scalars_K:
        q_K[:, q] = p[:, v]
    for q, v in table.quaternions_K:
        q_slice, v_slice = slice(q, q + 4), slice(v, v + 3)
        phi, rate, rate_derivative = p[:, v_slice], first[:, v_slice], second[:, v_slice]
        q_K[:, q_slice] = rotation.multiply(base[:, q_slice], rotation.exp(phi))
        first[:, v_slice], second[:, v_slice] = rotation.body_motion(phi, rate, rate_derivative)
    return q_K, first, second


def located(breaks: Times, t: Times) -> tuple[Indices, Array, Mask]:
    """Pieces at times (n,), times since they began [s], and whether the times lie outside."""
    i = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(breaks) - 2)
    return i, np.clip(t, breaks[0], breaks[-1]) - breaks[i], (t < breaks[0]) | (t > breaks[-1])


def constants(table: CoordinateTable, q_K: ConfigK) -> tuple[Array, Array]:
    """The constant piece at a configuration: coef (n_vK, 6) and base (n_qK,)."""
    coef = np.zeros((table.n_vK, polynomial.N_COEF))
    for q, v in table.scalars_K:
        coef[v, 0] = q_K[q]
    return coef, np.asarray(q_K, dtype=float)


def on_common_breaks(
    table: CoordinateTable, channels: Mapping[str, Channel], span: Sequence[float] = ()
) -> tuple[Times, Array, Array, Mask]:
    """Channels on common breaks; coordinates without a channel hold the table's start, unnamed.

    Args:
        table: names and indices of the coordinates.
        channels: name -> channel.
        span: times [s] that the breaks must contain.

    Returns:
        breaks (n + 1,), coef (n, n_vK, 6), base (n, n_qK), named (n_vK,).
    """
    breaks = merged_times([np.array(span, dtype=float), *(c.times for c in channels.values())])
    if len(breaks) == 0:
        breaks = np.array([0.0, 1.0])
    elif len(breaks) == 1:
        breaks = np.array([breaks[0], breaks[0] + 1.0])
    n = len(breaks) - 1
    rest_coef, rest_base = constants(table, table.start_K)
    coef, base = np.tile(rest_coef, (n, 1, 1)), np.tile(rest_base, (n, 1))
    named = np.zeros(table.n_vK, dtype=bool)
    slices = channel_names(table)
    for name, motion in channels.items():
        q, v = slices[name]
        coef[:, v], base[:, q] = motion.on(breaks)
        named[v] = True
    return breaks, coef, base, named


def constant_acceleration(
    table: CoordinateTable, t: Times, q_K: Array, v_K: Array, acc_K: Array
) -> tuple[Array, Array]:
    """Quadratic pieces, each beginning where the one before it ends.

    Args:
        table: names and indices of the coordinates.
        t: (n + 1,) times [s].
        q_K: (n_qK,) at t[0], or (n, n_qK) at the start of every piece.
        v_K: (n_vK,) at t[0], or (n, n_vK) at the start of every piece.
        acc_K: (n, n_vK) accelerations.

    Returns:
        coef (n, n_vK, 6) and base (n, n_qK).
    """
    n, h = len(t) - 1, np.diff(t)[:, None]
    coef, base = np.zeros((n, table.n_vK, polynomial.N_COEF)), np.zeros((n, table.n_qK))
    base[:], coef[..., 1], coef[..., 2] = q_K, v_K, 0.5 * acc_K
    q_scalars, v_scalars = table.scalar_indices_K
    if n > 1 and np.ndim(q_K) == 1 and np.ndim(v_K) == 1:
        speed_gains = np.cumsum((acc_K * h)[:-1], axis=0)
        coef[1:, v_scalars, 1] = (v_K + speed_gains)[:, v_scalars]
        moves = h * (coef[..., 1] + h * coef[..., 2])
        base[1:, q_scalars] = q_K[q_scalars] + np.cumsum(moves[:-1, v_scalars], axis=0)
        # The body velocity at the end of a rotation depends on its whole piece.
        for i in range(1, n if table.quaternions_K else 0):
            piece = slice(i - 1, i)
            end_q, end_v, _ = evaluate(table, coef[piece], base[piece], h[piece, 0])
            for q, v in table.quaternions_K:
                base[i, q : q + 4], coef[i, v : v + 3, 1] = end_q[0, q : q + 4], end_v[0, v : v + 3]
    coef[:, v_scalars, 0] = base[:, q_scalars]
    return coef, base


def through_waypoints(table: CoordinateTable, points: Mapping[str, Points]) -> dict[str, Channel]:
    """Smooth channels through waypoints, on common breaks."""
    breaks = merged_times([t for t, _ in points.values()])
    return {
        name: (channel.rotation_waypoints if name in table.rotations else channel.scalar_waypoints)(
            snapped_to_breaks(t, breaks), values
        )
        for name, (t, values) in points.items()
    }


def through_samples(
    table: CoordinateTable, columns: Mapping[str, Points], rest: bool = True
) -> dict[str, Channel]:
    """Splines through samples; ``rest`` as in :func:`channel.scalar_samples`."""
    return {
        name: (channel.rotation_samples if name in table.rotations else channel.scalar_samples)(
            t, values, rest
        )
        for name, (t, values) in columns.items()
    }


def merged_times(times: Sequence[Times]) -> Times:
    """All times in order, without those within SAME_TIME after another."""
    distinct: list[float] = []
    for t in np.unique(np.concatenate([np.zeros(0), *times])):
        if not distinct or t - distinct[-1] > SAME_TIME:
            distinct.append(float(t))
    return np.array(distinct)


def refined_breaks(breaks: Times, times: Sequence[Times]) -> Times:
    """The breaks, and all times that differ from them by more than SAME_TIME."""
    distinct = merged_times(times)
    return np.sort(
        np.concatenate(
            [breaks, distinct[np.abs(snapped_to_breaks(distinct, breaks) - distinct) > SAME_TIME]]
        )
    )


def snapped_to_breaks(t: Times, breaks: Times) -> Times:
    """The break nearest to each time."""
    after = np.clip(np.searchsorted(breaks, t), 1, max(len(breaks) - 1, 1))
    lower, upper = breaks[after - 1], breaks[np.minimum(after, len(breaks) - 1)]
    return np.where(np.abs(t - lower) <= np.abs(upper - t), lower, upper)


def without_jumps(
    table: CoordinateTable,
    breaks: Times,
    coef: Array,
    base: Array,
    named: MaskRows,
    mistakes: Mistakes,
) -> Array:
    """Coefficients (n, n_vK, 6) changed so that neighbouring pieces meet C^1.

    Reports every coordinate and time at which a position or velocity jumps by more than the
    tolerances of :mod:`fantoccini.motion.joints`. Coefficients without jumps are not changed.
    """
    h = np.diff(breaks)
    q_0, v_0, _ = evaluate(table, coef[:-1], base[:-1], h[:-1])
    q_1, v_1, _ = evaluate(table, coef[1:], base[1:], np.zeros(len(h) - 1))
    max_move, max_speed = (x[0] for x in joints.tolerances(table, breaks[None], coef[None]))
    move = np.zeros_like(v_0)
    for name, (q, v) in channel_names(table).items():
        if not named[v.start]:
            continue
        if name in table.rotations:
            distance = np.linalg.norm(rotation.between(q_0[:, q], q_1[:, q]), axis=-1)
            max_distance = np.full_like(distance, joints.TOLERANCES.position)
        else:
            move[:, v] = (q_1 - q_0)[:, q]
            distance = np.abs(move[:, v.start])
            max_distance = np.maximum(
                max_move[v.start], joints.TOLERANCES.position * np.abs(q_0[:, q.start])
            )
        speed_change = np.linalg.norm(v_1[:, v] - v_0[:, v], axis=-1)
        for quantity, sizes, bound in (
            ("position", distance, max_distance),
            ("velocity", speed_change, max_speed[v.start]),
        ):
            for i in np.nonzero(~(sizes <= bound))[0]:
                mistakes.add(
                    (name,), f"jumps in {quantity} by {sizes[i]:.3g} at t = {breaks[i + 1]:g} s"
                )
    has_speed_jump = (np.abs(v_1 - v_0) > joints.TOLERANCES.rounded_speed)[:, named]
    if not np.any(has_speed_jump) and not np.any(np.abs(move) > joints.TOLERANCES.rounded_position):
        return coef
    out = np.array(coef)
    out[:-1] = joints.with_end(table, coef[:-1], h[:-1], move, v_1)
    return out
