"""Inputs made ready for runs: what they do not name holds the start state's values.

Everything here has a leading axis: one input a trajectory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array
from fantoccini.motion import pieces, polynomial, rotation
from fantoccini.motion.findings import Findings

if TYPE_CHECKING:
    from fantoccini.tree import CoordinateTable

_SAME_POSITION = 1e-9
"""A start state that differs by less, relative to 1 or the value if larger, is the same."""


def bound(
    table: CoordinateTable,
    breaks: Array,
    coef: Array,
    base: Array,
    named: Array,
    q_here: Array,
    q_K: Array,
    t: float,
) -> tuple[Array, Array]:
    """Coefficients and bases that begin where start states are.

    Args:
        table: names and places of the coordinates.
        breaks: (n, n_seg + 1) [s].
        coef: (n, n_seg, n_vK, 6).
        base: (n, n_seg, n_qK).
        named: (n, n_vK) bool.
        q_here: (n, n_qK) of the inputs at ``t``.
        q_K: (n, n_qK) of the start states.
        t: the start [s].

    Returns:
        coef (n, n_seg, n_vK, 6), base (n, n_seg, n_qK).

    Raises:
        InputError: a named coordinate does not start where its state is.
    """
    findings, coef, base = Findings(), np.array(coef), np.array(base)
    for name, (q, v) in pieces.channel_names(table).items():
        mine, theirs = q_here[:, q], q_K[:, q]
        mask = named[:, v.start]
        free = np.flatnonzero(~mask)
        coef[free[:, None], :, np.arange(v.start, v.stop)] = 0.0
        base[free, :, q] = theirs[free, None]
        if name in table.rotations:
            away = np.linalg.norm(rotation.between(theirs, mine), axis=-1)
            turned = mask & ((mine * theirs).sum(axis=-1) < 0)
            base[:, :, q] *= np.where(turned, -1.0, 1.0)[:, None, None]
        else:
            coef[free, :, v.start, 0] = theirs[free]
            away = np.abs(mine - theirs)[:, 0] / np.maximum(1.0, np.abs(mine[:, 0]))
        for i in np.flatnonzero(mask & ~(away <= _SAME_POSITION))[:1]:
            here, there = _text(mine[i]), _text(theirs[i])
            findings.add(
                (*which(i, len(coef)), name),
                f"is {here} in the inputs at t = {t:g} s, but {there} in the start state; "
                f"start from a state with {name} = {here}, or let the inputs begin at {there}",
            )
    findings.raise_any()
    return coef, base


def note_lengths(table: CoordinateTable, breaks: Array, coef: Array, findings: Findings) -> None:
    """Notes every driven length that is not positive, where it first is not."""
    h = np.diff(breaks)
    s = h[..., None] * np.linspace(0.0, 1.0, pieces.LOOKS)
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


def which(i: int, n: int) -> tuple[int, ...]:
    """Where in many inputs the i-th of n is, for messages; nothing for a single one."""
    return (int(i),) if n > 1 else ()


def _text(values: Array) -> str:
    shown = ", ".join(f"{x:.10g}" for x in values)
    return shown if len(values) == 1 else f"[{shown}]"
