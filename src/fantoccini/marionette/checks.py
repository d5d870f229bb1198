"""What a run asks of its arguments: the method, the start state, the inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fantoccini.errors import InputError, Problem, StateError
from fantoccini.motion import Input, State

if TYPE_CHECKING:
    from fantoccini.marionette.handle import Marionette

METHODS = ("event", "timestepping")

CLOSED = 1e-9
"""|h| below which a row counts as closed, relative to 1 m or the string's length."""

_SAME_SPEED = 1e-9
"""Relative difference of velocities that counts as none."""


def check_method(method: str) -> None:
    """Raises ValueError unless ``method`` is one that runs know."""
    if method not in METHODS:
        raise ValueError(f"method is {method!r}; it must be {' or '.join(map(repr, METHODS))}")


def check_start(marionette: Marionette, x: State) -> None:
    """Raises when a string is longer than its length, or is about to be.

    Raises:
        StateError: naming the rows, by how much, and the repair.
    """
    check_slip(marionette, x)
    instant = marionette.instant(x)
    scale = marionette.row_scales(x)
    too_long = instant.h > CLOSED * scale
    closed = np.abs(instant.h) <= CLOSED * scale
    speed = 1e-7 * max(1.0, float(np.max(np.abs(x.v_D), initial=0.0)))
    # A string on a winch that slips gives way.
    opening = closed & (instant.hdot > speed) & ~np.isfinite(marionette.upper)
    wires = marionette.two_sided & (
        (np.abs(instant.h) > CLOSED * scale) | (np.abs(instant.hdot) > speed)
    )
    names, findings = marionette.tree.row_names, []
    for i in np.flatnonzero(too_long | opening | wires):
        if too_long[i] or (wires[i] and abs(instant.h[i]) > CLOSED * scale[i]):
            findings.append(f"{names[i]} is violated by {instant.h[i]:.3g}")
        else:
            rate = f"{instant.hdot[i]:.3g}/s"
            findings.append(f"{names[i]} is at its bound and moves past it at {rate}")
    if findings:
        raise StateError(
            f"the start state breaks {len(findings)} of the strings and limits: "
            + "; ".join(findings)
            + ". marionette.project(x) gives the nearest state that does not."
        )


def check_slip(marionette: Marionette, x: State) -> None:
    """Raises StateError unless what winches have let out is a length for every string, or none."""
    n = len(marionette.tree.strings)
    if x.slip.shape not in ((0,), (n,)) or not np.all(np.isfinite(x.slip)) or np.any(x.slip < 0):
        raise StateError(
            f"slip: found {x.slip.tolist()}; it takes a length >= 0 for each of the {n} strings, "
            "or nothing"
        )


def check_inputs(marionette: Marionette, inputs: Input, t: float, t_end: float) -> None:
    """Raises unless inputs are this puppet's and do not stop or start dead within a run.

    Args:
        marionette: the puppet.
        inputs: not bound yet.
        t, t_end: the run [s].

    Raises:
        InputError: naming the coordinates and times.
    """
    own, theirs = marionette.coordinates, inputs.coordinates
    if (own.q_K, own.v_D) != (theirs.q_K, theirs.v_D):
        text = (
            "were made for a puppet with the driven coordinates "
            f"{', '.join(theirs.q_K) or 'none'}; {marionette.name} has "
            f"{', '.join(own.q_K) or 'none'}"
        )
        raise InputError([Problem("inputs", None, "", text)])
    problems = []
    ends = []
    if inputs.start > t:
        ends.append(("begin", inputs.start, inputs.coef[0, :, 1]))
    if inputs.end < t_end:
        ends.append(("end", inputs.end, inputs.evaluate(inputs.end)[1]))
    for what, when, speed in ends:
        for i in np.flatnonzero(np.abs(speed) > _SAME_SPEED):
            problems.append(
                Problem(
                    "inputs",
                    None,
                    own.v_K[i],
                    f"the inputs {what} at t = {when:g} s with the velocity {speed[i]:.6g}, and "
                    f"the run goes from {t:g} s to {t_end:g} s; let them {what} at rest, or let "
                    "the run not go beyond them",
                )
            )
    if problems:
        raise InputError(problems)


def check_speed(marionette: Marionette, x: State, bound: Input) -> None:
    """Raises StateError when the driven velocities would jump from a state to its inputs."""
    found = bound.evaluate(x.t)[1]
    wrong = np.flatnonzero(np.abs(found - x.v_K) > _SAME_SPEED * np.maximum(1.0, np.abs(x.v_K)))
    if len(wrong):
        names = [marionette.coordinates.v_K[i] for i in wrong]
        raise StateError(
            f"the velocity of {', '.join(names)} would jump at t = {x.t:g} s: the state has "
            f"{x.v_K[wrong[0]]:.6g}, the inputs begin with {found[wrong[0]]:.6g}"
        )
