"""Arrays of an input, checked and changed; :class:`Input` gives them names.

breaks (n + 1,) [s], coef (n, n_vK, 6) and base (n, n_qK) of the motion, force (n, n_vD, 6).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fantoccini.base import (
    Array,
    ConfigK,
    InputError,
    MaskRows,
    Mistake,
    Times,
    VecK,
    floats,
    frozen,
    polynomial,
)
from fantoccini.motion import joints, pieces
from fantoccini.motion.channel import Channel

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable


class InputArrays(NamedTuple):
    """The arrays of an input: see :class:`Input`."""

    breaks: Times
    coef: Array
    base: Array
    named: MaskRows
    force: Array | None


def checked_arrays(table: CoordinateTable, given: InputArrays) -> InputArrays:
    """The arrays, immutable.

    Raises:
        InputError: one has another shape or a number that is not finite, or times do not increase.
    """
    n = len(given.breaks) - 1
    shapes = {
        "breaks": (n + 1,),
        "coef": (n, table.n_vK, polynomial.N_COEF),
        "base": (n, table.n_qK),
        "named": (table.n_vK,),
        "force": (n, table.n_vD, polynomial.N_COEF),
    }
    copies: dict[str, Any] = {}
    for field, shape in shapes.items():
        value = getattr(given, field)
        if value is None and field == "force":
            continue
        copies[field] = frozen(value, bool if field == "named" else float)
        if copies[field].shape != shape:
            fail(field, f"has the shape {copies[field].shape}; it must be {shape}")
    arrays = given._replace(**copies)
    for field, known in (("coef", arrays.coef[:, arrays.named]), ("force", arrays.force)):
        if known is not None and not np.all(np.isfinite(known)):
            fail(field, "has a number that is not finite")
    breaks = arrays.breaks
    if n < 1 or not (np.all(np.diff(breaks) > 0) and np.isfinite(breaks).all()):
        fail("breaks", "must be two or more finite times that increase")
    return arrays


def constant_acceleration(
    table: CoordinateTable, t: Times, q_K: Array, v_K: Array, acc_K: Array
) -> tuple[Times, Array, Array]:
    """Breaks, coef and base of segments: see :meth:`Input.segments`.

    Raises:
        InputError: an array has another shape.
    """
    t, q, v, acc = (floats(x) for x in (t, q_K, v_K, acc_K))
    if t.ndim != 1 or len(t) < 2:
        fail("t", f"has the shape {t.shape}; it must be two times or more")
    n = len(t) - 1
    for field, value, width in (("q_K", q, table.n_qK), ("v_K", v, table.n_vK)):
        if value.shape not in ((width,), (n, width)):
            fail(field, f"has the shape {value.shape}; it must be {(width,)} or {(n, width)}")
    if acc.shape != (n, table.n_vK):
        fail("acc_K", f"has the shape {acc.shape}; it must be {(n, table.n_vK)}")
    coef, base = pieces.constant_acceleration(table, t, q, v, acc)
    return t, coef, base


def on_breaks(
    table: CoordinateTable, given: InputArrays, ends: tuple[ConfigK, ConfigK], breaks: Times
) -> InputArrays:
    """The arrays on their own and further breaks, held at the configurations ``ends`` outside."""
    first, last = (pieces.constants(table, q_K) for q_K in ends)
    coef, base = Channel(given.breaks, given.coef, given.base, first, last, table.scalars_K).on(
        breaks
    )
    force = None
    if given.force is not None:
        zero_force = np.zeros((table.n_vD, polynomial.N_COEF)), np.zeros(0)
        empty = np.zeros((len(given.coef), 0))
        force = Channel(given.breaks, given.force, empty, zero_force, zero_force).on(breaks)[0]
    return InputArrays(breaks, coef, base, given.named, force)


def filled(table: CoordinateTable, given: InputArrays, mask: MaskRows, q_K: ConfigK) -> InputArrays:
    """The arrays with the coordinates of ``mask`` (n_vK,) named, and held at q_K."""
    coef, base = np.array(given.coef), np.array(given.base)
    at_q_K, _ = pieces.constants(table, q_K)
    coef[:, mask] = at_q_K[mask]
    for q, v in pieces.channel_names(table).values():
        if mask[v.start]:
            base[:, q] = q_K[q]
    return given._replace(coef=coef, base=base, named=given.named | mask)


def at_rest(table: CoordinateTable, breaks: Times, coef: Array, v: VecK) -> Array:
    """The coefficients with small velocities v (2, n_vK) at both ends set to 0."""
    _, max_speed = joints.tolerances(table, breaks[None], coef[None])
    small = np.where((np.abs(v) <= max_speed) & (v != 0.0), 0.0, v)
    if np.array_equal(small, v):
        return coef
    coef, zero = np.array(coef), np.zeros((1, len(v[0])))
    h = np.diff(breaks)
    first = joints.with_start(table, coef[:1], np.zeros(1), h[:1], zero, small[:1])
    coef[:1] = first
    coef[-1:] = joints.with_end(table, coef[-1:], h[-1:], zero, small[1:])
    return coef


def force_or_zero(table: CoordinateTable, given: InputArrays) -> Array:
    """(n, n_vD, 6) generalised forces; 0 where there are none."""
    if given.force is not None:
        return given.force
    return np.zeros((len(given.coef), table.n_vD, polynomial.N_COEF))


def fail(field: str, message: str) -> None:
    """Raises an InputError about an argument."""
    raise InputError([Mistake("inputs", None, field, message)])
