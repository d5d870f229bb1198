"""Feedback near catches: active sets beyond events, derivatives through catches, gains."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.planning import PlanResult, solve
from fantoccini.control.planning.active_sets import advance_states, event_derivatives
from fantoccini.control.planning.planners import PlannerRound
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import AnswerStatus, StateArrays
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.motion import State


def drop_plan(lift: float, segments: int) -> PlanResult:
    """The 2D arm is released above its rest, with its string's end at rest: one catch."""
    arm = fan.puppets.arm2d()
    resting = arm.rest({"hand.length": 0.8})
    start = resting.replace(
        q_D=resting.q_D + np.array([lift, -0.3 * lift]), taut=np.zeros_like(resting.taut)
    )
    duration = 0.1 * segments
    run = fan.simulate(
        arm, start, t_end=duration, method=fan.TimeStepping(dt=0.004, extrapolate=False)
    )
    end = run.q_D[-1]
    goal = fan.control.Goal.pose(
        arm, dict(zip(arm.coordinates.q_D, end, strict=True)), speed_weight=0.0
    )
    problem = Problem(
        arm, start, goal, tolerance=0.001, bounds=fan.control.Bounds(speed=5.0, acceleration=10.0)
    )

    def hold_still(tree, rollouts, rng):
        first_node = np.zeros(1, dtype=int)
        rolled = rollouts.simulate(
            tree.states, first_node, np.zeros((1, segments, arm.coordinates.n_vK))
        )
        return PlannerRound(1, tree.add_segments(rolled, first_node, rollouts.options.interval))

    # In located form, the catch moves its end by more than the tolerance; the laws use its nodes.
    plan = solve(problem, planner=hold_still, iterations=1, confirm=False)
    assert plan.status is AnswerStatus.UNCONFIRMED and abs(plan.duration - duration) < 1e-9
    return plan


def catch_times(plan: PlanResult, start: State) -> list[float]:
    run = fan.simulate(plan.problem.marionette, start, t_end=plan.duration, method="event")
    return [event.t for event in run.events if event.kind.value == "catch"]


@pytest.mark.parametrize(
    ("lift", "kicks"), [(0.17, np.linspace(0.3, 0.7, 5)), (0.24, -np.linspace(0.7, 1.2, 6))]
)
def test_a_late_or_early_catch_uses_the_gains_of_its_mode(lift, kicks):
    """At the second node it is on the other side of the catch than the plan."""
    plan, is_late = drop_plan(lift, 4), kicks[0] > 0.0
    by_event, by_time = plan.feedback(), plan.feedback(window=0)
    assert by_event.active_sets[1, 0] == is_late and not len(by_time.extensions.offset)
    deviations = []
    for kick in kicks:
        start = plan.start.replace(v_D=plan.start.v_D + np.array([kick, 0.0]))
        assert (catch_times(plan, start)[0] > 0.1) == is_late
        deviations.append([law.run(start).distance for law in (by_time, by_event)])
    time_distance, event_distance = np.median(deviations, axis=0)
    assert event_distance < time_distance / 3.0, (time_distance, event_distance)


def test_the_active_set_is_the_puppets():
    plan = drop_plan(0.17, 4)
    law, arm = plan.feedback(), plan.problem.marionette
    assert law.active_sets[:, 0].tolist() == [False, True, True, True, True]
    x = arm.stepper(plan.start).advance(0.2)
    assert law.active_set(x) == [True]
    without_taut_rows = arm.project(x).replace(taut=np.zeros_like(x.taut))
    assert law.active_set(without_taut_rows) == [True], "not filled in"
    slack = x.replace(q_K=x.q_K + np.array([0.0, 0.01]), taut=np.zeros_like(x.taut))
    assert law.active_set(slack) == [False]
    # The reference at its own time is the plan's; at other times it is the nearest one.
    node, gains = law.reference(1, x)
    assert gains is not None and np.array_equal(node.q_D, law.nodes.q_D[1])
    late_node, _ = law.reference(1, slack)
    assert Evaluation.at_state(arm, x.replace(q_D=late_node.q_D, v_D=late_node.v_D)).h[0] > 0.0, (
        "extended beyond the catch"
    )
    early_node, _ = law.reference(0, x)
    assert (
        abs(Evaluation.at_state(arm, x.replace(q_D=early_node.q_D, v_D=early_node.v_D)).h[0]) < 1e-4
    )
    # So late, the plan has no slack string: gains go by time.
    assert np.array_equal(law.reference(3, slack)[0].q_D, law.nodes.q_D[3])


def test_active_sets_are_extended_as_in_the_event_driven_method():
    """Forwards, and back to their origin; with and without the string."""
    arm = fan.puppets.arm3d()
    hanging = arm.rest({"hand.x": 0.3, "hand.length": 1.2})
    for x in (
        arm.project(hanging.replace(v_D=[0.0, 0.4, 0.0, -0.5])),
        hanging.replace(
            q_K=hanging.q_K + np.array([0.0, 0.0, 0.1]), taut=np.zeros_like(hanging.taut)
        ),
    ):
        acc_K = np.array([0.3, -0.2, 0.1])
        stepper = arm.stepper(x, "event")
        y = stepper.advance(0.1, acc_K)
        active = x.taut[None, :1]
        assert np.array_equal(y.taut, x.taut)
        start = StateArrays.of(x.replace(slip=np.zeros(1)))
        end = advance_states(arm, start, active, acc_K[None], np.array([0.1]))
        for name in ("q_D", "v_D", "q_K", "v_K"):
            np.testing.assert_allclose(getattr(end, name)[0], getattr(y, name), atol=2e-4)
        back_at_start = advance_states(arm, end, active, acc_K[None], np.array([-0.1]))
        np.testing.assert_allclose(back_at_start.q_D[0], x.q_D, atol=1e-6)


def test_derivatives_through_a_catch_are_those_of_neighbours():
    """Differences of event-driven runs, for changes that keep the order of events."""
    plan = drop_plan(0.83, 5)
    arm, start = plan.problem.marionette, plan.start
    law = plan.feedback()
    A, B = event_derivatives(arm, law.nodes[1], np.zeros(2), 0.15, np.zeros(1, bool))
    node = law.nodes[1]
    x = State(0.0, node.q_D, node.v_D, node.q_K, node.v_K, start.taut, node.slip)

    def end(change: np.ndarray) -> np.ndarray:
        dq, dv, dq_K, dv_K, acc_K = np.split(change, 5)
        changed_state = x.replace(
            q_D=x.q_D + dq, v_D=x.v_D + dv, q_K=x.q_K + dq_K, v_K=x.v_K + dv_K
        )
        y = arm.stepper(changed_state, "event").advance(0.15, acc_K)
        return np.concatenate([y.q_D, y.v_D, y.q_K, y.v_K])

    eps = 1e-6
    differences = [(end(eps * e) - end(-eps * e)) / (2.0 * eps) for e in np.eye(10)]
    derivatives = np.concatenate([A, B], axis=1)
    assert np.max(np.abs(derivatives)) > 10.0
    np.testing.assert_allclose(
        derivatives, np.transpose(differences), atol=1e-3 * np.max(np.abs(derivatives))
    )


def test_a_negative_window_is_refused():
    with pytest.raises(ValueError, match="window is -1"):
        drop_plan(0.17, 4).feedback(window=-1)
