"""Plans and their verification pass through nothing, however thin."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.planning import solve
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import RolloutOptions
from fantoccini.dynamics.clearance import Clearance

pytestmark = pytest.mark.medium

RADIUS = 0.005


@cache
def bob() -> fan.Marionette:
    """A bob under a trolley, both on rails along x."""
    return fan.loads(f"""
puppet: bob
bodies:
- name: bob
  joint: {{type: translation, axes: [x, z]}}
  shapes: [{{type: sphere, radius: {RADIUS}, mass: 0.1}}]
strings:
- {{name: s, length: 0.5, path: [{{body: bob}}, {{driven: [x], at: [0, 0, 0.5]}}]}}
""")


def wall(thickness: float, x: float = 0.5) -> dict:
    """A wall that cannot be passed."""
    return {"name": "wall", "type": "box", "size": [thickness, 10, 10], "at": [x, 0, 0]}


def walled_problem(thickness: float, *, margin: float = 0.0, strings: bool = False) -> Problem:
    return Problem(
        bob(),
        bob().rest(),
        {"bob.x": 1.0},
        [wall(thickness)],
        bounds=fan.control.Bounds(clearance=margin, speed=3.0, acceleration=30.0),
        rollouts=RolloutOptions(strings=strings, threads=2),
        tolerance=0.3,
    )


@pytest.mark.parametrize("strings", [False, True])
@pytest.mark.parametrize(("thickness", "margin"), [(1e-3, 0.0), (1e-3, 5e-3), (1e-5, 0.0)])
def test_no_plan_passes_through_a_thin_wall(thickness, margin, strings):
    problem = walled_problem(thickness, margin=margin, strings=strings)
    for seed in range(3):
        plan = solve(problem, seed=seed, iterations=2000, time_limit=60.0)
        assert not plan
        assert plan.refused == 0, "rollouts stop at the wall already"
        assert plan.states.q_D[-1, 0] < 0.5


@pytest.mark.parametrize("method", ["event", "timestepping"])
@pytest.mark.parametrize("thickness", [0.02, 1e-3, 1e-6])
def test_verification_detects_passages(thickness, method):
    problem = Problem(
        bob(),
        bob().rest(),
        {"bob.x": 1.0},
        bounds=fan.control.Bounds(speed=3.0, acceleration=30.0),
        rollouts=RolloutOptions(threads=2),
        tolerance=0.3,
    )
    plan = solve(problem, seed=0, time_limit=60.0)
    assert plan
    run = plan.verify(method=method).run
    for x in np.linspace(0.2, 0.6, 9):
        clearance = Clearance(bob(), [wall(thickness, x)], strings=False)
        assert clearance.least(run).distance < 0.0
        assert clearance.nearest(run).distance < 0.0


def test_a_plan_chosen_by_a_time_limit_says_that_a_second_run_may_differ():
    problem = Problem(
        bob(),
        bob().rest(),
        {"bob.x": 1.0},
        bounds=fan.control.Bounds(speed=1.0),
        rollouts=RolloutOptions(threads=2),
        tolerance=0.3,
    )
    plan = solve(problem, seed=0, time_limit=60.0)
    assert plan and "second run" not in plan.message
    grown = plan.grow(0.2)
    assert grown and "a second run may find another plan" in grown.message
