"""Equilibria by dynamic relaxation with kinetic damping, refined by Newton's method.

The puppet is let go and stopped whenever its kinetic energy peaks, until it hardly moves. Newton's
method then refines the equilibrium to rounding. An unstable one is left with a push, and the search
continues.

q_D are the dynamic coordinates of the puppet. A drive moves a coordinate by a motor; the poles of a
stepper motor are the positions at which it may stand for one command. In names, K stands for driven
coordinates: ends and lengths of strings, driven joints. A row of the tree describes a string,
limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, Status, rotation
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation, forward_dynamics
from fantoccini.dynamics.equilibrium.letting_go import let_go
from fantoccini.dynamics.equilibrium.newton import (
    Equilibrium,
    curvature,
    derivatives,
    instability,
    newton,
    pushed,
)
from fantoccini.model.puppet import StepperMotor
from fantoccini.model.tree import DriveRow
from fantoccini.motion import State


@dataclass(frozen=True)
class RelaxationBounds:
    """Bounds of relaxation. Moves are in rad or m."""

    dt: float = 0.002  # Step of the runs [s]
    run_time: float = 0.1
    """Duration of a run [s]: shorter than a swing, to stop near the peak of kinetic energy."""
    max_runs: int = 1500
    max_rest_distance: float = 1e-6
    """Distance up to which the puppet is at an equilibrium instead of passing it, and the largest
    acceleration there."""
    max_drive_move: float = 0.1  # Move from which a drive counts as too weak
    max_distance: float = 100.0  # Move from which the puppet has no equilibrium
    max_restarts: int = 8  # Restarts from unstable equilibria
    min_growth_rate: float = 1e-6
    """Squared growth rate of an instability, relative to that of the fastest oscillation."""


RELAXATION = RelaxationBounds()


def check_winches(marionette: CompiledPuppet, result: Equilibrium) -> None:
    """Raises StateError if winches slip at an equilibrium."""
    upper = marionette.max_forces
    if not np.any(np.isfinite(upper)):
        return
    acc, tension = forward_dynamics(marionette, result.x)
    if np.max(np.abs(acc), initial=0.0) > RELAXATION.max_rest_distance:
        names = marionette.tree.row_names
        slips = [f"{names[i]} ({upper[i]:g} N)" for i in np.flatnonzero(tension >= upper)]
        raise StateError(
            "the puppet cannot rest there: the largest tension of "
            f"{', '.join(slips) or 'its winches'} does not hold it; raise max_tension, or let "
            "other strings carry more"
        )


def relaxed(marionette: CompiledPuppet, x: State) -> Equilibrium:
    """The equilibrium that a puppet reaches when it is let go and stopped repeatedly.

    Raises:
        StateError: it keeps moving, or a run cannot begin or continue.
    """
    q_D = x.q_D
    for _ in range(RELAXATION.max_restarts):
        lower_state = None
        for q_D in _stopped_configurations(marionette, x):
            result = newton(marionette, x.replace(q_D=q_D))
            if result is None:
                continue
            evaluation = Evaluation.at_state(marionette, result.x)
            curvature_modes = curvature(evaluation, derivatives(marionette, result)[0])
            push = instability(evaluation, result.rows, curvature_modes, RELAXATION.min_growth_rate)
            is_close = np.max(np.abs(result.x.q_D - q_D)) < RELAXATION.max_rest_distance
            if push is not None and is_close:
                lower_state = pushed(marionette, result.x, push)
            if push is None or (is_close and lower_state is None):
                x = with_motors_in_step(marionette, result.x)
                return result if x is result.x else newton(marionette, x) or result
            if lower_state is not None:
                break
        if lower_state is None:
            break
        x = lower_state
    reason = _drives_giving_way(marionette, x, q_D)
    raise StateError(f"let go and stopped, the puppet keeps moving{reason}")


def pulled_towards_rows(marionette: CompiledPuppet, x: State) -> State:
    """A state that violates rows, moved towards them by a time-stepping run."""
    _, samples = let_go(marionette, x, RELAXATION.run_time, dt=RELAXATION.dt, without_contact=True)
    return x.replace(q_D=samples["q_D"][-1]) if len(samples["q_D"]) else x


def _stopped_configurations(marionette: CompiledPuppet, x: State) -> Iterator[Array]:
    """Configurations closer and closer to an equilibrium, after longer and longer intervals."""
    q_D, v_D = x.q_D, np.zeros(marionette.coordinates.n_vD)
    start, yield_at = np.array(q_D), 4
    for piece in range(RELAXATION.max_runs):
        next_start = x.replace(q_D=q_D, v_D=v_D)
        status, samples = let_go(
            marionette, next_start, RELAXATION.run_time, dt=RELAXATION.dt, without_contact=True
        )
        # Stepper motors may lose steps during the run: they are set back in step afterwards.
        if status not in (Status.DONE, Status.LOST_STEPS):
            raise StateError(f"let go, {status.message}{_drives_giving_way(marionette, x, q_D)}")
        kinetic = samples["kinetic"]
        peaks = np.flatnonzero((kinetic[1:-1] >= kinetic[:-2]) & (kinetic[1:-1] > kinetic[2:]))
        peak = int(peaks[0]) + 1 if len(peaks) else len(kinetic) - 1
        q_D = samples["q_D"][peak]
        v_D = np.zeros_like(v_D) if len(peaks) else samples["v_D"][peak]
        if np.max(np.abs(q_D - start), initial=0.0) > RELAXATION.max_distance:
            return
        if piece == yield_at:
            yield_at = 2 * yield_at + 1
            yield q_D
    yield q_D


def _drives_giving_way(marionette: CompiledPuppet, start: State, q_D: Array) -> str:
    """Drives that a puppet without an equilibrium pushes away, in words."""
    texts = []
    for row in marionette.tree.drives:
        if row.is_rotation:
            distance = float(np.linalg.norm(rotation.between(start.q_D[row.q], q_D[row.q])))
        else:
            distance = float(np.abs(q_D[row.q] - start.q_D[row.q])[0])
        if distance < RELAXATION.max_drive_move:
            continue
        if not row.drive.follows:
            texts.append(f"the drive of {row.name} has no control, so that nothing holds it")
        elif row.drive.motor is not None:
            texts.append(f"the motor of {row.name} may be too weak to hold its load")
    return "".join(f"; {text}" for text in texts)


def poles(marionette: CompiledPuppet) -> list[tuple[DriveRow, float]]:
    """The drives with stepper motors, and the distance of their equivalent poles [rad or m]."""
    result = []
    for row in marionette.tree.drives:
        motor, drive = row.drive.motor, row.drive
        if isinstance(motor, StepperMotor):
            distance_per_turn = (
                1.0 if drive.drum is None and drive.mass is not None else 2.0 * np.pi
            )
            result.append(
                (row, 4.0 / motor.steps * distance_per_turn / row.ratio(marionette.number))
            )
    return result


def with_motors_in_step(marionette: CompiledPuppet, x: State) -> State:
    """The state with stepper motors moved by whole poles until they are in step."""
    q_D = x.q_D.copy()
    for row, pole in poles(marionette):
        if row.command is not None:
            q_D[row.q] -= pole * np.round((q_D[row.q] - x.q_K[row.command[0]]) / pole)
    return x if np.array_equal(q_D, x.q_D) else x.replace(q_D=q_D)
