"""Random configurations of a puppet: anywhere, and on its strings. Nothing is compiled for them."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.motion.tangent import moved

_SPREAD = 1.0
"""Size of the moves that lead anywhere [rad, m]."""
_NEAR = 0.25
"""Size of the moves that stay near the file's pose, over the mean length of the strings where they
are lengths [1]."""
_ROUNDS = 50
_ON = 1e-12
"""Distance to a string's length that counts as none, over the length."""


def start(marionette: Marionette) -> State:
    """The file's pose at rest; driven lengths without a value just reach."""
    table = marionette.coordinates
    x = _at_rest(marionette, table.start_D, np.nan_to_num(table.start_K, nan=0.0))
    h, q_K = marionette.constraint(x), x.q_K.copy()
    for i, string in enumerate(marionette.tree.strings):
        if string.length_index and np.isnan(table.start_K[string.length_index[0]]):
            q_K[string.length_index[0]] = h[i]
    return x.replace(q_K=q_K)


def anywhere(marionette: Marionette, n: int, rng: np.random.Generator) -> list[State]:
    """n states at rest with every joint moved at random; strings are not looked at."""
    x, table = start(marionette), marionette.coordinates
    return [
        turned(marionette, x, rng.normal(size=table.n_vD + table.n_vK) * _SPREAD)
        for _ in range(n)
    ]  # fmt: skip


def on_strings(
    marionette: Marionette, n: int, rng: np.random.Generator
) -> list[tuple[State, Array]]:
    """States near the file's pose with taut strings, and the rows (int) of those.

    Driven lengths are made to fit; where lengths are numbers the configuration is. In half of the
    states all strings are taut, in the others some.
    """
    tree, x = marionette.tree, start(marionette)
    n_s, table = len(tree.strings), marionette.coordinates
    if n_s == 0:
        return []
    size = float(np.mean(marionette.model.string_lengths(x.q_D, x.q_K))) or 1.0
    units = {row.name: row.unit for row in table.rows}
    spread = np.full(table.n_vD + table.n_vK, _NEAR)
    for first, names, places in (
        (0, table.q_D, table.scalars_D),
        (table.n_vD, table.q_K, table.scalars_K),
    ):
        for q, v in places:
            spread[first + v] *= size if units[names[q]] == "m" else 1.0
    found = []
    for k in range(n):
        some = np.arange(n_s)
        if k % 2:
            some = np.flatnonzero(rng.random(n_s) < 0.5)
            some = some if len(some) else rng.integers(n_s, size=1)
        made = fitted(marionette, turned(marionette, x, spread * rng.normal(size=spread.shape)))
        if made is not None:
            found.append((made, some))
    return found


def fitted(marionette: Marionette, x: State) -> State | None:
    """A configuration near x with every string at its length; None where there is none near.

    Driven lengths are set; for the others all coordinates move, as little as they can.
    """
    strings = marionette.tree.strings
    firm = [i for i, s in enumerate(strings) if s.length_index is None]
    for _ in range(_ROUNDS):
        h = marionette.constraint(x)
        if np.all(np.abs(h[firm]) <= _ON * marionette.model.row_scales(x.q_D, x.q_K)[firm]):
            break
        A = np.hstack([marionette.A_D(x), marionette.A_K(x)])[firm]
        x = turned(marionette, x, -np.linalg.pinv(A) @ h[firm])
    else:
        return None
    h, q_K = marionette.constraint(x), x.q_K.copy()
    for i, string in enumerate(strings):
        if string.length_index:
            q_K[string.length_index[0]] += h[i]
    return x.replace(q_K=q_K)


def turned(marionette: Marionette, x: State, move: Array) -> State:
    """x moved by a tangent vector (n_vD + n_vK,), dynamic part first."""
    table = marionette.coordinates
    q_D = moved(table.scalars_D, table.quaternions_D, x.q_D, move[: table.n_vD])
    q_K = moved(table.scalars_K, table.quaternions_K, x.q_K, move[table.n_vD :])
    return x.replace(q_D=q_D, q_K=q_K)


def _at_rest(marionette: Marionette, q_D: Array, q_K: Array) -> State:
    table, tree = marionette.coordinates, marionette.tree
    return State(
        0.0, q_D, np.zeros(table.n_vD), q_K, np.zeros(table.n_vK),
        np.zeros(tree.n_rows, dtype=bool), np.zeros(len(tree.strings)), table,
    )  # fmt: skip
