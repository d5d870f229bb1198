"""Puppets and starts for the variational integrator's tests."""

from __future__ import annotations

import functools
import re
from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini import puppets
from fantoccini.motion import State

DOLL = """
puppet: doll
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
  - name: foot
    parent: leg
    joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, -0.2]}
    mass: 0.1
    com: [0.03, 0, -0.05]
    inertia: [2e-4, 2e-4, 1e-4]
strings:
  - name: line
    path: [{body: body, at: [0.05, 0, 0.1]}, {driven: [x], at: [0, 0, 0]}]
    length: driven
pose: {body.z: -1.0, line.length: 0.95}
"""
"""A free body with a leg on a ball joint and a foot on a hinge, hung from the world's origin."""


@functools.cache
def doll() -> fan.Marionette:
    """The doll."""
    return fan.loads(DOLL)


def flyer() -> tuple[fan.Marionette, State]:
    """The doll in no gravity, its string too long to matter."""
    made = doll().with_parameters({"g": 0.0})
    return made, made.state({"line.length": 1e6})


@functools.cache
def marionette() -> fan.Marionette:
    """The bundled marionette."""
    return puppets.marionette()


@functools.cache
def undamped() -> fan.Marionette:
    """The bundled marionette without damping and drag."""
    text = (Path(puppets.__file__).parent / "marionette.yaml").read_text(encoding="utf-8")
    made = fan.loads(re.sub(r"\n\s+(damping|drag):.*", "", text))
    # Rows, energies and rest are those of the damped one, whose library others have made already.
    made.__dict__["library"] = marionette().library
    return made


@functools.cache
def all_taut() -> State:
    """The marionette at rest with its knees lifted until all strings pull."""
    puppet = marionette()
    rest = puppet.rest()
    lengths = dict(zip(puppet.coordinates.q_K, rest.q_K, strict=True))
    gap = dict(zip(puppet.tree.row_names, puppet.instant(rest).h, strict=False))
    for side in ("left", "right"):
        lengths[f"knee_{side}.length"] += gap[f"knee_{side}"] - 0.004
    return puppet.rest(lengths)


def swinging(puppet: fan.Marionette, rest: State, v_D: np.ndarray) -> State:
    """A state at rest that moves by v_D, less what its taut strings hold."""
    x = rest.replace(v_D=v_D)
    at = puppet.instant(x)
    taut = np.flatnonzero(np.abs(at.h) < 1e-9)
    W = at.W[:, taut]
    return x.replace(v_D=v_D - at.back(W @ np.linalg.solve(W.T @ W, at.hdot[taut])))


def gentle(amplitude: float) -> State:
    """The marionette, all strings taut, in a random swing of that size [rad/s, m/s]."""
    v_D = amplitude * np.random.default_rng(1).normal(size=25)
    return swinging(marionette(), all_taut(), v_D)


def energy(run: fan.Trajectory) -> np.ndarray:
    """T + V (T,)."""
    return run.ledger["kinetic"] + run.ledger["potential"]
