"""Winches of strings (n_strings, 3): largest tension [N], rewinding speed [m/s], restitution.

A winch changes the length of a string, and slips at its largest tension; restitution is the part of
the speed that a catch gives back.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError, floats
from fantoccini.base.documents import Number, Parameter
from fantoccini.kernel.contract import WINCH_AT
from fantoccini.model.tree import Tree


def winches_of(tree: Tree, p: Array) -> Array:
    """Winches (n_strings, 3) of a puppet file, with these parameters (n_p,)."""
    values = dict(zip(tree.parameters, p.tolist(), strict=True))
    defaults = {"max_tension": np.inf, "rewind_speed": 0.0}

    def number(value: Number) -> float:
        return float(values[value.parameter] if isinstance(value, Parameter) else value)

    table = np.zeros((len(tree.strings), len(WINCH_AT)))
    for row, string in zip(table, tree.strings, strict=True):
        entries = [(name, getattr(string, name)) for name in WINCH_AT]
        row[:] = [defaults[name] if x is None else number(x) for name, x in entries]
    return table


def checked_winches(tree: Tree, winches: Array) -> Array:
    """The winches as an array.

    Raises:
        StateError: a number is not allowed for a winch.
    """
    table, shape = np.array(floats(winches)), (len(tree.strings), len(WINCH_AT))
    if table.shape != shape:
        raise StateError(
            f"winches have the shape {table.shape}; it must be {shape}: largest tension, rewinding "
            "speed and restitution of every string"
        )
    for string, (max_tension, rewind_speed, restitution) in zip(tree.strings, table, strict=True):
        if not (max_tension > 0.0 and 0.0 <= rewind_speed < np.inf and 0.0 <= restitution <= 1.0):
            raise StateError(
                f"winch of {string.name}: found a largest tension of {max_tension:g} N, "
                "rewinding at "
                f"{rewind_speed:g} m/s and a restitution of {restitution:g}; they must be above "
                "0, at "
                "least 0 and finite, and 0 to 1"
            )
    return table
