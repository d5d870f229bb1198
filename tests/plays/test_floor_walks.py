"""Plays in which players walk on the floor: their feet touch it and hardly slide."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.cast import Footing, ResultCache, Walk
from fantoccini.theatre.gaits import BUNDLED_GAITS, MAX_SLIDE
from fantoccini.theatre.gestures import Step
from fantoccini.theatre.plays.floor_walks import FLOOR_PAUSES, floor_parts, floor_walk
from fantoccini.theatre.plays.reading import read_play

PLAY = """\
play: stroll
tempo: 100
cast:
  dog: {{puppet: {puppet}, at: [0, 0], facing: audience, walks: on the floor}}
acts:
  - act: One
    cues:
{cues}
"""
PAWS = ("forepaw_left", "forepaw_right", "hindpaw_left", "hindpaw_right")


def write(folder: Path, *cues: str, puppet: str = "dachshund") -> Path:
    """Path of a play's file."""
    lines = "\n".join(f"      - {cue}" for cue in cues)
    (folder / "stroll.yaml").write_text(PLAY.format(puppet=puppet, cues=lines), encoding="utf-8")
    return folder / "stroll.yaml"


def slides_and_loads(
    verification: fan.theatre.Verification, foot: str, first_step: float, cycle: float, n: int
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) slides of a foot [m] and (n,) largest forces on it [N], in each of its steps.

    Slides are integrals of the sliding speeds that the contact solver reports.
    """
    run = verification.run
    points = run.contact.involving(foot, "floor")
    loaded = points.normal_force > 1e-6 * verification.play.marionette.weight
    speed, force = np.zeros((2, len(run.t)))
    np.maximum.at(speed, points.sample[loaded], points.sliding_speed[loaded])
    np.maximum.at(force, points.sample, points.normal_force)
    step = np.floor((run.t - first_step) / cycle).astype(int)
    inside = (step[:-1] >= 0) & (step[:-1] < n)
    slides = np.bincount(step[:-1][inside], (speed[:-1] * np.diff(run.t))[inside], n)
    loads = np.array([np.max(force[step == k]) for k in range(n)])
    return slides, loads


@pytest.fixture(scope="module", name="stroll")
def _stroll(tmp_path_factory: pytest.TempPathFactory) -> fan.theatre.Play:
    folder = tmp_path_factory.mktemp("stroll")
    return fan.load_play(write(folder, "{who: dog, walks to: [0.6, 0], name: out}"))


@pytest.fixture(scope="module", name="verified")
def _verified(stroll: fan.theatre.Play) -> fan.theatre.Verification:
    return fan.theatre.verify_play(stroll)


@pytest.mark.slow
def test_the_feet_of_a_dachshund_touch_the_floor_in_every_step_and_hardly_slide(stroll, verified):
    assert stroll, stroll.changes
    assert verified, verified.faults
    (walk,) = verified.feet
    assert walk.part.n * walk.part.step.length == pytest.approx(0.6, abs=1e-9)
    assert set(walk.first_steps) == {
        f"{end} {side} foot" for end in ("front", "hind") for side in ("left", "right")
    }
    n = len(walk.feet.slide)
    for foot, t in walk.first_steps.items():
        end, side, _ = foot.split()
        paw = f"{'fore' if end == 'front' else 'hind'}paw_{side}"
        slides, loads = slides_and_loads(verified, paw, t, walk.step_time, n)
        assert np.all(slides < MAX_SLIDE), (paw, slides)
        assert np.all(loads > 0.02 * stroll.marionette.weight), (paw, loads)


@pytest.mark.slow
def test_bundled_puppets_turn_above_the_floor_and_walk_on_it(tmp_path):
    """Swing about the vertical would make feet slide by several millimetres."""
    places_of = dict.fromkeys(BUNDLED_GAITS, "[[0.1, -0.12]]") | {"dachshund": "[[0.06, -0.08]]"}
    for puppet, places in places_of.items():
        cue = f"{{who: dog, walks to: [0.2, -0.1], past: {places}}}"
        play = fan.load_play(write(tmp_path, cue, puppet=puppet))
        verification = fan.theatre.verify_play(play)
        assert play and verification, (play.changes, verification.faults)
        assert len(verification.feet) == 2
        for walk in verification.feet:
            assert walk.feet.max_slide < MAX_SLIDE
            n = len(walk.feet.slide)
            bodies = play.cast.players["dog"].bodies.feet
            for foot, first_step in zip(bodies, walk.first_steps.values(), strict=True):
                name = play.cast.scene_name(foot)
                _, loads = slides_and_loads(verification, name, first_step, walk.step_time, n)
                assert np.all(loads > 0.02 * play.marionette.weight), (name, loads)


@pytest.mark.slow
def test_it_hangs_before_and_after_a_walk_on_the_floor(stroll, verified):
    run = verified.run
    (part,) = (walk.part for walk in verified.feet)
    on_floor = run.t[np.unique(run.contact.sample)]
    assert part.begin < on_floor.min() and on_floor.max() < part.end
    lengths = [i for i, name in enumerate(run.coordinates.q_K) if name.endswith(".length")]
    np.testing.assert_allclose(run.q_K[-1, lengths], run.q_K[0, lengths], atol=1e-9)
    heights = [run.q_D[k, run.coordinates.q_D.index("chest.z")] for k in (0, -1)]
    assert heights[1] == pytest.approx(heights[0], abs=1e-3)


@pytest.mark.slow
def test_on_a_slippery_floor_the_verification_names_foot_step_time_and_slide(stroll, monkeypatch):
    monkeypatch.setattr("fantoccini.theatre.cast.contacts.FRICTION", 0.05)
    verification = fan.theatre.verify_play(dataclasses.replace(stroll, cache=ResultCache()))
    assert not verification
    pattern = (
        r"step \d+ of dog's (front|hind) (left|right) foot: it slides [\d.]+ mm; allowed: 2 mm, "
        r"in One, beat [\d.]+ \([\d.]+ s\)"
    )
    assert any(re.fullmatch(pattern, fault) for fault in verification.faults), verification.faults


@pytest.mark.medium
def test_straight_parts_of_a_walk_are_on_the_floor_and_turns_above_it(tmp_path):
    script = read_play(write(tmp_path, "{who: dog, turns to: left}"), ResultCache())
    dog = script.cast.players["dog"]
    before, after = FLOOR_PAUSES
    turn, step = Step(0.0, 0.3), Step(0.01)
    steps = (
        *[turn] * 2,
        *[Step()] * before,
        *[step] * 4,
        *[Step()] * after,
        turn,
        *[Step()] * before,
        *[step] * 3,
        *[Step()] * after,
    )
    walk = Walk(Footing(0.0, 0.0), 1.0, steps, dog.gait.step_time, FLOOR_PAUSES)
    T = walk.step_time
    assert [(part.n, part.begin) for part in floor_parts(walk)] == [
        (4, pytest.approx(1.0 + 2.0 * T)),
        (3, pytest.approx(1.0 + (2.0 + before + 4.0 + after + 1.0) * T)),
    ]
    assert walk.move_time == 1.0
    assert dataclasses.replace(walk, steps=(Step(), *steps[2:])).move_time == 1.0 + T
    gesture = floor_walk(dog, walk)
    assert gesture.duration == pytest.approx(len(steps) * T)
    table = dog.marionette.coordinates
    lengths = [v for v, name in enumerate(table.v_K) if name.endswith(".length")]
    withers = [table.v_K.index(f"withers.{axis}") for axis in "xy"]
    home = complex(*(dog.rest_state[f"withers.{axis}"] for axis in "xy")) - dog.middle
    for part in floor_parts(walk):
        for t in (part.begin, part.end):
            offsets, rates = gesture.offsets(t - walk.begin)
            # It hangs as at the start, where the walk has it.
            np.testing.assert_allclose(rates, 0.0, atol=1e-9)
            np.testing.assert_allclose(offsets[lengths], 0.0, atol=1e-9)
            xy, heading = walk.footing(np.array([t]))
            place = complex(*xy[0]) + np.exp(1j * heading[0]) * home - home
            np.testing.assert_allclose(offsets[withers], [place.real, place.imag], atol=1e-9)
        middle, _ = gesture.offsets(part.begin - walk.begin + (before + 1) * T)
        assert np.all(middle[lengths] > -0.03) and np.max(middle[lengths]) > 0.02


@pytest.mark.medium
def test_a_puppet_without_a_gait_cannot_walk_on_the_floor(tmp_path):
    path = write(tmp_path, "{who: dog, walks to: [0.3, 0]}", puppet="heron")
    with pytest.raises(fan.errors.FileError) as error:
        fan.load_play(path)
    message = "no gait on the floor is known for heron; needed: `above the floor`, or one of the"
    assert message in str(error.value) and "stroll.yaml:4: cast.dog.walks" in str(error.value)
