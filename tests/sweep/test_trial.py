"""The ready-made study `Trial`: the use of values, and the figures that it keeps."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

LIFTING = {"hand.length": [(0, 0.8), (0.2, 0.75)]}
FAST_TRIAL = {"method": "timestepping", "t_end": 0.2}


def test_a_trial_equals_a_handwritten_run(arm):
    times = np.linspace(0, 0.3, 7)
    keep = ("max tension:hand", "last elbow", "mean hand.length", "elbow", "first energy:kinetic")
    trial = fan.lab.Trial(inputs=LIFTING, t_end=0.25, keep=keep, times=times)
    result = fan.sweep(trial, {"p:m2": [0.08, 0.1]}, puppet=arm)
    heavy = arm.with_parameters({"m2": 0.1})
    run = fan.simulate(
        heavy, heavy.rest({"hand.length": 0.8}), fan.Input.waypoints(heavy, LIFTING), t_end=0.25
    )
    assert result["max tension:hand"][1] == run.tension["hand"].max()
    assert result["max_tension"][1] == run.tension["hand"].max()
    assert result["last elbow"][1] == run.q_D[-1, 1]
    assert result["elbow"].shape == (2, 7)
    assert np.array_equal(result["elbow"][1, :6], run.resample(times[:6]).q_D[:, 1])
    assert np.isnan(result["elbow"][:, 6]).all()
    assert 0.75 < result["mean hand.length"][1] < 0.8
    assert result["end"].tolist() == [0.25, 0.25] and result["events"][1] == len(run.events)
    assert np.array_equal(trial.run(result.case(1)).q_D, run.q_D)


def test_names_select_the_use_of_values(arm):
    over = {
        "inputs": {"none": {"hand.length": [(0, 0.8)]}, "lift": LIFTING},
        "v:elbow": [0.0, 1.0],
        "dt": [0.002, 0.001],
    }
    trial = fan.lab.Trial(**FAST_TRIAL, keep=["first v:elbow", "last hand.length", "max t"])
    result = fan.sweep(trial, over, puppet=arm)
    assert result.failures == ()
    assert result.axes["inputs"].tolist() == ["none", "lift"]
    assert result["last hand.length"][0, 0, 0] == 0.8
    assert result["last hand.length"][1, 0, 0] == pytest.approx(0.75)
    assert (result["first v:elbow"][:, 1] > 0.1).all()


def test_start_and_driven_coordinates(arm):
    trial = fan.lab.Trial(
        **FAST_TRIAL, start={"hand.x": 0.4}, keep=["first hand.x", "first hand.length"]
    )
    result = fan.sweep(trial, {"hand.length": [0.78, 0.8]}, puppet=arm)
    assert result["first hand.x"].tolist() == [0.4, 0.4]
    assert result["first hand.length"].tolist() == [0.78, 0.8]


def test_a_run_that_stops_is_a_result(arm):
    pull = {"hand.length": [(0, 0.8), (0.5, 0.05)]}
    result = fan.sweep(fan.lab.Trial(inputs=pull), puppet=arm)
    assert result.failures == () and result["status"] != "DONE" and 0 < result["end"] < 0.5


def test_a_puppet_without_strings_has_figures():
    pendulum = fan.loads(
        "puppet: rod\n"
        "bodies:\n"
        "  - {name: rod, joint: {type: revolute, axis: [0, 1, 0]}, mass: 1, com: [0, 0, -1],"
        " inertia: [1, 1, 1]}\n"
    )
    result = fan.sweep(fan.lab.Trial(**FAST_TRIAL), {"rod": [0.1, 0.2]}, puppet=pendulum)
    assert result.failures == () and result["max_tension"].tolist() == [0.0, 0.0]


def test_mistakes_are_named(arm):
    with pytest.raises(fan.errors.UnknownNameError, match="no statistic is called 'peak'"):
        fan.lab.Trial(keep=["peak elbow"])
    with pytest.raises(ValueError, match="'last elbow'"):
        fan.lab.Trial(keep=["elbow"])
    for trial, over, message in (
        (fan.lab.Trial(**FAST_TRIAL), {"hand.lenght": [0.8]}, "did you mean 'hand.length'"),
        (fan.lab.Trial(), {"hand.length": [0.8]}, "needs t_end"),
        (fan.lab.Trial(**FAST_TRIAL, keep=["max tension:foot"]), None, "no column of the run"),
    ):
        result = fan.sweep(trial, over, puppet=arm)
        assert message in result.failures[0].failure.message
    assert "needs a puppet" in fan.sweep(fan.lab.Trial(**FAST_TRIAL)).failures[0].failure.message
