"""Catches of strings and limits: the rows that an impulse strikes and holds.

A row is a string or a joint limit; at a catch it becomes taut, with an impulse. A saltation
describes how small changes of the state pass this event, and a wire is a string that also pushes.
In names, D stands for dynamic coordinates, which move by the equations of motion, and K for driven
ones: ends and lengths of strings, driven joints. h is the gap of a string, path length minus string
length; hdot and hddot are its rates.
"""

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
    evaluation = Evaluation.at_state(marionette, before)
    wires, n_rows = marionette.two_sided, marionette.tree.n_rows
    was_held, stays_held = np.zeros((2, n_rows), dtype=bool)
    was_held[held[0]] = stays_held[held[1]] = True
    scale = marionette.row_scales(before.q_D, before.q_K)
    is_closed = np.abs(evaluation.h) <= ROW_TOLERANCES.start_gap * scale
    rows = np.flatnonzero(was_held | is_closed | wires)
    restitution = string_restitution(marionette, evaluation)
    closing_speed = (1.0 + restitution) * evaluation.hdot
    solution = evaluation.complementarity(rows, closing_speed[rows], wires)
    is_struck = np.zeros(n_rows, dtype=bool)
    is_struck[rows] = np.abs(solution.x) > RELATIVE_ROUNDING * np.max(
        np.abs(solution.x), initial=0.0
    )
    max_speed = np.max(np.abs(evaluation.hdot[rows]), initial=0.0)
    # Rows held after the catch were stopped by it, even from speeds close to rest.
    rows = np.flatnonzero(is_struck | wires | stays_held)
    zeros = np.zeros((len(before.v_D), 1))
    velocity_jump, held_impulse = KKTSystem(evaluation, rows).solve(
        zeros, closing_speed[rows, None]
    )
    impulse = np.zeros(n_rows)
    impulse[rows] = held_impulse[:, 0]
    caught_rows = np.flatnonzero(
        is_closed & ~was_held & ~wires & (evaluation.hdot > RELATIVE_ROUNDING * max_speed)
    )
    is_near = is_closed & ~was_held & (evaluation.hdot > -ROW_TOLERANCES.rest_speed)
    is_near[caught_rows] = False
    is_near |= stays_held & ~was_held & ~is_struck
    names, derivatives = marionette.tree.row_names, row_derivatives_at(marionette, before)
    saltation = Saltation(
        marionette,
        before,
        evaluation,
        rows,
        (),
        restitution,
        velocity_jump[:, 0],
        impulse,
        [Guard.of_row(derivatives, int(row), evaluation.hdot[row]) for row in caught_rows],
        tuple(names[row] for row in caught_rows),
        [f"{names[row]}: at its bound" for row in np.flatnonzero(is_near)],
    )
    subject = (
        f"catch at t = {before.t:.6g} s cannot be differentiated: its velocities are not those of "
        "the impulse on the strings that it strikes and holds"
    )
    if not solution.solved:
        raise SimulationError(Status.NOT_SETTLED, f"the {subject}")
    saltation.check(after.v_D, subject)
    return saltation
