"""Validation of arguments that single runs and batches share.

A batch is many runs of one puppet over the same time.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, floats
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, Inputs, State


def check_marionette(value: object) -> None:
    """Raises TypeError unless the argument is one marionette."""
    if not isinstance(value, Marionette):
        raise TypeError(
            f"marionette is a {type(value).__name__}; it must be one Marionette, as fan.load "
            "gives it. Simulate several one by one, or with fan.sweep"
        )


def check_one_run(x0: object, inputs: object) -> None:
    """Raises TypeError unless the arguments are one state, and one input or None."""
    state = "a State, as marionette.state({...}) or .rest({...}) gives it"
    motion = "an Input, such as fan.Input.waypoints(marionette, {...})"
    for name, value, kind, expected in (
        ("x0", x0, State, state),
        ("inputs", inputs, Input | None, motion),
    ):
        if isinstance(value, Inputs | list | tuple):
            raise TypeError(f"{name} are several; needed: one, or fan.simulate_batch")
        if not isinstance(value, kind):
            raise TypeError(f"{name} is a {type(value).__name__}; it must be {expected}")


def save_times(
    save_at: Array | None, save_every: int | None, method: str, t: float, t_end: float
) -> Array | None:
    """Times of the samples to save, including the end [s]."""
    if save_every is not None and method == "event":
        raise ValueError("save_every is for fixed steps; method='event' needs save_at")
    if save_at is None:
        return None
    if method != "event":
        raise ValueError(f"save_at is for method='event'; {method} needs save_every")
    times = floats(save_at)
    if times.ndim != 1 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise ValueError("save_at must be a list of finite times that increase")
    if len(times) and (times[0] < t or times[-1] > t_end):
        raise ValueError(f"save_at must lie between the start {t:g} s and the end {t_end:g} s")
    return np.union1d(times, [t_end] if np.isfinite(t_end) else [])
