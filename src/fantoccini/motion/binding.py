"""Binds inputs to start states: unnamed coordinates hold the state's values.

All arrays have a leading axis: one input for each trajectory.
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
    q_here: Array,
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
        q_here: (n, n_qK) configurations of the inputs at ``t``.
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
    of_q = np.zeros(table.n_qK, dtype=np.intp)  # the velocity of each number of a configuration
    for q, v in pieces.channel_names(table).values():
        of_q[q] = v.start
    named_q, (q_s, v_s) = named[:, of_q], table.places_K
    coef = np.where(named[:, None, :, None], coef, 0.0)
    base = np.where(named_q[:, None], base, q_K[:, None])
    coef[:, :, v_s, 0] = np.where(named[:, None, v_s], coef[:, :, v_s, 0], q_K[:, None, q_s])
    move, differs = np.zeros(named.shape), np.zeros(len(coef), dtype=bool)
    move[:, v_s] = np.where(named[:, v_s], (q_K - q_here)[:, q_s], 0.0)
    if speeds is not None:
        v_here, v_K = np.where(named, speeds[0], 0.0), speeds[1]
        differs = np.any(np.abs(v_K - v_here) > joints.TOLERANCES.rounded_speed, axis=1)
    differs |= ~np.all(np.abs(move) <= joints.TOLERANCES.rounded_position, axis=1)
    # Tolerances are computed only where there is a difference: batches are large.
    place, speed = np.zeros(named.shape), np.zeros(named.shape)
    own = breaks[differs] if len(breaks) > 1 else breaks
    place[differs], speed[differs] = joints.tolerances(table, own, coef[differs])
    away = np.abs(q_here - q_K)
    same = np.maximum(place[:, of_q], joints.TOLERANCES.position * np.maximum(1.0, np.abs(q_here)))
    for at, _ in table.quaternions_K:
        spot = slice(at, at + 4)
        mine, theirs = q_here[:, spot], q_K[:, spot]
        turned = named_q[:, at] & ((mine * theirs).sum(axis=-1) < 0)
        base[:, :, spot] *= np.where(turned, -1.0, 1.0)[:, None, None]
        away[:, spot] = np.linalg.norm(rotation.between(theirs, mine), axis=-1)[:, None]
        same[:, spot] = joints.TOLERANCES.position
    strange, off = ~np.isfinite(q_K), named_q & ~(away <= same)
    if np.any(strange) or np.any(off):
        for name, (q, _) in pieces.channel_names(table).items():
            _note_start(mistakes, name, (q_here[:, q], q_K[:, q]), strange[:, q], off[:, q], t)
    mistakes.refuse()
    if speeds is not None and np.any(differs):
        v_K = np.where(np.abs(v_K - v_here) <= speed, v_K, v_here)
        _begin(table, breaks, coef, base, t, np.flatnonzero(differs), move, v_K)
    return coef, base


def _note_start(
    mistakes: Mistakes, name: str, places: tuple[Array, Array], strange: Mask, off: Mask, t: float
) -> None:
    """Reports a coordinate that is not finite in a start state, or differs from the inputs.

    Args:
        mistakes: collector.
        name: name of the coordinate.
        places: (n, 1 or 4) values of the inputs and of the start states.
        strange, off: (n, 1 or 4) where that is so.
        t: the start [s].
    """
    n = len(off)
    for i in np.flatnonzero(np.any(strange, axis=1))[:1]:
        mistakes.add((*which(i, n), name), f"is {_text(places[1][i])} in the start state")
    for i in np.flatnonzero(off[:, 0])[:1]:
        in_inputs, in_state = (_text(place[i]) for place in places)
        mistakes.add(
            (*which(i, n), name),
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
            names, needed = (", ".join(table.q_K[:5]) or "none" for table in (other, first))
            raise ValueError(
                f"inputs[{i}] is of another puppet than inputs[0]: its driven coordinates are "
                f"{names}; needed: {needed}"
            )


def _begin(
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
    changed = joints.with_start(table, coef[lanes, i], s, h, move[lanes], v[lanes])
    coef[lanes, i] = changed
    q, at = table.places_K
    base[lanes[:, None], i[:, None], q] = changed[:, at, 0]


def note_lengths(table: CoordinateTable, breaks: Array, coef: Array, mistakes: Mistakes) -> None:
    """Notes the first time at which each driven length is not positive."""
    h = np.diff(breaks)
    s = h[..., None] * np.linspace(0.0, 1.0, pieces.LENGTH_SAMPLES)
    for name, (_, v) in pieces.channel_names(table).items():
        if not name.endswith(".length"):
            continue
        if np.all(polynomial.control_points(coef[:, :, v.start], h) > 0):
            continue
        value = polynomial.evaluate(coef[:, :, None, v.start], s)[0]
        if np.any(value <= 0):
            n, i, k = np.unravel_index(np.argmax(value <= 0), value.shape)
            t = np.broadcast_to(breaks[:, :-1, None] + s, value.shape)[n, i, k]
            mistakes.add(
                (*which(n, len(coef)), name),
                f"is {value[n, i, k]:.6g} m at t = {t:g} s; the length of a string must stay "
                "above 0",
            )


def which(i: int | np.intp, n: int) -> tuple[int, ...]:
    """Index of an input among n, for messages; empty for a single one."""
    return (int(i),) if n > 1 else ()


def _text(values: Array) -> str:
    shown = ", ".join(f"{x:.10g}" for x in values)
    return shown if len(values) == 1 else f"[{shown}]"
