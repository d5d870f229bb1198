"""Feedback by model predictive control: bounds, tracking, and counts of updates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import StateError
from fantoccini.control.optimal.prediction import with_inputs_fitting_strings

pytestmark = pytest.mark.slow

TIP_IN_LOWER = (0.3, 0.0, 0.0)


def tip_position(arm: fan.Marionette, x: fan.State) -> np.ndarray:
    pose = arm.pose(x, "lower")
    return pose[:3, 3] + pose[:3, :3] @ np.array(TIP_IN_LOWER)


def kicked_state(arm: fan.Marionette, size: float) -> fan.State:
    random = np.random.default_rng(4)
    kick = random.normal(size=arm.coordinates.n_vD)
    return arm.project(arm.rest().replace(v_D=size * kick / np.linalg.norm(kick)))


def state_after(arm: fan.Marionette, mpc: fan.MPC | None, x0: fan.State, n: int) -> fan.State:
    stepper = arm.stepper(x0, fan.TimeStepping(dt=0.001))
    for _ in range(n):
        acc_K = None if mpc is None else mpc.step(stepper.state)
        stepper.advance(0.02 if mpc is None else mpc.interval, acc_K)
    return stepper.state


def holding_mpc(arm: fan.Marionette, **options: object) -> fan.MPC:
    target = tip_position(arm, arm.rest())
    return fan.MPC(arm, {("lower", TIP_IN_LOWER): target}, horizon=0.6, nodes=30, **options)


def test_a_kicked_arm_settles_earlier_with_feedback(arm):
    x0, target = kicked_state(arm, 2.0), tip_position(arm, arm.rest())
    distances = [
        np.linalg.norm(tip_position(arm, state_after(arm, mpc, x0, 75)) - target)
        for mpc in (holding_mpc(arm), None)
    ]
    assert distances[0] < 2e-3
    assert distances[1] > 5.0 * distances[0]


def test_an_undisturbed_arm_at_rest_is_not_moved(arm):
    mpc, x0 = holding_mpc(arm), arm.rest()
    stepper = arm.stepper(x0)
    for _ in range(5):
        acc_K = mpc.step(stepper.state)
        assert acc_K == pytest.approx(0.0, abs=1e-4)
        stepper.advance(mpc.interval, acc_K)


def test_bounds_of_inputs_are_never_left(arm):
    bounds = fan.control.Bounds(acceleration=0.2, speed=0.08)
    mpc = holding_mpc(arm, bounds=bounds)
    stepper, accelerations = arm.stepper(kicked_state(arm, 2.0)), []
    for _ in range(40):
        acc_K = mpc.step(stepper.state)
        stepper.advance(mpc.interval, acc_K)
        assert np.all(np.abs(acc_K) <= 0.2 + 1e-12)
        assert np.all(np.abs(stepper.state.v_K) <= 0.08 * (1.0 + 1e-6))
        accelerations.append(np.max(np.abs(acc_K)))
    assert max(accelerations) > 0.19


def test_the_state_after_the_measurement_is_predicted(arm):
    """The answers are the same for an older state with known inputs since then."""
    prompt_mpc, late_mpc = holding_mpc(arm), holding_mpc(arm)
    x = kicked_state(arm, 1.0)
    for mpc in (prompt_mpc, late_mpc):
        mpc.step(x)
    stepper = arm.stepper(x, fan.TimeStepping(dt=0.5 * prompt_mpc.interval, extrapolate=False))
    later = stepper.advance(prompt_mpc.interval, prompt_mpc.acceleration(x.t))
    assert late_mpc.step(x, later.t) == pytest.approx(prompt_mpc.step(later), abs=1e-6)


@pytest.mark.parametrize("difference", [0.005, -0.005])
def test_strings_longer_or_shorter_than_those_of_the_model_hardly_matter(arm, difference):
    """Regression: with strings 5 mm off, feedback was worse than none."""
    target, x0 = tip_position(arm, arm.rest()), kicked_state(arm, 0.5)
    lengths = [i for i, name in enumerate(arm.coordinates.q_K) if name.endswith(".length")]
    error = np.zeros(len(x0.q_K))
    error[lengths] = difference
    # The state of a puppet whose strings are longer or shorter than their commands.
    stepper = arm.stepper(arm.project(x0.replace(q_K=x0.q_K + error)), fan.TimeStepping(dt=0.001))
    mpc = holding_mpc(arm)
    for _ in range(75):
        x = stepper.state
        stepper.advance(mpc.interval, mpc.step(x.replace(q_K=x.q_K - error, taut=x.taut)))
    assert np.linalg.norm(tip_position(arm, stepper.state) - target) < 2e-3


def test_inputs_are_corrected_by_millimetres_where_strings_are_nearly_parallel():
    """Misfits of opposite sign would need a large displacement of a hand to vanish."""
    puppet = fan.loads(
        """
puppet: two_strings
bodies:
  - name: bar
    joint: {type: translation, axes: [x, z], driven: true, at: [0, 0, 1]}
  - name: place
    joint: {type: translation, axes: [x, z]}
  - name: weight
    parent: place
    joint: {type: revolute, axis: [0, 1, 0]}
    shapes: [{type: box, size: [0.05, 0.05, 0.02], mass: 0.5}]
strings:
  - name: left
    path: [{body: weight, at: [-0.02, 0, 0]}, {body: bar, at: [-0.01, 0, 0]}]
    length: 1
  - name: right
    path: [{body: weight, at: [0.02, 0, 0]}, {body: bar, at: [0.01, 0, 0]}]
    length: 1
"""
    )
    x = puppet.rest()
    x = x.replace(q_D=x.q_D + np.array([0.0, 0.0, 0.2]), taut=np.ones_like(x.taut))
    h = puppet.constraint(x)
    assert h.min() < -2e-3 and h.max() > 2e-3
    fitted = with_inputs_fitting_strings(puppet, x)
    assert 0.0 < np.max(np.abs(fitted.q_K - x.q_K)) < 0.02


def test_missed_deadlines_and_skipped_intervals_are_counted(arm):
    x = kicked_state(arm, 1.0)
    quick, slow = holding_mpc(arm, deadline=100.0), holding_mpc(arm, deadline=1e-9)
    for mpc in (quick, slow):
        mpc.step(x)
        planned = mpc.acceleration(x.t + 2.5 * mpc.interval)
        assert planned == pytest.approx(mpc.prediction.acc_K[2])
        mpc.step(x.replace(t=x.t + 4.0 * mpc.interval))
        assert (mpc.updates, mpc.skipped) == (2, 3)
        assert mpc.latency >= mpc.seconds > 0.0
    assert (quick.missed, slow.missed) == (0, 2)


def test_a_task_advances_with_time(arm):
    """A path is followed beyond the horizon; tracks that do not count yet are allowed."""
    target = tip_position(arm, arm.rest())

    def path(t: float) -> np.ndarray:
        s = min(max(t, 0.0), 1.0)
        return target + np.array([0.05 * s**3 * (10.0 + s * (6.0 * s - 15.0)), 0.0, 0.0])

    late = fan.control.Track.velocity("*", 0.0, weight=1e-3, start=1.0)
    tracks = [fan.control.Track.point("lower", path, at=TIP_IN_LOWER, weight=1e4), late]
    task = fan.Task(arm, arm.rest(), 1.5, tracks, bounds=fan.control.Bounds(acceleration=10.0))
    x = state_after(arm, fan.MPC(arm, task, horizon=0.4, nodes=20), arm.rest(), 75)
    assert np.linalg.norm(tip_position(arm, x) - path(1.5)) < 2e-3


def test_mistakes_are_named(arm):
    task = fan.Task(arm, arm.rest(), 1.0, [fan.control.Track.velocity("*")])
    with pytest.raises(StateError, match="another puppet"):
        fan.MPC(fan.puppets.arm2d(), task)
    with pytest.raises(StateError, match="free"):
        fan.MPC(arm, replace(task, duration=(1.0, 2.0)))
    with pytest.raises(StateError, match="has an end"):
        fan.MPC(arm, replace(task, end=arm.rest()))
    with pytest.raises(StateError, match="before the state's time"):
        fan.MPC(arm, task).step(arm.rest().replace(t=1.0), 0.5)
    with pytest.raises(fan.errors.UnknownNameError):
        fan.MPC(arm, {"lowr": (0.0, 0.0, 0.0)})


def test_a_marionette_continues_its_circle_after_a_kick():
    """25 degrees of freedom, 21 inputs, 50 nodes; strings go slack on the way."""
    task = fan.control.load_task("circle")
    puppet = task.marionette
    unheld_task = replace(task, bounds=replace(task.bounds, held=(), speed=1.5))
    mpc = fan.MPC(puppet, unheld_task)
    random = np.random.default_rng(1)
    kick = random.normal(size=25)
    stepper = puppet.stepper(
        puppet.project(task.x0.replace(v_D=2.0 * kick / np.linalg.norm(kick))),
        fan.TimeStepping(dt=0.001),
    )
    distances, slack_count = [], 0
    for _ in range(75):
        x = stepper.advance(mpc.interval, mpc.step(stepper.state))
        pose = puppet.pose(x, "forearm_right")
        hand = pose[:3, 3] + pose[:3, :3] @ np.array([0.0, 0.0, -0.09])
        distances.append(np.linalg.norm(hand - task.tracks[0].path(x.t)))
        slack_count += not np.all(x.taut[:7])
    assert slack_count > 0 and max(distances) > 0.01
    assert max(distances[-25:]) < 0.1 * max(distances)
    assert mpc.braked == 0


def test_a_standing_puppet_is_kept_in_place():
    """It is kicked at 0.45 m/s, with its feet on the floor: without feedback it keeps swinging."""
    stage = fan.puppets.promenade()
    rest_position, x0 = stage.pose(stage.rest(), "torso")[:3, 3], stage.rest()
    kick = np.zeros(stage.coordinates.n_vD)
    kick[:2] = 0.4, 0.2
    rms_distances, final_distances = [], []
    for has_feedback in (False, True):
        mpc = fan.MPC(stage, {"torso": rest_position}, horizon=0.5, nodes=20)
        stepper = stage.stepper(stage.project(x0.replace(v_D=kick)), fan.TimeStepping(dt=1e-3))
        distances = []
        for _ in range(60):
            stepper.advance(mpc.interval, mpc.step(stepper.state) if has_feedback else None)
            distances.append(
                np.linalg.norm(stage.pose(stepper.state, "torso")[:3, 3] - rest_position)
            )
        rms_distances.append(float(np.sqrt(np.mean(np.square(distances)))))
        final_distances.append(max(distances[-10:]))
    assert rms_distances[1] < 0.6 * rms_distances[0]
    assert final_distances[1] < 0.2 * final_distances[0]
    assert not mpc.braked
