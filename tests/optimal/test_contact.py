"""Optimal control with contact: a block pulled over a floor, compared with closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal import shooting

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

BLOCK_YAML = """
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
"""
MASS, FRICTION, GRAVITY = 2.0, 0.3, 9.81
DISTANCE, SPEED, N, T = 0.4, 0.5, 25, 1.0
END_WEIGHTS = 1e3, 1e2


@pytest.fixture(scope="module")
def block() -> fan.Marionette:
    return fan.loads(BLOCK_YAML)


def pulling_task(block: fan.Marionette, dt: float, **options) -> fan.Task:
    """The block's target is 0.4 m farther after 1 s, at 0.5 m/s, with little acceleration."""
    position_weight, speed_weight = END_WEIGHTS
    return fan.Task(
        block,
        block.rest(),
        T,
        [
            fan.control.Track.coordinate(
                "body.x", DISTANCE, weight=0.0, end_weight=position_weight
            ),
            fan.control.Track.velocity("body.x", SPEED, weight=0.0, end_weight=speed_weight),
        ],
        fan.control.Smooth(1.0, 0.0),
        fan.control.Bounds(tension={"line": (0.1, np.inf)}),
        interval=T / N,
        dt=dt,
        guess=fan.Input.waypoints(block, {"line.x": [(0, 0.65), (2 * T, 0.65 + 2 * DISTANCE)]}),
        **options,
    )


def closed_form() -> tuple[np.ndarray, float]:
    """Accelerations and cost of a point mass that the string moves, by least squares."""
    h, (position_weight, speed_weight) = T / N, END_WEIGHTS
    displacement, velocity = h * h * (N - np.arange(N) - 0.5), np.full(N, h)
    H = (
        h * np.eye(N)
        + position_weight * np.outer(displacement, displacement)
        + speed_weight * np.outer(velocity, velocity)
    )
    acc = np.linalg.solve(
        H, position_weight * DISTANCE * displacement + speed_weight * SPEED * velocity
    )
    cost = 0.5 * h * acc @ acc + 0.5 * position_weight * (displacement @ acc - DISTANCE) ** 2
    return acc, cost + 0.5 * speed_weight * (velocity @ acc - SPEED) ** 2


@pytest.fixture(scope="module", params=[0.01, 0.005])
def dt_and_optimum(request, block: fan.Marionette) -> tuple[float, fan.control.Optimum]:
    return request.param, fan.optimise(pulling_task(block, request.param), cost_tolerance=0.0)


def test_a_block_is_pulled_with_least_effort(dt_and_optimum):
    dt, best = dt_and_optimum
    acc, cost = closed_form()
    assert best.status is fan.control.AnswerStatus.SOLVED, best.summary()
    # The motion is event-driven, so no cost is below the least; derivatives are those of time
    # steps.
    assert -1e-9 < best.cost / cost - 1.0 < 2.0 * dt**2
    assert np.max(np.abs(best.nodes.acc_K[:, 0] - acc)) < 5.0 * dt


def test_it_is_confirmed_by_an_event_driven_run_that_pulls_against_friction(dt_and_optimum):
    _, best = dt_and_optimum
    run = best.run
    assert run.method == "event"
    samples = np.searchsorted(run.t, best.t[1:-1] + 1e-12, side="right") - 1
    expected = MASS * (best.nodes.acc_K[1:, 0] + FRICTION * GRAVITY)
    assert np.max(np.abs(run.tension["line"][samples] - expected)) < 1e-6


def test_an_answer_with_an_incomplete_event_driven_run_is_not_confirmed(
    block: fan.Marionette, monkeypatch: pytest.MonkeyPatch
):
    simulate = shooting.simulate_uninterrupted

    def simulate_or_time_out(*arguments, method=None, **options):
        """Event-driven runs, which have no method argument, reach their time limit."""
        if method is None:
            raise TimeoutError
        return simulate(*arguments, method=method, **options)

    monkeypatch.setattr(shooting, "simulate_uninterrupted", simulate_or_time_out)
    best = fan.optimise(pulling_task(block, 0.01), iterations=3)
    assert best.status is fan.control.AnswerStatus.NO_RUN
    assert not best
    assert best.run.method == "timestepping"


def test_the_derivatives_are_those_of_the_time_steps_of_the_search(block: fan.Marionette):
    """A step of the inputs changes the run by A and B, through sticking and sliding."""
    from fantoccini.control.optimal.dynamics import TimeSteps
    from fantoccini.control.tasks.chosen_parameters import ChosenParameters
    from fantoccini.control.tasks.nodes import Nodes

    task = pulling_task(block, 0.01)
    free_parameters = ChosenParameters(block, task.x0, {})
    runs = shooting.StepRuns(TimeSteps(block, 0.01, 1, free_parameters, True), free_parameters)
    nodes, run = runs.run(Nodes.from_input(block, task.x0, task.guess, T, N))
    linear = runs.linearise(nodes, runs.ends(nodes, run))
    du = 1e-5 * np.sin(np.arange(N))[:, None]
    z = np.zeros((N + 1, nodes.n_z))
    for i in range(N):
        z[i + 1] = linear.A[i] @ z[i] + linear.B[i] @ du[i]
    end_nodes = [runs.run(nodes.after_step(0.0 * z, sign * du))[0] for sign in (1.0, -1.0)]
    difference = (
        end_nodes[1].changes_to(
            end_nodes[0].q_D, end_nodes[0].v_D, end_nodes[0].q_K, end_nodes[0].v_K, first_node=0
        )
        / 2.0
    )
    assert np.max(np.abs(difference - z)) < 1e-4 * np.max(np.abs(z))


def test_periodic_ends_are_the_start_moved(block: fan.Marionette):
    task = pulling_task(block, 0.01, periodic={"body.x": DISTANCE, "line.x": DISTANCE})
    end, x0 = task.required_end, task.x0
    assert end is not None
    assert end.state.q_K[0] == pytest.approx(x0.q_K[0] + DISTANCE)
    assert end.state.q_D[0] == pytest.approx(x0.q_D[0] + DISTANCE)
    assert np.array_equal(end.state.q_D[1:], x0.q_D[1:])
    assert np.array_equal(end.state.v_D, x0.v_D)


def test_mistakes_of_periodic_tasks(block: fan.Marionette):
    with pytest.raises(fan.errors.StateError, match="needed: one of them"):
        pulling_task(block, 0.01, periodic={}, end=block.rest())
    with pytest.raises(fan.errors.UnknownNameError, match=r"body\.u.*did you mean"):
        pulling_task(block, 0.01, periodic={"body.u": 1.0})


def test_exact_derivatives_are_refused(block: fan.Marionette):
    with pytest.raises(fan.errors.StateError, match="without contact"):
        fan.optimise(pulling_task(block, 0.01), exact=True)


def test_an_optimum_with_obstacles_is_followed_by_mpc(block: fan.Marionette):
    """Its task has the wall in its puppet; either puppet may be given."""
    wall = {"name": "wall", "type": "box", "size": [0.2, 1, 1], "at": [2, 0, 0.5]}
    best = fan.optimise(pulling_task(block, 0.01, obstacles=[wall]), iterations=2)
    steps = []
    for puppet in (block, best.marionette):
        mpc = fan.MPC(puppet, best.task, horizon=0.4, nodes=10)
        assert [o.name for o in mpc.marionette.puppet.obstacles] == ["wall"]
        steps.append(mpc.step(block.rest()))
    assert np.array_equal(*steps) and np.all(np.isfinite(steps))
    post = best.task.marionette.puppet.obstacles[0].model_copy(update={"name": "post"})
    with pytest.raises(fan.errors.StateError, match="obstacles that the task lacks: post"):
        fan.MPC(block.with_obstacles([post]), best.task)
