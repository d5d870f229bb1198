"""Derivatives of runs and steps by accelerations of commands, compared with differences."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.simulation.intervals import interval_derivatives
from oracles.differences import difference, worst

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

FINE = {"method": fan.Event(rtol=1e-13, atol=1e-13), "effort": False}

PUPPET = """
puppet: lift
bodies:
- name: cage
  joint: {name: lift, type: prismatic, axis: [0, 0, 1], driven: true}
  shapes: [{type: sphere, radius: 0.05, mass: 2.0}]
- name: rod
  parent: cage
  joint: {name: pin, type: revolute, axis: [0, 1, 0]}
  mass: 0.4
  com: [0, 0, -0.5]
  inertia: [0.03, 0.03, 0.001]
- name: bob
  joint: {type: translation, axes: [x, y, z]}
  shapes: [{type: sphere, radius: 0.02, mass: 0.2}]
strings:
- {name: line, path: [{body: rod, at: [0, 0, -1]}, {body: bob, at: [0, 0, 0]}], length: driven}
drives:
- {on: lift, mass: 0.3, control: {type: CONTROL}}
- {on: line.length, mass: 0.1, control: {type: pd, stiffness: 900, damping: 40}}
pose: {bob.z: -1.5, line.length: 0.5}
"""
CONTROLS = ("computed_torque, bandwidth: 20", "pd, stiffness: 2000, damping: 120")


@pytest.fixture(scope="module", params=CONTROLS, ids=("computed_torque", "pd"))
def lift(request) -> fan.Marionette:
    return fan.loads(PUPPET.replace("CONTROL", request.param))


@pytest.fixture(scope="module")
def moving(lift: fan.Marionette) -> fan.State:
    x = lift.rest()
    return lift.project(x.replace(v_D=x.v_D + 0.1 * np.arange(len(x.v_D)), v_K=x.v_K + 0.2))


def test_the_end_of_an_interval_by_the_accelerations_of_commands(lift, moving):
    T, acc = 0.05, np.array([1.5, -0.8])

    def made(d: np.ndarray) -> tuple[fan.Input, fan.Trajectory]:
        inputs = fan.Input.segments(lift, [0.0, T], moving.q_K, moving.v_K, (acc + d)[None])
        return inputs, fan.simulate(lift, moving, inputs, T, **FINE)

    def end(d: np.ndarray) -> np.ndarray:
        run = made(d)[1]
        return np.concatenate([run.q_D[-1], run.v_D[-1], run.q_K[-1], run.v_K[-1]])

    inputs, run = made(np.zeros(2))
    B = interval_derivatives(lift, run, inputs).B[0]
    assert np.max(np.abs(B[: 2 * len(moving.v_D)])) > 1e-3
    assert worst(B, difference(end, 2, 1e-3)) < 1e-8


def test_a_time_step_by_the_accelerations_of_commands(lift, moving):
    dt, acc = 0.005, np.array([1.5, -0.8])

    def end(d: np.ndarray) -> np.ndarray:
        stepper = lift.stepper(moving, method=fan.TimeStepping(dt=dt, extrapolate=False))
        x = stepper.advance(dt, acc + d)
        return np.concatenate([x.q_D, x.v_D, x.q_K, x.v_K])

    linear = lift.linearise_steps(moving.q_D, moving.v_D, moving.q_K, moving.v_K, acc, dt=dt)
    n = len(moving.v_D)
    assert np.max(np.abs(linear.B[0][: 2 * n])) > 1e-4
    assert worst(linear.B[0], difference(end, 2, 1e-3)) < 1e-7
