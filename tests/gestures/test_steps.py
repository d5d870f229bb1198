"""Steps of any lengths and turns: their ends, their speed, and the raised knees."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Ends
from fantoccini.theatre.gestures.stepping import Step, StepPath, footing_after
from fantoccini.theatre.gestures.walking import SWAY, step_gesture

STEPS = (
    Step(0, 0.5),
    Step(0, 0.5),
    Step(0.08),
    Step(0.08),
    Step(0.08),
    Step(),
    Step(),
    Step(-0.05, 0.3),
    Step(-0.05, 0.3),
    Step(0.0, -0.6),
    Step(0.1, -0.2),
)
STRINGS = ("shoulder_left", "shoulder_right", "head", "hand_left", "knee_right")


@cache
def rest_state(marionette: fan.Marionette) -> fan.State:
    return marionette.rest()


def gesture_of(
    marionette: fan.Marionette, steps=STEPS, step_time: float = 0.5
) -> fan.theatre.Gesture:
    return step_gesture(
        Ends(BodyParts.for_puppet(marionette), rest_state(marionette)), steps, step_time
    )


def ends_at(marionette: fan.Marionette, gesture: fan.theatre.Gesture, t: float) -> np.ndarray:
    x0, (d, _), v_K = rest_state(marionette), gesture.offsets(t), marionette.coordinates.v_K
    x, y = (
        np.array([float(x0[f"{s}.{p}"]) + d[v_K.index(f"{s}.{p}")] for s in STRINGS]) for p in "xy"
    )
    return x + 1j * y


def end_of_arcs(steps) -> tuple[complex, float]:
    """Every step is an arc with the chord 2 R sin(turn / 2), R = length / turn."""
    z, heading = 0j, 0.0
    for step in steps:
        chord = step.length
        if step.turn:
            chord = 2.0 * step.length / step.turn * np.sin(0.5 * step.turn)
        z += chord * np.exp(1j * (heading + 0.5 * step.turn))
        heading += step.turn
    return z, heading


def test_steps_end_where_their_arcs_do(marionette):
    gesture = gesture_of(marionette)
    z, heading = end_of_arcs(STEPS)
    assert footing_after(STEPS) == pytest.approx((z.real, z.imag, heading), abs=1e-12)
    assert gesture.duration == pytest.approx(len(STEPS) * 0.5)
    first, last = ends_at(marionette, gesture, 0.0), ends_at(marionette, gesture, gesture.duration)
    home = 0.5 * (first[0] + first[1])
    np.testing.assert_allclose(last - home, z + np.exp(1j * heading) * (first - home), atol=1e-9)
    travel = [gesture.travel[marionette.coordinates.v_K.index(f"head.{part}")] for part in "xy"]
    np.testing.assert_allclose(complex(*travel), (last - first)[2], atol=1e-9)
    assert gesture.changes_heading


def test_all_ends_follow_the_track_as_one_body(marionette):
    gesture, track = gesture_of(marionette), StepPath(STEPS, 0.5)
    first = ends_at(marionette, gesture, 0.0)
    home = 0.5 * (first[0] + first[1])
    for t in np.linspace(0.0, gesture.duration, 457):
        path, heading = track.at(np.array([t]))
        turned, ends = np.exp(1j * heading[0][0]), ends_at(marionette, gesture, t)
        residuals = (ends - home - path[0][0]) / turned - (first - home)
        np.testing.assert_allclose(residuals, residuals[0], atol=2e-5)
        assert abs(residuals[0].real) < 2e-5 and abs(residuals[0].imag) < SWAY + 2e-5


def test_the_track_is_smooth_and_rests_between_legs():
    track, t = StepPath(STEPS, 0.5), np.linspace(0.0, 5.5, 55001)
    path, heading = track.at(t)
    for value, rate, change in (path, heading):
        np.testing.assert_allclose(np.gradient(value, t), rate, atol=2e-5)
        np.testing.assert_allclose(np.gradient(rate, t)[1:-1], change[1:-1], atol=1e-2)
    for leg in (0.0, 1.0, 2.5, 3.5, 4.5, 5.0, 5.5):
        path, heading = track.at(np.array([leg]))
        assert abs(path[1][0]) < 1e-12 and abs(heading[1][0]) < 1e-12
    # The last step goes from rest to rest: 15/8 of its mean speed.
    peak = np.max(np.abs(track.at(t[t >= 5.0])[0][1]))
    assert peak == pytest.approx(1.875 * 0.1 / 0.5, rel=1e-4)


def test_three_equal_steps_have_the_speed_of_two():
    speed = np.abs(StepPath([Step(0.08)] * 3, 0.5).at(np.linspace(0.0, 1.5, 301))[0][1])
    assert np.max(speed) == pytest.approx(3 * 0.08 / (2 * 0.5))
    np.testing.assert_allclose(speed[100:201], np.max(speed))


def test_velocities_never_jump(marionette):
    gesture = gesture_of(marionette)
    for t in gesture.breaks[1:-1]:
        before, after = gesture.offsets(t - 1e-9)[1], gesture.offsets(t + 1e-9)[1]
        np.testing.assert_allclose(before, after, atol=1e-6)
    assert not np.any(np.abs(gesture.ends[1]) > 1e-12)


def test_knees_are_raised_alternately_but_not_at_rest(marionette):
    gesture, v_K = gesture_of(marionette), marionette.coordinates.v_K
    moving_steps = [k for k, step in enumerate(STEPS) if not step.stands]
    assert list(gesture.marks)[:4] == ["left", "right", "left 2", "right 2"]
    assert list(gesture.marks.values()) == pytest.approx([(k + 0.5) * 0.5 for k in moving_steps])
    for k in range(len(STEPS)):
        d, _ = gesture.offsets((k + 0.5) * 0.5)
        lengths = {s: d[v_K.index(f"knee_{s}.length")] for s in ("left", "right")}
        side = ("left", "right")[moving_steps.index(k) % 2] if k in moving_steps else ""
        # On the spot they are raised less: the hips turn, and the knees would meet.
        lift = 0.06 if STEPS[k].length else 0.025
        for s, length in lengths.items():
            assert length == pytest.approx(-lift if s == side else 0.0, abs=1e-12)


def test_equal_steps_are_a_walk(marionette):
    walk = fan.theatre.load_gesture(marionette, "walk", steps=5, step=0.07, turn=0.9)
    steps_gesture = gesture_of(marionette, [Step(0.07, 0.9 / 5)] * 5, 0.6)
    np.testing.assert_allclose(steps_gesture.coef, walk.coef, atol=1e-12)
    assert steps_gesture.marks == walk.marks


def test_impossible_steps_are_refused(marionette):
    for wrong in ((1.5, 0.0), (0.0, 2.0), (np.nan, 0.0)):
        with pytest.raises(ValueError, match="of a step is"):
            Step(*wrong)
    with pytest.raises(ValueError, match="at least one step"):
        gesture_of(marionette, [])
    with pytest.raises(ValueError, match="step_time"):
        gesture_of(marionette, STEPS, 0.0)
