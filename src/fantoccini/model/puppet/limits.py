"""Limits of puppet files, so that every file is read or rejected within seconds."""

from __future__ import annotations

from typing import NamedTuple


class PuppetLimits(NamedTuple):
    """Largest counts, far above those of real puppets."""

    max_parts: int = 1000
    """Bodies, strings, springs and masses of chains, twins included: more take gigabytes."""
    max_pieces: int = 200
    """Springs of a chain."""
    max_motor_steps: int = 100_000
    """Steps of a stepper motor per turn or metre, and microsteps per step."""


LIMITS = PuppetLimits()
