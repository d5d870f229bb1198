"""Whether what a fixed step has made may be believed: violation and energy, judged at the end.

Time-stepping goes on whatever happens. A run that reached its end so is DONE only where its rows
held and its energy has a source.
"""

from __future__ import annotations

import numpy as np

from fantoccini.errors import Status
from fantoccini.marionette import Marionette, tension_step
from fantoccini.motion import Trajectory

MOST_VIOLATION = 0.02
"""Violation of a string or limit beyond which a run counts as overstepped [m or rad]."""

MOST_GAIN = 5.0
"""Energy out of nothing, relative to all that there was to take, beyond which a run has gained.

Near the longest step for a spring the energy swings to several times its own, and does not grow."""

_FALL = 1e-3
"""Fall of the puppet whose energy is always there to take [m]."""
_LEAST = 1e-9
"""Energy that is always there to take [J]."""
_MOST_NAMED = 5


def verdict(violation: float, gain: float) -> Status:
    """DONE, OVERSTEPPED or GAINED_ENERGY; numbers that are not finite count as too large."""
    if not violation <= MOST_VIOLATION:
        return Status.OVERSTEPPED
    return Status.DONE if gain <= MOST_GAIN else Status.GAINED_ENERGY


def gains(
    marionette: Marionette, kinetic: np.ndarray, potential: np.ndarray, work: np.ndarray,
    residual: np.ndarray,
) -> np.ndarray:
    """(...,) the ledger's largest residual, relative to all the energy that there was to take.

    That is T at the start, the most that V has fallen, and all work, taken as positive.

    Args:
        marionette: the puppet.
        kinetic, potential, work, residual: (..., T) columns of the ledger [J].
    """  # fmt: skip
    fallen = np.max(potential[..., :1] - potential, axis=-1)
    worked = np.sum(np.abs(np.diff(work, axis=-1)), axis=-1)
    there = kinetic[..., 0] + fallen + worked + _FALL * marionette.weight + _LEAST
    return np.max(residual, axis=-1) / there


def judged(
    marionette: Marionette, made: Trajectory, dt: float, worst: float
) -> tuple[Status, str]:
    """How a run with a fixed step that reached its end is to be called, and why, in words.

    Args:
        marionette: the puppet.
        made: the run.
        dt: its step [s].
        worst: the largest violation of all its steps [m or rad]; those of a row may be smaller.
    """
    ledger = made.ledger
    energies = (ledger[name] for name in ("kinetic", "potential", "work", "residual"))
    gain = float(gains(marionette, *energies))
    beyond = made.violation.values
    status = verdict(float(np.max(beyond, initial=worst)), gain)
    if status is Status.OVERSTEPPED:
        by_row = np.max(beyond, axis=0)
        rows = [r for r in np.argsort(-by_row)[:_MOST_NAMED] if not by_row[r] <= MOST_VIOLATION]
        names = ", ".join(f"{made.violation.names[r]} by {by_row[r]:.3g}" for r in rows)
        first = int(np.argmax(~(np.max(beyond, axis=1) <= MOST_VIOLATION)))
        where = f"{names} m or rad, more than {MOST_VIOLATION:g} from t = {made.t[first]:.6g} s on"
        if not rows:
            where = f"by {worst:.3g} m or rad in a step between the rows that were written"
        text = (
            f"{where}. {_advice(marionette, made, dt)}; or the inputs ask for what the puppet "
            "cannot follow, which method='event' finds out"
        )
        return status, text
    if status is Status.GAINED_ENERGY:
        text = (
            f"the ledger's residual reached {np.max(ledger['residual']):.3g} J, {gain:.2g} times "
            f"all that there was to take. {_advice(marionette, made, dt)}"
        )
        return status, text
    return status, ""


def _advice(marionette: Marionette, made: Trajectory, dt: float) -> str:
    longest = tension_step(marionette.model, made.q_D[0], made.q_K[0], made.tension.values[0])
    if dt <= longest:
        return f"Take a dt shorter than {dt:g} s"
    return (
        f"The tensions at the start make vibrations that grow in steps above {longest:.2g} s: take "
        f"a dt below that instead of {dt:g} s"
    )
