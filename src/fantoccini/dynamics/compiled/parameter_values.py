"""Values of parameters that differ from run to run of a batch."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, floats
from fantoccini.base.documents import Parameter
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.kernel.contract import WINCH_AT


def parameter_rows(marionette: CompiledPuppet, values: Mapping[str, Array | float] | None) -> Array:
    """(1 or n, n_p) parameters of every run: the model's own, with those given in their place.

    Args:
        marionette: the puppet.
        values: by name, a number or (n,) numbers.

    Raises:
        UnknownNameError: a name that the puppet does not have.
        StateError: a number that is not finite, or the parameter of a winch, which all share.
        PuppetError: a value out of range.
        ValueError: arrays that are not of one length, or not of numbers.
    """
    given = {name: floats(x) for name, x in (values or {}).items()}
    index, sizes = marionette.parameter_index, {}
    wound = _parameters_of_winches(marionette)
    for name, x in given.items():
        if name not in index:
            raise UnknownNameError("parameter", name, tuple(index))
        if x.ndim > 1 or x.size == 0:
            raise ValueError(f"parameter {name} has the shape {x.shape}; it takes a number or (n,)")
        if not np.all(np.isfinite(x)):
            bad = x[~np.isfinite(x)].flat[0]
            raise StateError(f"parameter {name}: found {bad}; it must be a finite number")
        if name in wound and np.any(x != marionette.p[index[name]]):
            raise StateError(
                f"parameter {name} belongs to the winch of {wound[name]}, which all runs share: "
                f"take marionette.with_parameters({{{name!r}: ...}})"
            )
        if x.ndim:
            sizes[name] = len(x)
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{n} of {name}" for name, n in sizes.items())
        raise ValueError(f"parameters must have one number of values; found {listed}")
    # What a parameter may be is an interval, so its ends speak for all between.
    for end in (np.min, np.max):
        if given:
            marionette.puppet.with_values({name: float(end(x)) for name, x in given.items()})
    rows = np.tile(marionette.p, (next(iter(sizes.values()), 1), 1))
    for name, x in given.items():
        rows[:, index[name]] = x
    return rows


def _parameters_of_winches(marionette: CompiledPuppet) -> dict[str, str]:
    """Name of a parameter that a winch has -> the string."""
    found = {}
    for string in marionette.tree.strings:
        for key in WINCH_AT:
            value = getattr(string, key)
            if isinstance(value, Parameter):
                found[value.parameter] = string.name
    return found
