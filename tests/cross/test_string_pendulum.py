"""A point mass on a string against closed forms: slack, flight, catch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

import fantoccini as fan
from harness import start
from oracles.string_pendulum import flight, time_on_circle

pytestmark = pytest.mark.own_puppets

LENGTH, MASS, GRAVITY = 0.7, 0.3, 9.81

PUPPET = """
puppet: mass_on_a_string
bodies:
  - name: bob
    joint: {type: translation, axes: [x, z]}
    mass: 0.3
strings:
  - {name: string, path: [{body: bob, at: [0, 0, 0]}, {world: [0, 0, 0]}], length: 0.7}
pose: {bob.x: 0, bob.z: -0.7}
"""


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    path = tmp_path_factory.mktemp("puppet") / "mass_on_a_string.yaml"
    path.write_text(PUPPET)
    return fan.load(path)


@pytest.mark.parametrize("k", [2.3, 3.0, 3.9, 4.0, 4.5, 4.9])
def test_closed_form_agrees_with_itself(k):
    """The flight's parabola ends where the formula says, and the quadrature gives the same time."""
    f = flight(k, LENGTH, MASS, GRAVITY)
    t = f.t_catch - f.t_release
    fall = np.array([0.0, -GRAVITY])
    v = f.v_release + fall * t
    n = f.x_catch / LENGTH
    x = f.x_release + f.v_release * t + fall * t * t / 2
    np.testing.assert_allclose(x, f.x_catch, atol=1e-13)
    np.testing.assert_allclose(v, f.v_before, atol=1e-13)
    np.testing.assert_allclose(v - n * (n @ v), f.v_after, atol=1e-13)
    assert MASS * n @ v == pytest.approx(f.impulse, abs=1e-13)
    seconds = quad(
        lambda a: np.sqrt(LENGTH / GRAVITY / (k - 4 * np.sin(a / 2) ** 2)),
        0.0,
        f.psi + np.pi / 2,
        epsabs=1e-14,
    )[0]
    assert f.t_release == pytest.approx(seconds, abs=1e-12)


@pytest.mark.parametrize("k", [2.3, 3.0, 4.0, 4.6])
def test_slack_flight_and_catch(pendulum, k):
    """Slack angle, time, catch time, place, impulse and the motion after it, to 1e-10."""
    f = flight(k, LENGTH, MASS, GRAVITY)
    x0 = start(pendulum, {}, {"bob.x": np.sqrt(k * GRAVITY * LENGTH)})
    end = f.t_catch + 0.02
    still = fan.Input.hold(pendulum)
    run = fan.simulate(pendulum, x0, still, t_end=end, method=fan.Event(rtol=1e-13, atol=1e-13))
    release, catch = [e for e in run.events if e.kind in ("release", "catch")][:2]
    assert (release.kind, catch.kind) == ("release", "catch")
    assert release.t == pytest.approx(f.t_release, abs=1e-10)
    assert catch.t == pytest.approx(f.t_catch, abs=1e-10)
    assert catch.impulse == pytest.approx(f.impulse, abs=1e-10)
    assert catch.speed == pytest.approx(f.impulse / MASS, abs=1e-10)

    before, after = np.flatnonzero(run.t == catch.t)
    np.testing.assert_allclose(run.q_D[before], f.x_catch, atol=1e-10)
    np.testing.assert_allclose(run.v_D[before], f.v_before, atol=1e-10)
    np.testing.assert_allclose(run.v_D[after], f.v_after, atol=1e-10)
    at_release = np.flatnonzero(run.t == release.t)[0]
    np.testing.assert_allclose(run.q_D[at_release], f.x_release, atol=1e-10)
    loss = run.ledger["impact"][-1]
    assert abs(loss) == pytest.approx(f.loss, abs=1e-10)


def test_swing_between_taut_and_taut(pendulum):
    """Below the middle the string stays taut; a complete elliptic integral is a quarter period."""
    k = 1.7
    alpha = 2 * np.arcsin(np.sqrt(k) / 2)
    quarter = time_on_circle(k, alpha, LENGTH, GRAVITY)
    x0 = start(pendulum, {}, {"bob.x": np.sqrt(k * GRAVITY * LENGTH)})
    still = fan.Input.hold(pendulum)
    run = fan.simulate(
        pendulum, x0, still, t_end=4 * quarter, method=fan.Event(rtol=1e-13, atol=1e-13)
    )
    assert not [e for e in run.events if e.kind in ("release", "catch")]
    np.testing.assert_allclose(run.q_D[-1], x0.q_D, atol=1e-10)
    np.testing.assert_allclose(run.v_D[-1], x0.v_D, atol=1e-10)
    tension = MASS * GRAVITY * (k + 1)  # at the bottom: m g + m v^2 / L
    assert run.tension["string"][0] == pytest.approx(tension, abs=1e-10)
    stretched = np.hypot(*run.q_D.T) - LENGTH
    assert np.abs(stretched).max() < 1e-12
