"""tune: parameters of motions without derivatives, compared with closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control import AnswerStatus, DrawOptions

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

LENGTH, DISTANCE = 0.5, 0.02


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
    """Half of the displacement, and the other half later."""
    first_move = [(0.0, 0.0), (0.1, 0.5 * DISTANCE)]
    second_move = [(delay, 0.5 * DISTANCE), (delay + 0.1, DISTANCE), (2.0, DISTANCE)]
    return fan.Input.waypoints(trolley, {"trolley.x": first_move + second_move})


def swing(run: fan.Trajectory) -> float:
    """Remaining energy of the swing, per m g L."""
    omega = np.sqrt(9.81 / LENGTH)
    return float(run.q_D[-1] @ run.q_D[-1] + (run.v_D[-1] @ run.v_D[-1]) / omega**2)


@pytest.mark.parametrize("method", ["event", fan.TimeStepping(dt=1e-3)])
def test_the_second_move_is_half_a_period_later(trolley, method):
    """Zero vibration: two equal moves half a period apart leave no swing (Smith, 1957)."""
    half_period = np.pi * np.sqrt(LENGTH / 9.81)
    tuned = fan.tune(
        trolley,
        lambda v: two_moves(trolley, max(v["delay"], 0.11)),
        {"delay": (0.4, 0.2)},
        swing,
        method=method,
        draws=DrawOptions(runs=20, generations=30, narrow=0.0001),
    )
    assert tuned.status is AnswerStatus.NARROW
    assert tuned.values["delay"] == pytest.approx(half_period, abs=2e-3)
    assert tuned.spread["delay"] <= 1e-4 * 0.2
    assert tuned.cost == tuned.curve[-1, 0] == swing(tuned.run)
    repeated_swing, early_swing = (
        swing(fan.simulate(trolley, trolley.rest(), inputs, method=method))
        for inputs in (tuned.inputs, two_moves(trolley, 0.4))
    )
    assert (
        tuned.cost == pytest.approx(repeated_swing, abs=1e-6 * early_swing)
        and tuned.cost < 1e-3 * early_swing
    )
    assert np.all(np.diff(tuned.curve[:, 0]) <= 0.0)
    assert tuned.inputs.end == tuned.run.t[-1] == 2.0


@pytest.mark.parametrize("method", ["event", fan.TimeStepping(dt=1e-2)])
def test_the_cost_sees_the_whole_run(trolley, method):
    """The largest swing on the way, from another start time, with any sampling."""
    x0 = trolley.rest().replace(t=1.0)
    sampled_times = []

    def largest_swing(run: fan.Trajectory) -> float:
        sampled_times.append(run.t)
        return float(np.max(np.abs(run.q_D[run.t > 1.5])))

    tuned = fan.tune(
        trolley,
        lambda v: two_moves(trolley, max(v["delay"], 0.11)).shifted(1.0),
        {"delay": (0.4, 0.1)},
        largest_swing,
        x0,
        method=method,
        draws=DrawOptions(runs=8, generations=3),
    )
    assert all(len(t) == 201 and t[0] == 1.0 and t[-1] == 3.0 for t in sampled_times)
    assert tuned.cost == largest_swing(tuned.run) > 0.0


def test_the_users_random_numbers_stay(trolley):
    np.random.seed(5)
    expected = np.random.random(3)
    np.random.seed(5)
    fan.tune(
        trolley,
        lambda v: two_moves(trolley, 0.5),
        {"a": (0.0, 1.0)},
        swing,
        draws=DrawOptions(runs=4, generations=1),
    )
    assert np.array_equal(np.random.random(3), expected)


def test_the_same_seed_gives_the_same(trolley):
    def tune_with_seed(seed: int) -> fan.control.TuningResult:
        return fan.tune(
            trolley,
            lambda v: two_moves(trolley, max(v["delay"], 0.11)),
            {"delay": (0.4, 0.1)},
            swing,
            draws=DrawOptions(runs=10, generations=3, seed=seed),
        )

    assert tune_with_seed(1).values == tune_with_seed(1).values
    assert tune_with_seed(1).values != tune_with_seed(2).values
    assert tune_with_seed(1).status is AnswerStatus.GENERATIONS


def test_failing_motions_are_skipped(trolley):
    """A family that raises an error for a third of the numbers, and has wrong starts for others."""

    def family(v: dict[str, float]) -> fan.Input:
        if v["delay"] < 0.5:
            raise fan.errors.StateError("too early")
        if v["delay"] > 0.9:
            return fan.Input.waypoints(trolley, {"trolley.x": [(0.0, 1.0), (2.0, 1.1)]})
        return two_moves(trolley, v["delay"])

    tuned = fan.tune(
        trolley,
        family,
        {"delay": (0.7, 0.3)},
        lambda run: np.inf if run.q_K[-1, 0] > 0.9 else swing(run),
        draws=DrawOptions(runs=20, generations=15),
    )
    assert tuned.values["delay"] == pytest.approx(np.pi * np.sqrt(LENGTH / 9.81), abs=0.02)
    assert np.isfinite(tuned.cost)


def test_two_numbers(trolley):
    """The best first part is half of the displacement."""

    def family(v: dict[str, float]) -> fan.Input:
        waypoints = [
            (0.0, 0.0),
            (0.1, v["part"] * DISTANCE),
            (max(v["delay"], 0.11), v["part"] * DISTANCE),
        ]
        waypoints += [(max(v["delay"], 0.11) + 0.1, DISTANCE), (2.0, DISTANCE)]
        return fan.Input.waypoints(trolley, {"trolley.x": waypoints})

    numbers = {"part": (0.3, 0.2), "delay": (0.5, 0.2)}
    tuned = fan.tune(
        trolley, family, numbers, swing, draws=DrawOptions(runs=16, generations=40, narrow=0.001)
    )
    assert tuned.values["part"] == pytest.approx(0.5, abs=0.01)
    assert tuned.values["delay"] == pytest.approx(np.pi * np.sqrt(LENGTH / 9.81), abs=0.01)


def test_invalid_arguments_of_tune_are_refused(trolley):
    def tune(numbers=None, cost=swing, **options) -> fan.control.TuningResult:
        return fan.tune(
            trolley,
            lambda v: two_moves(trolley, 0.5),
            {"a": (0.0, 1.0)} if numbers is None else numbers,
            cost,
            draws=DrawOptions(runs=4, generations=2),
            **options,
        )

    one_wrong = {"a": (0.0, 1.0), "b": 1.0}
    for numbers in ({}, {"a": (0.0, 0.0)}, {"a": (0.0, np.nan)}, {"a": 1.0}, one_wrong):
        with pytest.raises(ValueError, match="numbers is"):
            tune(numbers)
    with pytest.raises(ValueError, match="NaN"):
        tune(cost=lambda run: float("nan"))
    for option in ({"runs": 2}, {"runs": 3.5}, {"generations": 0}, {"seed": -1}):
        with pytest.raises(ValueError, match=next(iter(option)) + "|non-negative"):
            fan.tune(
                trolley,
                lambda v: two_moves(trolley, 0.5),
                {"a": (0.0, 1.0)},
                swing,
                draws=DrawOptions(**{"runs": 3, "generations": 1, **option}),
            )

    def family_of_ends(v: dict[str, float]) -> fan.Input:
        return fan.Input.waypoints(
            trolley, {"trolley.x": [(0.0, 0.0), (1.0 + v["a"] ** 2, DISTANCE)]}
        )

    with pytest.raises(ValueError, match="end at"):
        fan.tune(trolley, family_of_ends, {"a": (0.5, 0.1)}, swing)
    tuned = fan.tune(
        trolley,
        family_of_ends,
        {"a": (0.5, 0.1)},
        swing,
        t_end=2.0,
        draws=DrawOptions(runs=4, generations=1),
    )
    assert tuned.run.t[-1] == 2.0
    with pytest.raises(fan.errors.StateError, match=r"none of the first 8 runs.*ended with DONE"):
        tune(cost=lambda run: np.inf)


def test_an_interrupted_search_keeps_the_best(trolley):
    def progress(at: object) -> None:
        raise KeyboardInterrupt

    tuned = fan.tune(
        trolley,
        lambda v: two_moves(trolley, 0.5),
        {"a": (0.0, 1.0)},
        swing,
        draws=DrawOptions(runs=4),
        progress=progress,
    )
    assert tuned.status is AnswerStatus.STOPPED
    assert len(tuned.curve) == 1


def test_time_is_limited(trolley):
    tuned = fan.tune(
        trolley,
        lambda v: two_moves(trolley, max(v["delay"], 0.2)),
        {"delay": (0.4, 0.1)},
        swing,
        draws=DrawOptions(runs=4, time_limit=1e-06),
    )
    assert tuned.status is AnswerStatus.TIMEOUT and len(tuned.curve) == 1
