"""Places that are passed at free times, compared with SciPy's optima over these times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import fantoccini as fan
from fantoccini.control.optimal import reach_notes
from fantoccini.control.optimal.touch_terms import TouchTerms
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.nodes import Nodes

pytestmark = pytest.mark.slow

T, N, END_WEIGHT = 1.0, 25, 1e4
TIP_IN_LOWER = (0.3, 0.0, 0.0)


@pytest.fixture(scope="module")
def pen() -> fan.Marionette:
    """A pen driven along x and z, with a bob below it."""
    return fan.loads("""
puppet: plotter
bodies:
- name: pen
  joint: {type: translation, axes: [x, z], driven: true}
  shapes: [{type: sphere, radius: 0.02, mass: 0.1}]
- {name: bob, parent: pen, joint: {name: pin, type: revolute, axis: [0, 1, 0]}, mass: 1.0,
   com: [0, 0, -0.3], inertia: [0.01, 0.01, 0.001]}
""")


def drawing_task(pen: fan.Marionette, touches: list[fan.control.Touch], duration=T) -> fan.Task:
    """The pen moves from rest at (0, 0) to rest at (1, 0)."""
    tracks = [
        getattr(fan.control.Track, kind)(name, value, weight=0.0, end_weight=END_WEIGHT)
        for kind, name, value in (
            ("coordinate", "pen.x", 1.0),
            ("coordinate", "pen.z", 0.0),
            ("velocity", "pen.x", 0.0),
            ("velocity", "pen.z", 0.0),
        )
    ]
    return fan.Task(
        pen,
        pen.rest(),
        duration,
        tracks,
        fan.control.Smooth(1.0, 0.0),
        interval=np.max(duration) / N,
        touches=touches,
    )


def least_cost(times: np.ndarray, places: np.ndarray, duration: float = T) -> float:
    """Cost of such accelerations through (n, 2) places at given times: one linear system."""
    h = duration / N
    interval_starts = h * np.arange(N)

    def position_gains(t: np.ndarray) -> np.ndarray:
        return (
            0.5 * np.clip(t[:, None] - interval_starts, 0, None) ** 2
            - 0.5 * np.clip(t[:, None] - interval_starts - h, 0, None) ** 2
        )

    A = position_gains(np.asarray(times))
    E = np.vstack([position_gains(np.array([duration])), np.full(N, h)])
    total = 0.0
    for coordinate_values, end in zip(np.transpose(places), ((1.0, 0.0), (0.0, 0.0)), strict=True):
        H, n = h * np.eye(N) + END_WEIGHT * E.T @ E, len(A)
        system = np.block([[H, A.T], [A, np.zeros((n, n))]])
        a = np.linalg.solve(system, np.concatenate([END_WEIGHT * E.T @ end, coordinate_values]))[:N]
        total += 0.5 * h * a @ a + 0.5 * END_WEIGHT * np.sum((E @ a - end) ** 2)
    return total


def test_the_time_of_a_touch_is_the_best_one(pen: fan.Marionette):
    best = fan.optimise(
        drawing_task(pen, [fan.control.Touch("pen", (0.3, 0.0, 0.2))]),
        cost_tolerance=0.0,
        tolerance=1e-8,
    )
    scipy_optimum = minimize_scalar(
        lambda t: least_cost([t], [[0.3, 0.2]]),
        bounds=(0.1, 0.9),
        method="bounded",
        options={"xatol": 1e-10},
    )
    assert best.status is fan.control.AnswerStatus.SOLVED
    (touch,) = best.closest_approaches
    assert touch.t == pytest.approx(scipy_optimum.x, abs=1e-7)
    assert best.cost == pytest.approx(scipy_optimum.fun, rel=1e-10)
    assert touch.distance < 1e-9
    assert str(touch) in best.summary()
    with_usual_tolerances = fan.optimise(best.task)
    assert with_usual_tolerances.holds and with_usual_tolerances.cost == pytest.approx(
        scipy_optimum.fun, rel=1e-4
    )


@pytest.mark.parametrize(("between", "t"), [((0.5, 0.8), 0.5), ((0.1, 0.3), 0.3)])
def test_the_time_stays_in_its_window(pen: fan.Marionette, between: tuple, t: float):
    best = fan.optimise(
        drawing_task(pen, [fan.control.Touch("pen", (0.3, 0.0, 0.2), between=between)]),
        cost_tolerance=0.0,
    )
    assert best.holds, best.summary()
    assert best.closest_approaches[0].t == pytest.approx(t, abs=1e-9)
    assert best.cost == pytest.approx(least_cost([t], [[0.3, 0.2]]), rel=1e-6)


def test_successive_touches_keep_their_order(pen: fan.Marionette):
    places = [[0.6, 0.15], [0.35, 0.1]]
    touches = [fan.control.Touch("pen", (x, 0.0, z)) for x, z in places]
    free = fan.optimise(drawing_task(pen, touches[::-1]), cost_tolerance=0.0)
    assert free.holds, free.summary()
    assert free.closest_approaches[0].t < free.closest_approaches[1].t
    ordered_task = drawing_task(pen, [touches[0], replace(touches[1], in_turn=True)])
    best = fan.optimise(ordered_task, cost_tolerance=0.0, iterations=200)
    scipy_optimum = minimize(
        lambda t: least_cost([t[0], t[0] + t[1]], places),
        [0.4, 0.2],
        method="L-BFGS-B",
        bounds=[(0.1, 0.8), (0.05, 0.8)],
        options={"ftol": 1e-15, "gtol": 1e-8},
    )
    assert best.holds, best.summary()
    assert [touch.t for touch in best.closest_approaches] == pytest.approx(
        np.cumsum(scipy_optimum.x), abs=1e-3
    )
    assert best.cost == pytest.approx(scipy_optimum.fun, rel=1e-7)
    assert best.cost > free.cost


def test_the_duration_may_be_free_as_well(pen: fan.Marionette):
    task = replace(
        drawing_task(pen, [fan.control.Touch("pen", (0.3, 0.0, 0.2))], (0.5, 4.0)), time_weight=20.0
    )
    best = fan.optimise(task, cost_tolerance=0.0, iterations=200)
    scipy_optimum = minimize(
        lambda x: least_cost(x[:1] * x[1], [[0.3, 0.2]], x[1]) + 20.0 * x[1],
        [0.4, 1.2],
        method="L-BFGS-B",
        bounds=[(0.1, 0.9), (0.5, 4.0)],
        options={"ftol": 1e-15, "gtol": 1e-7},
    )
    assert best.holds, best.summary()
    assert best.cost == pytest.approx(scipy_optimum.fun, rel=1e-6)
    assert best.run.t[-1] == pytest.approx(scipy_optimum.x[1], rel=1e-3)
    assert best.closest_approaches[0].t == pytest.approx(
        scipy_optimum.x[0] * scipy_optimum.x[1], rel=1e-3
    )


def test_an_arm_passes_a_place_at_the_best_time(arm: fan.Marionette):
    """Compared with SLSQP by differences of event-driven runs, with the time as an unknown."""
    x0, n, end = arm.rest(), 8, 0.8
    pose = arm.pose(x0, "lower")
    place = pose[:3, 3] + pose[:3, :3] @ np.array(TIP_IN_LOWER) + [0.05, 0.0, 0.05]
    tracks = [
        fan.control.Track.velocity("*", 0.0, weight=0.01),
        fan.control.Track.coordinate("hand.length", x0.q_K[1], weight=0.0, end_weight=100.0),
    ]
    task = fan.Task(
        arm,
        x0,
        end,
        tracks,
        fan.control.Smooth(1e-2, 0.0),
        fan.control.Bounds().with_taut_strings(arm, x0),
        interval=end / n,
        dt=0.001,
        touches=[fan.control.Touch("lower", place, TIP_IN_LOWER, (0.1, end))],
    )
    best = fan.optimise(task, cost_tolerance=0.0, iterations=100)
    assert best.holds, best.summary()
    t, h, k = np.linspace(0, end, n + 1), end / n, arm.coordinates.n_vK

    def run_of(unknown: np.ndarray) -> fan.Trajectory:
        move = fan.Input.segments(arm, t, x0.q_K, x0.v_K, unknown[:-1].reshape(n, k))
        return fan.simulate(arm, x0, move, end, save_at=t, effort=False)

    def cost(unknown: np.ndarray) -> float:
        run = run_of(unknown).resample(t)
        speed = np.trapezoid(np.sum(run.v_D**2, axis=1), t)
        end_cost = 100.0 * (run.q_K[-1, 1] - x0.q_K[1]) ** 2
        return 0.5 * (0.01 * speed + end_cost + 1e-2 * h * np.sum(unknown[:-1] ** 2))

    def touch_residual(unknown: np.ndarray) -> np.ndarray:
        pose = arm.pose(run_of(unknown).at(unknown[-1]), "lower")
        return (pose[:3, 3] + pose[:3, :3] @ np.array(TIP_IN_LOWER) - place)[[0, 2]]

    initial_guess = np.append(np.ravel(best.nodes.acc_K) * 0.9, best.closest_approaches[0].t + 0.03)
    scipy_optimum = minimize(
        cost,
        initial_guess,
        method="SLSQP",
        constraints={"type": "eq", "fun": touch_residual},
        bounds=[(None, None)] * n * k + [(0.1, end)],
        options={"ftol": 1e-12, "maxiter": 200},
    )
    assert best.cost == pytest.approx(scipy_optimum.fun, rel=1e-4)
    assert best.closest_approaches[0].t == pytest.approx(scipy_optimum.x[-1], abs=2e-3)
    assert best.closest_approaches[0].distance < 1e-6


def test_parameters_are_chosen_along_with_touches():
    """Compared with SciPy's minimum over searches with a fixed parameter."""
    lever = fan.loads("""
puppet: lever
bodies:
- name: rod
  joint: {name: pin, type: revolute, axis: [0, -1, 0]}
  mass: 1.0
  com: [0, 0, -0.5]
  inertia: [0.1, 0.1, 0.001]
strings:
- name: line
  path: [{body: rod, at: [0, 0, {parameter: tie, value: -0.6}]}, {world: [0.8, 0, 0.2]}]
  length: driven
pose: {pin: 60 deg, line.length: 0.5}
""")
    x0 = lever.rest()
    place = lever.pose(x0.replace(q_D=x0.q_D - 0.15), "rod") @ [0, 0, -1, 1]
    task = fan.Task(
        lever,
        x0,
        0.6,
        [fan.control.Track.velocity("*", weight=0.1)],
        fan.control.Smooth(1e-2, 1e-6),
        interval=0.05,
        touches=[fan.control.Touch("rod", place[:3], (0, 0, -1))],
        parameters={"tie": (-0.75, -0.5)},
    )

    def cost(tie: float) -> float:
        tied_lever = lever.with_parameters({"tie": tie})
        fixed_task = replace(task, marionette=tied_lever, x0=tied_lever.rest(x0), parameters={})
        best = fan.optimise(fixed_task, cost_tolerance=1e-4)
        assert best.holds, best.summary()
        return best.cost

    best = fan.optimise(task, cost_tolerance=1e-4)
    assert best.holds, best.summary()
    scipy_optimum = minimize_scalar(
        cost, bounds=(-0.75, -0.5), method="bounded", options={"maxiter": 8}
    )
    assert best.cost == pytest.approx(scipy_optimum.fun, rel=2e-3)
    assert best.parameters["tie"] == pytest.approx(scipy_optimum.x, abs=0.01)


def test_it_continues_from_a_result_and_has_gains(pen: fan.Marionette):
    first = fan.optimise(
        drawing_task(pen, [fan.control.Touch("pen", (0.3, 0.0, 0.2))]), iterations=6
    )
    continued = fan.optimise(first.task, first)
    assert continued.cost <= first.cost + 1e-2 and continued.kkt < first.kkt
    assert first.gains.shape == (N, 2, 6) and np.all(np.isfinite(first.gains))


def test_a_place_that_is_missed_is_violated(arm: fan.Marionette):
    x0 = arm.rest()
    task = fan.Task(
        arm,
        x0,
        1.0,
        [],
        bounds=fan.control.Bounds(acceleration=0.1),
        interval=0.1,
        touches=[fan.control.Touch("lower", (3.0, 0.0, 0.0), TIP_IN_LOWER)],
    )
    best = fan.optimise(task, iterations=10)
    assert not best and best.status is fan.control.AnswerStatus.VIOLATED
    assert best.closest_approaches[0].distance > 1.0
    assert "does not reach its end or a place" in best.summary()


def test_places_move_as_their_derivatives():
    """The time is fixed; rotations, lengths of intervals and parameters change."""
    puppet = fan.loads("""
puppet: flail
bodies:
- name: rod
  joint: {name: hip, type: ball, at: [0, 0, {parameter: height, value: 0.2}]}
  mass: 1.0
  com: [0, 0, -0.5]
  inertia: [0.1, 0.1, 0.01]
- name: hand
  joint: {type: translation, axes: [x, y, z], driven: true}
strings:
- {name: line, path: [{body: rod, at: [0, 0, -1]}, {body: hand, at: [0, 0, 0]}], length: 0.5}
pose: {hand.x: 0.1, hand.z: -0.31}
""")
    x0 = puppet.rest()
    touch = fan.control.Touch("rod", (0.2, 0.1, 0.4), (0.1, 0.2, -1.0), between=(0.13, 0.13 + 1e-9))
    task = fan.Task(
        puppet, x0, (0.2, 0.4), [], interval=0.1, touches=[touch], parameters={"height": (0, 1)}
    )
    free_parameters = ChosenParameters(puppet, x0, task.parameters)
    touches, rng = TouchTerms(task, free_parameters), np.random.default_rng(3)
    nodes = replace(Nodes.constant(puppet, x0, 0.4, 4), parameters=np.array([0.25]))
    nodes = nodes.after_step(0.3 * rng.normal(size=(5, nodes.n_z)), np.zeros((4, 3)))
    z, c = rng.normal(size=(5, nodes.n_z)), np.array([0.05, 0.5])
    zeros = np.zeros((4, 3))
    step = 1e-5
    gaps = [touches.gap(nodes.after_step(x * z, zeros, x * c)) for x in (-step, step)]
    change = -(gaps[1] - gaps[0]) / (2.0 * step)
    moments = touches.moments(nodes)
    assert moments.edge[0] != 0.0 and moments.intervals[0] == 1
    changes = np.concatenate([z[1], z[2], c])
    assert change == pytest.approx(
        moments.r_derivatives[0] @ changes, abs=1e-6 * np.max(np.abs(change))
    )


def test_equally_near_moments_are_spread(pen: fan.Marionette):
    touches = [fan.control.Touch("pen", (0.3, 0.0, 0.2), in_turn=k > 0) for k in range(3)]
    best = fan.optimise(drawing_task(pen, touches), iterations=0)
    assert [touch.t for touch in best.closest_approaches] == pytest.approx(
        [0.25, 0.5, 0.75], abs=0.01
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"body": "pencil"}, "pen"),
        ({"place": (0.0, 1.0)}, "place of a touch of pen is .* 3 finite numbers"),
        ({"at": (0.0, np.nan, 0.0)}, "point of a touch of pen is .* 3 finite numbers"),
        ({"between": (0.5, 0.5)}, "a time and a later one"),
        ({"between": (1.5, 2.0)}, "the motion is from 0 s to 1 s"),
    ],
)
def test_invalid_touches_are_refused(pen: fan.Marionette, options: dict, words: str):
    with pytest.raises(fan.FantocciniError, match=words):
        drawing_task(
            pen, [fan.control.Touch(**{"body": "pen", "place": (0.3, 0.0, 0.2), **options})]
        )


def test_options_that_exclude_touches_are_refused(pen: fan.Marionette):
    late = fan.control.Touch("pen", (0.3, 0.0, 0.2), between=(0.6, 0.9))
    early = fan.control.Touch("pen", (0.5, 0.0, 0.2), between=(0.1, 0.5), in_turn=True)
    with pytest.raises(fan.errors.StateError, match=r"in turn, and by 0\.5 s"):
        drawing_task(pen, [late, early])
    with pytest.raises(fan.errors.StateError, match="a list of Touch"):
        drawing_task(pen, ["pen"])  # type: ignore[list-item]
    with pytest.raises(fan.errors.StateError, match="explore excludes touches"):
        replace(drawing_task(pen, [late]), explore=1)
    with pytest.raises(fan.errors.StateError, match="the task has touches"):
        fan.MPC(pen, drawing_task(pen, [late]), horizon=0.5, nodes=10)


TASK_YAML = """\
task: dab
puppet: arm2d
start: {hand.length: 0.8}
duration: 0.8
touches:
  - {point: lower, at: [0.3, 0, 0], by: [0.05, 0, 0.05], between: [0.1, null]}
  - point: lower
    place: [0.3, 0, 0.1]
    between: [0.3, 0.6]
    in_turn: true
interval: 0.05
"""


def test_a_file_equals_a_gesture_in_python(tmp_path, arm: fan.Marionette):
    path = tmp_path / "dab.yaml"
    path.write_text(TASK_YAML, encoding="utf-8")
    first, second = fan.control.load_task(path).touches
    pose = arm.pose(arm.rest({"hand.length": 0.8}), "lower")
    start = pose[:3, 3] + pose[:3, :3] @ np.array(TIP_IN_LOWER)
    assert np.array(first.place) - start == pytest.approx([0.05, 0.0, 0.05])
    assert (first.body, first.at, first.between) == ("lower", TIP_IN_LOWER, (0.1, np.inf))
    assert not first.in_turn and second.in_turn
    assert second.place == pytest.approx([0.3, 0.0, 0.1]) and second.between == (0.3, 0.6)


@pytest.mark.parametrize(
    ("change", "line", "key", "words"),
    [
        (("point: lower,", "point: lowr,"), 6, "touches[0].point", "did you mean 'lower'"),
        (("by: [0.05, 0, 0.05], ", ""), 6, "touches[0]", "neither `place` nor `by`"),
        (("[0.1, null]", "[0.9, null]"), 6, "touches[0].between", "the motion is from 0 s to 0.8"),
        (("[0.3, 0.6]", "[0.6, 0.3]"), 9, "touches[1].between", "a time and a later one"),
        (("[0.1, null]", "[0.7, null]"), 9, "touches[1].between", "in turn, and by 0.6 s"),
        (("interval", "slack: true\nexplore: 1\ninterval"), 12, "explore", "it excludes touches"),
    ],
)
def test_mistakes_in_a_file_have_places(tmp_path, change, line: int, key: str, words: str):
    path = tmp_path / "dab.yaml"
    path.write_text(TASK_YAML.replace(*change, 1), encoding="utf-8")
    with pytest.raises(fan.errors.FileError) as caught:
        fan.control.load_task(path)
    (message,) = (str(mistake) for mistake in caught.value.mistakes)
    assert f"dab.yaml:{line}: {key}" in message and words in message


def test_the_picture_shows_the_places(tmp_path, pen: fan.Marionette):
    best = fan.optimise(
        drawing_task(pen, [fan.control.Touch("pen", (0.3, 0.0, 0.2))]), iterations=5
    )
    without_touches = replace(best, closest_approaches=())
    picture = best.plot(tmp_path / "with.png").read_bytes()
    assert picture != without_touches.plot(tmp_path / "without.png").read_bytes()


def test_a_place_beyond_reach_is_reported_beforehand(arm: fan.Marionette):
    task = fan.Task(
        arm,
        arm.rest(),
        1.0,
        [],
        touches=[fan.control.Touch("lower", (3.0, 0.0, 0.0), TIP_IN_LOWER)],
    )
    (text,) = reach_notes(task)
    assert text.startswith("lower hangs no nearer than") and "to the place it touches" in text
