"""Messages on drives that lost steps or ran away: loads and torques of their motors."""

from __future__ import annotations

import math

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import DirectCurrent
from fantoccini.model.tree import DriveRow
from fantoccini.motion import Trajectory

N_SAMPLES = 8
"""Number of samples before a motor's failure at which its load is computed."""
MAX_NAMED = 4
"""Maximum number of drives named in a message."""


def weak_motors(marionette: Marionette, run: Trajectory) -> str:
    """Message on drives that lost steps or ran away: time, error and required torque; may be ""."""
    by_name = run.overloads
    rows = {row.name: row for row in marionette.tree.watched if row.name in by_name}
    if not rows:
        return ""
    loads = _loads(marionette, run, min(by_name[name].since for name in rows))
    texts = []
    for name in list(rows)[:MAX_NAMED]:
        row, overload, load = rows[name], by_name[name], loads[name]
        unit = "m" if _is_linear(row) else "rad"
        failure = "ran away" if overload.ran_away else "lost steps"
        error = overload.error
        error_text = "" if error is None else f", {abs(error):.3g} {unit} error at the end"
        force = "N" if _is_linear(row) and row.drive.drum is None else "N m"
        max_torque = _max_torque(marionette, row)
        cause = f"its load needs {load:.3g} {force} to follow the command, "
        if row.drive.motor is None:
            cause += "and its controller requests too little"
        elif load > max_torque:
            cause += f"its motor has {max_torque:.3g}"
        else:
            cause += f"its motor has {max_torque:.3g} and yields at catches and accelerations"
            if not row.steps:
                cause += ", or its controller requests too little"
        texts.append(f"{name} {failure} from t = {overload.since:.6g} s on{error_text}: {cause}")
    if len(rows) > MAX_NAMED:
        texts.append(f"{len(rows) - MAX_NAMED} more")
    advice = "give them stronger motors, more gear, stiffer control or easier motions"
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
    largest = min(number(motor.current), number(motor.voltage) / number(motor.resistance))
    return number(motor.constant) * largest


def _loads(marionette: Marionette, run: Trajectory, before: float) -> dict[str, float]:
    """Drive -> largest load at samples before a time, if it followed its command [N m or N].

    The load is f in  M acc + M_DK acc_K + c + A_D^T tension = S f,  with S^T acc the commands'
    accelerations, and with the taut rows of the run.
    """
    last = max(1, int(np.searchsorted(run.t, before)))
    samples = np.unique(np.linspace(0, last - 1, min(last, N_SAMPLES)).astype(int))
    following = [row for row in marionette.tree.drives if row.command is not None]
    largest = np.max([np.abs(_forces(marionette, run, i, following)) for i in samples], axis=0)
    by_name, at = {}, 0
    for row in following:
        width = row.v.stop - row.v.start
        size = float(np.linalg.norm(largest[at : at + width]))
        by_name[row.name] = size / row.ratio(marionette.number)
        at += width
    return by_name


def _forces(marionette: Marionette, run: Trajectory, i: int, following: list[DriveRow]) -> Array:
    """Forces with which drives follow their commands at sample ``i`` of a run."""
    x, acc_K, n = run.state(i), run.acc_K[i], marionette.coordinates.n_vD
    places = np.array([k for row in following for k in range(row.v.start, row.v.stop)])
    commanded = np.array(
        [
            acc_K[row.command[1] + k]
            for row in following
            if row.command is not None
            for k in range(row.v.stop - row.v.start)
        ]
    )
    A = marionette.A_D(x)[x.taut]
    bias = (marionette.Adot_v(x) + marionette.A_K(x) @ acc_K)[x.taut]
    load = marionette.bias(x) + marionette.damping(x) + marionette.mass_matrix_DK(x) @ acc_K
    S, m, k = np.eye(n)[:, places], len(A), len(places)
    zero = np.zeros
    system = np.block(
        [
            [marionette.mass_matrix(x), A.T, -S],
            [A, zero((m, m)), zero((m, k))],
            [S.T, zero((k, m)), zero((k, k))],
        ]
    )
    right_side = np.concatenate([-load, -bias, commanded])
    # With redundant strings, least squares give the solution of least norm.
    return np.linalg.lstsq(system, right_side, rcond=1e-12)[0][n + m :]
