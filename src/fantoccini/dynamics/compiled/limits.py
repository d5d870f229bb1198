"""Bounds of every run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Bounds of a run, and scales of a puppet's forces and lengths."""

    least_gravity: float = 1.0
    """Smallest gravity used in force scales [m/s^2], so that they are never zero."""
    least_share: float = 1e-6  # Part of the largest share above which a row is named
    first_step: float = 1e-4
    """First step of the event-driven integrator [s]; it adapts within a few steps."""
    recovery_speed: float = 1.0
    """Largest speed at which time-stepping corrects violations [m/s], so that no string kicks."""
    max_steps: int = 50_000_000
    max_events: int = 1_000_000


LIMITS = Limits()
