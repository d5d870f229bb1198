"""Time-stepping runs of a puppet that is let go, with its inputs held.

A winch changes the length of a string, and slips at its largest tension. In names, K stands for
driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Status
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.kernel.runtime import Run
from fantoccini.motion import Input, State

_RIGID_WINCH = np.array([[np.inf, 0.0, 0.0]])
"""Winch that does not slip, and catches without restitution."""


def let_go(
    marionette: CompiledPuppet, x: State, duration: float, *, dt: float, without_contact: bool
) -> tuple[Status, dict[str, Array]]:
    """Status and samples of a time-stepping run from a state, with its inputs held.

    Args:
        marionette: the puppet.
        x: start state.
        duration: duration of the run [s].
        dt: length of the steps [s].
        without_contact: whether to ignore contact and the slip of winches.
    """
    if without_contact:
        options = marionette.run_options(dt=dt, contacts=None)
        winches = np.tile(_RIGID_WINCH, (len(marionette.tree.strings), 1))
    else:
        options, winches = marionette.run_options(dt=dt), marionette.winches
    run = Run(
        marionette.library,
        "timestepping",
        options,
        x.replace(t=0.0),
        marionette.p,
        winches,
        Input.hold(marionette.coordinates).bound(x.q_K),
    )
    samples = np.concatenate([piece.samples for piece in run.advance(duration)])
    return run.status, marionette.sample_layout.split(samples)
