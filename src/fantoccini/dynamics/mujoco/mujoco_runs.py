"""Simulation in MuJoCo, returned as a trajectory.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings, driven
joints), v and acc their rates. The ledger is the table of energies and work, and breaks are the
times at which pieces of an input meet. A row of the tree describes a string, limit, spring or
drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, ConfigD, ConfigK, Status, Times, VecD, VecK
from fantoccini.dynamics.compiled import bind_input, check_start, checked_end
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.mujoco.mujoco_puppet import MuJoCoPuppet
from fantoccini.motion import LEDGER, SAME_TIME, Columns, Input, State, Trajectory

_STEP_ROUNDING = 1e-6
"""Remainder beyond a whole number of steps that is rounding, and adds no step [steps]."""


class _Motion(NamedTuple):
    """The first fields of a trajectory, in the same order, with a sample per step."""

    t: Times
    q_D: ConfigD
    v_D: VecD
    acc_D: VecD
    q_K: ConfigK
    v_K: VecK
    acc_K: VecK


def mujoco_run(
    marionette: Marionette,
    x0: State,
    inputs: Input,
    t_end: float,
    dt: float,
    text: str | None = None,
) -> Trajectory:
    """Simulates a puppet in MuJoCo with the Runge-Kutta method of order 4.

    Driven coordinates are set at every step; within a step their accelerations and the user forces
    are constant. Strings and limits are soft: ``violation`` shows how far they give. The trajectory
    has no events; its ledger, the table of energies, has nan for losses and work.

    Args:
        marionette: the puppet.
        x0: start state.
        inputs: motion of the driven coordinates, and user forces; steps end at the inputs' breaks.
        t_end: end of the run [s].
        dt: length of the longest step [s].
        text: MJCF text; see :class:`MuJoCoPuppet`.

    Returns:
        The trajectory with a sample per step; it ends before the first sample that is not finite.

    Raises:
        ExchangeError: MuJoCo cannot model a part of the puppet.
        MissingLibraryError: MuJoCo is not installed.
        StateError: ``x0`` violates a string or limit.
    """
    check_start(marionette, x0, "timestepping")
    t_end = checked_end(t_end, x0.t)
    puppet = MuJoCoPuppet(marionette, dt, text)
    data = puppet.data
    t = _step_times(x0.t, t_end, inputs.breaks, dt)
    bound = bind_input(marionette, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    q_K, v_K, acc_K = bound.evaluate(t)
    h = np.diff(t)
    u_D = inputs.evaluate_force(np.append(t[:-1] + 0.5 * h, t[-1]))
    mean_acc = np.concatenate([np.diff(v_K, axis=0) / h[:, None], acc_K[-1:]])
    puppet.set_dynamic(x0.q_D, x0.v_D)
    dynamic_samples: list[Array] = []
    tensions: list[Array] = []
    limit_forces: list[Array] = []
    for k in range(len(t)):
        puppet.set_driven(q_K[k], v_K[k], mean_acc[k])
        data.qfrc_applied[puppet.v_D] = u_D[k]
        state = np.concatenate([data.qpos[puppet.q_D], data.qvel[puppet.v_D]])
        if not np.all(np.isfinite(state)):
            break
        puppet.evaluate()
        dynamic_samples.append(np.concatenate([state, data.qacc[puppet.v_D]]))
        tension, limit_force = puppet.forces()
        tensions.append(tension)
        limit_forces.append(limit_force)
        if k < len(h):
            puppet.model.opt.timestep = h[k]
            puppet.step()
    n, table = len(dynamic_samples), marionette.coordinates
    split_at = np.cumsum([table.n_qD, table.n_vD])
    q_D, v_D, acc_D = np.split(np.array(dynamic_samples), split_at, axis=1)
    motion = _Motion(t[:n], q_D, v_D, acc_D, q_K[:n], v_K[:n], acc_K[:n])
    status = Status.DONE if n == len(t) else Status.NOT_FINITE
    return _trajectory(marionette, motion, np.array(tensions), np.array(limit_forces), status)


def _step_times(start: float, end: float, breaks: Times, dt: float) -> Times:
    """Times from start to end with all breaks between, at most ``dt`` apart."""
    inner_breaks = breaks[(breaks > start + SAME_TIME) & (breaks < end - SAME_TIME)]
    interval_ends = np.concatenate([[start], inner_breaks, [end]])
    pieces = [
        np.linspace(a, b, int(np.ceil((b - a) / dt - _STEP_ROUNDING)), endpoint=False)
        for a, b in pairwise(interval_ends)
    ]
    return np.append(np.concatenate(pieces), end)


def _trajectory(
    marionette: Marionette, motion: _Motion, tension: Array, limit_force: Array, status: Status
) -> Trajectory:
    """The trajectory of a motion, with its energies and violations."""
    tree, n = marionette.tree, len(motion.t)
    strings, limits = (tuple(row.name for row in rows) for rows in (tree.strings, tree.limits))
    configuration = {"q_D": motion.q_D, "q_K": motion.q_K, "p": marionette.p}
    library = marionette.library
    energy = library.evaluate("energy", **configuration, v_D=motion.v_D, v_K=motion.v_K)
    ledger = np.full((n, len(LEDGER)), np.nan)
    ledger[:, LEDGER.index("kinetic")] = energy.T
    ledger[:, LEDGER.index("potential")] = energy.V
    h = library.evaluate("rows", **configuration).h
    violation = np.where(marionette.two_sided, np.abs(h), np.maximum(h, 0.0))
    return Trajectory(
        *motion,
        tension=Columns(strings, tension, "string"),
        limit_force=Columns(limits, limit_force, "limit"),
        taut=Columns(strings, tension != 0.0, "string"),
        ledger=Columns(LEDGER, ledger, "entry"),
        events=(),
        status=status,
        method="mujoco",
        coordinates=marionette.coordinates,
        puppet=marionette.current_puppet,
        violation=Columns(tree.row_names, violation, "string or limit"),
        slip=Columns(strings, np.zeros((n, len(strings))), "string"),
    )
