"""Motions of least cost, compared with closed forms and another optimiser."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve, minimize
from tests.optimal.small_crane import CRANE_TEXT

import fantoccini as fan

pytestmark = [pytest.mark.medium, pytest.mark.long]

LENGTH, DISTANCE, MAX_ACCELERATION = 1.0, 0.05, 0.05

TIP = (0.3, 0.0, 0.0)
CIRCLE_ANGLE = 10.0 * np.linspace(0, 1, 81) ** 3 - 15.0 * np.linspace(0, 1, 81) ** 4
CIRCLE_ANGLE = 2.0 * np.pi * (CIRCLE_ANGLE + 6.0 * np.linspace(0, 1, 81) ** 5)


@pytest.fixture(scope="module")
def circle(arm: fan.Marionette) -> np.ndarray:
    """(81, 3) circle of the arm's tip, beginning and ending at rest."""
    pose = arm.pose(arm.rest(), "lower")
    tip = pose[:3, 3] + pose[:3, :3] @ np.array(TIP)
    return tip + 0.03 * np.stack(
        [1.0 - np.cos(CIRCLE_ANGLE), 0.0 * CIRCLE_ANGLE, np.sin(CIRCLE_ANGLE)], axis=1
    )


@pytest.fixture(scope="module")
def round_trip(arm: fan.Marionette, circle: np.ndarray) -> fan.control.Optimum:
    return fan.follow(arm, {("lower", TIP): circle}, 2.0)


def least_time() -> float:
    """The least time from rest to rest of a linear crane with bounded acceleration [s].

    Accelerations are + - + - the largest, antisymmetric about the middle; the displacement and the
    swing at the middle determine the first switch and the time.
    """
    frequency = np.sqrt(9.81 / LENGTH)

    def end_residual(unknown: np.ndarray) -> tuple[float, float]:
        first_switch, T = unknown
        edges = np.array([0.0, first_switch, 0.5 * T, T - first_switch, T])
        acc = MAX_ACCELERATION * np.array([1.0, -1.0, 1.0, -1.0])
        distance = np.sum(acc * ((T - edges[:-1]) ** 2 - (T - edges[1:]) ** 2)) / 2.0
        swing = np.sum(acc * -np.diff(np.cos(frequency * (edges - 0.5 * T))))
        return distance - DISTANCE, swing

    solution = fsolve(end_residual, [0.7, 2.4], xtol=1e-12)
    assert end_residual(solution) == pytest.approx((0.0, 0.0), abs=1e-12)
    return float(solution[1])


@pytest.mark.parametrize("name", ["crane", pytest.param("circle", marks=pytest.mark.slow)])
def test_the_bundled_tasks_converge(name: str):
    best = fan.optimise(fan.control.load_task(name), time_limit=600.0)
    assert best.status is fan.control.AnswerStatus.SOLVED and best.is_exact, best.summary()
    assert best.kkt <= 1e-6 and not best.reason
    assert f"{len(best.nodes)} intervals" in best.summary(), "the summary includes the grid"


def test_a_crane_goes_from_rest_to_rest_in_the_least_time(small_crane: fan.Marionette):
    state = small_crane.rest({"line.x": DISTANCE})
    task = fan.Task(
        small_crane,
        small_crane.rest(),
        (0.5, 3.0),
        [],
        fan.control.Smooth(1e-8, 0.0),
        fan.control.Bounds(acceleration=MAX_ACCELERATION, held=("line.length",)),
        end=state,
        interval=0.03,
        dt=0.002,
    )
    best = fan.optimise(task)
    assert best.holds, best.summary()
    assert best.run.t[-1] == pytest.approx(least_time(), rel=1e-4)
    assert np.max(np.abs(best.nodes.acc_K)) <= MAX_ACCELERATION * (1.0 + 1e-6)
    # Beyond the end the load hangs still: the swing is below 1e-6 rad.
    later = fan.simulate(small_crane, best.run.state(len(best.run) - 1).replace(t=0.0), None, 5.0)
    swing = (later.q_D[:, 0] - later.q_K[:, 0]) / LENGTH
    assert np.max(np.abs(swing)) < 1e-6
    assert best.end_gap < 1e-6


def test_the_tip_follows_a_circle_event_driven(
    arm: fan.Marionette, circle: np.ndarray, round_trip: fan.control.Optimum
):
    assert round_trip.status in (fan.control.AnswerStatus.SOLVED, fan.control.AnswerStatus.SETTLED)
    run = fan.simulate(arm, arm.rest(), round_trip.inputs, 2.0, save_at=np.linspace(0, 2, 81))
    samples = run.resample(np.linspace(0, 2, 81))
    pose = arm.poses(samples.q_D, samples.q_K)[:, 1]
    deviation = pose[..., 3] + pose[..., :3] @ np.array(TIP) - circle
    assert np.sqrt(np.mean(np.sum(deviation**2, axis=1))) < 2e-4
    assert np.min(run.tension["hand"]) > 0.0
    assert round_trip.rms()["lower"] < 2e-4


def test_the_cost_is_the_integral_of_the_run(
    arm: fan.Marionette, circle: np.ndarray, round_trip: fan.control.Optimum
):
    run, h = round_trip.run, round_trip.nodes.interval
    samples = run.resample(round_trip.t)
    pose = arm.poses(samples.q_D, samples.q_K)[:, 1]
    path = np.stack([np.interp(round_trip.t, np.linspace(0, 2, 81), c) for c in circle.T], axis=1)
    deviation = np.sum((pose[..., 3] + pose[..., :3] @ np.array(TIP) - path) ** 2, axis=1)
    total = 0.5 * 1e4 * np.trapezoid(deviation, round_trip.t)
    smooth, acc = fan.control.Smooth(), round_trip.nodes.acc_K
    total += 0.5 * smooth.acceleration * h * np.sum(acc**2)
    jumps = np.diff(acc, axis=0, prepend=0.0, append=0.0)
    total += 0.5 * smooth.jerk / h * np.sum(jumps**2)
    assert round_trip.cost == pytest.approx(total, rel=1e-6)


def test_another_optimiser_finds_no_lower_cost(small_crane: fan.Marionette):
    """Few accelerations, each varied by differences of event-driven runs."""
    x0, N, T = small_crane.rest(), 6, 1.2
    tracks = [
        fan.control.Track.coordinate("bob.x", lambda t: 0.1 * t**2, weight=50.0, end_weight=20.0)
    ]
    bounds = fan.control.Bounds(held=("line.length",), acceleration={"line.x": 0.4})
    smooth = fan.control.Smooth(1e-2, 1e-4)
    task = fan.Task(small_crane, x0, T, tracks, smooth, bounds, interval=0.2, dt=0.001)
    best = fan.optimise(task, cost_tolerance=1e-9)
    h = T / N
    t = np.linspace(0, T, N + 1)

    def cost(acc: np.ndarray) -> float:
        columns = np.stack([acc, 0.0 * acc], axis=1)
        move = fan.Input.segments(small_crane, t, x0.q_K, x0.v_K, columns)
        run = fan.simulate(small_crane, x0, move, T, save_at=t, effort=False).resample(t)
        deviation = (run.q_D[:, 0] - 0.1 * t**2) ** 2
        jumps = np.diff(acc, prepend=0.0, append=0.0)
        smooth = 0.5e-2 * h * np.sum(acc**2) + 0.5e-4 / h * np.sum(jumps**2)
        return 25.0 * np.trapezoid(deviation, t) + 10.0 * deviation[-1] + smooth

    assert best.cost == pytest.approx(cost(best.nodes.acc_K[:, 0]), rel=1e-9)
    scipy_optimum = minimize(
        cost,
        np.zeros(N),
        bounds=[(-0.4, 0.4)] * N,
        method="L-BFGS-B",
        options={"ftol": 1e-13, "gtol": 1e-9},
    )
    assert best.cost == pytest.approx(scipy_optimum.fun, rel=1e-4)
    assert best.nodes.acc_K[:, 0] == pytest.approx(scipy_optimum.x, abs=5e-3)
    assert np.max(np.abs(best.nodes.acc_K)) == pytest.approx(0.4, abs=1e-6)  # the bound is active


def test_bounds_of_tensions_jerks_and_joints_hold(arm: fan.Marionette, circle: np.ndarray):
    free = fan.follow(arm, {("lower", TIP): circle}, 2.0)
    tension = free.run.tension["hand"]
    min_tension = 0.5 * (np.min(tension) + tension[0])
    elbow = free.run.q_D[:, 1]
    lowest = float(np.min(elbow)) + 0.02
    bounds = fan.control.Bounds(
        tension={"hand": (min_tension, np.inf)}, joint={"elbow": (lowest, 3.0)}, jerk=10.0
    )
    bounded = fan.follow(arm, {("lower", TIP): circle}, 2.0, bounds=bounds)
    assert bounded.holds, bounded.summary()
    assert np.min(bounded.run.resample(bounded.t[:-1]).tension["hand"]) > min_tension - 2e-3
    assert np.min(bounded.run.q_D[:, 1]) > lowest - 2e-3
    jumps = np.diff(bounded.nodes.acc_K, axis=0, prepend=0.0, append=0.0) / bounded.nodes.interval
    assert np.max(np.abs(jumps)) <= 10.0 * (1.0 + 1e-3)
    assert bounded.rms()["lower"] > free.rms()["lower"]


def test_a_start_beyond_its_bounds_is_named(arm: fan.Marionette):
    bounds = fan.control.Bounds(joint={"elbow": (-1.0, 1.0)})
    with pytest.raises(
        fan.errors.StateError, match=r"elbow is 2\.13.* at the start, beyond its bounds"
    ):
        fan.follow(arm, {"elbow": 0.5}, 1.0, bounds=bounds)


def test_an_unreachable_end_is_reported(small_crane: fan.Marionette):
    bounds = fan.control.Bounds(acceleration=0.01, held=("line.length",))
    end = small_crane.rest({"line.x": 0.5})
    task = fan.Task(small_crane, small_crane.rest(), 1.0, [], bounds=bounds, end=end, interval=0.1)
    best = fan.optimise(task, iterations=10)
    assert not best
    assert best.status is fan.control.AnswerStatus.VIOLATED
    assert best.end_gap > 0.4
    assert "does not reach its end" in best.summary()


def test_it_continues_from_a_result(arm: fan.Marionette, circle: np.ndarray):
    first = fan.follow(arm, {("lower", TIP): circle}, 2.0, iterations=2)
    assert first.status is fan.control.AnswerStatus.ITERATIONS
    continued = fan.optimise(first.task, first)
    assert continued.cost < first.cost
    from_inputs = fan.optimise(first.task, first.inputs, iterations=0)
    assert from_inputs.cost == pytest.approx(first.cost, rel=1e-6)


def test_it_is_deterministic_with_any_number_of_threads(arm: fan.Marionette, circle: np.ndarray):
    single_thread, two = (
        fan.follow(arm, {("lower", TIP): circle}, 2.0, iterations=4, threads=n) for n in (1, 2)
    )
    assert np.array_equal(single_thread.nodes.acc_K, two.nodes.acc_K)


def test_ctrl_c_keeps_the_best_so_far(arm: fan.Marionette, circle: np.ndarray):
    def interrupt(now: object) -> None:
        raise KeyboardInterrupt

    best = fan.follow(arm, {("lower", TIP): circle}, 2.0, progress=interrupt)
    assert best.status is fan.control.AnswerStatus.STOPPED
    assert best.cost < best.curve[0][1]


def test_gains_bring_a_disturbed_arm_back(arm: fan.Marionette, round_trip: fan.control.Optimum):
    nodes, K = round_trip.nodes, round_trip.gains
    x0 = arm.rest()
    pushed = x0.replace(v_D=x0.v_D + np.array([0.3, 0.0]))
    pushed = arm.project(pushed)
    errors = {}
    for feedback in (False, True):
        stepper = arm.stepper(pushed)
        distances = []
        for i in range(len(nodes)):
            x = stepper.state
            acc = nodes.acc_K[i].copy()
            if feedback:
                z = np.concatenate(
                    [
                        x.q_D - nodes.q_D[i],
                        x.v_D - nodes.v_D[i],
                        x.q_K - nodes.q_K[i],
                        x.v_K - nodes.v_K[i],
                    ]
                )
                acc += K[i] @ z
            stepper.advance(nodes.interval, acc)
            distances.append(np.linalg.norm(stepper.state.q_D - nodes.q_D[i + 1]))
        errors[feedback] = np.mean(distances[len(nodes) // 2 :])
    assert errors[True] < 0.5 * errors[False]


@pytest.mark.parametrize(
    ("targets", "words"),
    [
        ({"lowr": [0, 0, 0]}, "lower"),
        ({"lower": [0, 0]}, "needed: 3 finite numbers"),
        ({"elbow": ([0.0, 0.0], [1.0, 2.0])}, "rising times"),
        ({"elbow": lambda t: np.nan}, "needed: 1 finite number"),
    ],
)
def test_invalid_targets_are_refused(arm: fan.Marionette, targets: dict, words: str):
    with pytest.raises(fan.FantocciniError, match=words):
        fan.follow(arm, targets, 1.0)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        (fan.control.Bounds(speed=0.0), "greater than 0"),
        (fan.control.Bounds(speed={"hand.y": 1.0}), r"hand\.x"),
        (fan.control.Bounds(position={"hand.x": (1.0, 0.0)}), "the first must be less"),
        (fan.control.Bounds(tension={"hnd": (0.0, 1.0)}), "hand"),
        (fan.control.Bounds(tension={"hand": (np.nan, 1.0)}), "a lower and a higher one"),
        (fan.control.Bounds(tension={"hand": 1.0}), "a lower and a higher one"),  # type: ignore[dict-item]
        (fan.control.Bounds(joint={"elbo": (0.0, 1.0)}), "elbow"),
        (fan.control.Bounds(held=("hand.z",)), r"hand\.x"),
    ],
)
def test_invalid_bounds_are_refused(arm: fan.Marionette, bounds: fan.control.Bounds, words: str):
    with pytest.raises(fan.FantocciniError, match=words):
        fan.follow(arm, {"elbow": 0.5}, 1.0, bounds=bounds)


def test_the_motion_does_not_depend_on_the_unit_of_the_cost(arm: fan.Marionette):
    x0 = arm.rest()
    optima = []
    for unit in (1.0, 1e-4):
        tracks = [fan.control.Track.coordinate("elbow", 2.1, weight=unit)]
        smooth = fan.control.Smooth(1e-4 * unit, 1e-6 * unit)
        bounds = fan.control.Bounds().with_taut_strings(arm, x0)
        task = fan.Task(arm, x0, 1.0, tracks, smooth, bounds, interval=0.05)
        optima.append(fan.optimise(task))
    assert optima[1].iterations > 3
    assert optima[1].cost / 1e-4 == pytest.approx(optima[0].cost, rel=0.05)


def test_a_guess_is_adapted_to_its_task(small_crane: fan.Marionette):
    """Its own duration and start, fixed inputs that do not move, accelerations within bounds."""
    x0 = small_crane.rest()
    tracks = [fan.control.Track.coordinate("bob.x", 0.1)]
    short = fan.optimise(fan.Task(small_crane, x0, 1.0, tracks, interval=0.1), iterations=2)
    bounds = fan.control.Bounds(acceleration={"line.x": 0.2}, held=("line.length",))
    task = fan.Task(
        small_crane, x0.replace(t=5.0), 2.0, tracks, fan.control.Smooth(), bounds, interval=0.2
    )
    best = fan.optimise(task, short, iterations=0)
    assert best.run.t[[0, -1]] == pytest.approx([5.0, 7.0])
    assert np.max(np.abs(best.nodes.acc_K[:, 0])) <= 0.2
    assert np.all(best.run.q_K[:, 1] == x0.q_K[1])
    bounds = fan.control.Bounds(speed={"line.x": 1e-3})
    fast = fan.Task(small_crane, x0, 1.0, tracks, fan.control.Smooth(), bounds, interval=0.1)
    assert not fan.optimise(fast, short, iterations=0)  # a motion beyond its bounds does not hold


def test_tasks_without_derivatives_are_refused(small_crane: fan.Marionette):
    x0 = small_crane.rest()
    moving_track = [fan.control.Track.coordinate("bob.x", lambda t: 0.1 * t)]
    with pytest.raises(fan.errors.StateError, match="paths must be values"):
        fan.optimise(fan.Task(small_crane, x0, (1.0, 2.0), moving_track))
    with pytest.raises(fan.errors.StateError, match="a bound of jerk"):
        fan.optimise(fan.Task(small_crane, x0, (1.0, 2.0), [], bounds=fan.control.Bounds(jerk=1.0)))
    winch = fan.loads(CRANE_TEXT.replace("length: driven", "length: driven\n    max_tension: 9.0"))
    with pytest.raises(fan.errors.StateError, match="the winch of line may slip"):
        fan.optimise(fan.Task(winch, winch.rest(), 1.0, []))
    pushed = x0.replace(v_K=np.array([0.0, 0.1]))
    with pytest.raises(fan.errors.StateError, match=r"line\.length is held, but moves"):
        bounds = fan.control.Bounds(held=("line.length",))
        fan.optimise(fan.Task(small_crane, pushed, 1.0, [], bounds=bounds))


@pytest.mark.parametrize(
    ("track", "words"),
    [
        (
            lambda: fan.control.Track.coordinate("bob.x", 0.1, start=0.61, end=0.69),
            "no node lies there",
        ),
        (lambda: fan.control.Track.coordinate("bob.x", 0.1, start=0.6, end=0.2), "must be less"),
        (lambda: fan.control.Track.tension("line", 4.0, end_weight=1.0), "end_weight"),
    ],
)
def test_invalid_tracks_are_refused(small_crane: fan.Marionette, track, words: str):
    with pytest.raises(fan.errors.StateError, match=words):
        fan.optimise(fan.Task(small_crane, small_crane.rest(), 1.0, [track()], interval=0.1))


def test_invalid_tasks_are_refused(arm: fan.Marionette):
    x0 = arm.rest()
    with pytest.raises(fan.errors.StateError, match="a lower and a higher one"):
        fan.Task(arm, x0, (2.0, 1.0), [])
    with pytest.raises(fan.errors.StateError, match="a list of Track"):
        fan.Task(arm, x0, 1.0, ["elbow"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="interval"):
        fan.Task(arm, x0, 1.0, [], interval=0.0)
