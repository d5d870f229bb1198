"""Ledgers: energies, work and losses, from the energy terms of runs.

A ledger has the columns kinetic and potential energy, work, losses, and the residual that remains
of their balance. Slip is the length of string that a winch lets out at its largest tension.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.contract import ENERGY_TERMS
from fantoccini.motion import LEDGER


def ledger_of(columns: Mapping[str, Array], at_start: Array | None = None) -> Array:
    """Ledger (..., T, 8) from energies, work and losses (..., T).

    residual = (T + V) - (T + V)_0 - work + damping + impact + slip + friction

    Args:
        columns: energies, work and losses by name [J].
        at_start: (..., 1) T + V at the start [J]; by default that of the first sample.
    """
    slip = columns["slip_loss"]
    energy = columns["kinetic"] + columns["potential"]
    at_start = energy[..., :1] if at_start is None else at_start
    residual = energy - at_start - columns["work"] + columns["damping"] + columns["impact"] + slip
    residual = residual + columns["friction"]
    entries = {**columns, "slip": slip, "residual": residual}
    return np.stack([entries[name] for name in LEDGER], axis=-1)


def ledgers_of_terms(energy_terms: Array) -> Array:
    """Ledgers (n, T, 8) from the energy terms of batches (n, T, 7)."""
    return ledger_of(dict(zip(ENERGY_TERMS, np.moveaxis(energy_terms, -1, 0), strict=True)))
