"""Simulated scene: the bundled marionette on all seven strings, swinging gently."""

from __future__ import annotations

import functools

import numpy as np

import fantoccini as fan
from fantoccini.model import tree
from fantoccini.model.puppet import Puppet
from fantoccini.motion import State

DT = 0.002
"""Step of all methods with a fixed one [s]."""

KNEES = {"knee_left.length": 1.04, "knee_right.length": 1.04}
"""Length of the knees' strings, 2 cm shorter than in the file, so that the thighs hang [m]."""

_SWING = 0.05
"""Magnitude of the velocities of a gentle swing [m/s or rad/s]."""


@functools.cache
def marionette() -> fan.Marionette:
    """The bundled puppet: 25 DOF, 7 strings."""
    return fan.puppets.marionette()


@functools.cache
def hanging() -> State:
    """Its equilibrium with all strings taut."""
    state = marionette().rest(KNEES)
    tension = tensions(state)
    if min(tension.values()) <= 0.0:
        raise RuntimeError(f"a string is slack: {tension}")
    return state


def tensions(x: State) -> dict[str, float]:
    """Tension of every string at a state [N]."""
    _, forces = marionette().forward_dynamics(x)
    names = [s.name for s in marionette().tree.strings]
    return dict(zip(names, map(float, forces), strict=False))


def swinging_state(seed: int = 0) -> State:
    """The same pose with small velocities that keep every string's length."""
    x = hanging()
    v = _SWING * np.random.default_rng(seed).normal(size=len(x.v_D))
    A = marionette().A_D(x)[: len(marionette().tree.strings)]
    return x.replace(v_D=v - np.linalg.pinv(A) @ (A @ v))


@functools.cache
def still_air() -> Puppet:
    """The puppet without features that peers lack or define otherwise: drag, neck spring, limits.

    The peers get this puppet; our own timings are of the full puppet.
    """
    puppet = marionette().puppet.expanded()
    spared = dict.fromkeys(("spring", "limits", "cone", "twist"))
    bodies = [
        body.model_copy(update={"drag": None, "joint": body.joint.model_copy(update=spared)})
        for body in puppet.bodies
    ]
    return puppet.model_copy(update={"bodies": type(puppet.bodies)(bodies)})


@functools.cache
def still_tree() -> tree.Tree:
    """The tree of :func:`still_air`; its coordinates are those of the whole puppet."""
    return tree.grow(still_air())
