"""Plans repeated in MuJoCo, from their start and inputs alone."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from tests.plan.seeds import calm, first_plan, near, polished

import fantoccini as fan
from fantoccini.control.planning import PlanResult
from fantoccini.control.planning.search_tree import SearchTree

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan() -> PlanResult:
    """A plan without catches, which are soft in MuJoCo."""
    problem = fan.control.load_problem("arm3d_boxes")
    return first_plan(problem, lambda plan: near(plan) and calm(plan), polished)


def test_a_plan_arrives_in_mujoco_too(plan):
    mujoco_check, event = plan.verify(backend="mujoco"), plan.verify(method="event")
    assert mujoco_check.arrives and mujoco_check.distance <= plan.tolerance
    assert (
        mujoco_check.deviation == pytest.approx(event.deviation, abs=2e-3)
        and mujoco_check.deviation > 0.0
    )
    assert mujoco_check.distance == pytest.approx(event.distance, abs=5e-3)
    assert mujoco_check.clearance == pytest.approx(event.clearance, abs=1e-3)
    run = mujoco_check.run
    assert run.method == "mujoco" and run.status is fan.Status.DONE and not run.events
    assert run.t[-1] == pytest.approx(plan.start.t + plan.duration)
    assert np.diff(run.t).max() <= 0.25 * plan.rollouts.options.dt * (1 + 1e-9)
    assert run.violation["hand"].max() < 1e-3 and run.tension["hand"].max() > 0.1
    assert np.array_equal(run.q_K, plan.inputs.evaluate(run.t)[0])


def test_finer_steps_come_nearer_to_the_event_driven_run(plan):
    event = plan.verify(method=fan.Event(rtol=1e-9, atol=1e-9))
    differences = [
        np.abs(plan.verify(f, backend="mujoco").run.q_D[-1] - event.run.q_D[-1]).max()
        for f in (1.0, 0.25)
    ]
    assert differences[1] < differences[0]


def test_a_plan_with_other_inputs_does_not_arrive(plan):
    other = {name: a.copy() for name, a in plan.tree.arrays.items()}
    other["acceleration"][list(plan.path)] *= -1.0
    path = dataclasses.replace(plan.plan_path, tree=SearchTree.from_arrays(other, plan.tree))
    spoiled = dataclasses.replace(plan, plan_path=path)
    mujoco_check = spoiled.verify(backend="mujoco")
    assert not mujoco_check.arrives and mujoco_check.deviation > 0.1
    assert not spoiled.verify(method="event").arrives


def test_the_marionettes_plan_arrives_with_its_limits():
    """17.E: springs, drag, cones and twists are included; some limits are reached on the way.

    These limits depend on the last bit: each one that pushes in fantoccini does so in MuJoCo.
    MuJoCo pushes back once a limit is passed: a limit may be passed for a step at an impact.
    Catches are soft in MuJoCo: this plan has no hard one.
    """
    problem = fan.control.load_problem("marionette_bell")

    def touched(run: fan.Trajectory, least: float) -> set[str]:
        return {name for name, force in run.limit_force.items() if force.max() > least}

    def wanted(plan_found: PlanResult) -> bool:
        if not touched(plan_found.trajectory, 1e-3):
            return False
        events = plan_found.verify(method="event").run.events
        return max((e.impulse for e in events if e.kind == "catch"), default=0.0) < 1e-3

    plan = first_plan(problem, wanted, seeds=60)
    mujoco_check, event = plan.verify(backend="mujoco"), plan.verify(method="event")
    assert mujoco_check.arrives and mujoco_check.deviation == pytest.approx(
        event.deviation, abs=5e-3
    )
    assert mujoco_check.distance == pytest.approx(event.distance, abs=2e-3)
    assert touched(event.run, 1e-4) and touched(event.run, 1e-4) <= touched(mujoco_check.run, 0.0)
    passed, step = (
        dict.fromkeys(mujoco_check.run.violation.names, 1e-3),
        np.diff(mujoco_check.run.t).max(),
    )
    for struck in event.run.events:
        if struck.name in passed:
            passed[struck.name] = max(passed[struck.name], struck.speed * step)
    for name, bound in passed.items():
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
