"""Puppets and starts for the variational integrator's tests."""

from __future__ import annotations

import copy
import functools

import numpy as np
from benchmarks.long_runs import subject

import fantoccini as fan
from fantoccini.motion import State

# The marionette and its initial states are those of the report of long runs.
marionette, all_taut = subject.damped, subject.taut_rest
swinging, gentle = subject.swinging_state, subject.random_swing

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
    """The doll without gravity, its string too long to become taut."""
    puppet = doll().with_parameters({"g": 0.0})
    return puppet, puppet.state({"line.length": 1e6})


@functools.cache
def undamped() -> fan.Marionette:
    """The bundled marionette without damping and drag."""
    puppet = copy.copy(subject.undamped())
    # Rows, energies and rest are those of the damped puppet, whose library is compiled already.
    puppet.__dict__["library"] = marionette().library
    return puppet


def energy(run: fan.Trajectory) -> np.ndarray:
    """T + V (T,) [J]."""
    return run.ledger["kinetic"] + run.ledger["potential"]
