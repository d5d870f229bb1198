"""The measured puppets, and their start states."""

from __future__ import annotations

import functools
import re

import numpy as np

import fantoccini as fan
from fantoccini import puppets
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.motion import State

FLYER = """
puppet: flyer
gravity: [0, 0, {parameter: g, value: -9.81}]
bodies:
  - name: body
    joint: {type: free}
    mass: 0.5
    com: [0.01, 0.02, -0.1]
    inertia: [4e-3, 5e-3, 2e-3]
  - name: leg
    parent: body
    joint: {type: ball, at: [0, 0.05, -0.2]}
    mass: 0.2
    com: [0, 0, -0.1]
    inertia: [1e-3, 1e-3, 2e-4]
strings:
  - {name: line, path: [{body: body, at: [0.05, 0, 0.1]}, {world: [0, 0, 0]}], length: driven}
pose: {body.z: -1.0, line.length: 0.95}
"""
"""A free body with a leg on a ball joint, with or without a string from the origin."""


@functools.cache
def undamped() -> fan.Marionette:
    """The bundled marionette without damping and drag."""
    text = puppets.path("marionette").read_text(encoding="utf-8")
    return fan.loads(re.sub(r"\n\s+(damping|drag):.*", "", text))


@functools.cache
def damped() -> fan.Marionette:
    """The bundled marionette."""
    return puppets.marionette()


@functools.cache
def taut_rest() -> State:
    """The marionette at rest with its knees lifted until all strings pull."""
    rest = damped().rest()
    lengths = dict(zip(damped().coordinates.q_K, rest.q_K, strict=True))
    gap = dict(zip(damped().tree.row_names, Evaluation.at_state(damped(), rest).h, strict=False))
    for side in ("left", "right"):
        lengths[f"knee_{side}.length"] += gap[f"knee_{side}"] - 0.004
    return damped().rest(lengths)


def swinging_state(puppet: fan.Marionette, rest: State, v_D: np.ndarray) -> State:
    """A state at rest with the velocity v_D, less its components along taut strings."""
    x = rest.replace(v_D=v_D)
    evaluation = Evaluation.at_state(puppet, x)
    taut = np.flatnonzero(np.abs(evaluation.h) < 1e-9)
    W = evaluation.W[:, taut]
    return x.replace(
        v_D=v_D - evaluation.solve_factor(W @ np.linalg.solve(W.T @ W, evaluation.hdot[taut]))
    )


def random_swing(amplitude: float) -> State:
    """The marionette, all strings taut, in a random swing of this amplitude [rad/s, m/s]."""
    return swinging_state(
        damped(), taut_rest(), amplitude * np.random.default_rng(1).normal(size=25)
    )


def lifted_state(by: float, amplitude: float) -> State:
    """The marionette lifted off its strings [m], in a random swing [rad/s, m/s]."""
    x, names = taut_rest(), damped().coordinates.q_D
    height = next(i for i, name in enumerate(names) if name.endswith(".z"))
    q_D = x.q_D.copy()
    q_D[height] += by
    return x.replace(q_D=q_D, v_D=amplitude * np.random.default_rng(3).normal(size=25))


def swaying_inputs(x: State) -> fan.Input:
    """An input that smoothly shifts a shoulder and lifts a hand."""
    start = dict(zip(damped().coordinates.q_K, x.q_K, strict=True))
    moves = {"shoulder_left.x": 0.01, "hand_right.length": -0.01}
    return fan.Input.waypoints(
        damped(), {n: [(0.0, start[n]), (0.4, start[n] + by)] for n, by in moves.items()}
    )
