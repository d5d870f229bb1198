"""Checks of event-driven runs with contact."""

from __future__ import annotations

import numpy as np

import fantoccini as fan
from fantoccini import Status

CLOSE = 1e-8
"""Required accuracy of contact."""


def of(run: fan.Trajectory, *kinds: str) -> list[fan.motion.EventRecord]:
    """Events of these kinds."""
    return [event for event in run.events if event.kind in kinds]


def sound(run: fan.Trajectory, residual: float = 1e-8) -> None:
    """Asserts that the run reached its end, that nothing overlaps and that the ledger closes."""
    assert run.status is Status.DONE
    assert run.contact.gap.min(initial=0.0) > -1e-12
    assert np.max(np.abs(run.ledger["residual"])) < residual
