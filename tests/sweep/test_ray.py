"""A sweep on a real Ray cluster of this machine: the same bits, failures, dead workers, Ctrl-C.

Studies are defined inside the tests: Ray then sends them whole, and workers do not need the module
of the test.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
import time
import types

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.lab.sweeps import ray_executor

pytestmark = pytest.mark.medium

ray = pytest.importorskip("ray")


@pytest.fixture(scope="module")
def cluster():
    ray_executor.connect(ray, 2, None)
    yield
    ray.shutdown()


def test_ray_gives_the_same_bits_as_threads(cluster, arm, tmp_path):
    heavy = arm.with_parameters({"m2": 0.12})
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (0.1, 0.78)]})

    def study(case):
        puppet = case.marionette
        x0 = puppet.project(puppet.state({"hand.length": 0.8, "v:elbow": case.rng.normal()}))
        run = fan.simulate(puppet, x0, case["inputs"], t_end=0.2)
        return {"end": run.q_D[-1], "peak": run.tension["hand"].max(), "seed": str(case.seed)}

    arguments = {
        "over": {"puppet": [arm, heavy], "inputs": [lift], "p:m1": [0.1, 0.12]},
        "draw": {"x": (0, 1)},
        "seeds": 3,
    }
    on_threads = fan.sweep(study, **arguments)
    on_ray = fan.sweep(study, **arguments, on="ray", store=tmp_path)
    assert on_ray.done.all() and on_threads.done.all()
    for name in ("end", "peak", "seed", "x"):
        assert np.array_equal(on_threads[name], on_ray[name]), name
    assert (
        fan.sweep(study, **arguments, store=tmp_path)["end"].tobytes()
        == on_threads["end"].tobytes()
    )
    assert ray.is_initialized()


def test_a_study_may_close_over_a_puppet(cluster, arm):
    arm.compile()  # libraries are not sent
    trial = fan.lab.Trial(t_end=0.05, method="timestepping", keep=["last elbow"])

    def study(case):
        return {"mass": arm.mass * case["k"]}

    assert np.array_equal(
        fan.sweep(study, {"k": [1, 2]}, on="ray")["mass"], [arm.mass, 2 * arm.mass]
    )
    over = {"hand.length": [0.78, 0.8]}
    on_ray, on_threads = (
        fan.sweep(trial, over, puppet=arm, on=executor) for executor in ("ray", "threads")
    )
    assert on_ray.failures == () and np.array_equal(on_ray["last elbow"], on_threads["last elbow"])


def test_failures_and_dead_workers_are_reported_and_stop_nothing(cluster):
    def study(case):
        if case["k"] == 3:
            raise ValueError("three")
        if case["k"] == 11:
            os.kill(os.getpid(), signal.SIGKILL)
        return {"x": case["k"]}

    result = fan.sweep(study, {"k": range(20)}, on="ray")
    assert [(f.index, f.failure.error) for f in result.failures] == [
        (3, "ValueError"),
        (11, "WorkerDied"),
    ]
    assert "in study" in result.failures[0].failure.trace
    assert "ended 2 times" in result.failures[1].failure.message
    assert result.done.sum() == 18


def test_a_study_that_cannot_reach_the_workers_is_a_failure(cluster):
    class UnsendableStudy:
        def __call__(self, case):
            return {}

        def __reduce__(self):
            return int, ("not a study",)

    result = fan.sweep(UnsendableStudy(), {"k": [0, 1]}, on="ray")
    assert len(result.failures) == 2
    assert "not a study" in result.failures[0].failure.message


def test_workers_bound_the_number_of_concurrent_cases(cluster, tmp_path):
    def study(case):
        marker = tmp_path / str(case["k"])
        marker.touch()
        time.sleep(0.05)
        running = len(list(tmp_path.iterdir()))
        marker.unlink()
        return {"running": running}

    assert fan.sweep(study, {"k": range(6)}, on="ray", workers=1)["running"].max() == 1


def test_an_interrupt_keeps_finished_cases(cluster, tmp_path):
    def study(case):
        return {"x": case.rng.random()}

    def interrupt(progress):
        if progress.done >= 5:
            raise KeyboardInterrupt

    arguments = {"over": {"k": range(40)}, "on": "ray", "store": tmp_path}
    with pytest.raises(fan.errors.SweepStopped, match="run the same sweep again"):
        fan.sweep(study, **arguments, progress=interrupt)
    assert ray.is_initialized()
    resumed = fan.sweep(study, **arguments)
    assert np.array_equal(resumed["x"], fan.sweep(study, {"k": range(40)})["x"])


def test_a_sweep_ends_only_a_cluster_that_it_started(cluster, monkeypatch):
    """Start and end are only recorded, because each would take some seconds."""
    calls, is_initialized = [], itertools.chain([False], itertools.repeat(True))
    monkeypatch.setattr(ray, "is_initialized", lambda: next(is_initialized))
    monkeypatch.setattr(ray_executor, "connect", lambda *arguments: calls.append(arguments))
    monkeypatch.setattr(ray, "shutdown", lambda: calls.append("ended"))
    result = fan.sweep(lambda case: {"x": case["k"]}, {"k": [1, 2]}, on="ray", workers=1)
    assert np.array_equal(result["x"], [1, 2])
    assert calls == [(ray, 1, None), "ended"]


def test_a_cluster_elsewhere_is_joined_and_not_configured(monkeypatch):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    calls = []
    stub = types.SimpleNamespace(init=lambda **options: calls.append(options))
    ray_executor.connect(stub, 3, None)
    ray_executor.connect(stub, 3, "auto")
    monkeypatch.setenv("RAY_ADDRESS", "10.0.0.1:6379")
    ray_executor.connect(stub, 3, None)
    assert calls[0]["num_cpus"] == 3 and calls[0]["include_dashboard"] is False
    assert calls[1]["address"] == "auto" and calls[2]["address"] is None
    assert all("num_cpus" not in options for options in calls[1:])


def test_a_missing_ray_is_an_error_with_a_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match="pip install 'fantoccini"):
        fan.sweep(lambda case: {}, on="ray")
