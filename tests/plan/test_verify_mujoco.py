"""Plans repeated in MuJoCo, from their start and inputs alone."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from tests.plan.seeds import first_plan, is_polished, polish_plan, without_catches

import fantoccini as fan
from fantoccini.control.planning import PlanResult
from fantoccini.control.planning.search_tree import SearchTree

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan() -> PlanResult:
    """A plan without catches, which are soft in MuJoCo."""
    problem = fan.control.load_problem("arm3d_boxes")
    return first_plan(
        problem, lambda plan: is_polished(plan) and without_catches(plan), polish_plan
    )


def test_a_plan_arrives_in_mujoco_too(plan):
    mujoco_check, event_check = plan.verify(backend="mujoco"), plan.verify(method="event")
    assert mujoco_check.arrives and mujoco_check.distance <= plan.tolerance
    assert (
        mujoco_check.deviation == pytest.approx(event_check.deviation, abs=2e-3)
        and mujoco_check.deviation > 0.0
    )
    assert mujoco_check.distance == pytest.approx(event_check.distance, abs=5e-3)
    assert mujoco_check.clearance == pytest.approx(event_check.clearance, abs=1e-3)
    run = mujoco_check.run
    assert run.method == "mujoco" and run.status is fan.Status.DONE and not run.events
    assert run.t[-1] == pytest.approx(plan.start.t + plan.duration)
    assert np.diff(run.t).max() <= 0.25 * plan.rollouts.options.dt * (1 + 1e-9)
    assert run.violation["hand"].max() < 1e-3 and run.tension["hand"].max() > 0.1
    assert np.array_equal(run.q_K, plan.inputs.evaluate(run.t)[0])


def test_finer_steps_come_nearer_to_the_event_driven_run(plan):
    event_check = plan.verify(method=fan.Event(rtol=1e-9, atol=1e-9))
    differences = [
        np.abs(plan.verify(f, backend="mujoco").run.q_D[-1] - event_check.run.q_D[-1]).max()
        for f in (1.0, 0.25)
    ]
    assert differences[1] < differences[0]


def test_a_plan_with_other_inputs_does_not_arrive(plan):
    arrays = {name: a.copy() for name, a in plan.tree.arrays.items()}
    arrays["acceleration"][list(plan.path)] *= -1.0
    path = dataclasses.replace(plan.plan_path, tree=SearchTree.from_arrays(arrays, plan.tree))
    reversed_plan = dataclasses.replace(plan, plan_path=path)
    mujoco_check = reversed_plan.verify(backend="mujoco")
    assert not mujoco_check.arrives and mujoco_check.deviation > 0.1
    assert not reversed_plan.verify(method="event").arrives


def test_the_marionettes_plan_arrives_with_its_limits():
    """17.E: springs, drag, cones and twists are included; some limits are reached on the way.

    These limits depend on the last bit: each one that pushes in fantoccini does so in MuJoCo.
    MuJoCo pushes back once a limit is passed: a limit may be passed for a step at an impact.
    Catches are soft in MuJoCo: this plan has no hard one.
    """
    problem = fan.control.load_problem("marionette_bell")

    def limits_reached(run: fan.Trajectory, min_force: float) -> set[str]:
        return {name for name, force in run.limit_force.items() if force.max() > min_force}

    def has_soft_limits(candidate: PlanResult) -> bool:
        if not limits_reached(candidate.trajectory, 1e-3):
            return False
        events = candidate.verify(method="event").run.events
        return max((e.impulse for e in events if e.kind == "catch"), default=0.0) < 1e-3

    plan = first_plan(problem, has_soft_limits, seeds=60)
    mujoco_check, event_check = plan.verify(backend="mujoco"), plan.verify(method="event")
    assert mujoco_check.arrives and mujoco_check.deviation == pytest.approx(
        event_check.deviation, abs=5e-3
    )
    assert mujoco_check.distance == pytest.approx(event_check.distance, abs=2e-3)
    assert limits_reached(event_check.run, 1e-4) and limits_reached(
        event_check.run, 1e-4
    ) <= limits_reached(mujoco_check.run, 0.0)
    allowed_violation = dict.fromkeys(mujoco_check.run.violation.names, 1e-3)
    step = np.diff(mujoco_check.run.t).max()
    for event in event_check.run.events:
        if event.name in allowed_violation:
            allowed_violation[event.name] = max(allowed_violation[event.name], event.speed * step)
    for name, bound in allowed_violation.items():
        assert mujoco_check.run.violation[name].max() < bound, name


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"backend": "drake"}, "backend is 'drake'; it must be 'fantoccini' or 'mujoco'"),
        (
            {"backend": "mujoco", "method": "event"},
            "supports only method='timestepping', not 'event'",
        ),
        (
            {"backend": "mujoco", "method": fan.Event(rtol=1e-9)},
            r"supports only method='timestepping', not Event\(rtol=1e-09",
        ),
        ({"backend": "mujoco", "dt_factor": 0.0}, "dt_factor is 0"),
    ],
)
def test_options_without_mujoco_are_refused(plan, options, message):
    with pytest.raises(ValueError, match=message):
        plan.verify(**options)


def test_without_mujoco_the_extra_is_named(plan, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(fan.errors.MissingLibraryError, match=r"pip install 'fantoccini\[mujoco\]'"):
        plan.verify(backend="mujoco")
    assert plan.verify().arrives
