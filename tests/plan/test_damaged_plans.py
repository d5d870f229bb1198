"""Damaged plans on disk."""

from __future__ import annotations

import pytest

import fantoccini as fan
from damage import fuzz

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]


def test_a_damaged_plan_is_a_located_error(tmp_path):
    """Byte flips, cut ends, swapped and changed entries and headers."""
    problem = fan.control.load_problem("arm3d_boxes")
    plan_file = tmp_path / "plan.npz"
    fan.control.solve(problem, seed=1, time_limit=0.5).save(plan_file)
    fan.control.PlanResult.load(plan_file, problem)
    assert fuzz(lambda path: fan.control.PlanResult.load(path, problem), plan_file, 60, seed=2) > 30
