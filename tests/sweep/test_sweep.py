"""A sweep on threads: shapes, the same numbers from any number of workers, failures, Ctrl-C."""

from __future__ import annotations

import signal
import threading

import numpy as np
import pytest

import fantoccini as fan

LENGTHS = [0.78, 0.8, 0.85]


def swing_study(case: fan.lab.Case) -> dict:
    """The arm's swing after a random push."""
    arm = case.marionette
    x0 = arm.project(arm.state({"hand.length": case["length"], "v:elbow": case.rng.normal()}))
    run = fan.simulate(arm, x0, t_end=0.2, method="timestepping")
    return {"end": run.q_D[-1], "peak": run.tension["hand"].max(), "status": run.status.name}


def test_results_are_shaped_like_the_grid(arm):
    over = {"length": LENGTHS, "p:m2": [0.05, 0.08]}
    result = fan.sweep(swing_study, over, puppet=arm, seeds=2)
    assert result.shape == result["peak"].shape == (3, 2, 2)
    assert result["end"].shape == (3, 2, 2, 2)
    assert result.names == ("end", "peak", "status")
    assert set(result["status"].ravel()) == {"DONE"}
    assert np.array_equal(result["length"][:, 1, 1], LENGTHS)
    assert np.array_equal(result.axes["p:m2"], [0.05, 0.08])
    assert result.done.all() and result.failures == () and (result.seconds > 0).all()
    case = result.case(1, 1, 1)
    assert case.index == result.case(7).index == 7 and case.marionette.p[1] == 0.08
    assert np.array_equal(swing_study(case)["end"], result["end"][1, 1, 1])


def test_any_number_of_workers_gives_the_same_bits(arm):
    arguments = {
        "over": {"length": LENGTHS},
        "puppet": arm,
        "draw": {"p:m1": (0.1, 0.2)},
        "seeds": 4,
    }
    single, two, three = (fan.sweep(swing_study, **arguments, workers=n) for n in (1, 2, 3))
    for name in ("end", "peak", "p:m1"):
        assert np.array_equal(single[name], two[name]) and np.array_equal(single[name], three[name])
    reversed_sweep = fan.sweep(swing_study, **{**arguments, "over": {"length": LENGTHS[::-1]}})
    assert np.array_equal(reversed_sweep["end"][::-1], single["end"])


def test_a_failure_is_reported_and_stops_nothing(arm):
    def study(case):
        if case["k"] == 1:
            raise ZeroDivisionError("by nothing")
        if case["k"] == 2:
            raise SystemExit(3)
        return {"x": case["k"], "flag": True, "text": "long enough"} if case["k"] < 4 else None

    result = fan.sweep(study, {"k": range(5)}, workers=2)
    assert [f.index for f in result.failures] == [1, 2, 4]
    first, second, last = result.failures
    assert str(first) == "case 1 (k=1; repeat 0): ZeroDivisionError: by nothing"
    assert "in study\n" in first.failure.trace and "outcome.py" not in first.failure.trace
    assert second.failure.error == "SystemExit"
    assert "must return a dict" in last.failure.message
    assert np.array_equal(result["x"], [0, np.nan, np.nan, 3, np.nan], equal_nan=True)
    assert list(result["text"]) == ["long enough", "", "", "long enough", ""]
    assert list(result.done) == [True, False, False, True, False]
    assert "5 cases, 3 failed" in repr(result)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ({"x": None}, "figure 'x' is None"),
        ({"x": [[1], [1, 2]]}, "figure 'x'"),
        ({3: 1.0}, "figure called 3"),
        ({"k": 1.0}, "not that of a varied value"),
        ([1.0], "must return a dict"),
    ],
)
def test_a_study_that_returns_something_else_is_an_error(returned, message):
    result = fan.sweep(lambda case: returned, {"k": [0]})
    assert message in result.failures[0].failure.message


def test_a_puppet_that_cannot_be_built_fails_its_own_cases(arm):
    compilations = []

    class BrokenPuppet(fan.Marionette):
        def compile(self):
            compilations.append(1)
            raise fan.errors.BuildError("no compiler here")

    broken = BrokenPuppet(arm.puppet)
    result = fan.sweep(swing_study, {"puppet": {"good": arm, "bad": broken}, "length": [0.8, 0.81]})
    assert [f.values["puppet"] for f in result.failures] == ["bad", "bad"]
    assert "no compiler here" in result.failures[1].failure.message
    assert result.done[:2].all() and len(compilations) == 1


def test_a_case_without_a_puppet_can_be_run_again():
    def study(case):
        return {"x": case.rng.random()}

    result = fan.sweep(study, seeds=3)
    assert [study(result.case(k))["x"] for k in range(3)] == result["x"].tolist()
    assert result.case(0).marionette is None


def test_figures_of_several_shapes_stay_apart():
    result = fan.sweep(lambda case: {"x": np.zeros(case["n"])}, {"n": [1, 2, 3]})
    assert [len(x) for x in result["x"]] == [1, 2, 3]


def test_the_table_goes_to_csv(tmp_path):
    result = fan.sweep(
        lambda case: {"x": case["a"] * np.array([1.0, 10.0]), "s": str(case["b"])},
        {"a": [1, 2], "b": ["u", "v"]},
        seeds=2,
    )
    columns = result.columns()
    assert list(columns) == ["a", "b", "repeat", "x", "s", "error"]
    assert {len(c) for c in columns.values()} == {8}
    assert [record["b"] for record in result.records()] == list(columns["b"])
    result.to_csv(tmp_path / "table.csv")
    lines = (tmp_path / "table.csv").read_text().splitlines()
    assert lines[0] == "a,b,repeat,x[0],x[1],s,error"
    assert lines[1] == "1,u,0,1.0,10.0,u," and len(lines) == 9
    with pytest.raises(fan.errors.UnknownNameError, match="did you mean 'x'"):
        result["xx"]


def test_progress_is_reported_and_may_interrupt():
    calls = []

    def progress(state):
        calls.append((state.done, state.total, state.failed))
        if state.done == 4:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(
        fan.errors.SweepStopped, match="of 50 cases; the error carries them"
    ) as caught:
        fan.sweep(lambda case: {"x": case["k"]}, {"k": range(50)}, workers=2, progress=progress)
    assert calls[:5] == [(k, 50, 0) for k in range(5)]
    result = caught.value.result
    assert result.done.sum() in (4, 5) and f"{50 - result.done.sum()} not run" in repr(result)
    assert np.nansum(result["x"]) > 0


def test_an_interrupt_does_not_wait_for_running_cases():
    study_begun, test_ended = threading.Event(), threading.Event()

    def study(case):
        study_begun.set()
        if threading.current_thread() is not threading.main_thread() and case["k"] == 0:
            signal.raise_signal(signal.SIGINT)
            test_ended.wait(30)
        return {}

    try:
        with pytest.raises(fan.errors.SweepStopped):
            fan.sweep(study, {"k": range(10)}, workers=1)
        assert study_begun.is_set()
    finally:
        test_ended.set()


def test_mistakes_of_the_call_are_named(arm):
    with pytest.raises(TypeError, match="a function of a case"):
        fan.sweep({"a": [1]})
    with pytest.raises(ValueError, match="'threads' or 'ray'"):
        fan.sweep(swing_study, on="dask")
    with pytest.raises(ValueError, match="workers is 0"):
        fan.sweep(swing_study, workers=0)
    with pytest.raises(ValueError, match="address goes with on='ray'"):
        fan.sweep(swing_study, address="auto")
