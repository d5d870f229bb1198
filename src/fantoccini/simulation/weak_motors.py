"""What a run's motors would have had to give: in words, for a run that they were too weak for."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.puppet import DirectCurrent
from fantoccini.tree import DriveRow

_ROWS = 8
"""Rows before a motor gave way at which its load is asked for."""
_NAMED = 4
"""Drives that are told of one by one."""


def too_weak(marionette: Marionette, run: Trajectory) -> str:
    """Which drives lost steps or ran away, when, by how much, and the torque that would hold.

    Empty where none did.
    """
    found = run.overloads
    rows = {row.name: row for row in marionette.tree.watched if row.name in found}
    if not rows:
        return ""
    loads = _loads(marionette, run, min(found[name].since for name in rows))
    said = []
    for name in list(rows)[:_NAMED]:
        row, what, load = rows[name], found[name], loads[name]
        unit = "m" if _moves(row) else "rad"
        did = "ran away" if what.ran_away else "lost steps"
        where = "" if what.error is None else f", {abs(what.error):.3g} {unit} off at the end"
        force = "N" if _moves(row) and row.drive.drum is None else "N m"
        has = _most(marionette, row)
        need = f"its load takes {load:.3g} {force} to follow the command, its motor has {has:.3g}"
        if load <= has:
            need += " and gives way to catches and accelerations"
        said.append(f"{name} {did} from t = {what.since:.6g} s on{where}: {need}")
    if len(rows) > _NAMED:
        said.append(f"{len(rows) - _NAMED} more")
    advice = "give them stronger motors or more gear, or inputs that ask for less"
    return "".join(f"; {text}" for text in said) + f"; {advice}"


def _moves(row: DriveRow) -> bool:
    """Whether a drive's coordinate is a length."""
    return row.drive.drum is not None or row.drive.mass is not None


def _most(marionette: Marionette, row: DriveRow) -> float:
    """The largest torque or force of a motor at rest [N m or N]."""
    motor, number = row.drive.motor, marionette.model.number
    if not isinstance(motor, DirectCurrent):
        return number(motor.torque)
    most = min(number(motor.current), number(motor.voltage) / number(motor.resistance))
    return number(motor.constant) * most


def _loads(marionette: Marionette, run: Trajectory, before: float) -> dict[str, float]:
    """By drive, the most that its motor has to give for the command to be followed [N m or N].

    That is f of  M acc + M_DK acc_K + c + A_D^T tension = S f,  with the accelerations S^T acc
    those of the commands and the taut rows as they are, at rows of the run before a time.
    """
    last = max(1, int(np.searchsorted(run.t, before)))
    rows = np.unique(np.linspace(0, last - 1, min(last, _ROWS)).astype(int))
    led = [row for row in marionette.tree.drives if row.command is not None]
    most = np.max([np.abs(_forces(marionette, run, i, led)) for i in rows], axis=0)
    found, at = {}, 0
    for row in led:
        width = row.v.stop - row.v.start
        size = float(np.linalg.norm(most[at : at + width]))
        found[row.name] = size / row.ratio(marionette.model.number)
        at += width
    return found


def _forces(marionette: Marionette, run: Trajectory, i: int, led: list[DriveRow]) -> Array:
    """The forces with which drives follow their commands at row ``i`` of a run."""
    x, acc_K, n = run.state(i), run.acc_K[i], marionette.coordinates.n_vD
    places = np.array([k for row in led for k in range(row.v.start, row.v.stop)])
    told = np.array([
        acc_K[row.command[1] + k] for row in led for k in range(row.v.stop - row.v.start)
    ])  # fmt: skip
    A = marionette.A_D(x)[x.taut]
    bias = (marionette.Adot_v(x) + marionette.A_K(x) @ acc_K)[x.taut]
    load = marionette.bias(x) + marionette.damping(x) + marionette.mass_matrix_DK(x) @ acc_K
    S, m, k = np.eye(n)[:, places], len(A), len(places)
    zero = np.zeros
    system = np.block([
        [marionette.mass_matrix(x), A.T, -S],
        [A, zero((m, m)), zero((m, k))],
        [S.T, zero((k, m)), zero((k, k))],
    ])  # fmt: skip
    wanted = np.concatenate([-load, -bias, told])
    # Redundant strings share what they bear: the least squares give the shortest of all answers.
    return np.linalg.lstsq(system, wanted, rcond=1e-12)[0][n + m :]
