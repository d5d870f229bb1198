"""Puppets with drives at rest: all forces balance, steppers are in step, modes are correct."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import fantoccini as fan

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]


def test_a_turned_bar_rests_on_its_motor():
    """Motors of orientations have no potential; all forces balance from every initial guess."""
    puppet = fan.loads("""
puppet: hung
bodies:
  - name: bar
    joint: {type: ball, driven: true}
    mass: 0.2
    com: [0.1, 0.02, 0]
    inertia: [4.0e-4, 4.0e-4, 4.0e-4]
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 0.05}
strings:
  - name: line
    path: [{body: bar, at: [0.2, 0, 0]}, {body: bob}]
    length: 0.2
    chain: {pieces: 2, mass: 0.01, stiffness: 300}
drives:
  - {on: bar.rotation, inertia: 1.0e-5, control: {type: pd, stiffness: 1, damping: 0.05}}
pose: {bob.x: 0.2, bob.z: -0.2}
""")
    for turn in [[0, -1.2, 0], [0, -0.5, 0.3], [1.3, 0.9, -0.7]]:
        x = puppet.rest({"bar.rotation": turn})
        assert np.abs(puppet.forward_dynamics(x)[0]).max() < 1e-7


def test_a_stepper_rests_in_step_with_a_chain():
    """n T sin(s/4 n x) = load (1 + load / 2 EA), with the deviation x from the command."""
    puppet = fan.loads("""
puppet: hoist
bodies:
  - {name: bob, joint: {type: translation, axes: [z]}, mass: 3}
strings:
  - name: line
    path: [{body: bob}, {world: [0, 0, 1]}]
    length: driven
    chain: {pieces: 2, mass: 0.01, stiffness: 3000}
drives:
  - {on: line.length, inertia: 1.0e-5, drum: 0.01, motor: {type: stepper, torque: 0.4}}
""")
    pull = 9.81 * np.array([3.0, 3.01])
    held = np.mean(pull * (1 + pull / 6000)) * 0.01 / 0.4
    step = 2 * np.pi / 3200 * 0.01
    for start, command in ((0.5, 0.5), (0.5, 0.3), (0.4, 0.52)):
        x = puppet.rest({"line.length": start, "line.command.length": command})
        length = x.q_D[puppet.coordinates.q_D.index("line.length")]
        way = length - step * np.floor(command / step + 0.5)
        assert way == pytest.approx(np.arcsin(held) / 50 * 0.01, rel=1e-6)


def test_modes_under_computed_torque():
    """s, gains and damping are those of zdot = A z + B acc_K: K and D are not symmetric."""
    puppet = fan.loads("""
puppet: carried
bodies:
  - name: cart
    joint: {type: prismatic, axis: [1, 0, 0], driven: true}
    mass: 0.5
  - name: crank
    parent: cart
    joint: {type: revolute, axis: [0, -1, 0], driven: true}
    mass: 0.3
    com: [0.05, 0, -0.2]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  - name: arm
    parent: crank
    joint: {type: revolute, axis: [0, -1, 0], at: [0, 0, -0.3], damping: 0.001}
    mass: 2.5
    com: [0, 0, -0.15]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
drives:
  - on: crank
    inertia: 2.0e-5
    gear: 10
    control: {type: computed_torque, bandwidth: 6, damping_ratio: 0.1}
""")
    x = puppet.rest({"crank": 0.4})
    modes, lin, table = puppet.modes(x), puppet.linearise(x), puppet.coordinates
    values, left, right = scipy.linalg.eig(lin.A, left=True)
    order = [i for i in np.argsort(np.abs(values)) if values[i].imag > 1e-6]
    assert len(modes) == len(modes.swinging) == len(order) == 2
    for mode, i in zip(modes, order, strict=True):
        s, forced = values[i], left[:, i].conj() / (left[:, i].conj() @ right[:, i])
        assert mode.s == pytest.approx(s, rel=1e-9)
        assert mode.damping == pytest.approx(-s.real / abs(s), rel=1e-9)
        shape = right[:2, i]
        largest = np.argmax(np.abs(shape))
        assert [*mode.shape.values()] == pytest.approx(shape / shape[largest], rel=1e-7)
        pushed = np.abs(forced @ lin.B * s * s) * np.abs(shape[largest]) * 2 * np.pi / s.imag
        assert [mode.gain[name] for name in table.v_K] == pytest.approx(pushed, rel=1e-7)
