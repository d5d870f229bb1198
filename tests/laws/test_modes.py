"""Modes at rest against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.medium

G = 9.81

BOB = """
puppet: bob
bodies:
  - name: bob
    joint: {type: translation, axes: [x, y, z], damping: {parameter: damping, value: 0}}
    mass: 0.4
strings:
  - {name: line, path: [{body: bob}, {driven: [x], at: [0, 0, 0]}], length: driven}
pose: {bob.z: -0.7, line.length: 0.7}
"""

DOUBLE = """
puppet: double
bodies:
  - {name: upper, joint: {type: translation, axes: [x, z]}, mass: 0.3}
  - {name: lower, joint: {type: translation, axes: [x, z]}, mass: 0.3}
strings:
  - {name: first, path: [{body: upper}, {world: [0, 0, 0]}], length: 0.5}
  - {name: second, path: [{body: lower}, {body: upper}], length: 0.5}
pose: {upper.z: -0.5, lower.z: -1.0}
"""

ROD = """
puppet: rod
bodies:
  - name: rod
    joint: {type: free}
    mass: 0.6
    inertia: [0.003, 0.02, 0.018]
strings:
  - {name: left, path: [{body: rod, at: [-0.15, 0, 0]}, {world: [-0.15, 0, 0.8]}], length: 0.8}
  - {name: right, path: [{body: rod, at: [0.15, 0, 0]}, {world: [0.15, 0, 0.8]}], length: 0.8}
"""


@pytest.fixture(scope="module")
def bob() -> fan.Marionette:
    return fan.loads(BOB)


def frequencies(modes: fan.dynamics.Modes) -> np.ndarray:
    return np.array([mode.frequency for mode in modes.swinging]) * 2.0 * np.pi


def test_a_bob_on_a_string_swings_two_ways(bob):
    """omega = sqrt(g/L); an end that moves along x excites one of them, by pi per swing."""
    modes = bob.modes(bob.rest())
    wanted = np.full(2, np.sqrt(G / 0.7))
    assert np.max(np.abs(frequencies(modes) - wanted)) < 1e-9
    assert modes.rows == ("line",) and len(modes) == 2
    along, across = modes
    assert along.excitable and not across.excitable
    assert abs(along.shape["bob.x"]) == 1.0 and abs(across.shape["bob.y"]) == 1.0
    assert max(abs(along.shape[name]) for name in ("bob.y", "bob.z")) < 1e-9
    assert abs(along.gain["line.x"] - np.pi) < 1e-9 and along.gain["line.length"] < 1e-9
    assert abs(along.share["bob.x"] - 1.0) < 1e-9
    assert [mode.damping for mode in modes] == [0.0, 0.0]
    assert "nothing" in str(modes)


@pytest.mark.parametrize("c", [0.05, 1.0, 2.0, 10.0])
def test_damping_ratios(bob, c):
    """zeta = c / (2 m omega); beyond 1 it creeps, s = -omega (zeta +- sqrt(zeta^2 - 1))."""
    omega = np.sqrt(G / 0.7)
    zeta = c / (2.0 * 0.4 * omega)
    damped = bob.with_parameters({"damping": c})
    modes = damped.modes(damped.rest())
    if zeta < 1.0:
        for mode in modes:
            assert abs(mode.damping - zeta) < 1e-9
            assert abs(2.0 * np.pi * mode.frequency - omega) < 1e-8
    else:
        wanted = -omega * (zeta + np.array([-1, -1, 1, 1]) * np.sqrt(zeta**2 - 1.0))
        roots = np.array([mode.s for mode in modes])
        assert not modes.swinging and "4 decaying" in str(modes)
        assert np.max(np.abs(np.sort(roots.real) - np.sort(wanted))) < 1e-7


def test_growth_at_resonance_is_the_gain(bob):
    """A hand moves to and fro by 0.1 mm for five swings; differences of the linear theory."""
    x0 = bob.rest()
    mode = bob.modes(x0)[0]
    swing, a = 1.0 / mode.frequency, 1e-4
    t = np.linspace(0.0, 5 * swing, 501)
    wave = fan.Input.samples(bob, t, {"line.x": a * (1.0 - np.cos(2 * np.pi * t / swing))})
    run = fan.simulate(bob, x0, wave)
    late = run.columns()["bob.x"][run.t > 4 * swing]
    first = run.columns()["bob.x"][(run.t > 3 * swing) & (run.t <= 4 * swing)]
    growth = np.max(late) - np.max(first)
    assert abs(growth / a - mode.gain["line.x"]) < 0.03


def test_a_double_pendulum():
    """omega^2 = (2 -+ sqrt(2)) g/L of two equal bobs on equal strings."""
    double = fan.loads(DOUBLE)
    modes = double.modes(double.rest())
    wanted = np.sqrt((2.0 + np.array([-1.0, 1.0]) * np.sqrt(2.0)) * G / 0.5)
    assert np.max(np.abs(frequencies(modes) - wanted)) < 1e-8
    # The lower string's angle is +-sqrt(2) times the upper one's.
    for mode, ratio in zip(modes, (1.0 + np.sqrt(2.0), 1.0 - np.sqrt(2.0)), strict=True):
        assert abs(mode.shape["lower.x"] / mode.shape["upper.x"] - ratio) < 1e-8
        assert not mode.excitable  # nothing is driven


def test_a_stiff_light_chain_swings_as_a_string():
    """omega^2 = g/L; rounding of its springs accelerates light pieces by 1e-6 m/s^2 and more."""
    chained = fan.loads("""
puppet: chained
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 0.2}
strings:
  - name: rope
    path: [{body: bob}, {world: [0, 0, 2]}]
    length: 1.0
    chain: {pieces: 6, mass: 1.0e-4, stiffness: 1.0e5}
pose: {bob.z: 1.0}
""")
    x = chained.rest()
    modes = chained.modes(x)
    assert frequencies(modes)[:2] == pytest.approx([np.sqrt(G), np.sqrt(G)], rel=1e-3)
    with pytest.raises(fan.errors.StateError, match="does not rest there"):
        chained.modes(x.replace(q_D=x.q_D + 1e-4))


def test_a_rod_on_two_strings():
    """omega^2 = g/L of both swings, g d^2 / (4 L k^2) of the bifilar twist; it rolls freely."""
    rod = fan.loads(ROD)
    modes = rod.modes(rod.rest())
    twist = np.sqrt(G * 0.3**2 / (4.0 * 0.8 * (0.018 / 0.6)))
    wanted = np.sort([np.sqrt(G / 0.8), np.sqrt(G / 0.8), twist])
    assert np.max(np.abs(frequencies(modes) - wanted)) < 1e-8
    turning = next(mode for mode in modes.swinging if abs(mode.shape["rod.wz"]) > 0.5)
    assert abs(2.0 * np.pi * turning.frequency - twist) < 1e-8
    still = [mode for mode in modes if not mode.swings]  # type: ignore[attr-defined]
    assert len(still) == 1 and all(mode.s == 0 for mode in still)
    assert all(abs(mode.shape["rod.wx"]) == 1.0 for mode in still)
    assert len(modes.rows) == 2 and "1 neutral" in str(modes)


def test_a_pendulum_without_strings():
    """omega^2 = m g l / (m l^2 + I) of a body on a hinge without a drive."""
    hinge = fan.loads("""
puppet: hinge
bodies:
  - name: body
    joint: {type: revolute, axis: [0, 1, 0]}
    mass: 2.0
    com: [0, 0, -0.4]
    inertia: [0.02, 0.03, 0.02]
""")
    (mode,) = hinge.modes(hinge.rest())
    assert abs(2 * np.pi * mode.frequency - np.sqrt(2.0 * G * 0.4 / (2.0 * 0.16 + 0.03))) < 1e-10
    assert mode.gain == {} and not mode.excitable


def test_the_frequency_is_that_of_the_simulated_swing():
    """arm2d is released near rest: its period is the mode's."""
    arm = fan.puppets.arm2d()
    x0 = arm.rest({"hand.length": 0.8})
    (mode,) = arm.modes(x0).swinging
    q_D = x0.q_D + 1e-4 * np.real([mode.shape[name] for name in arm.coordinates.v_D])
    start = arm.project(x0.replace(q_D=q_D))
    run = fan.simulate(arm, start, t_end=3.0)
    elbow = run.q_D[:, 1] - x0.q_D[1]
    up = np.flatnonzero((elbow[:-1] < 0.0) & (elbow[1:] >= 0.0))
    crossings = [
        np.interp(
            0.0,
            (fine := run.resample(np.linspace(run.t[i], run.t[i + 1], 400))).q_D[:, 1] - x0.q_D[1],
            fine.t,
        )
        for i in up
    ]
    periods = np.diff(crossings)
    assert len(periods) >= 3
    assert np.max(np.abs(periods * mode.frequency - 1.0)) < 1e-5


def test_a_state_in_motion_has_no_modes(bob):
    with pytest.raises(fan.errors.StateError, match=r"marionette\.rest"):
        bob.modes(bob.state({"bob.x": 0.3, "bob.z": -0.5}))
