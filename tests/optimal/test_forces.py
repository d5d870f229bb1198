"""Bounds of the forces on driven coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal.api import first_nodes
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.hybrid import ExactRuns
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.tasks.chosen_parameters import ChosenParameters

pytestmark = pytest.mark.slow

MASS, DISTANCE, g = 2.0, 0.5, 9.81

HOIST_YAML = f"""
puppet: hoist
bodies:
- name: cage
  joint: {{name: lift, type: prismatic, axis: [0, 0, 1], driven: true}}
  shapes: [{{type: sphere, radius: 0.05, mass: {MASS}}}]
- {{name: bob, joint: {{name: pin, type: revolute, axis: [0, 1, 0], at: [3, 0, 0]}}, mass: 1.0,
   com: [0, 0, -0.3], inertia: [0.01, 0.01, 0.001]}}
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
pose: {bob.z: -1.5, line.length: 0.5}
"""


@pytest.fixture(scope="module")
def hoist() -> fan.Marionette:
    return fan.loads(HOIST_YAML)


@pytest.fixture(scope="module")
def cart() -> fan.Marionette:
    return fan.loads(CART_YAML)


@pytest.mark.parametrize(
    ("max_force", "tolerance"), [(2.0 * MASS * g, 1e-5), (1.5 * MASS * g, 2e-3)]
)
def test_a_hoist_is_as_fast_as_its_force_allows(
    hoist: fan.Marionette, max_force: float, tolerance: float
):
    """The force from rest to rest is 0 to `max_force`: first the largest, then free fall."""
    max_acceleration = max_force / MASS - g
    least_time = np.sqrt(2.0 * DISTANCE * (max_acceleration + g) / (max_acceleration * g))
    task = fan.Task(
        hoist,
        hoist.rest(),
        (0.3, 2.0),
        [],
        fan.control.Smooth(1e-9, 0.0),
        fan.control.Bounds(force={"lift": (0.0, max_force)}),
        end=hoist.rest({"lift": DISTANCE}),
        interval=2.0 / 40,
    )
    best = fan.optimise(task, iterations=100, cost_tolerance=0.0)
    assert best.holds, best.summary()
    assert best.run.t[-1] == pytest.approx(least_time, rel=tolerance)
    effort = fan.simulate(hoist, hoist.rest(), best.inputs, best.run.t[-1]).effort["lift"]
    assert np.min(effort) > -1e-3 and np.max(effort) < max_force + 1e-3


def test_a_winch_pulls_with_the_tension(arm: fan.Marionette):
    """The force on a string's length is minus its tension: the same bounds, the same motion."""
    x0 = arm.rest()
    tension = arm.forward_dynamics(x0).tension[0]
    low, high = 0.9 * tension, 1.05 * tension
    optima = []
    for bounds in (
        fan.control.Bounds(tension={"hand": (low, high)}),
        fan.control.Bounds(tension={"hand": (1e-3, np.inf)}, force={"hand.length": (-high, -low)}),
    ):
        task = fan.Task(
            arm,
            x0,
            1.0,
            [fan.control.Track.coordinate("hand.length", x0.q_K[1] - 0.05, weight=100.0)],
            fan.control.Smooth(1e-2, 1e-5),
            bounds,
            interval=0.05,
        )
        # Derivatives of time steps differ from those of tensions at nodes, and end one percent
        # above: the search continues with exact ones.
        optima.append(fan.optimise(task, cost_tolerance=0.0, iterations=100))
    free = fan.optimise(replace(optima[0].task, bounds=fan.control.Bounds()), cost_tolerance=0.0)
    assert all(optima) and free.cost < 0.99 * optima[0].cost  # the bounds count
    assert all(optimum.status is fan.control.AnswerStatus.SOLVED for optimum in optima)
    assert optima[1].cost == pytest.approx(optima[0].cost, rel=1e-6)


def test_forces_change_with_motions_as_in_their_rows(cart: fan.Marionette):
    """They are compared with central differences of event-driven runs, with masses on the cart."""
    x0 = cart.rest()
    x0 = x0.replace(v_D=np.array([0.2, *x0.v_D[1:]]))
    x0 = cart.project(x0)
    names = ("rail", "line.length")
    task = fan.Task(
        cart,
        x0,
        0.5,
        [],
        bounds=fan.control.Bounds(force={name: (-50.0, 50.0) for name in names}),
        interval=0.1,
        dt=0.001,
        parameters={"load": (0.2, 0.8)},
    )
    free_parameters, rng = ChosenParameters(cart, x0, task.parameters), np.random.default_rng(5)
    runs = ExactRuns(TimeSteps(cart, task.dt, 1, free_parameters), free_parameters)
    objective = Objective(task)
    initial_nodes = first_nodes(task, free_parameters, None)
    N, k = initial_nodes.acc_K.shape
    initial_nodes = replace(initial_nodes, acc_K=0.5 * rng.normal(size=(N, k)))
    direction, load = rng.normal(size=(N, k)), 0.3

    def forces(step: float) -> np.ndarray:
        nodes = replace(
            initial_nodes,
            acc_K=initial_nodes.acc_K + step * direction,
            parameters=initial_nodes.parameters + step * load,
        )
        run = runs.run(nodes)
        assert run is not None
        return objective.rows.values(run[0], runs.ends(*run))[0]

    nodes, run = runs.run(initial_nodes)
    ends = runs.ends(nodes, run)
    effort = fan.simulate(cart, x0, nodes.inputs(), 0.5)
    values = objective.rows.values(nodes, ends)[0]
    assert values[0] == pytest.approx([effort.effort[name][0] for name in names], rel=1e-8)
    linear = runs.linearise(nodes, ends).with_constants(np.array([1]))
    assert not runs.reasons
    derivatives = objective.rows.derivatives(nodes, linear)[:, :, k : 2 * k + nodes.n_z + 1]
    z = np.append(linear.dstart_c[:, 1] * load, load)
    for i in range(N):
        change = (forces(1e-5)[i] - forces(-1e-5)[i]) / 2e-5
        assert derivatives[i] @ np.concatenate([z, direction[i]]) == pytest.approx(
            change, rel=2e-5, abs=2e-5
        )
        z = linear.A[i] @ z + linear.B[i] @ direction[i]


def test_the_force_of_a_cart_holds_its_bounds(cart: fan.Marionette):
    x0 = cart.rest()
    tracks = [
        fan.control.Track.coordinate("rail", 0.3, weight=0.0, end_weight=1e3),
        fan.control.Track.velocity("*", weight=0.1),
    ]
    bounds = fan.control.Bounds(force={"rail": (-0.6, 0.6)}, held=("line.length",))
    task = fan.Task(cart, x0, 1.0, tracks, fan.control.Smooth(1e-3, 1e-6), bounds, interval=0.04)
    free = fan.optimise(replace(task, bounds=fan.control.Bounds(held=("line.length",))))
    bounded = fan.optimise(task)
    assert bounded.holds, bounded.summary()
    efforts = []
    for best in (free, bounded):
        run = fan.simulate(cart, x0, best.inputs, 1.0, save_at=best.t)
        samples = np.searchsorted(run.t, best.t[:-1] + 1e-9) - 1
        efforts.append(float(np.max(np.abs(run.effort["rail"][samples]))))
    assert efforts[0] > 1.0
    assert efforts[1] == pytest.approx(0.6, abs=1e-3)
    assert np.max(np.abs(run.effort["rail"])) < 0.6 + 0.05  # the rod swings between the nodes
    assert bounded.cost > free.cost


def test_the_force_of_a_motor_is_bounded_through_its_command():
    """A lift behind a motor that follows its command by a spring and a damper."""
    lift = fan.loads(
        HOIST_YAML.split("- {name: bob")[0]
        + """
drives:
- {on: lift, mass: 0.1, control: {type: pd, stiffness: 2000, damping: 120}}
"""
    )
    x0 = lift.rest()
    tracks = [
        fan.control.Track.coordinate("lift", x0.q_D[0] + 0.2, weight=0.0, end_weight=1e3),
        fan.control.Track.velocity("lift", weight=0.0, end_weight=1e2),
    ]
    efforts = []
    for bounds in (
        fan.control.Bounds(),
        fan.control.Bounds(force={"lift.command": (0.0, 1.15 * MASS * g)}),
    ):
        task = fan.Task(
            lift, x0, 0.6, tracks, fan.control.Smooth(1e-3, 1e-6), bounds, interval=0.02
        )
        best = fan.optimise(task)
        run = fan.simulate(lift, x0, best.inputs, 0.6, save_at=best.t)
        efforts.append(float(np.max(run.effort["lift.command"])))
    assert best.holds, best.summary()
    assert efforts[0] > 1.3 * MASS * g and efforts[1] < 1.17 * MASS * g


def test_coordinates_without_a_force_are_refused(arm: fan.Marionette, tmp_path):
    x0 = arm.rest()

    def task(force: dict, **options) -> fan.Task:
        return fan.Task(arm, x0, 1.0, [], bounds=fan.control.Bounds(force=force), **options)

    with pytest.raises(fan.errors.UnknownNameError, match=r"hand\.length"):
        fan.optimise(task({"hand.lenght": (-1.0, 1.0)}))
    with pytest.raises(fan.errors.StateError, match=r"the force of hand\.length is bounded by"):
        fan.optimise(task({"hand.length": (1.0, -1.0)}))
    with pytest.raises(fan.errors.StateError, match="explore excludes bounds of forces"):
        task({"hand.length": (-50.0, 0.0)}, explore=1)
    with pytest.raises(fan.errors.StateError, match="bounds of forces"):
        fan.MPC(arm, task({"hand.length": (-50.0, 0.0)}), horizon=0.5, nodes=10)
    stage = fan.loads("""
puppet: block
floor: 0
contact: {friction: 0.3}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: box, size: [0.3, 0.3, 0.1], mass: 2}]}
strings:
- name: line
  path: [{body: body, at: [0.15, 0, 0]}, {driven: [x], at: [0.65, 0, 0.05]}]
  length: 0.5
pose: {body.z: 0.05}
""")
    bounds = fan.control.Bounds(force={"line.x": (0.0, 1.0)})
    with pytest.raises(fan.errors.StateError, match="without contact"):
        fan.optimise(fan.Task(stage, stage.rest(), 1.0, [], bounds=bounds))
    path = tmp_path / "t.yaml"
    text = "task: t\npuppet: arm2d\nduration: 1\nbounds:\n  force: {hand.length: [-50, 0]}\n"
    path.write_text(text, encoding="utf-8")
    assert fan.control.load_task(path).bounds.force == {"hand.length": (-50.0, 0.0)}
    path.write_text(text.replace("hand.length", "hand.long"), encoding="utf-8")
    with pytest.raises(
        fan.errors.FileError, match=r"t\.yaml:5: bounds\.force\.hand\.long.*hand\.length"
    ):
        fan.control.load_task(path)
