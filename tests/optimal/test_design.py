"""Parameters that are chosen along with the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import fantoccini as fan
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.tasks.bounds import Interval
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.nodes import Nodes

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

TIE_RANGE = (-0.65, -0.5)


@pytest.fixture(scope="module")
def lever() -> fan.Marionette:
    return fan.loads("""
puppet: lever
bodies:
- name: rod
  joint: {name: pin, type: revolute, axis: [0, -1, 0], at: [0, 0, {parameter: hinge, value: 0}]}
  mass: 1.0
  com: [0, 0, -0.5]
  inertia: [0.1, 0.1, 0.001]
- name: bob
  parent: rod
  joint: {name: swing, type: revolute, axis: [0, -1, 0], at: [0, 0, -1], damping: 0.05}
  mass: {parameter: load, value: 0.3}
  com: [0, 0, -0.2]
  inertia: [0.002, 0.002, 0.001]
strings:
- name: line
  path: [{body: rod, at: [0, 0, {parameter: tie, value: -0.6}]}, {world: [0.8, 0, 0.2]}]
  length: driven
pose: {pin: 60 deg, swing: -60 deg, line.length: 0.5}
""")


def lifting(lever: fan.Marionette, parameters: Mapping[str, Interval] | None = None) -> fan.Task:
    """The winch lowers the rod's end by 0.15 rad, with little acceleration."""
    hanging = lever.rest()
    s = np.linspace(0, 1, 101)
    angles = 0.15 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    end_points = [
        lever.pose(hanging.replace(q_D=hanging.q_D - [x, 0]), "rod") @ [0, 0, -1, 1] for x in angles
    ]
    path = (s, np.array(end_points)[:, :3])
    track = fan.control.Track.point("rod", path, at=(0, 0, -1), weight=100.0, end_weight=100.0)
    smooth = fan.control.Smooth(1e-2, 1e-6)
    return fan.Task(
        lever, hanging, 1.0, [track], smooth, interval=0.05, dt=0.005, parameters=parameters or {}
    )


@pytest.mark.parametrize("dt", [0.001, 0.00025])
def test_the_cost_changes_with_parameters_as_in_its_program(lever: fan.Marionette, dt: float):
    task = lifting(lever, parameters={"tie": TIE_RANGE, "load": (0.1, 2.0), "hinge": (-0.1, 0.1)})
    bob = fan.control.Track.point("bob", (0.4, 0, -0.8), at=(0, 0, -0.2), weight=10.0)
    task = replace(task, tracks=[*task.tracks, bob], dt=dt)
    free_parameters = ChosenParameters(lever, task.x0, task.parameters)
    runs = EventRuns(TimeSteps(lever, task.dt, 1, free_parameters), free_parameters)
    objective = Objective(task)
    acc = 0.3 * np.random.default_rng(0).normal(size=(20, 1))
    initial_nodes = replace(
        Nodes.constant(lever, task.x0, 1.0, 20), acc_K=acc, parameters=np.array([-0.55, 1.2, 0.02])
    )

    def cost(change: np.ndarray) -> float:
        nodes_and_run = runs.run(
            replace(initial_nodes, parameters=initial_nodes.parameters + change)
        )
        assert nodes_and_run is not None
        return objective.cost(nodes_and_run[0], runs.ends(*nodes_and_run))

    nodes_and_run = runs.run(initial_nodes)
    assert nodes_and_run is not None
    nodes, ends = nodes_and_run[0], runs.ends(*nodes_and_run)
    program = objective.program(nodes, runs.linearise(nodes, ends), 0.0, 0.0)
    n_c, n_z = 3, program.A.shape[1]
    k = program.B.shape[2]
    slope = np.zeros(n_c)
    for i in range(n_c):
        u = np.zeros((20, k))
        u[0, k - n_c + i] = 1.0
        z = np.zeros(n_z)
        for j in range(20):
            z = program.A[j] @ z + program.B[j] @ u[j]
            slope[i] += program.g[j] @ np.concatenate([u[j], z])
    d = 1e-4 * np.eye(n_c)
    differences = [(cost(direction) - cost(-direction)) / 2e-4 for direction in d]
    assert slope == pytest.approx(differences, rel=10 * dt)


def test_the_place_of_a_string_is_found_along_with_the_motion(lever: fan.Marionette):
    best = fan.optimise(lifting(lever, parameters={"tie": TIE_RANGE}), cost_tolerance=0.0)
    assert best.holds, best.summary()

    def least_cost(tie: float) -> float:
        tied_lever = lever.with_parameters({"tie": tie})
        # The path stays that of the original puppet.
        task = replace(lifting(lever), marionette=tied_lever, x0=tied_lever.rest(lever.rest()))
        return fan.optimise(task, cost_tolerance=0.0).cost

    minimum = minimize_scalar(
        least_cost, bounds=TIE_RANGE, method="bounded", options={"xatol": 1e-4}
    )
    assert best.parameters["tie"] == pytest.approx(minimum.x, abs=2e-3)
    assert best.cost == pytest.approx(minimum.fun, rel=1e-4)
    assert (
        dict(zip(lever.tree.parameters, best.marionette.p, strict=True))["tie"]
        == best.parameters["tie"]
    )
    assert best.gains.shape == (20, 1, 6)
    assert f"tie = {best.parameters['tie']:.6g}" in best.summary()
    further = fan.optimise(best.task, best)
    assert further.iterations == 0 and further.parameters == best.parameters
    repeated = fan.simulate(best.marionette, best.run.state(0), best.inputs, t_end=1.0)
    assert repeated.q_D[-1] == pytest.approx(best.run.q_D[-1], abs=1e-9)


def test_a_parameter_stays_within_its_bounds(lever: fan.Marionette):
    free = fan.optimise(lifting(lever, parameters={"tie": TIE_RANGE}), cost_tolerance=0.0)
    best_tie = free.parameters["tie"]
    narrow_range = (-0.65, -0.595)
    assert best_tie > -0.595
    best = fan.optimise(lifting(lever, parameters={"tie": narrow_range}), cost_tolerance=0.0)
    assert best.parameters["tie"] == pytest.approx(-0.595, abs=1e-6)
    assert best.cost > free.cost


def test_mistakes(lever: fan.Marionette):
    with pytest.raises(fan.errors.UnknownNameError, match="tye"):
        fan.optimise(lifting(lever, parameters={"tye": TIE_RANGE}))
    with pytest.raises(fan.errors.StateError, match=r"tie is -0\.6 and is to lie from -0\.5"):
        fan.optimise(lifting(lever, parameters={"tie": (-0.5, -0.3)}))
    with pytest.raises(fan.errors.StateError, match="chooses parameters"):
        fan.MPC(lever, lifting(lever, parameters={"tie": TIE_RANGE}))
