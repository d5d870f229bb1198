"""Random configurations of a puppet: any, and on its strings. Nothing is compiled for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.motion.tangent import moved


@dataclass(frozen=True)
class _Sampling:
    """How configurations are drawn.

    Attributes:
        anywhere: standard deviation of moves, strings ignored [rad, m].
        near: the same near the file's pose; lengths relative to the mean string length.
        max_iterations: of Newton's method that fits strings.
        max_gap: of a fitted string, relative to its length.
    """

    anywhere: float = 1.0
    near: float = 0.25
    max_iterations: int = 50
    max_gap: float = 1e-12


_SAMPLING = _Sampling()


def start(marionette: Marionette) -> State:
    """The file's pose at zero velocity; a driven length without a value makes its string taut."""
    table = marionette.coordinates
    tree, q_K = marionette.tree, np.nan_to_num(table.start_K, nan=0.0)
    x = State(
        0.0, table.start_D, np.zeros(table.n_vD), q_K, np.zeros(table.n_vK),
        np.zeros(tree.n_rows, dtype=bool), np.zeros(len(tree.strings)), table,
    )  # fmt: skip
    h, q_K = marionette.constraint(x), x.q_K.copy()
    for i, string in enumerate(tree.strings):
        if string.length_index and np.isnan(table.start_K[string.length_index[0]]):
            q_K[string.length_index[0]] = h[i]
    return x.replace(q_K=q_K)


def random_states(marionette: Marionette, n: int, rng: np.random.Generator) -> list[State]:
    """n states at zero velocity with every joint displaced at random; strings are ignored."""
    x, table = start(marionette), marionette.coordinates
    size = table.n_vD + table.n_vK
    return [displaced(marionette, x, rng.normal(size=size) * _SAMPLING.anywhere) for _ in range(n)]


def taut_states(
    marionette: Marionette, n: int, rng: np.random.Generator
) -> list[tuple[State, NDArray[np.intp]]]:
    """States near the file's pose with taut strings, and the rows of those.

    All strings are taut in half of the states, some in the others.
    """
    tree, x = marionette.tree, start(marionette)
    n_s, table = len(tree.strings), marionette.coordinates
    if n_s == 0:
        return []
    size = float(np.mean(marionette.model.string_lengths(x.q_D, x.q_K))) or 1.0
    units = {row.name: row.unit for row in table.rows}
    spread = np.full(table.n_vD + table.n_vK, _SAMPLING.near)
    scalars = [(table.q_D[q], v) for q, v in table.scalars_D]
    scalars += [(table.q_K[q], table.n_vD + v) for q, v in table.scalars_K]
    for name, v in scalars:
        spread[v] *= size if units[name] == "m" else 1.0
    found = []
    for k in range(n):
        rows: NDArray[np.intp] = np.arange(n_s)
        if k % 2:
            rows = np.flatnonzero(rng.random(n_s) < 0.5)
            rows = rows if len(rows) else rng.integers(n_s, size=1)
        near = displaced(marionette, x, spread * rng.normal(size=spread.shape))
        if (fitted := fit_strings(marionette, near)) is not None:
            found.append((fitted, rows))
    return found


def fit_strings(marionette: Marionette, x: State) -> State | None:
    """A configuration near x with every string at its length; None if none is found.

    Driven lengths are set; for strings of fixed length, all coordinates make the smallest move.
    """
    strings = marionette.tree.strings
    fixed = [i for i, s in enumerate(strings) if s.length_index is None]
    for _ in range(_SAMPLING.max_iterations):
        h = marionette.constraint(x)
        scales = marionette.model.row_scales(x.q_D, x.q_K)[fixed]
        if np.all(np.abs(h[fixed]) <= _SAMPLING.max_gap * scales):
            break
        A = np.hstack([marionette.A_D(x), marionette.A_K(x)])[fixed]
        x = displaced(marionette, x, -np.linalg.pinv(A) @ h[fixed])
    else:
        return None
    h, q_K = marionette.constraint(x), x.q_K.copy()
    for i, string in enumerate(strings):
        if string.length_index:
            q_K[string.length_index[0]] += h[i]
    return x.replace(q_K=q_K)


def displaced(marionette: Marionette, x: State, move: Array) -> State:
    """x displaced by a tangent vector (n_vD + n_vK,), dynamic part first."""
    table = marionette.coordinates
    q_D = moved(table.scalars_D, table.quaternions_D, x.q_D, move[: table.n_vD])
    q_K = moved(table.scalars_K, table.quaternions_K, x.q_K, move[table.n_vD :])
    return x.replace(q_D=q_D, q_K=q_K)
