"""Motors too weak for their load are events, are in the summary, and set the status."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import scipy.integrate
from tests.harness import method_of

import fantoccini as fan
from fantoccini.app.cli_support.reporting import report_run
from fantoccini.base.errors import SimulationError, Status

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets, pytest.mark.long]

HOIST = """
puppet: hoist
bodies:
  - {name: bob, joint: {type: translation, axes: [z]}, mass: 0.3}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: driven}
drives:
  - on: line.length
    inertia: 1.0e-5
    drum: 0.01
    friction: {viscous: 1.0e-6}
"""
STEPPER = "    motor: {type: stepper, torque: {parameter: T, value: 0.05}}\n"
SERVO = """\
    motor: {type: servo, torque: {parameter: T, value: 0.05}}
    control: {type: computed_torque, bandwidth: 30}
"""
LOAD = 0.3 * 9.81 * 0.01
"""Torque of the bob on the motor at rest [N m]."""
COMMANDED_LENGTH = 0.01 * 2 * np.pi / 3200 * 25465
"""A length that is a whole number of microsteps, near 0.5 m."""
SOFT = """\
    motor: {type: servo, torque: 0.05}
    control: {type: pd, stiffness: 0.01, damping: 0.001}
"""
SOFT_WITHOUT_MOTOR = "    control: {type: pd, stiffness: 0.01, damping: 0.001}\n"
METHODS = ("event", "timestepping", "variational")


def with_short_steps(method: str) -> fan.dynamics.Method:
    """A method with short steps."""
    return method_of(method, dt=1e-4)


@pytest.fixture(scope="module")
def stepped():
    return fan.loads(HOIST + STEPPER)


@pytest.fixture(scope="module")
def servoed():
    return fan.loads(HOIST + SERVO)


def lost_steps(run) -> list[float]:
    return [e.t for e in run.events if e.kind == "lost_step"]


def time_of_first_lost_step(torque: float) -> float:
    """Time at which a rotor under the load passes the 2nd full step from its command."""
    mass = 0.3 * 0.01**2 + 1e-5

    def rates(t, y):
        return [y[1], (LOAD - torque * np.sin(50 * y[0]) - 1e-6 * y[1]) / mass]

    start = [np.arcsin(LOAD / 0.05) / 50, 0.0]
    how = {"rtol": 1e-11, "atol": 1e-12, "max_step": 1e-3}
    (times,) = scipy.integrate.solve_ivp(
        rates, (0, 0.03), start, events=lambda t, y: 50 * y[0] - np.pi, **how
    ).t_events
    return float(times[0])


@pytest.mark.parametrize("method", METHODS)
def test_a_weak_stepper_loses_steps(stepped, method):
    """Steps are lost at the times of the rotor's equation, and the run is not DONE."""
    x0, weak = stepped.rest({"line.length": COMMANDED_LENGTH}), stepped.with_parameters({"T": 0.02})
    run = fan.simulate(weak, x0, t_end=0.04, method=with_short_steps(method), throw=False)
    first = time_of_first_lost_step(0.02)
    assert lost_steps(run)[0] == pytest.approx(first, abs=1e-8 if method == "event" else 3e-4)
    assert run.status is Status.LOST_STEPS and run.t[-1] == 0.04
    assert run.causes == ("line.length",)
    drive = run.summary()["drives"]["line.length"]
    assert drive["lost_steps"] == 3 and not drive["ran_away"] and drive["error"] < 0
    strong = fan.simulate(stepped, x0, t_end=0.04, method=with_short_steps(method))
    assert not lost_steps(strong) and not strong.summary()["drives"]


def test_an_overstepped_row_precedes_lost_steps():
    """This holds in single runs and in batches; the drive is not named in the attribution."""
    link = "{name: link, path: [{world: [2, 0, 0]}, {driven: [x], at: [2.5, 0, 0]}], length: 0.55}"
    puppet = fan.loads((HOIST + STEPPER).replace("drives:", f"  - {link}\ndrives:"))
    x0, weak = puppet.rest({"line.length": COMMANDED_LENGTH}), puppet.with_parameters({"T": 0.02})
    inputs = [fan.Input.waypoints(weak, {"link.x": [(0, 2.5), (0.04, x)]}) for x in (2.5, 2.6)]
    how = {"t_end": 0.04, "method": with_short_steps("timestepping")}
    runs = [fan.simulate(weak, x0, x_inputs, throw=False, **how) for x_inputs in inputs]
    many = fan.simulate_batch(weak, x0, inputs, **how)
    for statuses in ([run.status for run in runs], many.status.tolist()):
        assert statuses == [Status.LOST_STEPS, Status.OVERSTEPPED]
    assert lost_steps(runs[1]) and not runs[1].causes and not many.causes(1)


def test_a_flows_guard_locates_the_first_lost_step(stepped):
    x0, weak = stepped.rest({"line.length": COMMANDED_LENGTH}), stepped.with_parameters({"T": 0.02})
    flow = weak.flow(x0)
    solution = scipy.integrate.solve_ivp(
        flow.rate,
        (flow.t0, 0.03),
        flow.y0,
        rtol=1e-9,
        atol=1e-9,
        events=lambda t, y: flow.guards(t, y)[len(flow.rows)],
    )
    assert solution.t_events[0][0] == pytest.approx(time_of_first_lost_step(0.02), abs=1e-6)


@pytest.mark.parametrize("method", ["timestepping", "variational"])
def test_a_winch_that_runs_away_ends_the_run(stepped, method, capsys):
    """It does not fall for ever; the message states a sufficient holding torque."""
    x0, weak = stepped.rest({"line.length": COMMANDED_LENGTH}), stepped.with_parameters({"T": 0.02})
    with pytest.raises(SimulationError, match=r"line\.length ran away from t = 0\.01") as caught:
        fan.simulate(weak, x0, t_end=5.0, method=with_short_steps(method))
    run = caught.value.trajectory
    assert run.status is Status.RUNAWAY and caught.value.status is run.status
    out = run.q_D[-1, run.coordinates.q_D.index("line.length")] - 0.5
    assert 1.0 < out < 1.01
    assert f"needs {LOAD:.3g} N m" in str(caught.value) and "has 0.02" in str(caught.value)
    report_run(run, 1.0)
    assert "line.length ran away" in capsys.readouterr().out
    held = stepped.with_parameters({"T": 1.02 * LOAD})
    run = fan.simulate(
        held,
        held.rest({"line.length": COMMANDED_LENGTH}),
        t_end=0.2,
        method=with_short_steps(method),
    )
    assert run.status is Status.DONE


@pytest.mark.parametrize("method", METHODS)
def test_a_servo_that_is_too_weak_runs_away(servoed, method):
    """0.1 m below all its commands, with its motor at its bound: s = a t^2 / 2."""
    x0, torque = servoed.state({"line.length": COMMANDED_LENGTH}), 0.02
    x0 = servoed.project(x0)
    weak = servoed.with_parameters({"T": torque})
    run = fan.simulate(weak, x0, t_end=0.4, method=with_short_steps(method), throw=False)
    (event,) = [e for e in run.events if e.kind == "runaway"]
    fall = 0.01 * (LOAD - torque) / (0.3 * 0.01**2 + 1e-5)
    assert event.name == "line.length"
    assert event.t == pytest.approx(np.sqrt(0.2 / fall), rel=0.03)
    assert run.status is Status.RUNAWAY and run.t[-1] == 0.4
    strong = fan.simulate(servoed, x0, t_end=0.4, method=with_short_steps(method))
    assert strong.status is Status.DONE


def test_a_motor_that_lags_does_not_run_away(servoed):
    """A motor that reaches its bound on the way still gets to its command."""
    move = fan.Input.waypoints(servoed, {"line.length": [(0, 0.9), (0.05, 0.3)]})
    x0 = servoed.rest({"line.length": 0.9})
    tight = servoed.with_parameters({"T": 0.04})
    run = fan.simulate(tight, x0, move, t_end=1.5, method="timestepping", throw=False)
    lag = run.q_D[:, run.coordinates.q_D.index("line.length")] - run.q_K[:, 0]
    assert lag.max() > 0.3 and abs(lag[-1]) < 0.04
    assert run.status is Status.DONE


def test_batches_report_each_lane(stepped):
    """Strong and weak motors side by side; a lane that runs away ends alone."""
    x0 = stepped.rest({"line.length": COMMANDED_LENGTH})
    gentle = fan.Input.hold(stepped).bound(x0.q_K)
    rough = fan.Input.waypoints(stepped, {"line.length": [(0, COMMANDED_LENGTH), (0.03, 0.35)]})
    inputs = [gentle, rough.with_rest_until(0.2).bound(x0.q_K), gentle]
    for method in ("timestepping", "variational"):
        many = fan.simulate_batch(stepped, x0, inputs, t_end=0.8, method=with_short_steps(method))
        assert many.status.tolist() == [Status.DONE, Status.RUNAWAY, Status.DONE]
        assert many.causes(1) == ("line.length",) and not many.causes(0)
        assert many.reached[1] < 0.8 == many.reached[0]
        single = fan.simulate(
            stepped, x0, inputs[1], t_end=0.8, method=with_short_steps(method), throw=False
        )
        assert (single.status, single.t[-1]) == (Status.RUNAWAY, pytest.approx(many.reached[1]))


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_a_copied_stepper_has_lost_the_same_steps(stepped, method):
    """A copy's motors used to restart at their present tooth."""
    x0 = stepped.rest({"line.length": COMMANDED_LENGTH})
    stepper = stepped.with_parameters({"T": 0.02}).stepper(x0, with_short_steps(method))
    stepper.advance(0.02)
    assert stepper.status is Status.LOST_STEPS
    copied = pickle.loads(pickle.dumps(stepper))
    for _ in range(10):
        stepper.advance(0.003)
        copied.advance(0.003)
        assert copied.status is stepper.status and copied.state == stepper.state
        assert np.array_equal(copied.events, stepper.events)
        assert np.array_equal(copied.samples, stepper.samples)


def test_a_stepper_continues_and_reports_lost_steps(stepped):
    """Online, lost steps raise no error: the status keeps them; events are new ones."""
    x0 = stepped.rest({"line.length": COMMANDED_LENGTH})
    stepper = stepped.with_parameters({"T": 0.02}).stepper(x0, fan.TimeStepping(dt=1e-4))
    stepper.advance(0.01)
    assert stepper.status is Status.DONE and not len(stepper.events)
    stepper.advance(0.01)
    assert stepper.status is Status.LOST_STEPS and stepper.arrived
    assert stepper.state.t == pytest.approx(0.02)
    with pytest.raises(SimulationError, match="moved a drive"):
        stepper.advance(2.0)


def test_a_performance_reports_lost_steps(stepped):
    """It continues, names the failures of its motors, and its recording is not DONE."""
    x0 = stepped.rest({"line.length": COMMANDED_LENGTH})
    live = fan.Performance(stepped.with_parameters({"T": 0.02}), x0)
    live.record()
    live.advance(0.1)
    assert "motor is too weak" in live.lagging["line"]
    take = live.stop()
    assert take.trajectory.status is take.replay().status is Status.LOST_STEPS
    assert take.duration == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("soft", [SOFT, SOFT_WITHOUT_MOTOR])
def test_a_controller_that_asks_for_too_little_runs_away(soft, method, capsys):
    """The puppet used to fall for ever below the motor's bound, and the run ended DONE."""
    hoist = fan.loads(HOIST + soft)
    x0 = hoist.project(hoist.state({"line.length": 0.5}))
    with pytest.raises(SimulationError, match=r"controller requests too little") as caught:
        fan.simulate(hoist, x0, t_end=5.0, method=with_short_steps(method))
    run = caught.value.trajectory
    (event,) = [e for e in run.events if e.kind == "runaway"]
    # 1 m below all commands, almost without force: s = a t^2 / 2.
    fall = 0.3 * 9.81 / (0.3 + 1e-5 / 0.01**2)
    there = np.sqrt(2.0 / fall)
    # At the end of a step, which is long where `event` chooses it.
    late = 1.2 if method == "event" else 1.02  # with friction
    assert there * (1 - 1e-3) < event.t < there * late
    assert run.status is Status.RUNAWAY and run.causes == ("line.length",) and run.t[-1] < 1.0
    report_run(run, 1.0)
    assert "reached its end" not in capsys.readouterr().out


def test_a_turning_rotor_without_control_is_reported(capsys):
    """It has no command to run away from, but its slip must be reported."""
    hoist = fan.loads(HOIST)
    x0 = hoist.project(hoist.state({"line.length": 0.5}))
    run = fan.simulate(hoist, x0, t_end=2.0, method="timestepping")
    report_run(run, 1.0)
    assert "line.length has no control: its rotor turned freely" in capsys.readouterr().out
