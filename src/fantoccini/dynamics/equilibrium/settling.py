"""Rest with contact: the puppet is let go on floor and props until it is still.

q_D are the dynamic coordinates and v_D their velocities; the inputs are the driven coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import StateError, Status
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.dynamics.equilibrium.letting_go import let_go
from fantoccini.motion import State


@dataclass(frozen=True)
class Settling:
    """Bounds of settling, and thresholds of rest."""

    dt: float = 1e-3  # Step of the runs [s]
    mean_run_time: float = 0.25
    """Mean duration of a run [s]; durations vary, since a swing of twice a constant one would never
    lose its energy."""
    run_time_variation: float = 0.4
    n_free_runs: int = 60
    """Number of runs after which all velocities are set to zero; then friction alone acts."""
    max_runs: int = 240
    max_rest_speed: float = 1e-7  # Largest velocity at rest [rad/s or m/s]
    max_rest_move: float = 1e-8  # Largest move over a run at rest [rad or m]


SETTLING = Settling()
_GOLDEN_RATIO = 0.5 * (5.0**0.5 - 1.0)
"""Golden ratio: the fractional parts of its multiples spread most evenly."""


def settled(marionette: CompiledPuppet, x: State) -> State:
    """The state in which a puppet comes to rest when it is let go, its inputs held.

    Friction can hold many states; this is the one that the puppet falls into.

    Args:
        marionette: a puppet with contact.
        x: start state; its velocities are ignored.

    Raises:
        StateError: the puppet keeps moving, or the run stops.
    """
    q_D, v_D = np.array(x.q_D), np.zeros_like(x.v_D)
    for piece in range(SETTLING.max_runs):
        variation = 2.0 * (piece * _GOLDEN_RATIO % 1.0) - 1.0
        duration = SETTLING.mean_run_time * (1.0 + SETTLING.run_time_variation * variation)
        status, samples = let_go(
            marionette, x.replace(q_D=q_D, v_D=v_D), duration, dt=SETTLING.dt, without_contact=False
        )
        if status not in (Status.DONE, Status.LOST_STEPS):
            raise StateError(f"let go, {status.message}")
        v_D = samples["v_D"][-1]
        moved = np.max(np.abs(samples["q_D"][-1] - q_D), initial=0.0)
        q_D = samples["q_D"][-1]
        if (
            moved < SETTLING.max_rest_move
            and np.max(np.abs(v_D), initial=0.0) < SETTLING.max_rest_speed
        ):
            zeros = {"v_D": np.zeros_like(v_D), "v_K": np.zeros_like(x.v_K)}
            return x.replace(q_D=q_D, **zeros, taut=samples["taut"][-1] > 0)
        if piece < SETTLING.n_free_runs:
            v_D = np.zeros_like(v_D)
    names = marionette.coordinates.v_D
    fastest_velocity = names[int(np.argmax(np.abs(v_D)))]
    raise StateError(
        f"let go, the puppet still moves after {SETTLING.max_runs * SETTLING.mean_run_time:g} s: "
        f"{fastest_velocity} "
        f"at {np.max(np.abs(v_D)):.3g}/s"
    )
