"""States at rest, written by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from fantoccini import tree
from fantoccini.errors import StateError
from fantoccini.marionette import values_by_name
from fantoccini.marionette.model import Model
from fantoccini.motion import State


def state(model: Model, values: Mapping[str, float | Iterable[float]] | None = None) -> State:
    """A state at rest: the file's pose with some values changed.

    Driven lengths that neither the pose nor ``values`` name are those that just reach, and
    commands of drives are where their coordinates are, at rest.

    Args:
        model: the puppet.
        values: coordinate name -> value; ``joint.rotation`` takes a quaternion (w, x, y, z)
            or a rotation vector; ``v:NAME`` sets a velocity. Angles may be ``30 deg``.
    """
    if values is not None and not isinstance(values, Mapping):
        raise StateError(
            f"found {values!r}; a state is given as names and values: {{'hand.length': 0.8}}"
        )
    table = model.coordinates
    q_D, q_K = table.start_D.copy(), table.start_K.copy()
    v_D, v_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
    for name, value in (values or {}).items():
        values_by_name.put(table, name, value, q_D, v_D, q_K, v_K)
    # The masses of chains lie between the ends of this state, not of the file's pose.
    q_D, q_K = tree.placed(model.tree, q_D, q_K, model.number, frozenset(values or ()))
    if np.any(np.isnan(q_K)) or np.any(np.isnan(q_D)):
        places = {"q_D": np.nan_to_num(q_D), "q_K": np.nan_to_num(q_K)}
        h = model.library.evaluate("rows", **places, p=model.p).h
        for string, span in zip(model.tree.strings, h, strict=False):
            string.just_reaches(span, q_D, q_K)
    values_by_name.put_commands(model.tree.drives, values or {}, q_D, q_K)
    taut, slip = np.zeros(model.tree.n_rows, dtype=bool), np.zeros(len(model.tree.strings))
    return State(0.0, q_D, v_D, q_K, v_K, taut, slip, table)
