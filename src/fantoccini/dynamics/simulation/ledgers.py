"""Ledgers: energies, work and losses, from what runs write of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.contract import BOOKS
from fantoccini.motion import LEDGER


def ledger_of(part: Mapping[str, Array]) -> Array:
    """(..., T, 8) ledger of energies, work and losses (..., T).

    residual = (T + V) - (T + V)_0 - work + damping + impact + slip + friction
    """
    slip = part["slip_loss"]
    energy = part["kinetic"] + part["potential"]
    residual = energy - energy[..., :1] - part["work"] + part["damping"] + part["impact"] + slip
    residual = residual + part["friction"]
    entries = {**part, "slip": slip, "residual": residual}
    return np.stack([entries[name] for name in LEDGER], axis=-1)


def ledger_of_books(books: Array) -> Array:
    """(n, T, 8) ledgers from the books of batches (n, T, 7)."""
    return ledger_of(dict(zip(BOOKS, np.moveaxis(books, -1, 0), strict=True)))
