"""The kinematic baseline: swing removed by the pendulum's inverse, bounds, vertical strings."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.capture.clips import write
from benchmarks.capture.kinematic import kinematic_inputs
from benchmarks.capture.swing import hand_strings, identify_swing, lead
from scipy.ndimage import gaussian_filter1d

import fantoccini as fan
from fantoccini.theatre.retarget import figure_of, retarget_clip
from fantoccini.theatre.retarget.following import MAX_ACCELERATION, MAX_SPEED
from fantoccini.theatre.retarget.retargeting import part_positions, tied_strings

pytestmark = pytest.mark.medium

DT = 0.01
PENDULUM = """
puppet: led_pendulum
bodies:
  - name: bob
    joint: {type: translation, axes: [x, z]}
    shapes: [{type: sphere, radius: 0.04, mass: 0.5}]
strings:
  - name: line
    path: [{body: bob, at: [0, 0, 0]}, {driven: [x], at: [0, 0, 0]}]
    length: 0.8
pose: {bob.z: -0.8}
"""


@pytest.fixture(scope="module")
def conduct(marionette, tmp_path_factory):
    (path,) = [p for p in write(tmp_path_factory.mktemp("clips"), "lafan1") if p.stem == "conduct"]
    return retarget_clip(marionette, path)


def smooth_step(size: float, width: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times, and a path with a step at 0.5 s [m]."""
    t = DT * np.arange(round(end / DT) + 1)
    return t, gaussian_filter1d(np.where(t < 0.5, 0.0, size), width / DT)


def test_feed_forward_makes_a_pendulum_follow_its_path():
    # L d2y/dt2 = g (u - y) for small swings: u = y + (L/g) d2y/dt2 makes the bob follow y.
    pendulum = fan.loads(PENDULUM)
    t, y = smooth_step(0.02, 0.1, 3.0)
    off = []
    for u in (y, lead(y, DT, 0.8 / 9.81)):
        inputs = fan.Input.samples(pendulum, t, {"line.x": u})
        run = fan.simulate(pendulum, pendulum.rest(), inputs, save_at=t, effort=False)
        off.append(np.abs(run.resample(t)["bob.x"] - y).max())
    assert off[0] > 0.3 * 0.02
    assert off[1] < 0.01 * 0.02


def test_lead_inverts_damped_pendulums():
    from scipy.signal import lsim

    t, y = smooth_step(0.02, 0.1, 3.0)
    u = lead(y, DT, 0.06, 0.1)
    assert lsim(([0.1, 1.0], [0.06, 0.1, 1.0]), u, t)[1] == pytest.approx(y, abs=0.03 * 0.02)


def test_feed_forward_takes_a_third_of_a_hands_swing_out(marionette):
    x0 = marionette.rest()
    figure = figure_of(marionette, x0)
    string = hand_strings(figure, x0)[0]
    swing = identify_swing(marionette, figure, x0, lengths=(float(x0[string.length]),))
    t, y = smooth_step(0.04, 0.05, 3.0)
    for name, axis in string.ends.items():
        swung = []
        for path in (y, swing.lead(name, y, np.full_like(y, x0[string.length]), DT)):
            inputs = fan.Input.samples(marionette, t, {name: x0[name] + path})
            run = fan.simulate(marionette, x0, inputs, effort=False).resample(t)
            hand = part_positions(figure, marionette.poses(run.q_D, run.q_K))["hand_left"] @ axis
            swung.append(np.ptp(hand[t > 0.7]))
        assert swung[1] < 0.7 * swung[0], name


@pytest.mark.parametrize("feed_forward", [False, True])
@pytest.mark.slow
def test_inputs_keep_their_bounds(conduct, feed_forward):
    speed, acceleration = 0.8, 10.0
    for bounds in ((MAX_SPEED, MAX_ACCELERATION), (speed, acceleration)):
        baseline = kinematic_inputs(conduct, feed_forward, speed=bounds[0], acceleration=bounds[1])
        times = np.linspace(baseline.inputs.start, baseline.inputs.end, 4000)
        _, v, acc = baseline.inputs.evaluate(times)
        assert np.abs(v).max() <= bounds[0] * (1.0 + 1e-6)
        assert np.abs(acc).max() <= bounds[1] * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_lag_makes_the_puppet_late(conduct):
    prompt, late = (kinematic_inputs(conduct, False, lag=lag) for lag in (0.0, 0.2))
    hand = conduct.marionette.coordinates.q_K.index("hand_left.length")
    t = np.linspace(2.0, 6.0, 400)
    path = gaussian_filter1d(late.inputs.evaluate(t)[0][:, hand], 1.0)
    delays = np.linspace(0.3, 0.9, 61)
    off = [np.std(prompt.inputs.evaluate(t - delay)[0][:, hand] - path) for delay in delays]
    assert delays[np.argmin(off)] == pytest.approx(0.5, abs=0.15)


def test_bounds_too_tight_to_follow_are_refused(conduct):
    with pytest.raises(fan.errors.StateError, match="cannot follow"):
        kinematic_inputs(conduct, speed=1e-6)


def test_strings_are_vertical_above_poses_near_the_clip(conduct):
    baseline = kinematic_inputs(conduct, False)
    for part, errors in baseline.errors.items():
        assert np.sqrt(np.mean(errors**2)) < 0.03 * conduct.figure.height, part
    table = conduct.marionette.coordinates
    times = np.minimum(baseline.times[::20], baseline.inputs.end)
    q_K, _, _ = baseline.inputs.evaluate(times)
    points = conduct.marionette.string_points(baseline.q_D[::20], q_K).values()
    for string, path in zip(conduct.marionette.tree.strings, points, strict=True):
        low, high = path[:, 0], path[:, -1]
        np.testing.assert_allclose(low[:, :2], high[:, :2], atol=0.01)  # of the smoothing
        column = table.q_K.index(f"{string.name}.length")
        np.testing.assert_allclose(high[:, 2] - low[:, 2], q_K[:, column], atol=0.01)
    assert {string.name for string in tied_strings(conduct.figure, conduct.start)} == set(
        baseline.widths
    )
