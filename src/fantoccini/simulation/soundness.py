"""Verdict on a run of fixed steps that reached its end: violations and energy.

Time-stepping continues whatever happens. A run that reached its end is DONE only where its rows
held and its energy has a source.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Status
from fantoccini.marionette import Marionette, critical_step_of_tensions
from fantoccini.motion import Trajectory, pair_name


@dataclass(frozen=True)
class Bounds:
    """Bounds beyond which a run is not sound."""

    violation: float = 0.02  # Of a string or limit [m or rad]
    gain: float = 5.0
    """Energy without a source, relative to all available energy. Near the critical step of a spring
    the energy swings to several times its own, and does not grow."""
    fall: float = 1e-3  # Fall of the puppet whose energy is always available [m]
    energy: float = 1e-9  # Energy that is always available [J]
    max_named: int = 5  # Rows that a message names


BOUNDS = Bounds()


def verdict(violation: float, gain: float) -> Status:
    """DONE, OVERSTEPPED or GAINED_ENERGY; numbers that are not finite count as too large."""
    if not violation <= BOUNDS.violation:
        return Status.OVERSTEPPED
    return Status.DONE if gain <= BOUNDS.gain else Status.GAINED_ENERGY


def gains(
    marionette: Marionette, kinetic: Array, potential: Array, work: Array, residual: Array
) -> Array:
    """(...,) largest residual of ledgers, relative to the available energy.

    That is T at the start, the largest fall of V, and all work, taken as positive. The columns of
    the ledger are (..., T) [J].
    """
    fallen = np.max(potential[..., :1] - potential, axis=-1)
    worked = np.sum(np.abs(np.diff(work, axis=-1)), axis=-1)
    available = kinetic[..., 0] + fallen + worked + BOUNDS.fall * marionette.weight + BOUNDS.energy
    return np.max(residual, axis=-1) / available


def judged(
    marionette: Marionette, made: Trajectory, dt: float, worst: float
) -> tuple[Status, str]:
    """Status of a run with a fixed step that reached its end, and the reason in words.

    Args:
        marionette: the puppet.
        made: the run.
        dt: its step [s].
        worst: the largest violation of all its steps [m or rad]; samples may have smaller ones.
    """
    ledger = made.ledger
    energies = (ledger[name] for name in ("kinetic", "potential", "work", "residual"))
    gain = float(gains(marionette, *energies))
    table = made.violation
    if table is None:
        return Status.DONE, ""
    status = verdict(float(np.max(table.values, initial=worst)), gain)
    if status is Status.OVERSTEPPED:
        most = np.max(table.values, axis=0)
        rows = [r for r in np.argsort(-most)[: BOUNDS.max_named] if not most[r] <= BOUNDS.violation]
        names = ", ".join(f"{table.names[r]} by {most[r]:.3g}" for r in rows)
        first = int(np.argmax(~(np.max(table.values, axis=1, initial=0.0) <= BOUNDS.violation)))
        when = f"from t = {made.t[first]:.6g} s on"
        where = f"{names} m or rad, more than {BOUNDS.violation:g} {when}"
        if not rows and made.contact is not None and -made.contact.gap.min(initial=0.0) > 0.0:
            deepest = int(np.argmin(made.contact.gap))
            name = pair_name(made.contact.names[made.contact.pair[deepest]])
            where = f"{name} overlap by {-made.contact.gap[deepest]:.3g} m"
        elif not rows:
            where = f"by {worst:.3g} m or rad in a step between the samples that were written"
        text = f"{where}. {_advice(marionette, made, dt)}; or the puppet cannot follow the inputs"
        if made.contact is None:
            text += ", which method='event' finds out"
        return status, text
    if status is Status.GAINED_ENERGY:
        text = (
            f"the ledger's residual reached {np.max(ledger['residual']):.3g} J, {gain:.2g} times "
            f"all available energy. {_advice(marionette, made, dt)}"
        )
        return status, text
    return status, ""


def _advice(marionette: Marionette, made: Trajectory, dt: float) -> str:
    start = made.q_D[0], made.q_K[0], made.tension.values[0]
    longest = critical_step_of_tensions(marionette.model, *start)
    if dt <= longest:
        return f"Take a dt shorter than {dt:g} s"
    return (
        f"The tensions at the start make vibrations that grow in steps above {longest:.2g} s: take "
        f"a dt below that instead of {dt:g} s"
    )
