"""Message about drives that lost steps or ran away: loads, and torques of their motors.

A drive moves a coordinate by a motor towards its command. It loses steps if a stepper motor lags
too far, and runs away if its load moves it far from its commands. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints. A taut string pulls, a slack one does not. A row of the tree describes a
string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

import math

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import DirectCurrent
from fantoccini.model.tree import DriveRow
from fantoccini.motion import Trajectory

N_SAMPLES = 8
"""Number of samples, spread over the run before the first failure, at which loads are computed."""
MAX_NAMED = 4
"""Maximum number of drives named in a message."""


def weak_motors_message(marionette: Marionette, run: Trajectory) -> str:
    """Time, error and required torque of drives that lost steps or ran away; "" without any."""
    overloads = run.overloads
    rows = {row.name: row for row in marionette.tree.watched if row.name in overloads}
    if not rows:
        return ""
    loads = _loads(marionette, run, min(overloads[name].since for name in rows))
    texts = []
    for name in list(rows)[:MAX_NAMED]:
        row, overload, load = rows[name], overloads[name], loads[name]
        unit = "m" if _is_linear(row) else "rad"
        failure = "ran away" if overload.ran_away else "lost steps"
        error = overload.error
        error_text = "" if error is None else f", {abs(error):.3g} {unit} off at the end of the run"
        force = "N" if _is_linear(row) and row.drive.drum is None else "N m"
        max_torque = _max_torque(marionette, row)
        cause = f"it needs {load:.3g} {force} to follow the command, "
        if row.drive.motor is None:
            cause += "but its controller requests too little"
        elif load > max_torque:
            cause += f"its motor has {max_torque:.3g} {force}"
        else:
            cause += (
                f"its motor has {max_torque:.3g} {force}, too little when strings come taut or "
                "loads accelerate"
            )
            if not row.has_stepper:
                cause += ", or its controller requests too little"
        texts.append(f"{name} {failure} from t = {overload.since:.6g} s on{error_text}: {cause}")
    if len(rows) > MAX_NAMED:
        texts.append(f"{len(rows) - MAX_NAMED} more")
    advice = "use stronger motors, higher gear ratios, stiffer control or slower motions"
    return "".join(f"; {text}" for text in texts) + f"; {advice}"


def _is_linear(row: DriveRow) -> bool:
    """Whether a drive's coordinate is a length."""
    return row.drive.drum is not None or row.drive.mass is not None


def _max_torque(marionette: Marionette, row: DriveRow) -> float:
    """Largest torque or force of a motor at rest [N m or N]."""
    motor, number = row.drive.motor, marionette.number
    if motor is None:
        return math.inf
    if not isinstance(motor, DirectCurrent):
        return number(motor.torque)
    max_current = min(number(motor.current), number(motor.voltage) / number(motor.resistance))
    return number(motor.constant) * max_current


def _loads(marionette: Marionette, run: Trajectory, end: float) -> dict[str, float]:
    """Drive -> largest load that it would have had until a time, following its command [N m or N].

    The loads f are the forces of the drives in

        M acc + M_DK acc_K + c + A_D^T tension = S f,   S^T acc = accelerations of the commands

    with the constraints of the strings and limits that were taut in the run.
    """
    n_samples = max(1, int(np.searchsorted(run.t, end)))
    samples = np.unique(np.linspace(0, n_samples - 1, min(n_samples, N_SAMPLES)).astype(int))
    commanded_rows = [row for row in marionette.tree.drives if row.command is not None]
    largest = np.max([np.abs(_forces(marionette, run, i, commanded_rows)) for i in samples], axis=0)
    load_by_name, start = {}, 0
    for row in commanded_rows:
        width = row.v.stop - row.v.start
        load = float(np.linalg.norm(largest[start : start + width]))
        load_by_name[row.name] = load / row.ratio(marionette.number)
        start += width
    return load_by_name


def _forces(marionette: Marionette, run: Trajectory, i: int, drives: list[DriveRow]) -> Array:
    """Forces that drives need to follow their commands at sample ``i`` of a run.

    The suffixes D and K are those of dynamic and driven (kinematic) coordinates.
    """
    x, acc_K, n = run.state(i), run.acc_K[i], marionette.coordinates.n_vD
    indices = np.array([k for row in drives for k in range(row.v.start, row.v.stop)])
    commanded_acc = np.array(
        [
            acc_K[row.command[1] + k]
            for row in drives
            if row.command is not None
            for k in range(row.v.stop - row.v.start)
        ]
    )
    A = marionette.A_D(x)[x.taut]
    constraint_bias = (marionette.Adot_v(x) + marionette.A_K(x) @ acc_K)[x.taut]
    force_bias = marionette.bias(x) + marionette.damping(x) + marionette.mass_matrix_DK(x) @ acc_K
    selection, m, k = np.eye(n)[:, indices], len(A), len(indices)
    system = np.block(
        [
            [marionette.mass_matrix(x), A.T, -selection],
            [A, np.zeros((m, m)), np.zeros((m, k))],
            [selection.T, np.zeros((k, m)), np.zeros((k, k))],
        ]
    )
    right_side = np.concatenate([-force_bias, -constraint_bias, commanded_acc])
    # With redundant strings, least squares give the solution of least norm.
    return np.linalg.lstsq(system, right_side, rcond=1e-12)[0][n + m :]
