"""Inputs are C^1, do not overshoot, hold other coordinates, and refuse steps."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from fantoccini.base import rotation
from fantoccini.base.errors import InputError
from fantoccini.motion import Input

START = np.array([0.8, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.7, 0.0])


def random_points(seed: int) -> dict:
    rng = np.random.default_rng(seed)

    def times(n):
        return np.cumsum(rng.uniform(0.2, 1.0, n))

    turns = [rng.normal(size=3) * rng.uniform(0, 1.5) for _ in range(5)]
    q = [rotation.normalised(rng.normal(size=4))]
    for turn in turns:
        q.append(rotation.multiply(q[-1], rotation.exp(turn / max(1.0, np.linalg.norm(turn) / 3))))
    signs = rng.choice([-1.0, 1.0], size=len(q))
    return {
        "hand.length": [*zip(times(6), rng.uniform(0.3, 1.5, 6), strict=True)],
        "bar.x": [*zip(times(4), rng.normal(size=4), strict=True)],
        "crank": [*zip(times(3), 5 * rng.normal(size=3), strict=True)],
        "bar.rotation": [*zip(times(6), signs[:, None] * q, strict=True)],
    }


def derivative(f, t, h=1e-4):
    return (8 * (f(t + h) - f(t - h)) - (f(t + 2 * h) - f(t - 2 * h))) / (12 * h)


def angular_velocity(inputs, t, h=1e-3):
    """Body angular velocity from rotations alone, by differences of fourth order."""

    def turn(d):
        return rotation.between(inputs.evaluate(t)[0][:, 4:8], inputs.evaluate(t + d)[0][:, 4:8])

    return (8 * (turn(h) - turn(-h)) - (turn(2 * h) - turn(-2 * h))) / (12 * h)


def inner_times(inputs, n=400, margin=3e-3):
    t = np.linspace(inputs.start, inputs.end, n)
    return t[np.min(np.abs(t[:, None] - inputs.breaks), axis=1) > margin]


@pytest.mark.parametrize("seed", range(6))
def test_velocity_and_acceleration_are_the_derivatives(table, seed):
    inputs = Input.waypoints(table, random_points(seed))
    t = inner_times(inputs)
    _, v, acc = inputs.evaluate(t)
    for q, row in table.scalars_K:
        numeric = derivative(lambda x, q=q: inputs.evaluate(x)[0][:, q], t)
        if inputs.named[row]:
            assert np.allclose(v[:, row], numeric, atol=1e-6)
    assert np.allclose(acc, derivative(lambda x: inputs.evaluate(x)[1], t), atol=1e-6)
    assert np.allclose(v[:, 4:7], angular_velocity(inputs, t), atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_breaks_are_smooth(table, seed):
    inputs = Input.waypoints(table, random_points(seed))
    assert inputs.checked() is inputs
    inner = inputs.breaks[1:-1]
    (q_0, v_0, acc_0), (q_1, v_1, acc_1) = inputs.evaluate(inner - 1e-9), inputs.evaluate(inner)
    named = inputs.named
    assert np.allclose(q_0[:, :8], q_1[:, :8], atol=1e-7, equal_nan=True)
    assert np.allclose(v_0[:, named], v_1[:, named], atol=1e-6)
    assert np.allclose(acc_0[:, named], acc_1[:, named], atol=1e-4)
    for t in (inputs.start, inputs.end):
        assert np.allclose(inputs.evaluate(t)[1], 0, atol=1e-12)


def test_waypoints_are_met(table):
    points = random_points(3)
    inputs = Input.waypoints(table, points)
    for t, value in points["hand.length"]:
        assert inputs.evaluate(t)[0][0] == pytest.approx(value, abs=1e-13)
    for t, value in points["bar.rotation"]:
        away = rotation.between(inputs.evaluate(t)[0][4:8], rotation.normalised(value))
        assert np.linalg.norm(away) < 1e-13


def test_quaternions_stay_unit_and_continuous(table):
    inputs = Input.waypoints(table, random_points(4))
    q = inputs.evaluate(np.linspace(0, inputs.end + 1, 5000))[0][:, 4:8]
    assert np.allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-14)
    assert np.max(np.abs(np.diff(q, axis=0))) < 0.02


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0.05, 3.0), min_size=2, max_size=7),
    st.lists(st.floats(-5.0, 5.0), min_size=8, max_size=8),
)
def test_no_overshoot(gaps, values):
    from fantoccini.base.polynomial import evaluate
    from fantoccini.motion.channel import scalar_waypoints

    t = np.concatenate([[0.0], np.cumsum(gaps)])
    values = np.array(values[: len(t)])
    inputs = scalar_waypoints(t, values)
    s = np.linspace(0, 1, 101) * np.diff(t)[:, None]
    p, _, _ = evaluate(inputs.coef[:, 0, None, :], s)
    rising = np.sign(np.diff(values))[:, None]
    assert np.all(np.diff(p, axis=1) * rising >= -1e-12)


def test_turns_about_one_axis_follow_the_scalar_rule(table):
    t, angles = [0.0, 1.0, 1.7, 3.0], np.array([0.0, 0.4, 1.9, 2.2])
    inputs = Input.waypoints(
        table,
        {
            "crank": [*zip(t, angles, strict=True)],
            "bar.rotation": [(x, [0, 0, a]) for x, a in zip(t, angles, strict=True)],
        },
    )
    _, v, acc = inputs.evaluate(np.linspace(0, 3, 200))
    assert np.allclose(v[:, 6], v[:, 8], atol=1e-12)
    assert np.allclose(acc[:, 6], acc[:, 8], atol=1e-11)


def test_two_points_are_the_minimum_jerk_move(table):
    inputs = Input.waypoints(table, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
    s = np.linspace(0, 1, 50)
    law = 0.8 - 0.3 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    assert np.allclose(inputs.evaluate(1.5 * s)[0][:, 0], law, atol=1e-15)


def test_coordinates_are_held_before_and_after(table):
    inputs = Input.waypoints(
        table, {"hand.length": [(1, 0.8), (2, 0.5)], "bar.x": [(0, 0), (3, 1)]}
    )
    q, v, acc = inputs.evaluate([-5.0, 0.5, 2.5, 9.0])
    assert np.array_equal(q[:, 0], [0.8, 0.8, 0.5, 0.5])
    assert not v[:, 0].any() and not acc[:, 0].any()
    assert not v[[0, 3]].any() and not acc[[0, 3]].any()
    assert np.array_equal(inputs.breaks, [0, 1, 2, 3])


def test_times_may_have_any_shape(table):
    inputs = Input.waypoints(table, random_points(2))
    assert [x.shape for x in inputs.evaluate(0.5)] == [(10,), (9,), (9,)]
    assert [x.shape for x in inputs.evaluate(np.zeros((2, 0)))] == [
        (2, 0, 10),
        (2, 0, 9),
        (2, 0, 9),
    ]
    assert inputs.evaluate_force(np.zeros((3, 2))).shape == (3, 2, 5)


def test_an_input_without_driven_coordinates(table):
    free = dataclasses.replace(
        table, q_K=(), v_K=(), quaternions_K=(), scalars_K=(), rotations={}, start_K=np.zeros(0)
    )
    inputs = Input.hold(free).with_forces({"elbow": [(0, 1), (1, 2)]}).bound(np.zeros(0))
    assert inputs.evaluate([0.0, 1.0])[0].shape == (2, 0)
    assert inputs.evaluate_force(0.5)[0] == 1.5


def test_nearly_equal_times_are_one_break(table):
    inputs = Input.waypoints(
        table, {"hand.length": [(0, 1), (0.1 + 0.2, 2)], "bar.x": [(0, 0), (0.3, 1), (0.6, 2)]}
    )
    assert len(inputs.breaks) == 3


# -- binding -----------------------------------------------------------------------------------


def test_other_coordinates_hold_the_start(table):
    inputs = Input.waypoints(table, {"hand.length": [(0, 0.8), (1, 0.6)]}).bound(START)
    q, v, _ = inputs.evaluate(np.linspace(0, 1, 7))
    assert np.array_equal(q[:, 1:], np.tile(START[1:], (7, 1)))
    assert not v[:, 1:].any()
    assert not inputs.named[1:].any()


def test_hold_holds_everything(table):
    q, v, acc = Input.hold(table).bound(START).evaluate([0.0, 0.5, 1e9])
    assert np.array_equal(q, np.tile(START, (3, 1)))
    assert not v.any() and not acc.any()


def test_another_start_is_reported_with_both_values(table):
    inputs = Input.waypoints(
        table, {"hand.length": [(0, 0.9), (1, 0.6)], "bar.rotation": [(0, [0, 0, 0.1])]}
    )
    with pytest.raises(InputError) as error:
        inputs.bound(START)
    text = str(error.value)
    assert "hand.length" in text and "0.9" in text and "0.8" in text
    assert "bar.rotation" in text
    assert len(error.value.mistakes) == 2


def test_the_opposite_quaternion_is_the_same_start(table):
    q_K = START.copy()
    q_K[4:8] *= -1
    inputs = Input.waypoints(table, {"bar.rotation": [(0, [1, 0, 0, 0]), (1, [0, 0, 1.0])]})
    assert np.array_equal(inputs.bound(q_K).evaluate(0.0)[0][4:8], q_K[4:8])


# -- other sources -----------------------------------------------------------------------------


@pytest.mark.parametrize("rest", [True, False])
def test_samples_are_met_and_smooth(table, rest):
    t = np.linspace(0, 3, 40)
    turns = np.stack([np.sin(t), 0.7 * np.cos(2 * t), 0.3 * t], axis=-1)
    columns = {"hand.length": 1 + 0.3 * np.cos(t), "bar.rotation": rotation.exp(turns)}
    inputs = Input.samples(table, t, columns, rest=rest).checked()
    q, v, _ = inputs.evaluate(t)
    assert np.allclose(q[:, 0], columns["hand.length"], atol=1e-14)
    assert np.allclose(rotation.between(q[:, 4:8], columns["bar.rotation"]), 0, atol=1e-13)
    before, after = inputs.evaluate(t[1:-1] - 1e-9), inputs.evaluate(t[1:-1])
    assert np.allclose(before[2], after[2], atol=1e-5)
    at = inner_times(inputs, margin=4e-3)
    assert np.allclose(inputs.evaluate(at)[1][:, 4:7], angular_velocity(inputs, at), atol=1e-6)
    if rest:
        assert np.allclose(v[[0, -1]], 0, atol=1e-13)


def test_splines_through_rotations_converge(table):
    def worst(n):
        t = np.linspace(0, 2 * np.pi, n)
        speed = 0.5 * (1 - np.cos(t))

        def motion(x):
            return rotation.exp(
                np.stack([np.sin(x) ** 2, 0.5 * np.sin(x) ** 2, (1 - np.cos(x)) * 0.6], axis=-1)
            )

        inputs = Input.samples(table, t, {"bar.rotation": motion(t), "crank": speed})
        x = np.linspace(0, 2 * np.pi, 777)
        return np.max(np.abs(rotation.between(inputs.evaluate(x)[0][:, 4:8], motion(x))))

    assert np.log2(worst(41) / worst(81)) > 3.5


def test_four_columns_are_a_rotation(table):
    t = np.linspace(0, 1, 5)
    q = rotation.exp(np.outer(t, [0.2, 0.3, 0.4]))
    whole = Input.samples(table, t, {"bar.rotation": q})
    parts = Input.samples(table, t, dict(zip(table.q_K[4:8], q.T, strict=True)))
    assert np.array_equal(whole.coef, parts.coef, equal_nan=True)
    assert np.array_equal(whole.base, parts.base, equal_nan=True)


def test_segments_follow_their_accelerations(table):
    rng = np.random.default_rng(0)
    t = np.array([0.0, 0.5, 0.9, 1.6])
    v, acc = 0.1 * rng.normal(size=table.n_vK), rng.normal(size=(3, table.n_vK))
    acc[:, [0, 7]] *= 0.1
    inputs = Input.segments(table, t, START, v, acc)
    assert inputs.named.all()
    q_K, v_K, _ = inputs.evaluate(t[-1])
    assert v_K[8] == pytest.approx(v[8] + np.diff(t) @ acc[:, 8])
    again = Input.segments(table, t, inputs.evaluate(t[:-1])[0], inputs.evaluate(t[:-1])[1], acc)
    assert np.allclose(again.evaluate(t[-1])[0], q_K, atol=1e-14)


def test_segments_that_do_not_join_say_where(table):
    t, acc = np.array([0.0, 1.0, 2.0]), np.zeros((2, table.n_vK))
    q, v = np.tile(START, (2, 1)), np.zeros((2, table.n_vK))
    q[1, 1], v[1, 8] = 0.1, 0.2
    with pytest.raises(InputError) as error:
        Input.segments(table, t, q, v, acc)
    text = str(error.value)
    assert "bar.x: jumps in position by 0.1 at t = 1 s" in text
    assert "crank: jumps in velocity by 0.2 at t = 1 s" in text


def test_then_plays_inputs_one_after_another(table):
    up = Input.waypoints(table, {"hand.length": [(0, 0.8), (1, 0.6)]})
    turn = Input.waypoints(table, {"bar.rotation": [(5, [1, 0, 0, 0]), (7, [0, 0, 1.0])]})
    down = Input.waypoints(table, {"hand.length": [(0, 0.6), (1, 0.8)]})
    inputs = up.then(turn, down).bound(START)
    assert np.array_equal(inputs.breaks, [0, 1, 3, 4])
    assert np.allclose(inputs.evaluate([0.0, 1.0, 2.0, 4.0])[0][:, 0], [0.8, 0.6, 0.6, 0.8])
    with pytest.raises(InputError, match=r"hand.length: jumps in position by 0.2 at t = 1 s"):
        up.then(up)


def test_shifted_is_later(table):
    inputs = Input.waypoints(table, {"hand.length": [(0, 0.8), (1, 0.6)]})
    assert inputs.shifted(2.0).evaluate(2.3)[0][0] == pytest.approx(inputs.evaluate(0.3)[0][0])


def test_further_breaks_change_nothing(table):
    inputs = Input.waypoints(table, random_points(1)).bound(
        Input.waypoints(table, random_points(1)).evaluate(0.0)[0]
        + np.where(np.isin(np.arange(10), [0, 1, 4, 5, 6, 7, 9]), 0, np.nan_to_num(START))
    )
    cut = inputs.with_forces({"elbow": [(x, x) for x in np.linspace(-1, inputs.end + 1, 37)]})
    assert len(cut.breaks) > len(inputs.breaks) + 30
    t = np.linspace(-2, inputs.end + 2, 500)
    for ours, theirs in zip(cut.evaluate(t), inputs.evaluate(t), strict=True):
        assert np.allclose(ours, theirs, atol=1e-11)
    cut.checked()


def test_forces_are_piecewise_linear(table):
    inputs = Input.hold(table).with_forces(
        {"elbow": [(0.5, 1.0), (1.5, 2.0), (1.5, 0.0), (2.0, 4.0)], "head.wx": [(0, 1), (3, 1)]}
    )
    u = inputs.evaluate_force([0.2, 0.5, 1.0, 1.5, 1.75, 2.5, 3.5])
    assert np.allclose(u[:, 0], [0, 1, 1.5, 0, 2, 0, 0])
    assert np.allclose(u[:, 1], [1, 1, 1, 1, 1, 1, 0])
    assert not u[:, 2:].any()
    assert inputs.force.flags["C_CONTIGUOUS"] and inputs.coef.flags["C_CONTIGUOUS"]


def test_forces_next_to_a_break_do_not_move_it(table):
    inputs = Input.waypoints(table, {"crank": [(0, 0), (1, 1), (2, 5)]})
    near = inputs.with_forces({"elbow": [(5e-10, 0), (1 - 5e-10, 1), (2 + 5e-10, 2)]})
    assert np.array_equal(near.breaks, inputs.breaks)
    assert np.array_equal(near.coef, inputs.coef, equal_nan=True)


# -- mistakes ----------------------------------------------------------------------------------

MISTAKES = {
    "an unknown name": ({"hand.lenght": [(0, 1)]}, "did you mean 'hand.length'"),
    "a dynamic name": ({"elbow": [(0, 1)]}, "it is dynamic"),
    "a part of a rotation": ({"bar.qx": [(0, 1)]}, "drive 'bar.rotation' as a whole"),
    "a step in position": ({"bar.x": [(0, 0), (1, 1), (1, 2)]}, "bar.x[2]: comes at t = 1 s like"),
    "times that fall": ({"bar.x": [(0, 0), (1, 1), (0.5, 2)]}, "bar.x[2]: comes at t = 0.5 s"),
    "nan": ({"bar.x": [(0, float("nan"))]}, "bar.x[0]: the value: found nan"),
    "infinite time": ({"bar.x": [(float("inf"), 0)]}, "bar.x[0]: the time: found inf"),
    "text": ({"bar.x": [(0, "a")]}, "bar.x[0]: the value: found 'a'"),
    "a triple": ({"bar.x": [(0, 1, 2)]}, "bar.x[0]: found (0, 1, 2); needed: a pair"),
    "no waypoints": ({"bar.x": []}, "bar.x: found no waypoints"),
    "a number": ({"bar.x": 3}, "bar.x: found 3; needed: a list"),
    "a zero quaternion": ({"bar.rotation": [(0, [0, 0, 0, 0])]}, "zero quaternion"),
    "five numbers": ({"bar.rotation": [(0, [0, 0, 0, 0, 1])]}, "found 5 numbers"),
    "half a turn": (
        {"bar.rotation": [(0, [1, 0, 0, 0]), (1, [0, 0, 0, 1])]},
        "bar.rotation[1]: turns by 180 deg",
    ),
    "more than half a turn": (
        {"bar.rotation": [(0, [0, 0, 0]), (1, [0, 0, 3.5])]},
        "bar.rotation[1]: turns by 201 deg",
    ),
    "a negative length": (
        {"hand.length": [(0, 1), (1, -0.1)]},
        "the length of a string must stay above 0",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_name_the_cause_and_the_place(table, case):
    points, message = MISTAKES[case]
    with pytest.raises(InputError) as error:
        Input.waypoints(table, points)
    assert message in str(error.value)


def test_all_mistakes_at_once(table):
    with pytest.raises(InputError) as error:
        Input.waypoints(table, {"bar.x": [(0, "a"), (0, 1)], "nose": [], "crank": [(1, 2), (1, 3)]})
    assert len(error.value.mistakes) == 4


def test_angles_may_say_deg(table):
    inputs = Input.waypoints(table, {"crank": [(0, "90 deg")]})
    assert inputs.evaluate(0.0)[0][9] == pytest.approx(np.pi / 2)


def test_unknown_forces(table):
    with pytest.raises(InputError, match="did you mean 'elbow'"):
        Input.hold(table).with_forces({"elbo": [(0, 1)]})


def test_impossible_samples_are_refused(table):
    t = np.array([0.0, 1.0, 1.0, 3.0])
    columns = {"bar.x": [0, 1, np.nan, 2], "bar.qw": [1, 1, 1, 1], "nose": t, "crank": [1, 2]}
    with pytest.raises(InputError) as error:
        Input.samples(table, t, columns)
    text = str(error.value)
    for part in ("t[2]", "bar.x[2]", "bar.qw: needs the columns bar.qx", "nose", "crank: found"):
        assert part in text
