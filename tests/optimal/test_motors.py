"""Bounds of the voltages and currents of motors."""

from __future__ import annotations

from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from scipy.optimize import brentq, fsolve, linprog

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.control.optimal.api import first_nodes
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.hybrid import ExactRuns
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.tasks import task_schema
from fantoccini.control.tasks.chosen_parameters import ChosenParameters

pytestmark = pytest.mark.slow

MASS, DISTANCE, GRAVITY = 2.0, 0.5, 9.81
INERTIA, GEAR, DRUM, VISCOUS = 4e-5, 3.0, 0.02, 1e-5
MOTOR_CONSTANT, RESISTANCE = 0.05, 1.2
ROTOR_TURNS_PER_METRE = GEAR / DRUM
"""Turns of the rotor per metre [rad/m]."""
MOVED_MASS = MASS + ROTOR_TURNS_PER_METRE**2 * INERTIA
DRAG = ROTOR_TURNS_PER_METRE**2 * VISCOUS
"""Viscous friction at the lift [N s/m]."""
CONTROLLER = "{type: computed_torque, bandwidth: 30}"

HOIST_YAML = f"""
puppet: hoist
bodies:
- name: cage
  joint: {{name: lift, type: prismatic, axis: [0, 0, 1], driven: true}}
  shapes: [{{type: sphere, radius: 0.05, mass: {MASS}}}]
drives:
- on: lift
  inertia: {INERTIA}
  gear: {GEAR:g}
  drum: {DRUM}
  friction: {{viscous: {VISCOUS}}}
  motor:
    {{type: dc, constant: {MOTOR_CONSTANT}, current: 100, resistance: {RESISTANCE}, voltage: 48}}
  control: {CONTROLLER}
"""

CART_YAML = """
puppet: cart
bodies:
- name: cart
  joint: {name: rail, type: prismatic, axis: [1, 0, 0], driven: true}
  shapes: [{type: sphere, radius: 0.05, mass: 0.5}]
- name: rod
  parent: cart
  joint: {name: pin, type: revolute, axis: [0, 1, 0]}
  mass: {parameter: load, value: 0.4}
  com: [0, 0, -0.5]
  inertia: [0.03, 0.03, 0.001]
- name: bob
  joint: {type: translation, axes: [x, y, z]}
  shapes: [{type: sphere, radius: 0.02, mass: 0.2}]
strings:
- {name: line, path: [{body: rod, at: [0, 0, -1]}, {body: bob, at: [0, 0, 0]}], length: driven}
drives:
- on: rail
  inertia: 2.0e-5
  drum: 0.02
  gear: {parameter: gear, value: 2}
  motor:
    {type: dc, constant: 0.05, current: 50, resistance: {parameter: R, value: 1.5}, voltage: 60}
  control: {type: computed_torque, bandwidth: 20}
- on: line.length
  inertia: 2.0e-5
  drum: 0.02
  motor: {type: dc, constant: 0.05, current: 50, resistance: 2, voltage: 60}
  control: {type: pd, stiffness: 900, damping: 40}
pose: {bob.z: -1.5, line.length: 0.5}
"""


@pytest.fixture(scope="module")
def hoist() -> fan.Marionette:
    return fan.loads(HOIST_YAML)


@pytest.fixture(scope="module")
def cart() -> fan.Marionette:
    return fan.loads(CART_YAML)


def least_time(
    hoist: fan.Marionette,
    bounds: fan.control.Bounds,
    intervals: int,
    guess: fan.Input | None = None,
) -> fan.control.Optimum:
    """Motion from rest to rest over DISTANCE."""
    end = hoist.rest({"lift.command": DISTANCE})
    task = fan.Task(
        hoist,
        hoist.rest(),
        (0.3, 2.0),
        [],
        fan.control.Smooth(1e-9, 0.0),
        bounds,
        end=end,
        interval=2.0 / intervals,
        guess=guess,
    )
    best = fan.optimise(task, iterations=200, cost_tolerance=0.0)
    assert best.holds, best.summary()
    return best


def voltages(run: fan.Trajectory, drag: float = DRAG) -> np.ndarray:
    """R i + k w by Newton's law of the hoist, from the run's motion alone."""
    a, v = run.acc_D[:, 0], run.v_D[:, 0]
    current = (MOVED_MASS * a + drag * v + MASS * GRAVITY) / (
        ROTOR_TURNS_PER_METRE * MOTOR_CONSTANT
    )
    return RESISTANCE * current + MOTOR_CONSTANT * ROTOR_TURNS_PER_METRE * v


def least_time_by_linear_programs(current: float, voltage: float, intervals: int) -> float:
    """Least time in which a linear program covers DISTANCE [s]."""

    def excess(T: float) -> float:
        h, gain = T / intervals, ROTOR_TURNS_PER_METRE * MOTOR_CONSTANT
        velocity_gain = h * np.tril(np.ones((intervals, intervals)))
        v = np.concatenate(
            [velocity_gain - h * np.eye(intervals), velocity_gain]
        )  # where intervals begin and end
        i = (MOVED_MASS * np.tile(np.eye(intervals), (2, 1)) + DRAG * v) / gain
        holding_current = MASS * GRAVITY / gain
        A, b = [], []
        for rows, offset, limit in (
            (i, holding_current, current),
            (RESISTANCE * i + gain * v, RESISTANCE * holding_current, voltage),
        ):
            if limit == np.inf:
                continue
            A += [rows, -rows]
            b += [np.full(2 * intervals, limit - offset), np.full(2 * intervals, limit + offset)]
        displacement = h * h * (np.arange(intervals)[::-1] + 0.5)
        solution = linprog(
            -displacement,
            np.concatenate(A),
            np.concatenate(b),
            np.ones((1, intervals)),
            [0.0],
            bounds=(None, None),
        )
        return -solution.fun - DISTANCE

    return brentq(excess, 0.2, 2.0, xtol=1e-11)


def least_time_by_two_arcs(voltage: float) -> float:
    """Least time with `voltage`, then -`voltage`: two exponential arcs [s]."""
    gain = MOTOR_CONSTANT * ROTOR_TURNS_PER_METRE
    rate = (gain**2 / RESISTANCE + DRAG) / MOVED_MASS

    def arc(x: float, v: float, arc_voltage: float, t: float) -> tuple[float, float]:
        final_speed = (gain / RESISTANCE * arc_voltage - MASS * GRAVITY) / MOVED_MASS / rate
        decay = np.exp(-rate * t)
        return x + final_speed * t + (v - final_speed) * (1.0 - decay) / rate, final_speed + (
            v - final_speed
        ) * decay

    def end_residual(times: np.ndarray) -> list[float]:
        x, v = arc(*arc(0.0, 0.0, voltage, times[0]), -voltage, times[1])
        return [x - DISTANCE, v]

    return float(np.sum(fsolve(end_residual, [0.4, 0.05], xtol=1e-13)))


def test_a_hoist_is_as_fast_as_its_voltage_allows(hoist: fan.Marionette):
    """Compared with linear programs over the same intervals, and their closed form in the limit."""
    times = []
    for intervals in (40, 80):
        best = least_time(hoist, fan.control.Bounds(voltage={"lift.command": 12.0}), intervals)
        times.append(best.run.t[-1])
        assert times[-1] == pytest.approx(
            least_time_by_linear_programs(np.inf, 12.0, intervals), rel=1e-7
        )
        run = fan.simulate(hoist, hoist.rest(), best.inputs, times[-1])
        assert np.max(np.abs(voltages(run))) == pytest.approx(12.0, abs=1e-3)
        gain = ROTOR_TURNS_PER_METRE * MOTOR_CONSTANT
        voltage_of_effort = RESISTANCE / gain * run.effort["lift.command"] + gain * run.v_D[:, 0]
        assert voltage_of_effort == pytest.approx(voltages(run), abs=1e-6)
    exact = least_time_by_two_arcs(12.0)
    assert times[0] > times[1] > exact
    assert 2.0 * times[1] - times[0] == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize(("current", "voltage"), [(6.0, np.inf), (4.0, 12.0), (8.0, 20.0)])
def test_a_hoist_is_as_fast_as_its_current_and_voltage_allow(hoist, current, voltage):
    best = least_time(hoist, fan.control.Bounds(current=current, voltage=voltage), 40)
    assert best.run.t[-1] == pytest.approx(
        least_time_by_linear_programs(current, voltage, 40), rel=1e-7
    )
    run = fan.simulate(hoist, hoist.rest(), best.inputs, best.run.t[-1])
    i = run.effort["lift.command"] / (ROTOR_TURNS_PER_METRE * MOTOR_CONSTANT)
    assert np.max(np.abs(i)) == pytest.approx(current, abs=1e-3)
    assert np.max(np.abs(voltages(run))) < voltage + 1e-3


def test_a_search_from_a_motor_at_its_limit_returns_within_it():
    """The bound is the supply's voltage, and the initial motion needs much more."""
    weak = fan.loads(HOIST_YAML.replace("voltage: 48", "voltage: 12"))
    hurried = fan.Input.waypoints(weak, {"lift.command": [(0, 0.0), (0.25, DISTANCE)]})
    best = least_time(weak, fan.control.Bounds(voltage=12.0), 40, hurried)
    assert best.run.t[-1] == pytest.approx(
        least_time_by_linear_programs(np.inf, 12.0, 40), rel=1e-7
    )


def test_a_drive_that_follows_takes_the_least_time_of_its_command(hoist: fan.Marionette):
    """T = 2 sqrt(distance / a), which derivatives of time steps miss behind a stiff controller."""
    best = least_time(hoist, fan.control.Bounds(acceleration=8.0), 20)
    assert best.run.t[-1] == pytest.approx(2.0 * np.sqrt(DISTANCE / 8.0), rel=1e-6)


def test_the_requested_voltage_is_that_of_the_controller():
    """This includes states beyond the motor's limits, where the effort is smaller."""
    weak = fan.loads(HOIST_YAML.replace(CONTROLLER, "{type: pd, stiffness: 2000, damping: 120}"))
    within_limit, beyond_limit = (
        weak.state({"lift": 0.0, "lift.command": e, "v:lift": 0.3}) for e in (0.02, 0.5)
    )
    for x, is_exerted in ((within_limit, True), (beyond_limit, False)):
        state_arrays = {name: getattr(x, name) for name in ("q_D", "v_D", "q_K", "v_K")}
        (requested,) = weak.library.evaluate(
            "motor_demands", **state_arrays, acc_K=[0.0], p=weak.p
        ).f_D
        (effort,) = weak.effort(
            **state_arrays, acc_D=np.zeros(1), acc_K=np.zeros(1), tension=np.zeros(0)
        )
        assert requested == pytest.approx(2000 * (x.q_K - x.q_D)[0] + 120 * (x.v_K - x.v_D)[0])
        assert bool(effort == pytest.approx(requested)) is is_exerted


def test_a_spring_behind_a_command_keeps_its_voltage():
    """The motor lags: the bounded voltage is that of its law at the state of the run."""
    lift = fan.loads(HOIST_YAML.replace(CONTROLLER, "{type: pd, stiffness: 2000, damping: 120}"))
    x0, max_voltages = lift.rest(), []
    tracks = [
        fan.control.Track.coordinate("lift", x0.q_D[0] + 0.3, weight=0.0, end_weight=1e3),
        fan.control.Track.velocity("lift", weight=0.0, end_weight=1e2),
    ]
    for bounds in (fan.control.Bounds(), fan.control.Bounds(voltage=9.0)):
        task = fan.Task(
            lift, x0, 0.5, tracks, fan.control.Smooth(1e-4, 1e-7), bounds, interval=0.02
        )
        best = fan.optimise(task)
        run = fan.simulate(lift, x0, best.inputs, 0.5, save_at=best.t)
        max_voltages.append(float(np.max(np.abs(voltages(run)))))
        assert best.holds, best.summary()
    assert max_voltages[0] > 10.0
    samples = np.searchsorted(run.t, best.t + 1e-9) - 1
    assert np.max(np.abs(voltages(run))[samples]) == pytest.approx(9.0, abs=1e-3)
    assert max_voltages[1] < 9.0 + 0.05  # between the nodes


def test_voltages_change_with_motions_as_in_their_rows(cart: fan.Marionette):
    """Compared with central differences of event-driven runs, by masses, resistance and gear
    too.
    """
    x0 = cart.rest()
    x0 = cart.project(x0.replace(v_D=x0.v_D + 0.1, v_K=x0.v_K + 0.05))
    parameter_ranges = {"load": (0.2, 0.8), "gear": (1.0, 3.0), "R": (1.0, 2.0)}
    task = fan.Task(
        cart,
        x0,
        0.4,
        [],
        bounds=fan.control.Bounds(voltage=20.0, current={"line.command.length": 9.0}),
        interval=0.1,
        parameters=parameter_ranges,
    )
    free_parameters, rng = ChosenParameters(cart, x0, parameter_ranges), np.random.default_rng(7)
    runs = ExactRuns(TimeSteps(cart, task.dt, 1, free_parameters, False), free_parameters)
    rows = Objective(task).rows
    initial_nodes = first_nodes(task, free_parameters, None)
    N, k = initial_nodes.acc_K.shape
    initial_nodes = replace(initial_nodes, acc_K=0.5 * rng.normal(size=(N, k)))
    direction, parameter_direction = rng.normal(size=(N, k)), np.array([0.2, 0.4, -0.3])

    def values(step: float) -> np.ndarray:
        run = runs.run(
            replace(
                initial_nodes,
                acc_K=initial_nodes.acc_K + step * direction,
                parameters=initial_nodes.parameters + step * parameter_direction,
            )
        )
        assert run is not None
        return rows.values(run[0], runs.ends(*run))[0]

    nodes, run = runs.run(initial_nodes)
    ends = runs.ends(nodes, run)
    linear = runs.linearise(nodes, ends).with_constants(np.array([1, 2, 3]))
    assert not runs.reasons and rows.values(nodes, ends)[0].shape == (N, 6)
    derivatives = rows.derivatives(nodes, linear)
    differences = (values(1e-5) - values(-1e-5)) / 2e-5
    z = linear.dstart_c[:, 1:] @ parameter_direction
    z = np.concatenate([z, parameter_direction])
    for i in range(N):
        next_z = linear.A[i] @ z + linear.B[i] @ direction[i]
        derivative = derivatives[i][:, k:] @ np.concatenate([z, direction[i], next_z])
        assert derivative == pytest.approx(differences[i], rel=2e-5, abs=2e-5)
        z = next_z


def test_coordinates_without_a_motor_are_refused(hoist: fan.Marionette, tmp_path):
    def optimise_with(puppet: fan.Marionette, **bounds) -> None:
        fan.optimise(fan.Task(puppet, puppet.rest(), 1.0, [], bounds=fan.control.Bounds(**bounds)))

    with pytest.raises(
        fan.errors.UnknownNameError, match=r"voltage.*'lift'; the names are lift\.command"
    ):
        optimise_with(hoist, voltage={"lift": 12.0})
    arm = fan.puppets.arm2d()
    with pytest.raises(
        fan.errors.UnknownNameError, match=r"current.*'hand\.length'.*there are none"
    ):
        optimise_with(arm, current={"hand.length": 1.0})
    with pytest.raises(fan.errors.StateError, match=r"voltage is 12\.0.*a puppet with a dc motor"):
        optimise_with(arm, voltage=12.0)
    with pytest.raises(fan.errors.StateError, match=r"voltage of lift\.command is 0\.0"):
        optimise_with(hoist, voltage={"lift.command": 0.0})
    with pytest.raises(fan.errors.StateError, match=r"voltage of lift\.command is \(0, 12\)"):
        optimise_with(hoist, voltage={"lift.command": (0, 12)})
    servo = fan.loads(
        HOIST_YAML.replace(
            f"{{type: dc, constant: {MOTOR_CONSTANT}, current: 100, resistance: {RESISTANCE}, "
            "voltage: 48}",
            "{type: servo, torque: 3}",
        )
    )
    with pytest.raises(fan.errors.UnknownNameError, match="there are none"):
        optimise_with(servo, voltage={"lift.command": 12.0})
    task = fan.Task(hoist, hoist.rest(), 1.0, [], bounds=fan.control.Bounds(voltage=12.0))
    with pytest.raises(fan.errors.StateError, match="explore excludes bounds of forces, voltages"):
        replace(task, explore=1)
    with pytest.raises(fan.errors.StateError, match="bounds of forces, voltages"):
        fan.MPC(hoist, task, horizon=0.5, nodes=10)
    stage = HOIST_YAML.replace("bodies:", "floor: -1\ncontact: {friction: 0.3}\nbodies:")
    with pytest.raises(fan.errors.StateError, match="voltages need a puppet without contact"):
        optimise_with(fan.loads(stage), voltage=12.0)


TASK_YAML = """
task: lift
puppet: hoist.yaml
duration: 1
bounds:
  voltage: {lift.command: 12}
  current: 6
"""


def test_task_files_bound_motors(tmp_path):
    (tmp_path / "hoist.yaml").write_text(HOIST_YAML, encoding="utf-8")
    path = tmp_path / "t.yaml"

    def load(text: str) -> fan.Task:
        path.write_text(text.lstrip(), encoding="utf-8")
        return fan.control.load_task(path)

    bounds = load(TASK_YAML).bounds
    assert bounds.voltage == {"lift.command": 12.0} and bounds.current == 6.0
    jsonschema.validate(read_file(path).data, task_schema())
    for change, words in (
        (("lift.command", "lift"), r"t\.yaml:5: bounds\.voltage\.lift: .*lift\.command"),
        ((": 12}", ": 0}"), r"t\.yaml:5: bounds\.voltage\.lift\.command: .*greater than 0"),
        (("current: 6", "current: -6"), r"t\.yaml:6: bounds\.current: .*greater than 0"),
        (("hoist.yaml", "arm2d"), r"t\.yaml:6: bounds\.current: .*a puppet with a dc motor"),
        (("duration: 1", "duration: 1\nslack: true\nexplore: 1"), r"explore: .*bounds\.voltage"),
    ):
        with pytest.raises(fan.errors.FileError, match=words):
            load(TASK_YAML.replace(*change))
