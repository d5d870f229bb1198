"""Plans that end standing: strings and floor carry together, and the puppet stays."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import StateError
from fantoccini.control.planning import solve
from fantoccini.control.problems import Problem

pytestmark = pytest.mark.slow

FEET = [("shin_left", "floor"), ("shin_right", "floor")]
STRINGS = (
    "head",
    "shoulder_left",
    "shoulder_right",
    "hand_left",
    "hand_right",
    "knee_left",
    "knee_right",
)


@pytest.fixture(scope="module")
def standing(promenade) -> fan.State:
    return promenade.rest()


@pytest.fixture(scope="module")
def hanging(promenade, standing) -> fan.State:
    """A rest 6 cm above the floor."""
    names = promenade.coordinates.q_K
    lengths = {f"{s}.length": standing.q_K[names.index(f"{s}.length")] - 0.06 for s in STRINGS}
    return promenade.rest(lengths)


def share_by_hand(marionette: fan.Marionette, run: fan.Trajectory) -> float:
    """Part of the weight that strings do not carry, from the sum of the feet's forces."""
    force = run.contact.involving("floor").at_sample(len(run) - 1)
    return float(np.sum(force.force[:, 2])) / marionette.weight


def test_from_the_air_to_both_feet(promenade, hanging):
    plan = fan.plan(
        promenade, hanging, fan.control.Goal.stand(promenade, FEET), seed=0, time_limit=120.0
    )
    assert plan, plan.message
    # A simulation outside of the planner, with other steps, and longer.
    run = fan.simulate(
        promenade, hanging, plan.inputs, plan.inputs.end + 10.0, method=fan.TimeStepping(dt=2e-3)
    )
    assert np.max(np.abs(run.v_D[-1])) < 0.05 and np.max(np.abs(run.v_K[-1])) < 1e-9
    assert {name for pair in FEET for name in pair} == {
        name for k in set(run.contact.at_sample(len(run) - 1).pair) for name in run.contact.names[k]
    }
    verified = plan.verify()
    assert verified.arrives and verified.share >= 0.1
    assert verified.share == pytest.approx(share_by_hand(promenade, verified.run), abs=1e-9)
    assert not hanging.q_D[2] < verified.run.q_D[-1, 2] + 0.05, "it came down"
    assert [touch.allowed for touch in verified.touches] == [True, True]


def test_from_one_stance_to_another(promenade, standing):
    goal = fan.control.Goal.stand(promenade, FEET, pose={"elbow_left": 1.9})
    assert abs(standing.q_D[promenade.coordinates.q_D.index("elbow_left")] - 1.9) > 0.5
    plan = fan.plan(promenade, standing, goal, seed=0, time_limit=120.0)
    verified = plan.verify()
    assert plan, plan.message
    end = verified.run.q_D[-1, promenade.coordinates.q_D.index("elbow_left")]
    assert abs(end - 1.9) < plan.problem.tolerance and verified.share >= 0.1


def test_a_requested_share_of_the_weight(promenade, hanging):
    problem = Problem(promenade, hanging, fan.control.Goal.stand(promenade, FEET, share=0.25))
    plan = solve(problem, seed=0, time_limit=120.0)
    assert plan and plan.verify().share >= 0.25
    touching_goal = problem.goal.touching([])
    with pytest.raises(StateError, match=r"share is 1\.5"):
        touching_goal.standing(FEET, share=1.5)


def test_an_impossible_share_is_reported(promenade, hanging):
    """The shoulders' strings hold the torso: legs with loose knees do not carry it alone."""
    problem = Problem(promenade, hanging, fan.control.Goal.stand(promenade, FEET, share=0.97))
    plan = solve(problem, seed=0, iterations=20, time_limit=120.0)
    assert not plan and plan.status is fan.control.AnswerStatus.APPROXIMATE
    assert "the largest share of the weight that was found is 0." in plan.message
