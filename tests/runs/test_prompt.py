"""Answers at a prompt: short representations, arrays by name, and errors that name the mistake."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base import StateError
from fantoccini.control import Goal, Problem, StateArrays, solve

ARM = fan.puppets.arm2d()
REST = ARM.rest({"hand.length": 0.8})
RUN = fan.simulate(ARM, REST, t_end=0.1)


@pytest.mark.parametrize(
    "answer",
    [
        lambda: ARM.linearise(REST),
        lambda: ARM.linearise(REST).acc,
        lambda: ARM.linearise_step(REST),
        lambda: ARM.modes(REST),
        lambda: ARM.modes(REST)[0],
        lambda: ARM.rollout(REST, np.zeros((3, 2)), dt=0.002),
        lambda: ARM.states([REST]),
        lambda: RUN.tension,
        lambda: StateArrays.of(REST),
        lambda: Goal.of(ARM, {"elbow": 1.0}),
    ],
)
def test_an_answer_with_arrays_is_one_short_line(answer) -> None:
    text = repr(answer())
    assert "\n" not in text and len(text) < 400
    assert "array" not in text


def test_columns_become_arrays_of_their_values() -> None:
    assert np.asarray(RUN.tension).tolist() == RUN.tension.values.tolist()
    assert np.max(RUN.tension) == RUN.tension.values.max()
    assert not np.shares_memory(np.array(RUN.tension), RUN.tension.values)


def test_points_of_strings_go_by_name() -> None:
    points = ARM.string_points(RUN.q_D, RUN.q_K)
    assert list(points) == ["hand"]
    assert points["hand"].shape == (len(RUN), 2, 3)


def test_an_option_with_a_slip_names_the_one_that_is_meant() -> None:
    with pytest.raises(TypeError, match=r"plan\(\) has no option 'timelimit'; did you mean 't"):
        fan.plan(ARM, REST, {"elbow": 1.0}, timelimit=3.0)
    with pytest.raises(TypeError, match=r"plan\(\) has no option 'tolerence'; did you mean 'to"):
        fan.plan(ARM, REST, {"elbow": 1.0}, tolerence=3.0)
    with pytest.raises(TypeError, match=r"solve\(\) has no option 'sed'; did you mean 'seed'"):
        solve(Problem(ARM, REST, {"elbow": 1.0}), sed=3)


def test_batches_of_the_wrong_shape_are_state_errors() -> None:
    with pytest.raises(StateError, match="2 states and 3 inputs; needed"):
        fan.simulate_batch(ARM, [REST] * 2, [fan.Input.hold(ARM)] * 3, t_end=0.1)
    with pytest.raises(StateError, match="3 rows; it must have 1 or 2"):
        ARM.stepper_batch([REST] * 2).advance(0.1, np.zeros((3, 2)))


def test_lists_of_numbers_are_wrenches() -> None:
    u_D = ARM.wrench_forces(REST, {"lower": [0, 0, 1.0, 0, 0, 0]})
    assert u_D.shape == (2,)
