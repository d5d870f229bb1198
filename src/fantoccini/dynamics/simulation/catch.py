"""Catches of strings and limits: the rows that an impulse strikes and holds."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Indices, SimulationError, Status
from fantoccini.dynamics.compiled import ROW_TOLERANCES, Evaluation
from fantoccini.dynamics.derivatives import KKTSystem, row_derivatives_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.saltation import (
    RELATIVE_ROUNDING,
    Guard,
    Saltation,
    string_restitution,
)
from fantoccini.motion import State


def catch_at(
    marionette: Marionette, before: State, after: State, held: tuple[Indices, Indices]
) -> Saltation:
    """Saltation of a catch of a run.

    Args:
        marionette: the puppet.
        before, after: states on its two sides.
        held: rows taut before, and after.

    Raises:
        SimulationError: the run's velocities do not satisfy the equations of the impulse.
    """
    at = Evaluation.of(marionette, before)
    wires, n_rows = marionette.two_sided, marionette.tree.n_rows
    was, stays = np.zeros((2, n_rows), dtype=bool)
    was[held[0]] = stays[held[1]] = True
    scale = marionette.row_scales(before.q_D, before.q_K)
    closed = np.abs(at.h) <= ROW_TOLERANCES.start_gap * scale
    rows = np.flatnonzero(was | closed | wires)
    restitution = string_restitution(marionette, at)
    stopped = (1.0 + restitution) * at.hdot
    solution = at.complementarity(rows, stopped[rows], wires)
    strikes = np.zeros(n_rows, dtype=bool)
    strikes[rows] = np.abs(solution.x) > RELATIVE_ROUNDING * np.max(np.abs(solution.x), initial=0.0)
    fast = np.max(np.abs(at.hdot[rows]), initial=0.0)
    # Rows held after the catch were stopped by it, even from speeds close to rest.
    rows = np.flatnonzero(strikes | wires | stays)
    zeros = np.zeros((len(before.v_D), 1))
    kick, own = KKTSystem(at, rows).solve(zeros, stopped[rows, None])
    impulse = np.zeros(n_rows)
    impulse[rows] = own[:, 0]
    caught = np.flatnonzero(closed & ~was & ~wires & (at.hdot > RELATIVE_ROUNDING * fast))
    near = closed & ~was & (at.hdot > -ROW_TOLERANCES.rest_speed)
    near[caught] = False
    near |= stays & ~was & ~strikes
    names, by = marionette.tree.row_names, row_derivatives_at(marionette, before)
    saltation = Saltation(
        marionette,
        before,
        at,
        rows,
        (),
        restitution,
        kick[:, 0],
        impulse,
        [Guard.of_row(by, int(row), at.hdot[row]) for row in caught],
        tuple(names[row] for row in caught),
        [f"{names[row]}: at its bound" for row in np.flatnonzero(near)],
    )
    what = (
        f"catch at t = {before.t:.6g} s cannot be differentiated: its velocities are not those of "
        "the impulse on the strings that it strikes and holds"
    )
    if not solution.solved:
        raise SimulationError(Status.NOT_SETTLED, f"the {what}")
    saltation.check(after.v_D, what)
    return saltation
