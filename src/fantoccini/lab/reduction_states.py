"""Configurations and drives for :mod:`fantoccini.lab.reduction`, which checks the paper's Sec. VI.

q_D are the dynamic coordinates and q_K the driven ones: ends and lengths of strings, driven joints.
A row is a string with its gap (path length minus string length).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, Mistake, PuppetError, moved
from fantoccini.dynamics.compiled import refuse_contact
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

Rows = NDArray[np.intp]
"""Indices of strings."""

POSE_SPREAD = 0.25
"""Standard deviation of random moves from the file's pose [rad, mean string lengths]."""
MAX_ITERATIONS = 50
"""Newton iterations of :func:`fit_strings`."""
MAX_GAP = 1e-12
"""Largest gap of a fitted string, relative to its length."""
GYRATION_RADIUS = 0.1
"""Radius of gyration of a rotary drive, relative to the mean string length."""


def without_drives(marionette: Marionette) -> Marionette:
    """The puppet with inputs in place of its drives; raises as :func:`validate_reduction`."""
    refuse_contact(marionette, "reduction")
    puppet, progress = marionette.current_puppet, marionette.libraries.progress
    mixed = Marionette(puppet.model_copy(update={"drives": ()}), progress)
    if mixed.coordinates.n_vK == 0:
        file, _ = puppet.locate(puppet.name)
        raise PuppetError(
            [
                Mistake(
                    file,
                    None,
                    "",
                    "no coordinate is driven, so there is no mechanism to reduce; "
                    "give a string `length: driven` or an end `driven: [x]`, or a joint "
                    "`driven: true`",
                )
            ]
        )
    return mixed


def drive_inertia(mixed: Marionette, ratio: float = 1.0) -> tuple[float, float]:
    """Mass of a drive, ``ratio`` times the puppet's [kg]; inertia of a rotary drive [kg m^2]."""
    mass = ratio * (mixed.mass or 1.0)
    return mass, mass * (GYRATION_RADIUS * mean_length(mixed)) ** 2


def mean_length(marionette: Marionette) -> float:
    """Mean string length in the file's pose [m]; 1 without strings."""
    x = marionette.state()
    lengths = marionette.string_lengths(x.q_D, x.q_K)
    return float(np.mean(lengths)) if len(lengths) else 1.0


def in_metres(marionette: Marionette) -> NDArray[np.bool_]:
    """(n_vD + n_vK,) mask of the velocities in m/s; the others are in rad/s."""
    table = marionette.coordinates
    lengths = {row.name for row in table.rows if row.unit == "m"}
    return np.array([name in lengths for name in (*table.v_D, *table.v_K)], dtype=bool)


def random_states(marionette: Marionette, n: int, rng: np.random.Generator) -> list[State]:
    """n states with every joint displaced at random, by a standard deviation of 1 rad or 1 m.

    Strings are ignored.
    """
    x, size = marionette.state(), marionette.coordinates.n_vD + marionette.coordinates.n_vK
    return [displaced(marionette, x, rng.normal(size=size)) for _ in range(n)]


def taut_states(
    marionette: Marionette, n: int, rng: np.random.Generator
) -> list[tuple[State, Rows]]:
    """Up to n states near the file's pose, each with its taut strings.

    All strings are taut in states of even index, a random subset in those of odd index.
    """
    x, n_strings = marionette.state(), len(marionette.tree.strings)
    spread = POSE_SPREAD * np.where(in_metres(marionette), mean_length(marionette), 1.0)
    states = []
    for k in range(n if n_strings else 0):
        rows: Rows = np.arange(n_strings)
        if k % 2:
            rows = np.flatnonzero(rng.random(n_strings) < 0.5)
            rows = rows if len(rows) else rng.integers(n_strings, size=1)
        nearby = displaced(marionette, x, spread * rng.normal(size=spread.shape))
        if (state := fit_strings(marionette, nearby)) is not None:
            states.append((state, rows))
    return states


def fit_strings(marionette: Marionette, x: State) -> State | None:
    """A configuration near x with every string at its length; None if Newton's method fails.

    Driven lengths are set; for strings of fixed length, all coordinates make the smallest move.
    """
    strings = marionette.tree.strings
    fixed = [i for i, s in enumerate(strings) if s.length_index is None]
    for _ in range(MAX_ITERATIONS):
        h = marionette.constraint(x)
        scales = marionette.row_scales(x.q_D, x.q_K)[fixed]
        if np.all(np.abs(h[fixed]) <= MAX_GAP * scales):
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


def displaced(marionette: Marionette, x: State, displacement: Array) -> State:
    """x displaced by a tangent vector (n_vD + n_vK,), dynamic part first."""
    table = marionette.coordinates
    q_D = moved(table.scalars_D, table.quaternions_D, x.q_D, displacement[: table.n_vD])
    q_K = moved(table.scalars_K, table.quaternions_K, x.q_K, displacement[table.n_vD :])
    return x.replace(q_D=q_D, q_K=q_K)


def metric(marionette: Marionette, x: State, inertia: Array | float = 0.0) -> Array:
    """M over (v_D, v_K), (n_vD + n_vK)^2; ``inertia`` (n_vK,) of the drives [kg or kg m^2]."""
    M = marionette.equations["mass_matrix"](q_D=x.q_D, q_K=x.q_K, p=marionette.p)
    M_DK, M_KK = np.array(M["M_DK"]), np.array(M["M_KK"])
    J = np.diag(np.broadcast_to(inertia, len(M_KK)))
    return np.block([[np.array(M["M"]), M_DK], [M_DK.T, M_KK + J]])
