"""Binds inputs to start states: unnamed coordinates hold the state's values.

All arrays have a leading axis: one input for each trajectory.

A lane is one of these inputs with its trajectory. q_K and v_K are driven coordinates and
velocities, `breaks` the times at which the pieces of an input meet, and `coef` their coefficients.
In names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array, Indices, Mask, polynomial, rotation
from fantoccini.base.documents import Mistakes
from fantoccini.motion import joints, pieces

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable


def bound(
    table: CoordinateTable,
    breaks: Array,
    coef: Array,
    base: Array,
    named: Mask,
    q_inputs: Array,
    q_K: Array,
    t: float,
    speeds: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Coefficients and bases of inputs that begin at given start states.

    The piece in which the run begins is changed to remove differences within the tolerances of
    :mod:`fantoccini.motion.joints`.

    Args:
        table: names and indices of the coordinates.
        breaks: (n, n_seg + 1) breaks [s].
        coef: (n, n_seg, n_vK, 6) coefficients.
        base: (n, n_seg, n_qK) configurations of reference.
        named: (n, n_vK) whether a coordinate is named.
        q_inputs: (n, n_qK) configurations of the inputs at ``t``.
        q_K: (n, n_qK) configurations of the start states.
        t: time of the start [s].
        speeds: velocities (n, n_vK) of the inputs at ``t``, and of the start states; without
            them, velocities are not changed.

    Returns:
        coef (n, n_seg, n_vK, 6), base (n, n_seg, n_qK).

    Raises:
        InputError: a named coordinate differs from its start state.
    """
    mistakes = Mistakes.of_inputs()
    v_of_q = np.zeros(table.n_qK, dtype=np.intp)  # the velocity of each number of a configuration
    for q, v in pieces.channel_names(table).values():
        v_of_q[q] = v.start
    named_q, (q_scalars, v_scalars) = named[:, v_of_q], table.scalar_indices_K
    coef = np.where(named[:, None, :, None], coef, 0.0)
    base = np.where(named_q[:, None], base, q_K[:, None])
    coef[:, :, v_scalars, 0] = np.where(
        named[:, None, v_scalars], coef[:, :, v_scalars, 0], q_K[:, None, q_scalars]
    )
    move, differs = np.zeros(named.shape), np.zeros(len(coef), dtype=bool)
    move[:, v_scalars] = np.where(named[:, v_scalars], (q_K - q_inputs)[:, q_scalars], 0.0)
    if speeds is not None:
        v_inputs, v_K = np.where(named, speeds[0], 0.0), speeds[1]
        differs = np.any(np.abs(v_K - v_inputs) > joints.TOLERANCES.rounded_speed, axis=1)
    differs |= ~np.all(np.abs(move) <= joints.TOLERANCES.rounded_position, axis=1)
    # Tolerances are computed only where there is a difference: batches are large.
    max_move, max_speed = np.zeros(named.shape), np.zeros(named.shape)
    lane_breaks = breaks[differs] if len(breaks) > 1 else breaks
    max_move[differs], max_speed[differs] = joints.tolerances(table, lane_breaks, coef[differs])
    distance = np.abs(q_inputs - q_K)
    max_distance = np.maximum(
        max_move[:, v_of_q], joints.TOLERANCES.position * np.maximum(1.0, np.abs(q_inputs))
    )
    for q_start, _ in table.quaternions_K:
        q_slice = slice(q_start, q_start + 4)
        from_inputs, from_state = q_inputs[:, q_slice], q_K[:, q_slice]
        has_opposite_sign = named_q[:, q_start] & ((from_inputs * from_state).sum(axis=-1) < 0)
        base[:, :, q_slice] *= np.where(has_opposite_sign, -1.0, 1.0)[:, None, None]
        distance[:, q_slice] = np.linalg.norm(rotation.between(from_state, from_inputs), axis=-1)[
            :, None
        ]
        max_distance[:, q_slice] = joints.TOLERANCES.position
    not_finite, is_off = ~np.isfinite(q_K), named_q & ~(distance <= max_distance)
    if np.any(not_finite) or np.any(is_off):
        for name, (q, _) in pieces.channel_names(table).items():
            _report_start(
                mistakes, name, (q_inputs[:, q], q_K[:, q]), not_finite[:, q], is_off[:, q], t
            )
    mistakes.raise_if_any()
    if speeds is not None and np.any(differs):
        v_K = np.where(np.abs(v_K - v_inputs) <= max_speed, v_K, v_inputs)
        _move_start(table, breaks, coef, base, t, np.flatnonzero(differs), move, v_K)
    return coef, base


def _report_start(
    mistakes: Mistakes,
    name: str,
    values: tuple[Array, Array],
    not_finite: Mask,
    is_off: Mask,
    t: float,
) -> None:
    """Reports a coordinate that is not finite in a start state, or differs from the inputs.

    Args:
        mistakes: collector.
        name: name of the coordinate.
        values: (n, 1 or 4) values of the inputs and of the start states.
        not_finite, is_off: (n, 1 or 4) where that is so.
        t: the start [s].
    """
    n = len(is_off)
    for i in np.flatnonzero(np.any(not_finite, axis=1))[:1]:
        mistakes.add(
            (*index_path(i, n), name), f"is {_numbers_text(values[1][i])} in the start state"
        )
    for i in np.flatnonzero(is_off[:, 0])[:1]:
        in_inputs, in_state = (_numbers_text(value[i]) for value in values)
        mistakes.add(
            (*index_path(i, n), name),
            f"is {in_inputs} in the inputs at t = {t:g} s, but {in_state} in the start state; "
            f"start from a state with {name} = {in_inputs}, or let the inputs begin at {in_state}",
        )


def check_same_puppet(tables: Sequence[CoordinateTable]) -> None:
    """Raises ValueError unless there are inputs, all for the same driven coordinates.

    Args:
        tables: coordinate tables of the inputs.
    """
    if not tables:
        raise ValueError("inputs is empty; it must hold one Input or more")
    first = tables[0]
    for i, other in enumerate(tables):
        if (other.q_K, other.v_D) != (first.q_K, first.v_D):
            driven, needed = (", ".join(table.q_K[:5]) or "none" for table in (other, first))
            raise ValueError(
                f"inputs[{i}] is of another puppet than inputs[0]: its driven coordinates are "
                f"{driven}; needed: {needed}"
            )


def _move_start(
    table: CoordinateTable,
    breaks: Array,
    coef: Array,
    base: Array,
    t: float,
    lanes: Indices,
    move: Array,
    v: Array,
) -> None:
    """Moves the start of the pieces at time t by ``move`` and sets its velocity v, in place.

    ``lanes`` are the indices of the inputs to change.
    """
    breaks = np.broadcast_to(breaks, (len(coef), coef.shape[1] + 1))
    lanes = lanes[(breaks[lanes, 0] <= t) & (t < breaks[lanes, -1])]
    i = (breaks[lanes] <= t).sum(axis=1) - 1
    s, h = t - breaks[lanes, i], breaks[lanes, i + 1] - breaks[lanes, i]
    moved_coef = joints.with_start(table, coef[lanes, i], s, h, move[lanes], v[lanes])
    coef[lanes, i] = moved_coef
    q_scalars, v_scalars = table.scalar_indices_K
    base[lanes[:, None], i[:, None], q_scalars] = moved_coef[:, v_scalars, 0]


def report_lengths(table: CoordinateTable, breaks: Array, coef: Array, mistakes: Mistakes) -> None:
    """Notes the first time at which each driven length is not positive."""
    h = np.diff(breaks)
    s = h[..., None] * np.linspace(0.0, 1.0, pieces.LENGTH_SAMPLES)
    for name, (_, v) in pieces.channel_names(table).items():
        if not name.endswith(".length"):
            continue
        if np.all(polynomial.control_points(coef[:, :, v.start], h) > 0):
            continue
        length = polynomial.evaluate(coef[:, :, None, v.start], s)[0]
        if np.any(length <= 0):
            n, i, k = np.unravel_index(np.argmax(length <= 0), length.shape)
            t = np.broadcast_to(breaks[:, :-1, None] + s, length.shape)[n, i, k]
            mistakes.add(
                (*index_path(n, len(coef)), name),
                f"is {length[n, i, k]:.6g} m at t = {t:g} s; the length of a string must stay "
                "above 0",
            )


def index_path(i: int | np.intp, n: int) -> tuple[int, ...]:
    """Index of an input among n, for messages; empty for a single one."""
    return (int(i),) if n > 1 else ()


def _numbers_text(values: Array) -> str:
    shown = ", ".join(f"{x:.10g}" for x in values)
    return shown if len(values) == 1 else f"[{shown}]"
