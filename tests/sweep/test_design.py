"""Cases of a sweep: their number, their order and their random numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import fantoccini as fan
from fantoccini.lab.sweeps.design import make_design


def design_of(over=None, draw=None, seeds=None, seed=0, puppet=None):
    return make_design(over, draw, seeds, seed, puppet)


def test_a_dict_is_a_grid_whose_last_name_is_the_fastest():
    sweep_design = design_of({"a": [1, 2], "b": ["x", "y", "z"]})
    assert sweep_design.shape == (2, 3)
    assert [(c["a"], c["b"]) for c in sweep_design.cases] == [
        (1, "x"),
        (1, "y"),
        (1, "z"),
        (2, "x"),
        (2, "y"),
        (2, "z"),
    ]
    assert [c.index for c in sweep_design.cases] == list(range(6))


def test_a_list_of_dicts_is_one_case_each():
    sweep_design = design_of([{"a": 1, "b": 2.0}, {"b": 3.0, "a": 1}])
    assert [axis.name for axis in sweep_design.axes] == ["case"]
    assert [(c["a"], c["b"]) for c in sweep_design.cases] == [(1, 2.0), (1, 3.0)]


def test_seeds_repeat_every_case_on_the_last_axis():
    sweep_design = design_of({"a": [1, 2]}, seeds=3)
    assert sweep_design.shape == (2, 3)
    assert [(c["a"], c.repeat) for c in sweep_design.cases] == [
        (a, k) for a in (1, 2) for k in range(3)
    ]


def test_nothing_varied_is_one_case():
    assert design_of().shape == () and len(design_of().cases) == 1
    assert design_of(seeds=4).shape == (4,)


def test_puppets_and_inputs_go_by_their_names(arm):
    heavy_arm = arm.with_parameters({"m2": 0.2})
    lifting = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1, 0.7)]})
    lowering = fan.Input.waypoints(arm, {"hand.length": [(0, 0.7), (1, 0.8)]}).with_name("down")
    sweep_design = design_of({"puppet": [arm, heavy_arm], "inputs": [lifting, lowering]})
    assert sweep_design.axes[0].labels == ("arm2d", "arm2d 2")
    assert sweep_design.axes[1].labels == ("inputs 0", "down")
    assert sweep_design.puppets["arm2d 2"] is heavy_arm
    assert sweep_design.cases[1]["inputs"] is lowering
    with_labels = design_of({"puppet": {"light": arm, "heavy": heavy_arm}})
    assert with_labels.axes[0].labels == ("light", "heavy")
    by_cases = design_of([{"puppet": p, "a": a} for p in (arm, heavy_arm) for a in (1, 2)])
    assert [label["puppet"] for label in by_cases.labels] == ["arm2d"] * 2 + ["arm2d 2"] * 2


def test_arrays_are_values_and_stand_for_themselves():
    starts = np.arange(2000.0).reshape(2, 1000)
    sweep = fan.sweep(lambda case: {"x": case["start"].sum()}, {"start": starts})
    assert np.array_equal(sweep["start"], starts) and np.array_equal(sweep.axes["start"], starts)
    assert np.array_equal(sweep["x"], starts.sum(axis=1))
    with pytest.raises(ValueError, match="twice"):
        design_of({"start": starts[[0, 0]]})
    assert design_of({"start": starts}, seeds=np.int64(2), seed=np.int64(1)).shape == (2, 2)


def test_a_case_has_random_numbers_of_its_own_whatever_the_others_are():
    small_design = design_of({"a": [1, 2]}, seeds=2)
    large_design = design_of({"a": [0, 2, 1, 5]}, seeds=5)
    small_draws = {(c["a"], c.repeat): (c.rng.random(), c.seed) for c in small_design.cases}
    large_draws = {(c["a"], c.repeat): (c.rng.random(), c.seed) for c in large_design.cases}
    assert len(set(large_draws.values())) == 20
    assert {key: large_draws[key] for key in small_draws} == small_draws
    other_seed = design_of({"a": [1, 2]}, seeds=2, seed=1)
    assert not {c.seed for c in other_seed.cases} & {c.seed for c in small_design.cases}


def test_draws_depend_only_on_the_case_and_the_name():
    one_draw = design_of({"a": [1, 2]}, {"m": (0.5, 1.5)}, seeds=50)
    three_draws = design_of(
        {"a": [2]},
        {"n": stats.norm(3.0, 0.1), "k": lambda rng: int(rng.integers(10)), "m": (0.5, 1.5)},
        seeds=50,
    )
    m = [c["m"] for c in one_draw.cases if c["a"] == 2]
    assert m == [c["m"] for c in three_draws.cases]
    assert all(0.5 <= x <= 1.5 for x in m) and len(set(m)) == 50
    assert abs(np.mean([c["n"] for c in three_draws.cases]) - 3.0) < 0.06
    assert {c["k"] for c in three_draws.cases} <= set(range(10))
    assert three_draws.names == ("a", "n", "k", "m")


def test_a_case_keeps_its_key_when_the_grid_grows(arm):
    small_design = design_of({"a": [1.0, 2.0]}, {"m": (0, 1)}, 2, puppet=arm)
    large_design = design_of(
        {"a": np.linspace(0, 2, 5)}, {"m": (0, 1)}, 3, puppet=fan.puppets.arm2d()
    )
    assert set(small_design.keys) <= set(large_design.keys) and len(set(large_design.keys)) == 15
    heavy_design = design_of(
        {"a": [1.0, 2.0]}, {"m": (0, 1)}, 2, puppet=arm.with_parameters({"m1": 1.0})
    )
    assert not set(heavy_design.keys) & set(small_design.keys)
    assert [c.seed for c in heavy_design.cases] == [c.seed for c in small_design.cases]


def test_cases_with_other_random_numbers_have_other_keys():
    grid = design_of({"way": {"slow": [1, 2], "gentle": [1, 2]}})
    assert len(set(grid.keys)) == 2 and grid.cases[0].seed != grid.cases[1].seed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"over": {"a": 3}}, "a list of values"),
        ({"over": {"a": "xyz"}}, "a list of values"),
        ({"over": {"a": []}}, "no values"),
        ({"over": {"a": [1, 1]}}, "1 twice; seeds=N"),
        ({"over": [{"a": 1}, {"b": 1}]}, "different names, a, b"),
        ({"over": [{"a": 1}, {"a": 1}]}, "cases 0 and 1 are equal"),
        ({"over": 7}, "a dict of lists"),
        ({"over": []}, "a dict of lists"),
        ({"over": {"a": [1]}, "draw": {"a": (0, 1)}}, "needed: only one of them"),
        ({"over": {"repeat": [1]}}, "axis of the results"),
        ({"over": {"a": [object()]}}, "numbers, texts, arrays"),
        ({"draw": {"a": (1, 0)}}, "low must not exceed high"),
        ({"draw": {"a": 5}}, "a range"),
        ({"draw": {"puppet": (1, 0)}}, "give puppets in `over`"),
        ({"seeds": 0}, "1 or more"),
        ({"seed": -1}, "0 or more"),
        ({"over": {"puppet": ["arm2d"]}}, "fan.puppets.arm2d"),
    ],
)
def test_a_mistake_is_named(arguments, message):
    with pytest.raises((TypeError, ValueError), match=message):
        design_of(**arguments)


def test_a_parameter_that_no_puppet_has_is_a_mistake(arm):
    with pytest.raises(fan.errors.UnknownNameError, match="did you mean 'm2'"):
        design_of({"p:m22": [0.1]}, puppet=arm)
    with pytest.raises(fan.errors.UnknownNameError, match="no value of the sweep is called 'b'"):
        design_of({"a": [1]}).cases[0]["b"]
