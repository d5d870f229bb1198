"""Values of parameters that differ from run to run of a batch.

A parameter is a number that a puppet file names; a winch changes the length of a string. A
marionette is a puppet with its compiled equations; `marionette.puppet` is the description in its
file.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, floats
from fantoccini.base.documents import Parameter
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.kernel.contract import WINCH_AT


def parameter_rows(marionette: CompiledPuppet, values: Mapping[str, Array | float] | None) -> Array:
    """Parameters (1 or n, n_p) of every run: the model's own, with some replaced.

    Args:
        marionette: the puppet.
        values: name -> a number or (n,) numbers.

    Raises:
        UnknownNameError: the puppet has no such parameter.
        StateError: a number is not finite, or the parameter belongs to a winch, shared by all runs.
        PuppetError: a value is out of range.
        ValueError: arrays are not of equal length, or not of numbers.
    """
    arrays = {name: floats(x) for name, x in (values or {}).items()}
    index, sizes = marionette.parameter_index, {}
    winch_parameters = _parameters_of_winches(marionette)
    for name, x in arrays.items():
        if name not in index:
            raise UnknownNameError("parameter", name, tuple(index))
        if x.ndim > 1 or x.size == 0:
            raise ValueError(f"parameter {name} has the shape {x.shape}; needed: a number or (n,)")
        if not np.all(np.isfinite(x)):
            wrong_value = x[~np.isfinite(x)].flat[0]
            raise StateError(f"parameter {name}: found {wrong_value}; it must be a finite number")
        if name in winch_parameters and np.any(x != marionette.p[index[name]]):
            raise StateError(
                f"parameter {name} belongs to the winch of {winch_parameters[name]}, which all "
                "runs share: "
                f"use marionette.with_parameters({{{name!r}: ...}})"
            )
        if x.ndim:
            sizes[name] = len(x)
    if len(set(sizes.values())) > 1:
        counts_text = ", ".join(f"{n} of {name}" for name, n in sizes.items())
        raise ValueError(f"parameters must have equal numbers of values; found {counts_text}")
    # The allowed values are an interval: checking both ends is enough.
    for extremum in (np.min, np.max):
        if arrays:
            marionette.puppet.with_values({name: float(extremum(x)) for name, x in arrays.items()})
    rows = np.tile(marionette.p, (next(iter(sizes.values()), 1), 1))
    for name, x in arrays.items():
        rows[:, index[name]] = x
    return rows


def _parameters_of_winches(marionette: CompiledPuppet) -> dict[str, str]:
    """Name of a parameter of a winch -> name of its string."""
    owners = {}
    for string in marionette.tree.strings:
        for key in WINCH_AT:
            value = getattr(string, key)
            if isinstance(value, Parameter):
                owners[value.parameter] = string.name
    return owners
