"""Binds inputs to start states: coordinates that they do not name hold the state's values.

Everything here has a leading axis: one input a trajectory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array, Indices, Mask
from fantoccini.motion import joints, pieces, polynomial, rotation
from fantoccini.motion.findings import Findings

if TYPE_CHECKING:
    from fantoccini.tree import CoordinateTable


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

    The piece in which the run begins takes up small differences, as
    :mod:`fantoccini.motion.joints` allows them.

    Args:
        table: names and places of the coordinates.
        breaks: (n, n_seg + 1) [s].
        coef: (n, n_seg, n_vK, 6).
        base: (n, n_seg, n_qK).
        named: (n, n_vK) bool.
        q_here: (n, n_qK) of the inputs at ``t``.
        q_K: (n, n_qK) of the start states.
        t: the start [s].
        speeds: (n, n_vK) velocities of the inputs at ``t`` and of the start states; velocities
            are left alone when not given.

    Returns:
        coef (n, n_seg, n_vK, 6), base (n, n_seg, n_qK).

    Raises:
        InputError: a named coordinate does not start where its state is.
    """
    findings, coef, base = Findings(), np.array(coef), np.array(base)
    move, differs = np.zeros(named.shape), np.zeros(len(coef), dtype=bool)
    if speeds is not None:
        v_here, v_K = np.where(named, speeds[0], 0.0), speeds[1]
        differs = np.any(np.abs(v_K - v_here) > joints.TOLERANCES.rounded_speed, axis=1)
    names = pieces.channel_names(table)
    for name, (q, v) in names.items():
        mask = named[:, v.start]
        free = np.flatnonzero(~mask)
        coef[free[:, None], :, np.arange(v.start, v.stop)] = 0.0
        base[free, :, q] = q_K[free, None, q]
        if name in table.rotations:
            turned = mask & ((q_here[:, q] * q_K[:, q]).sum(axis=-1) < 0)
            base[:, :, q] *= np.where(turned, -1.0, 1.0)[:, None, None]
        else:
            coef[free, :, v.start, 0] = q_K[free, q]
            move[:, v.start] = np.where(mask, (q_K - q_here)[:, q.start], 0.0)
    differs |= ~np.all(np.abs(move) <= joints.TOLERANCES.rounded_place, axis=1)
    # Tolerances are computed only where there is a difference: batches are large.
    place, speed = np.zeros(named.shape), np.zeros(named.shape)
    own = breaks[differs] if len(breaks) > 1 else breaks
    place[differs], speed[differs] = joints.tolerances(table, own, coef[differs])
    for name, (q, v) in names.items():
        mine, theirs, mask = q_here[:, q], q_K[:, q], named[:, v.start]
        for i in np.flatnonzero(~np.all(np.isfinite(theirs), axis=1))[:1]:
            findings.add((*which(i, len(coef)), name), f"is {_text(theirs[i])} in the start state")
        if name in table.rotations:
            away = np.linalg.norm(rotation.between(theirs, mine), axis=-1)
            same = np.full(len(coef), joints.TOLERANCES.place)
        else:
            away = np.abs(mine - theirs)[:, 0]
            same = np.maximum(
                place[:, v.start], joints.TOLERANCES.place * np.maximum(1.0, np.abs(mine[:, 0]))
            )
        for i in np.flatnonzero(mask & ~(away <= same))[:1]:
            here, there = _text(mine[i]), _text(theirs[i])
            findings.add(
                (*which(i, len(coef)), name),
                f"is {here} in the inputs at t = {t:g} s, but {there} in the start state; "
                f"start from a state with {name} = {here}, or let the inputs begin at {there}",
            )
    findings.raise_any()
    if speeds is not None and np.any(differs):
        v_K = np.where(np.abs(v_K - v_here) <= speed, v_K, v_here)
        _begin(table, breaks, coef, base, t, np.flatnonzero(differs), move, v_K)
    return coef, base


def check_same_puppet(tables: Sequence[CoordinateTable]) -> None:
    """Raises ValueError unless there are inputs, all for the same driven coordinates.

    Args:
        tables: of the inputs.
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
    some: Indices,
    move: Array,
    v: Array,
) -> None:
    """Moves the start of the pieces at time t by ``move`` and sets its velocity v, in place."""
    breaks = np.broadcast_to(breaks, (len(coef), coef.shape[1] + 1))
    some = some[(breaks[some, 0] <= t) & (t < breaks[some, -1])]
    i = (breaks[some] <= t).sum(axis=1) - 1
    s, h = t - breaks[some, i], breaks[some, i + 1] - breaks[some, i]
    made = joints.begun(table, coef[some, i], s, h, move[some], v[some])
    coef[some, i] = made
    q, at = table.places_K
    base[some[:, None], i[:, None], q] = made[:, at, 0]


def note_lengths(table: CoordinateTable, breaks: Array, coef: Array, findings: Findings) -> None:
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
            findings.add(
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
