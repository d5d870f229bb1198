"""States of runs: every function takes them in their mode, and runs continue from them."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.compiled import ActiveSet, Evaluation, check_start
from fantoccini.model.puppet import loads
from fantoccini.motion import State

pytestmark = pytest.mark.medium

FIXED = ("timestepping", "variational")


@pytest.fixture(scope="module")
def lift(arm):
    return fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})


@pytest.fixture(scope="module")
def wandering(marionette):
    """One second of the marionette with wandering strings, by method."""
    x0 = marionette.rest()
    inputs = fan.motion.Inputs.random(marionette, 1, seed=1, t_end=1.0).bound(x0.q_K)[0]
    runs = {m: fan.simulate(marionette, x0, inputs, method=alone(m)) for m in FIXED}
    return inputs, runs


def alone(method):
    """The method, with steps that depend on their state alone."""
    return fan.TimeStepping(extrapolate=False) if method == "timestepping" else method


def forces(run: fan.Trajectory, row: int) -> np.ndarray:
    return np.concatenate([run.tension.values[row], run.limit_force.values[row]])


@pytest.mark.parametrize("method", FIXED)
def test_states_of_fixed_steps_have_the_tensions_of_their_run(marionette, wandering, method):
    """Accelerations use the mode of the state, for any gaps left by a step."""
    run = wandering[1][method]
    events = np.array([e.t for e in run.events])
    differences = []
    for i, t in enumerate(run.t):
        x = run.state(i)
        _, tension = marionette.forward_dynamics(x, run.acc_K[i])
        assert np.all(tension[~x.taut] == 0.0) or method == "variational"
        if np.any(x.taut):
            assert np.any(tension[x.taut] > 0.0), f"row {i}"
        if np.min(np.abs(events - t), initial=np.inf) > 0.0045:
            differences.append(np.max(np.abs(tension - forces(run, i))) / marionette.weight)
    assert len(differences) > 100
    assert np.median(differences) < 0.05 and np.quantile(differences, 0.9) < 0.3


def test_tensions_of_stepped_states_are_of_the_steps_order(arm, lift):
    """The difference of accelerations from the run's tensions shrinks with the step."""
    x0, worst = arm.rest({"hand.length": 0.8}), []
    for dt in (0.004, 0.002):
        run = fan.simulate(arm, x0, lift, t_end=1.4, method=fan.TimeStepping(dt=dt))
        differences = [
            np.max(np.abs(arm.forward_dynamics(run.state(i), run.acc_K[i])[1] - forces(run, i)))
            for i in range(1, len(run))
        ]
        worst.append(max(differences))
    assert 0.3 < worst[1] / worst[0] < 0.7 and worst[1] < 0.1 * arm.weight


def test_stepped_states_are_linearised_in_their_mode(arm, lift):
    """The rows of a linearisation are the taut ones in the run."""
    x0 = arm.rest({"hand.length": 0.8})
    run = fan.simulate(arm, x0, lift, t_end=1.4, method="timestepping")
    for i in range(0, len(run), 25):
        lin = arm.linearise(run.state(i), run.acc_K[i])
        assert lin.rows == ("hand",)
        np.testing.assert_allclose(
            lin.acc_D, arm.forward_dynamics(run.state(i), run.acc_K[i])[0], rtol=1e-9, atol=1e-9
        )


def test_project_keeps_taut_strings(arm, lift):
    """A string that is slack by some nanometres and taut in the mode gets its length."""
    x0 = arm.rest({"hand.length": 0.8})
    run = fan.simulate(arm, x0, lift, t_end=1.4, method="timestepping")
    gaps = [(Evaluation.at_state(arm, run.state(i)).h[0], i) for i in range(len(run))]
    for h, i in (min(gaps), max(gaps)):
        x = run.state(i)
        projected = arm.project(x)
        evaluation = Evaluation.at_state(arm, projected)
        assert (
            abs(evaluation.h[0]) < 1e-13 and abs(evaluation.hdot[0]) < 1e-12 and projected.taut[0]
        )
        assert np.max(np.abs(projected.q_D - x.q_D)) < 10.0 * abs(h)
        check_start(arm, projected)
    assert min(gaps)[0] < -1e-9


def test_projected_states_of_the_marionette_start_event_driven_runs(marionette, wandering):
    """`project` keeps the mode, and an event-driven run begins in it."""
    inputs, runs = wandering
    for method in FIXED:
        for i in range(0, 480, 60):
            x = runs[method].state(i)
            projected = marionette.project(x)
            assert np.all(np.abs(Evaluation.at_state(marionette, projected).h[x.taut]) < 1e-9)
            run = fan.simulate(marionette, projected, inputs, t_end=x.t + 0.002, effort=False)
            assert run.status.name == "DONE"


def test_an_active_set_that_is_wrong_is_refused(arm):
    """A slack string in the active set makes a state invalid."""
    x = arm.state({"hand.length": 0.8, "shoulder": 0.9, "elbow": 0.3})
    x = x.replace(q_K=[0.45, 1.5], taut=[True])
    with pytest.raises(fan.errors.StateError, match=r"range: hand by"):
        arm.forward_dynamics(x)
    with pytest.raises(fan.errors.StateError, match="hand is marked taut and slack by"):
        check_start(arm, x)
    assert not arm.project(x).taut[0]
    free = x.replace(taut=[False])
    assert arm.forward_dynamics(free)[1].tolist() == [0.0]


def test_another_motion_has_another_mode(arm):
    """A changed motion has its own mode; a bob that moves up leaves its string slack."""
    x = arm.rest({"hand.length": 0.8})
    assert x.taut[0] and x.replace(t=2.0, v_D=x.v_D).taut[0]
    up = x.replace(v_D=-10.0 * arm.A_D(x)[0])
    assert not up.taut[0] and arm.forward_dynamics(up)[1][0] == 0.0
    assert x.replace(v_D=[0.1, 0.0], taut=x.taut).taut[0]


def test_a_string_overstepped_at_rest_is_closed(arm):
    """No row counts as slack because of its violation."""
    x = arm.rest({"hand.length": 0.8})
    short = x.replace(q_K=[x.q_K[0], 0.8 - 1e-4])
    assert ActiveSet.at_state(arm, short, Evaluation.at_state(arm, short)).held[0]
    assert arm.forward_dynamics(short)[1][0] == pytest.approx(
        arm.forward_dynamics(x)[1][0], rel=0.01
    )


# -- continued runs ---------------------------------------------------------------------------


@pytest.mark.parametrize("method", FIXED)
def test_a_run_continues_from_any_of_its_rows(marionette, wandering, method):
    """A fixed-step run begins at any row of its own kind, and continues it."""
    inputs, runs = wandering
    full_run = runs[method]
    for i in range(0, len(full_run) - 5, 7):
        x = full_run.state(i)
        part = fan.simulate(
            marionette, x, inputs, t_end=full_run.t[i + 5], method=alone(method), effort=False
        )
        np.testing.assert_allclose(part.q_D[-1], full_run.q_D[i + 5], atol=1e-9)
        np.testing.assert_allclose(part.v_D[-1], full_run.v_D[i + 5], atol=1e-7)
    last = fan.simulate(marionette, full_run.state(len(full_run) - 1), t_end=1.1, method=method)
    assert last.status.name == "DONE"


@pytest.mark.parametrize("method", FIXED)
def test_a_run_continues_a_hundred_times(arm, lift, method):
    """Pieces, each from the end of the last one, equal the whole run."""
    x = arm.project(arm.rest({"hand.length": 0.8}).replace(v_D=[1.0, -2.0]))
    full_run = fan.simulate(arm, x, lift, t_end=1.0, method=alone(method))
    for k in range(100):
        end = (k + 1) * 0.01
        x = fan.simulate(arm, x, lift, t_end=end, method=alone(method)).state(-1)
    np.testing.assert_allclose(x.q_D, full_run.q_D[-1], atol=1e-8)
    np.testing.assert_allclose(x.v_D, full_run.v_D[-1], atol=1e-6)


def test_extrapolating_steps_continue_within_their_error(arm, lift):
    """A continued run lacks the earlier accelerations: an error of one step each."""
    x0 = arm.project(arm.rest({"hand.length": 0.8}).replace(v_D=[1.0, -2.0]))
    runs = {
        dt: fan.simulate(arm, x0, lift, t_end=1.0, method=fan.TimeStepping(dt=dt))
        for dt in (0.002, 0.001)
    }
    error = np.abs(runs[0.002].q_D[-1] - runs[0.001].q_D[-1]).max()
    x = x0
    for k in range(100):
        x = fan.simulate(arm, x, lift, t_end=(k + 1) * 0.01, method="timestepping").state(-1)
    assert 0.0 < np.abs(x.q_D - runs[0.002].q_D[-1]).max() < error


def test_an_event_driven_run_continues_from_its_rows(arm, lift):
    """The tolerance is that of the integrator."""
    x0 = arm.project(arm.rest({"hand.length": 0.8}).replace(v_D=[1.0, -2.0]))
    full_run = fan.simulate(arm, x0, lift, t_end=0.5)
    for i in range(0, len(full_run), max(1, len(full_run) // 10)):
        x = full_run.state(i)
        if x.t < 0.5 and not np.any(full_run.t[i + 1 : i + 2] == x.t):
            part = fan.simulate(arm, x, lift, t_end=0.5)
            np.testing.assert_allclose(part.q_D[-1], full_run.q_D[-1], atol=1e-7)


@pytest.mark.parametrize("before", [0.0, 1e-13, 1e-11, 1e-10, 1e-9, 1e-7])
def test_a_run_that_ends_at_a_catch_continues(arm, before):
    """The start was refused: the string is at its bound and moves past it."""
    x0 = arm.rest({"hand.length": 0.8})
    points = [(0, 0.8), (0.15, 0.5), (0.4, 0.5), (0.6, 0.8)]
    jerk = fan.Input.waypoints(arm, {"hand.length": points})
    full_run = fan.simulate(arm, x0, jerk, t_end=1.0)
    catches = [event for event in full_run.events if event.kind == "catch"]
    assert catches
    for event in catches:
        part = fan.simulate(arm, x0, jerk, t_end=event.t - before)
        rest = fan.simulate(arm, part.state(-1), jerk, t_end=1.0)
        np.testing.assert_allclose(rest.q_D[-1], full_run.q_D[-1], atol=1e-7)
        # The catch is in one of the two runs.
        impulses = [e.impulse for run in (part, rest) for e in run.events if e.kind == "catch"]
        assert max(impulses) == pytest.approx(max(e.impulse for e in catches), rel=1e-5)
        assert len(impulses) == len(catches)


def test_a_request_for_exact_lengths_has_a_remedy(arm, lift):
    """If a method cannot begin at a state, the message says how to correct it."""
    run = fan.simulate(arm, arm.rest({"hand.length": 0.8}), lift, method="timestepping")
    gaps = [Evaluation.at_state(arm, run.state(i)).h[0] for i in range(len(run))]
    for i, says in ((int(np.argmin(gaps)), "slack by"), (int(np.argmax(gaps)), "violated by")):
        with pytest.raises(fan.errors.StateError, match=rf"hand .*{says}.*marionette.project"):
            fan.simulate(arm, run.state(i), lift)


def test_far_too_short_is_refused_by_time_stepping_too(arm):
    """A violation larger than those of steps is a mistake."""
    x = arm.rest({"hand.length": 0.8})
    short = x.replace(q_K=[x.q_K[0], 0.79])
    with pytest.raises(fan.errors.StateError, match=r"hand is violated by 0.01"):
        fan.simulate(arm, short, t_end=0.1, method="timestepping")


SLIPPING = """
puppet: between
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: left, path: [{body: bob}, {driven: [x], at: [-1, 0, 0.5]}], length: 1.2,
     max_tension: 30, rewind_speed: 0.3}
  - {name: right, path: [{body: bob}, {driven: [x], at: [1, 0, 0.5]}], length: 1.2}
"""


def test_runs_with_a_slipping_winch_continue():
    """The winch's tension is that of the run, and continued runs slip as the whole."""
    between = fan.loads(SLIPPING)
    inputs = fan.Input.waypoints(between, {"left.x": [(0, -1.0), (2, -2.0), (4, -1.0)]})
    full_run = fan.simulate(between, between.rest(), inputs, t_end=4.0, method="timestepping")
    differences = []
    for i in range(10, len(full_run), 10):
        x = full_run.state(i)
        tension = between.forward_dynamics(x, full_run.acc_K[i])[1]
        differences.append(np.max(np.abs(tension - forces(full_run, i))))
    assert np.median(differences) < 0.05 * 30.0
    for i in range(0, len(full_run) - 60, 250):
        part = fan.simulate(
            between, full_run.state(i), inputs, t_end=full_run.t[i + 50], method="timestepping"
        )
        np.testing.assert_allclose(part.q_D[-1], full_run.q_D[i + 50], atol=1e-9)
        np.testing.assert_allclose(part.slip.values[-1], full_run.slip.values[i + 50], atol=1e-9)


# -- invalid states ---------------------------------------------------------------------------


def test_a_state_of_another_puppet_is_named(arm, marionette):
    """The message is about states, not about the widths of a generated function."""
    x = marionette.rest()
    nameless = State(0.0, x.q_D, x.v_D, x.q_K, x.v_K, x.taut)
    for state in (x, nameless):
        for ask in (
            arm.forward_dynamics,
            arm.mass_matrix,
            arm.linearise,
            arm.linearise_step,
            arm.project,
            arm.modes,
            arm.stepper,
            arm.flow,
            arm.kinetic_energy,
            arm.rest,
            lambda x: arm.energies(x),
            lambda x: Evaluation.at_state(arm, x),
            lambda x: fan.simulate(arm, x, t_end=0.1),
            lambda x: fan.simulate_batch(arm, [x, x], t_end=0.1),
            lambda x: fan.dynamics.sensitivity(arm, x, t_end=0.1),
        ):
            with pytest.raises(fan.errors.StateError, match="another puppet"):
                ask(state)


def test_a_run_has_one_puppet(arm):
    """Two puppets do not combine."""
    with pytest.raises(TypeError, match="one Marionette"):
        fan.simulate([arm, arm], arm.rest(), t_end=0.1)


def test_a_wire_that_is_slack_is_named(arm):
    """A state that no configuration satisfies names a row, also one that is too short."""
    text = """
puppet: too_short
bodies:
  - name: bob
    joint: {type: prismatic, axis: [1, 0, 0]}
    shapes: [{type: sphere, radius: 0.02, mass: 0.1}]
strings:
  - {name: rod, path: [{body: bob}, {world: [0, 0, 1]}], length: 0.5, wire: true}
"""
    puppet = fan.Marionette(loads(text))
    with pytest.raises(fan.errors.StateError, match=r"lengths: rod is too short by 500 mm"):
        puppet.project(puppet.state())


@pytest.mark.parametrize("part", ["t", "q_D", "v_D", "q_K", "v_K", "slip"])
def test_nan_is_in_no_state(arm, part):
    """A state with a part that is not a number is refused."""
    x = arm.rest({"hand.length": 0.8})
    value = np.array(getattr(x, part), dtype=float)
    for number in (np.nan, np.inf):
        wrong = number if part == "t" else np.where(np.arange(value.size) == 0, number, value)
        with pytest.raises(fan.errors.StateError, match=rf"{part}.* is {number}"):
            x.replace(**{part: wrong})


def test_nan_is_in_no_argument(arm):
    """Accelerations, forces, steps, times, tolerances, parameters, inputs."""
    x, nan = arm.rest({"hand.length": 0.8}), np.nan
    stepper, hold = arm.stepper(x), fan.Input.hold(arm)
    for ask in (
        lambda: arm.forward_dynamics(x, [nan, 0.0]),
        lambda: arm.forward_dynamics(x, None, [nan, 0.0]),
        lambda: arm.linearise(x, [nan, 0.0]),
        lambda: arm.linearise_step(x, [0.0, nan]),
        lambda: arm.linearise_step(x, dt=nan),
        lambda: arm.stepper(x, method=fan.TimeStepping(dt=nan)),
        lambda: arm.stepper(x, fan.Event(rtol=nan)),
        lambda: stepper.advance(nan),
        lambda: stepper.advance(0.1, {"hand.length": nan}),
        lambda: stepper.advance(0.1, u_D=[nan, 0.0]),
        lambda: stepper.run(nan, lambda x: None, 10.0),
        lambda: stepper.run(1.0, lambda x: None, nan),
        lambda: arm.wrench_forces(x, {"lower": [nan] * 6}),
        lambda: arm.with_parameters({"m2": nan}),
        lambda: arm.with_winches([[nan, 0.0, 0.0]]),
        lambda: arm.difference([nan, 0.0], [0.0, 0.0]),
        lambda: fan.dynamics.sensitivity(arm, x, t_end=0.1, rtol=nan),
        lambda: fan.dynamics.sensitivity(arm, x, t_end=0.1, save_at=[nan]),
        lambda: fan.simulate(arm, x, t_end=0.1, method=fan.Event(rtol=nan)),
        lambda: fan.simulate(arm, x, t_end=0.1, method="timestepping", save_every=nan),
        lambda: fan.Input.hold(arm, nan),
        lambda: hold.bound([0.45, nan]),
        lambda: hold.with_rest_until(nan),
        lambda: hold.with_forces({"elbow": [(0.0, nan)]}),
        lambda: fan.Input.segments(arm, [0.0, 1.0], [0.45, 0.8], [0.0, 0.0], [[nan, 0.0]]),
        lambda: fan.motion.Inputs.random(arm, 2, reach=nan),
        lambda: arm.state({"elbow": nan}),
    ):
        with pytest.raises((ValueError, fan.FantocciniError), match=r"nan|finite|increase"):
            ask()


def test_a_puppet_at_rest_has_no_velocities(arm):
    with pytest.raises(fan.errors.StateError, match="at rest has no velocities"):
        arm.rest({"v:elbow": 0.1})
