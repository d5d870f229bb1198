"""tune: numbers of motions without derivatives, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.optimal import OptimalStatus

LENGTH, AWAY = 0.5, 0.02


@pytest.fixture(scope="module")
def trolley() -> fan.Marionette:
    """A bob on a rod below a trolley."""
    return fan.loads(f"""
puppet: trolley
bodies:
- name: trolley
  joint: {{type: translation, axes: [x], driven: true}}
- {{name: bob, parent: trolley, joint: {{name: pin, type: revolute, axis: [0, 1, 0]}}, mass: 1.0,
   com: [0, 0, -{LENGTH}], inertia: [0, 0, 0]}}
""")


def two_moves(trolley: fan.Marionette, delay: float) -> fan.Input:
    """Half of the way, and the other half later."""
    first = [(0.0, 0.0), (0.1, 0.5 * AWAY)]
    second = [(delay, 0.5 * AWAY), (delay + 0.1, AWAY), (2.0, AWAY)]
    return fan.Input.waypoints(trolley, {"trolley.x": first + second})


def swing(run: fan.Trajectory) -> float:
    """Energy left of the swing, per m g L."""
    omega = np.sqrt(9.81 / LENGTH)
    return float(run.q_D[-1] @ run.q_D[-1] + (run.v_D[-1] @ run.v_D[-1]) / omega**2)


@pytest.mark.parametrize("method", ["event", fan.TimeStepping(dt=1e-3)])
def test_the_second_move_comes_half_a_swing_later(trolley, method):
    """Zero vibration: two equal moves half a period apart leave no swing (Smith, 1957)."""
    half = np.pi * np.sqrt(LENGTH / 9.81)
    found = fan.tune(
        trolley, lambda v: two_moves(trolley, max(v["delay"], 0.11)), {"delay": (0.4, 0.2)}, swing,
        method=method, runs=20, generations=30, narrow=1e-4,
    )
    assert found and found.status is OptimalStatus.SETTLED
    assert found.values["delay"] == pytest.approx(half, abs=2e-3)
    assert found.spread["delay"] <= 1e-4 * 0.2
    assert found.cost == swing(found.run) < 1e-3 * swing(
        fan.simulate(trolley, trolley.rest(), two_moves(trolley, 0.4), method=method)
    )
    assert np.all(np.diff(found.curve[:, 0]) <= 0.0)
    assert found.inputs.end == found.run.t[-1] == 2.0


def test_the_same_seed_gives_the_same(trolley):
    def found(seed: int) -> fan.Tuned:
        return fan.tune(
            trolley, lambda v: two_moves(trolley, max(v["delay"], 0.11)), {"delay": (0.4, 0.1)},
            swing, runs=10, generations=3, seed=seed,
        )

    assert found(1).values == found(1).values
    assert found(1).values != found(2).values
    assert found(1).status is OptimalStatus.ITERATIONS and not found(1)


def test_motions_that_fail_are_passed_by(trolley):
    """A family that raises, and runs that are worth nothing, for half of the numbers."""

    def family(v: dict[str, float]) -> fan.Input:
        if v["delay"] < 0.35:
            raise fan.StateError("too early")
        return two_moves(trolley, v["delay"])

    found = fan.tune(
        trolley, family, {"delay": (0.4, 0.2)},
        lambda run: np.inf if run.q_K[-1, 0] < 0.0 else swing(run), runs=20, generations=10,
    )
    assert found.values["delay"] >= 0.35


def test_what_makes_no_sense_is_refused(trolley):
    def tune(numbers=None, cost=swing, **options) -> fan.Tuned:
        return fan.tune(
            trolley, lambda v: two_moves(trolley, 0.5), {"a": (0.0, 1.0)} if numbers is None
            else numbers, cost, runs=4, generations=2, **options,
        )  # fmt: skip

    for numbers in ({}, {"a": (0.0, 0.0)}, {"a": (0.0, np.nan)}, {"a": 1.0}):
        with pytest.raises(ValueError, match="numbers is"):
            tune(numbers)
    with pytest.raises(ValueError, match="NaN"):
        tune(cost=lambda run: float("nan"))
    with pytest.raises(ValueError, match="runs"):
        fan.tune(trolley, lambda v: two_moves(trolley, 0.5), {"a": (0.0, 1.0)}, swing, runs=0)
    with pytest.raises(fan.StateError, match=r"none of the 8 runs.*ended with DONE"):
        tune(cost=lambda run: np.inf)


def test_an_interrupted_search_keeps_the_best(trolley):
    def progress(best: float, median: float) -> None:
        raise KeyboardInterrupt

    found = fan.tune(
        trolley, lambda v: two_moves(trolley, 0.5), {"a": (0.0, 1.0)}, swing, runs=4,
        progress=progress,
    )  # fmt: skip
    assert found.status is OptimalStatus.STOPPED
    assert len(found.curve) == 1


def test_time_is_limited(trolley):
    found = fan.tune(
        trolley, lambda v: two_moves(trolley, max(v["delay"], 0.2)), {"delay": (0.4, 0.1)}, swing,
        runs=4, time_limit=1e-6,
    )  # fmt: skip
    assert found.status is OptimalStatus.TIMEOUT and len(found.curve) == 1
