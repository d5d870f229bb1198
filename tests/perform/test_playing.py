"""Gestures and takes added to the hands: C^1, within bounds, and without changes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from tests.gestures.available import available_gestures
from tests.perform.hands import hands_of

import fantoccini as fan
from fantoccini.base import rotation
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.perform import reach

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def gestures(marionette):
    return available_gestures(marionette)


@pytest.fixture(scope="module")
def take(marionette):
    """Three seconds of motion of two strings."""
    live, rng = fan.Performance(marionette), np.random.default_rng(1)
    homes = {name: live.place(name)[0] for name in ("hand_left", "head")}
    live.record()
    for _ in range(10):
        for name, home in homes.items():
            live.move(name, home + rng.uniform(-0.05, 0.05, size=3))
        live.advance(0.3)
    return live.stop()


def check_bounds(live: fan.Performance, recording: fan.theatre.Recording) -> None:
    """Accelerations, and so changes of velocity in a tick, and speeds keep their bounds."""
    hands, v_K = hands_of(live), recording.trajectory.v_K
    for values, bound in ((recording.acc_K, hands.acceleration), (v_K, hands.speed)):
        sizes = np.array([reach.lengths(row, hands.group, len(bound)) for row in values])
        assert np.max(sizes / bound) <= 1.0 + 1e-9


def target_positions(live: fan.Performance) -> np.ndarray:
    return np.concatenate([live.target(handle.name)[0] for handle in live.handles])


def test_a_gesture_is_added_to_the_positions_of_the_hands(marionette, gestures):
    live = fan.Performance(marionette)
    live.move("head", live.place("head")[0] + [0.03, 0.0, 0.0])
    live.advance(1.0)
    home, wave = live.state.q_K, gestures["wave"]
    assert live.play(wave) == 0.0
    assert live.playing == ("wave",)
    start_time = live.t
    for _ in range(int(wave.duration / live.tick)):
        x = live.step()
        d, _ = piecewise.evaluate(wave.breaks, wave.coef, live.t - start_time)
        np.testing.assert_allclose(x.q_K, home + d, atol=2e-5)
    live.advance(0.5)
    assert live.playing == ()
    np.testing.assert_allclose(live.state.q_K, home, atol=1e-9)


def test_gestures_in_the_middle_of_others_never_jump_and_keep_bounds(marionette, gestures):
    live, rng = fan.Performance(marionette), np.random.default_rng(0)
    home = target_positions(live)
    names = [name for name, gesture in gestures.items() if not gesture.travel.any()]
    live.record()
    for _ in range(40):
        live.play(gestures[rng.choice(names)].scaled(rng.uniform(0.5, 1.5)))
        live.advance(rng.uniform(0.02, 1.2))
    live.go_home()
    live.advance(4.0)
    recording = live.stop()
    assert not recording.end_reason
    check_bounds(live, recording)
    np.testing.assert_allclose(target_positions(live), home, atol=1e-12)
    np.testing.assert_allclose(recording.trajectory.q_K[-1], recording.start.q_K, atol=1e-9)
    assert np.max(np.abs(recording.trajectory.v_K[-1])) < 1e-9


def test_after_a_walk_the_hands_are_at_the_new_place(marionette, gestures):
    live, walk = fan.Performance(marionette), gestures["walk"]
    home = live.state.q_K
    live.play(walk)
    live.advance(walk.duration + 0.5)
    np.testing.assert_allclose(live.state.q_K, home + walk.travel, atol=1e-9)
    live.play(gestures["wave"])
    live.advance(gestures["wave"].duration + 0.5)
    np.testing.assert_allclose(live.state.q_K, home + walk.travel, atol=1e-9)
    live.go_home()
    live.advance(4.0)
    np.testing.assert_allclose(live.state.q_K, home, atol=1e-9)


def test_home_reverts_gestures_then_the_hands(marionette, gestures):
    live = fan.Performance(marionette)
    home = target_positions(live)
    live.move("head", live.place("head")[0] + [0.03, 0.0, 0.0])
    moved_targets = target_positions(live)
    live.play(gestures["kneel"])
    live.advance(2.0)
    for targets in (moved_targets, home):
        live.go_home()
        live.advance(2.0)
        np.testing.assert_array_equal(target_positions(live), targets)
        positions = [live.place(handle.name)[0] for handle in live.handles]
        np.testing.assert_allclose(np.concatenate(positions), targets, atol=1e-9)


def test_a_button_pressed_twice_begins_again_where_it_is(marionette, gestures):
    live = fan.Performance(marionette)
    live.record()
    for _ in range(5):
        live.play(gestures["wave"])
        live.advance(0.7)
    size = np.max(np.abs(gestures["wave"].coef[:, :, 0]))
    recording = live.stop()
    check_bounds(live, recording)
    # It replaces itself: offsets do not add up.
    assert np.max(np.abs(recording.trajectory.q_K - recording.start.q_K)) < 1.2 * size


def test_a_part_adds_to_the_whole_and_a_posture_takes_over(marionette, gestures):
    names = marionette.coordinates.q_K
    live = fan.Performance(marionette)
    home = live.state.q_K
    live.play(gestures["kneel"])
    live.advance(2.0)
    kneeling_offsets = live.state.q_K - home
    assert np.max(np.abs(kneeling_offsets - gestures["kneel"].ends[0][1])) < 1e-9
    live.play(gestures["nod"])
    live.advance(gestures["nod"].duration + 0.2)
    np.testing.assert_allclose(live.state.q_K - home, kneeling_offsets, atol=1e-9)
    live.play(gestures["sit"])
    live.advance(2.5)
    np.testing.assert_allclose(live.state.q_K - home, gestures["sit"].ends[0][1], atol=1e-9)
    live.play(gestures["stand"])
    live.advance(2.5)
    knee_indices = [i for i, name in enumerate(names) if name.startswith("knee")]
    np.testing.assert_allclose(live.state.q_K[knee_indices], home[knee_indices], atol=1e-9)


def test_gestures_begin_on_time(marionette, gestures):
    live = fan.Performance(marionette)
    home, nod = live.state.q_K, gestures["nod"]
    assert live.play(nod, after=0.503) == pytest.approx(0.503)
    live.advance(0.5)
    np.testing.assert_array_equal(live.state.q_K, home)
    for _ in range(60):
        x = live.step()
        d, _ = piecewise.evaluate(nod.breaks, nod.coef, max(live.t - 0.503, 0.0))
        np.testing.assert_allclose(x.q_K, home + d, atol=2e-5)
    # During its motion it begins later if the transition to its start takes longer.
    assert live.play(nod, after=0.0) > 0.0


def test_a_repetition_ends_on_request(marionette, gestures):
    live = fan.Performance(marionette)
    home = live.state.q_K
    live.play(gestures["march"], repeat=True)
    live.record()
    live.advance(3.0 * gestures["march"].duration)
    assert live.playing == ("march",)
    live.stop_repeating("march")
    live.advance(gestures["march"].duration + 0.5)
    assert live.playing == ()
    check_bounds(live, live.stop())
    np.testing.assert_allclose(live.state.q_K, home, atol=1e-9)


def test_a_walk_shifts_the_home_position(marionette):
    live = fan.Performance(marionette)
    step = fan.theatre.Gesture.from_points(
        marionette, {"head.forward": [(0, 0), (1, "3 cm")]}, travels=True
    )
    x = live.target("head")[0][0]
    for _ in range(2):
        live.play(step)
        live.advance(1.5)
    assert live.target("head")[0][0] == pytest.approx(x + 0.06)


def test_an_overdub_repeats_the_take_and_leaves_armed_lanes_to_the_hands(marionette, take):
    live = fan.Performance(marionette)
    live.play_take(take, armed=["hand_right"])
    live.record()
    goal = live.place("hand_right")[0] + [0.06, 0.0, 0.0]
    live.move("hand_right", goal)
    live.advance(take.duration)
    overdub = live.stop()
    names = marionette.coordinates.q_K
    assert "hand_right" in live.lanes and "hand_right.x" in names
    unarmed = [i for i, name in enumerate(names) if not name.startswith("hand_right.")]
    np.testing.assert_allclose(
        overdub.trajectory.q_K[:, unarmed], take.trajectory.q_K[:, unarmed], rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(live.place("hand_right")[0], goal, atol=1e-9)
    # Without armed lanes the puppet moves equally, except for the memory of the time-stepper.
    live.play_take(take)
    live.record()
    live.advance(take.duration)
    replayed = live.stop().trajectory
    np.testing.assert_allclose(replayed.q_K, take.trajectory.q_K, rtol=0, atol=1e-12)
    np.testing.assert_allclose(replayed.q_D, take.trajectory.q_D, rtol=0, atol=1e-6)


def test_hands_stop_where_a_take_ends(marionette, take):
    live = fan.Performance(marionette)
    live.play_take(take.trimmed(0.0, 1.1))
    assert live.take_time == 0.0
    live.record()
    live.advance(3.0)
    check_bounds(live, live.stop())
    assert live.take_time is None
    np.testing.assert_allclose(
        target_positions(live),
        np.concatenate([live.place(h.name)[0] for h in live.handles]),
        atol=1e-9,
    )


def test_a_loop_never_jumps(marionette, take):
    part = take.trimmed(0.4, 2.2)
    live = fan.Performance(marionette)
    live.play_take(part, repeat=True)
    live.record()
    live.advance(5.0)
    recording = live.stop()
    assert live.take_time is not None and live.take_time < part.duration
    check_bounds(live, recording)
    live.stop_take()
    live.advance(1.0)
    assert np.max(np.abs(live.state.v_K)) < 1e-9


def test_a_looped_take_is_joined_by_state(marionette, take):
    bar = fan.Performance(fan.puppets.marionette_bar())
    home, _ = bar.place("bar")
    bar.record()
    bar.move("bar", home + np.array([0.1, 0.0, 0.05]), rotation.exp(np.array([0.1, 0.2, 0.3])))
    bar.advance(0.8)
    for recording in (take.trimmed(0.4, 2.2), bar.stop()):
        loop = recording.looped(3)
        assert np.max(np.abs(loop.acc_K)) <= max(np.max(np.abs(recording.acc_K)), 6.1)
        period, remainder = divmod(len(loop) - len(recording), 2)
        assert remainder == 0 and period > len(recording)
        for k in range(3):
            np.testing.assert_array_equal(
                loop.acc_K[k * period : k * period + len(recording)], recording.acc_K
            )
        looped_input, recorded_input = loop.inputs, recording.inputs
        for s in np.linspace(0.0, recording.duration - 1e-6, 7):
            for a, b in zip(
                looped_input.evaluate(2 * period * recording.tick + s),
                recorded_input.evaluate(s),
                strict=True,
            ):
                np.testing.assert_allclose(a, b, atol=1e-9)


def test_equal_ends_need_no_transition(marionette):
    live = fan.Performance(marionette)
    live.record()
    live.advance(0.5)
    resting_take = live.stop()
    assert len(resting_take.looped(3)) == 3 * len(resting_take)
    for count in (0, 1.5, 10_000):
        with pytest.raises(ValueError, match="count"):
            resting_take.looped(count)


def test_motions_that_cannot_be_played_are_refused(marionette, gestures, take):
    live = fan.Performance(fan.puppets.arm2d())
    for play_motion in (lambda: live.play(gestures["wave"]), lambda: live.play_take(take)):
        with pytest.raises(ValueError, match="puppet"):
            play_motion()
    live = fan.Performance(marionette)
    with pytest.raises(fan.errors.UnknownNameError, match="hand_right"):
        live.play_take(take, armed=["hand_rihgt"])
    live.set_hand_law(zero_law(marionette))
    for play_motion in (lambda: live.play(gestures["wave"]), lambda: live.play_take(take)):
        with pytest.raises(fan.errors.StateError, match="law"):
            play_motion()


def zero_law(marionette):
    class Still:
        def acceleration(self, x: fan.State) -> np.ndarray:
            return np.zeros(marionette.coordinates.n_vK)

        def stop(self) -> None:
            pass

    return Still()


def test_far_too_large_gestures_stay_within_bounds_and_lengths(marionette, gestures):
    live = fan.Performance(marionette)
    live.record()
    for name, factor in itertools.product(("jump", "wave"), (8.0, 30.0)):
        live.play(gestures[name].scaled(factor))
        live.advance(2.0)
    check_bounds(live, live.stop())
    for name, (low, high) in live.lengths.items():
        assert low - 0.06 <= live.length(name) <= high + 0.06


SCORE = """\
score: number
tempo: 90
lanes:
  arms: [{gesture: wave, at: 1}, {gesture: clap, at: 9}]
  head: [{gesture: nod, at: 2, repeat: 3}]
waits: {clap: {at: 9}, end: {at: 16}}
"""


@pytest.fixture(scope="module")
def score(marionette, tmp_path_factory):
    path = tmp_path_factory.mktemp("score") / "number.yaml"
    path.write_text(SCORE, encoding="utf-8")
    return fan.load_score(marionette, path)


def test_a_score_is_played_paused_and_set(marionette, score):
    live = fan.Performance(marionette)
    home = live.state.q_K

    def check_offsets(atol: float = 2e-5) -> None:
        d, _ = piecewise.evaluate(score.gesture.breaks, score.gesture.coef, live.score.t)
        np.testing.assert_allclose(live.state.q_K - home, d, atol=atol)

    live.play_score(score)
    live.record()
    for _ in range(40):
        live.advance(0.05)
        check_offsets()
    assert live.score.t == pytest.approx(2.0 - 0.15)
    live.score.running = False
    live.advance(0.5)
    paused_time = live.score.t
    live.advance(0.5)
    assert live.score.t == paused_time
    check_offsets(1e-6)
    live.score.seek(5.0)
    live.advance(1.5)
    assert live.score.t == 5.0
    check_offsets(1e-6)
    live.score.running = True
    live.advance(3.0)
    assert live.score.conductor.waiting.name == "clap" and live.score.is_still
    check_offsets(1e-6)
    assert live.score.conductor.go()
    live.advance(score.duration)
    assert live.score.conductor.go()
    live.advance(1.0)
    assert live.score.t == score.duration
    check_offsets(1e-6)
    live.score.seek(2.0)
    live.advance(1.0)
    live.stop_score()
    live.advance(2.0)
    assert live.score is None
    np.testing.assert_allclose(live.state.q_K, home, atol=1e-9)
    check_bounds(live, live.stop())


def test_armed_lanes_of_a_score_are_in_the_hands(marionette, score):
    live = fan.Performance(marionette)
    home = live.place("hand_right")[0]
    live.play_score(score, armed=["hand_right"])
    for _ in range(30):
        live.advance(0.1)
        np.testing.assert_array_equal(live.place("hand_right")[0], home)
        assert live.length("hand_right") == live.target_length("hand_right")


def test_played_motions_continue_or_are_reported_as_ended(marionette, gestures, score):
    live = fan.Performance(marionette)
    live.play(gestures["wave"], repeat=True)
    score_voice = live.play_score(score)
    live.advance(0.5)
    assert live.replace(fan.puppets.marionette()) == ()
    assert live.playing == ("wave",) and live.score is score_voice
    t = score_voice.t
    live.advance(0.2)
    assert score_voice.t > t
    messages = live.replace(fan.puppets.crane())
    assert {"the gestures ended", "the score ended"} <= set(messages)
    assert live.playing == () and live.score is None
