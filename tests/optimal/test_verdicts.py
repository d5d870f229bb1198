"""Tasks that an optimisation refuses at once, and reports on invalid answers."""

from __future__ import annotations

import signal
import threading
from dataclasses import replace

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal import shooting
from fantoccini.control.optimal.sqp import Filter

pytestmark = pytest.mark.medium


def task_to_end(small_crane: fan.Marionette, bounds: fan.control.Bounds, **options) -> fan.Task:
    options_of_task = {
        "duration": 1.0,
        "end": small_crane.rest({"line.x": 0.2}),
        "interval": 0.1,
    } | options
    return fan.Task(small_crane, small_crane.rest(), tracks=[], bounds=bounds, **options_of_task)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        (
            fan.control.Bounds(position={"line.x": (-0.1, 0.15)}),
            r"line\.x is 0\.2 at the end, beyond its bounds -0\.1 to 0\.15",
        ),
        (fan.control.Bounds(joint={"bob.x": (-1.0, 0.1)}), r"bob\.x is 0\.2 at the end"),
        (
            fan.control.Bounds(held=("line.x",)),
            r"line\.x is held, but its end differs from its start by 0\.2",
        ),
    ],
)
def test_an_end_outside_its_bounds_is_refused_at_once(small_crane, bounds, words):
    with pytest.raises(fan.errors.StateError, match=words):
        fan.optimise(task_to_end(small_crane, bounds))


def test_an_end_faster_than_its_bound_is_refused_at_once(small_crane):
    end = small_crane.rest({"line.x": 0.2})
    end = end.replace(v_K=np.array([0.6, 0.0]), v_D=np.array([0.6, 0.0]))
    with pytest.raises(fan.errors.StateError, match=r"the speed of line\.x is 0\.6 at the end"):
        fan.optimise(task_to_end(small_crane, fan.control.Bounds(speed=0.5), end=end))


def test_an_end_that_strings_do_not_allow_is_refused_at_once(small_crane):
    end = small_crane.rest({"line.x": 0.2})
    end = end.replace(q_D=end.q_D + np.array([0.0, -0.1]))
    with pytest.raises(fan.errors.StateError, match=r"the state at the end violates line by 0\.1"):
        fan.optimise(task_to_end(small_crane, fan.control.Bounds(), end=end))


def test_a_periodic_end_outside_its_bounds_is_refused_at_once(small_crane):
    bounds = fan.control.Bounds(position={"line.x": (-0.1, 0.15)})
    displacements = {"line.x": 0.2, "bob.x": 0.2}
    with pytest.raises(fan.errors.StateError, match=r"line\.x is 0\.2 at the end"):
        fan.optimise(task_to_end(small_crane, bounds, end=None, periodic=displacements))


def test_a_task_that_holds_everything_is_refused_at_once(small_crane):
    held = fan.control.Bounds(held=("line.x", "line.length"))
    with pytest.raises(fan.errors.StateError, match="all driven coordinates are held"):
        fan.optimise(task_to_end(small_crane, held, end=None))


def test_files_name_the_lines_of_an_end_outside_bounds_and_of_fixed_inputs(tmp_path):
    text = "task: t\npuppet: crane\nstart: {trolley: 0}\nend: {trolley: 2}\nduration: 3\n"
    (tmp_path / "t.yaml").write_text(text + "bounds: {position: {trolley: [-1, 1]}}\n")
    with pytest.raises(
        fan.errors.FileError, match=r"t\.yaml:4: end: trolley is 2 at the end, beyond"
    ):
        fan.control.load_task(tmp_path / "t.yaml")
    held = text.replace("end: {trolley: 2}\n", "") + "bounds: {held: [trolley, hoist.length]}\n"
    (tmp_path / "t.yaml").write_text(held)
    with pytest.raises(fan.errors.FileError, match=r"t\.yaml:5: bounds\.held: all driven"):
        fan.control.load_task(tmp_path / "t.yaml")


def test_a_violated_bound_is_named_with_its_coordinate_and_time(small_crane):
    bounds = fan.control.Bounds(acceleration=0.01, held=("line.length",))
    best = fan.optimise(task_to_end(small_crane, bounds), iterations=6)
    assert best.status is fan.control.AnswerStatus.VIOLATED
    assert "x ends 0." in best.reason and "at 1 s" in best.reason, best.reason
    assert best.reason in best.summary()
    # A tension that no motion reaches, from the first node on.
    tension_bounds = fan.control.Bounds(tension={"line": (9.0, np.inf)}, acceleration=0.5)
    best = fan.optimise(task_to_end(small_crane, tension_bounds, end=None), iterations=6)
    assert best.status is fan.control.AnswerStatus.VIOLATED
    assert "the tension of line is" in best.reason and "beyond its bounds 9 to inf" in best.reason


def test_a_violated_bound_says_whether_the_search_was_cut_short(small_crane):
    """Regression: a search that had no time left looked like a task without a solution."""
    unreachable_task = task_to_end(
        small_crane, fan.control.Bounds(acceleration=0.01, held=("line.length",))
    )
    out_of_time = fan.optimise(unreachable_task, time_limit=1e-9)
    assert out_of_time.status is fan.control.AnswerStatus.VIOLATED
    assert "the time limit ended the search" in out_of_time.summary()
    interrupted = fan.optimise(unreachable_task, iterations=2, time_limit=600.0)
    assert interrupted.status is fan.control.AnswerStatus.VIOLATED
    assert "2 iterations ended the search" in interrupted.reason
    completed = fan.optimise(unreachable_task, iterations=1000, time_limit=600.0)
    assert completed.status is fan.control.AnswerStatus.VIOLATED
    assert "ended the search" not in completed.reason


def test_a_guess_that_holds_is_the_answer_if_the_search_ends_elsewhere(small_crane):
    """Regression: a valid guess was lost when the search ended beyond the bounds."""
    bounds = fan.control.Bounds(acceleration=4.0)
    slow = fan.optimise(task_to_end(small_crane, bounds, duration=1.5))
    assert slow.holds
    # The first step towards a far path leaves the end, and the search ends there.
    track = fan.control.Track.coordinate("bob.x", -0.5, weight=1e3)
    task = replace(task_to_end(small_crane, bounds, duration=1.5), tracks=[track])
    best = fan.optimise(task, slow, iterations=1)
    assert best.status is fan.control.AnswerStatus.GUESS and best.holds and not best
    assert "line.x ends" in best.reason or "bob.x ends" in best.reason, best.reason
    assert best.reason in best.summary() and "1 iterations ended the search" in best.reason
    assert best.run.q_D[-1] == pytest.approx(slow.run.q_D[-1], abs=1e-6)
    assert np.isfinite(best.gains).all()
    without_guess = fan.optimise(replace(task, guess=None), iterations=1)
    assert without_guess.status is fan.control.AnswerStatus.VIOLATED


def test_a_search_without_progress_names_its_residual(small_crane, monkeypatch):
    monkeypatch.setattr(Filter, "accepts", lambda self, before, now, falls: False)
    bounds = fan.control.Bounds(acceleration=1.0, held=("line.length",))
    track = fan.control.Track.coordinate("bob.x", 0.2)
    best = fan.optimise(replace(task_to_end(small_crane, bounds, end=None), tracks=[track]))
    assert best.status is fan.control.AnswerStatus.STALLED
    assert "the acceleration of line.x at " in best.reason and "within -1 to 1" in best.reason


def test_a_stationary_motion_that_is_no_minimum_is_not_the_answer(small_crane):
    """At rest the bob's height is stationary, for any motion of the trolley."""
    bounds = fan.control.Bounds(acceleration=3.0, held=("line.length",))
    bounds = bounds.with_taut_strings(small_crane, small_crane.rest())
    high = fan.control.Track.coordinate("bob.z", -0.95, weight=100.0)
    rocking_task = replace(task_to_end(small_crane, bounds, end=None, duration=1.5), tracks=[high])
    best = fan.optimise(rocking_task, time_limit=600.0)
    assert best.curve[0][1] > 0.18
    assert best.cost < 0.5 * best.curve[0][1], best.summary()


def test_an_end_that_no_input_reaches_is_explained():
    """The load hangs from one point, and has no control about it."""
    crane = fan.puppets.crane()
    x0, end = crane.rest(), crane.rest({"trolley": 0.3})
    rotation_change = np.zeros(len(end.v_D))
    rotation_change[5] = 2e-4
    end = end.replace(q_D=crane.integrate(end.q_D, rotation_change))
    bounds = fan.control.Bounds(acceleration=1.0, held=("hoist.length",))
    best = fan.optimise(
        fan.Task(crane, x0, 3.0, [], fan.control.Smooth(1e-3, 0.0), bounds, end=end, interval=0.1),
        iterations=30,
    )
    assert best.status is not fan.control.AnswerStatus.SOLVED
    assert "ends 0.0002 from" in best.reason and "no input moves it" in best.reason, best.reason


def test_ctrl_c_in_the_first_motion_is_no_mistake_of_the_task(small_crane, monkeypatch):
    simulate = shooting.simulate

    def simulate_stopped(*args, **options):
        return replace(simulate(*args, **options), status=fan.Status.STOPPED)

    monkeypatch.setattr(shooting, "simulate", simulate_stopped)
    with pytest.raises(KeyboardInterrupt):
        fan.optimise(task_to_end(small_crane, fan.control.Bounds()))


def test_ctrl_c_in_a_later_motion_keeps_the_best(small_crane, monkeypatch):
    simulate, count = shooting.simulate, iter(range(100))

    def simulate_then_stop(*args, **options):
        run = simulate(*args, **options)
        return replace(run, status=fan.Status.STOPPED) if next(count) >= 4 else run

    monkeypatch.setattr(shooting, "simulate", simulate_then_stop)
    best = fan.optimise(
        replace(
            task_to_end(small_crane, fan.control.Bounds(), end=None),
            tracks=[fan.control.Track.coordinate("bob.x", lambda t: 0.1 * t**2)],
        )
    )
    assert best.status is fan.control.AnswerStatus.STOPPED
    assert best.cost < best.curve[0][1]


@pytest.mark.slow
def test_ctrl_c_at_any_time_is_either_raised_or_kept(small_crane):
    goal = task_to_end(small_crane, fan.control.Bounds(acceleration=1.0), interval=0.02)
    for delay in np.linspace(0.0005, 0.08, 60):
        best = interrupted_after(delay, goal)  # early it may not have reached its end
        assert best is None or best.run.t[-1] == pytest.approx(1.0)


def interrupted_after(delay: float, goal: fan.Task) -> fan.control.Optimum | None:
    """The optimum after Ctrl-C at a time [s]; None if it was raised."""
    timer = threading.Timer(delay, signal.raise_signal, (signal.SIGINT,))
    try:
        timer.start()
        try:
            return fan.optimise(goal)
        finally:
            timer.cancel()
            timer.join()
    except KeyboardInterrupt:
        return None
