"""Arrays of an input, checked and changed; :class:`Input` gives them names.

The motion of the driven coordinates q_K (ends and lengths of strings, driven joints) consists of n
pieces, which meet at breaks (n + 1,) [s]. Their polynomials have the coefficients coef
(n, n_vK, 6), relative to base (n, n_qK); force (n, n_vD, 6) has those of user forces. n_qK, n_vK
and n_vD are the numbers of driven coordinates, driven velocities and dynamic velocities.
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


def checked_arrays(table: CoordinateTable, unchecked: InputArrays) -> InputArrays:
    """The arrays, immutable.

    Raises:
        InputError: one has another shape or a number that is not finite, or times do not increase.
    """
    n = len(unchecked.breaks) - 1
    shapes = {
        "breaks": (n + 1,),
        "coef": (n, table.n_vK, polynomial.N_COEF),
        "base": (n, table.n_qK),
        "named": (table.n_vK,),
        "force": (n, table.n_vD, polynomial.N_COEF),
    }
    copies: dict[str, Any] = {}
    for field, shape in shapes.items():
        value = getattr(unchecked, field)
        if value is None and field == "force":
            continue
        copies[field] = frozen(value, bool if field == "named" else float)
        if copies[field].shape != shape:
            raise_input_error(field, f"has the shape {copies[field].shape}; it must be {shape}")
    arrays = unchecked._replace(**copies)
    for field, values in (("coef", arrays.coef[:, arrays.named]), ("force", arrays.force)):
        if values is not None and not np.all(np.isfinite(values)):
            raise_input_error(field, "has a number that is not finite")
    breaks = arrays.breaks
    if n < 1 or not (np.all(np.diff(breaks) > 0) and np.isfinite(breaks).all()):
        raise_input_error("breaks", "must be two or more finite times that increase")
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
        raise_input_error("t", f"has the shape {t.shape}; at least two times are needed")
    n = len(t) - 1
    for field, value, width in (("q_K", q, table.n_qK), ("v_K", v, table.n_vK)):
        if value.shape not in ((width,), (n, width)):
            raise_input_error(
                field, f"has the shape {value.shape}; it must be {(width,)} or {(n, width)}"
            )
    if acc.shape != (n, table.n_vK):
        raise_input_error("acc_K", f"has the shape {acc.shape}; it must be {(n, table.n_vK)}")
    coef, base = pieces.constant_acceleration(table, t, q, v, acc)
    return t, coef, base


def on_breaks(
    table: CoordinateTable,
    arrays: InputArrays,
    end_configurations: tuple[ConfigK, ConfigK],
    breaks: Times,
) -> InputArrays:
    """The arrays with further breaks beside their own, held at ``end_configurations`` outside."""
    before, after = (pieces.constants(table, q_K) for q_K in end_configurations)
    coef, base = Channel(
        arrays.breaks, arrays.coef, arrays.base, before, after, table.scalars_K
    ).on(breaks)
    force = None
    if arrays.force is not None:
        zero_force = np.zeros((table.n_vD, polynomial.N_COEF)), np.zeros(0)
        empty = np.zeros((len(arrays.coef), 0))
        force = Channel(arrays.breaks, arrays.force, empty, zero_force, zero_force).on(breaks)[0]
    return InputArrays(breaks, coef, base, arrays.named, force)


def filled(
    table: CoordinateTable, arrays: InputArrays, mask: MaskRows, q_K: ConfigK
) -> InputArrays:
    """The arrays with the coordinates of ``mask`` (n_vK,) named, and held at q_K."""
    coef, base = np.array(arrays.coef), np.array(arrays.base)
    constant_coef, _ = pieces.constants(table, q_K)
    coef[:, mask] = constant_coef[mask]
    for q_slice, v_slice in pieces.channel_names(table).values():
        if mask[v_slice.start]:
            base[:, q_slice] = q_K[q_slice]
    return arrays._replace(coef=coef, base=base, named=arrays.named | mask)


def at_rest(table: CoordinateTable, breaks: Times, coef: Array, v: VecK) -> Array:
    """The coefficients with small velocities v (2, n_vK) at both ends set to 0."""
    _, max_speed = joints.tolerances(table, breaks[None], coef[None])
    snapped = np.where((np.abs(v) <= max_speed) & (v != 0.0), 0.0, v)
    if np.array_equal(snapped, v):
        return coef
    coef, zero = np.array(coef), np.zeros((1, len(v[0])))
    h = np.diff(breaks)
    first_piece = joints.with_start(table, coef[:1], np.zeros(1), h[:1], zero, snapped[:1])
    coef[:1] = first_piece
    coef[-1:] = joints.with_end(table, coef[-1:], h[-1:], zero, snapped[1:])
    return coef


def force_or_zero(table: CoordinateTable, arrays: InputArrays) -> Array:
    """(n, n_vD, 6) generalised forces; 0 where there are none."""
    if arrays.force is not None:
        return arrays.force
    return np.zeros((len(arrays.coef), table.n_vD, polynomial.N_COEF))


def raise_input_error(field: str, message: str) -> None:
    """Raises an InputError about an argument."""
    raise InputError([Mistake("inputs", None, field, message)])
