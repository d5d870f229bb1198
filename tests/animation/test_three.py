"""three.js plays the files with the motion of the run, and draws them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.animation.glb_reader import UP, Player
from tests.animation.test_glb import TOLERANCE, still_of
from tests.animation.three import three
from tests.show.browser import count_colours, picture

import fantoccini as fan

pytestmark = pytest.mark.slow


def test_three_js_shows_the_run(greeting: fan.Trajectory, greeting_glb: Path) -> None:
    still = still_of(greeting)
    rng = np.random.default_rng(3)
    t = np.sort(np.concatenate([np.arange(2401) / 240, rng.uniform(0.0, 10.0, 300)]))
    # three.js has a clock of doubles, and keys in single precision.
    run = greeting.resample(t)
    poses = still.poses(run.q_D, run.q_K)
    names = [link.name for link in still.tree.links]
    with three(greeting_glb) as page:
        transforms = page.matrices(names, t)
        off = np.linalg.norm(transforms[..., :3, 3] - poses[..., 3] @ UP.T, axis=2)
        assert off.max() < TOLERANCE
        turned = np.linalg.norm(transforms[..., :3, :3] - UP @ poses[..., :3], axis=(2, 3))
        # A hand's breadth from a joint, that is 0.01 mm.
        assert turned.max() < 2e-4

        # A slack string agrees with the other player, written from the specification.
        sample_times = np.linspace(0.0, 9.9, 12)
        other = Player(greeting_glb)
        for string in ("head", "hand_right"):
            apart = page.vertices(string, sample_times) - other.vertices(string, sample_times)
            assert np.abs(apart).max() < 1e-5

        drawn = page.draw(8.0, (2.6, 0.9, 1.2), (0.0, 0.55, 0.0))
        assert drawn > 5000
        assert count_colours(picture(page.browser, "three_greeting")) > 40


def test_three_js_keeps_the_jump_of_a_catch(thrown: fan.Trajectory, tmp_path: Path) -> None:
    """One-sided differences at the catch give the run's two velocities."""
    path = fan.export(thrown, tmp_path / "thrown.glb")
    table = thrown.coordinates
    twice = np.flatnonzero(np.diff(thrown.t) <= 0.0)
    k = twice[np.argmax(np.linalg.norm(thrown.v_D[twice + 1] - thrown.v_D[twice], axis=1))]
    before, after = thrown.v_D[k], thrown.v_D[k + 1]
    assert np.linalg.norm(after - before) > 0.5
    assert table.v_D == ("bob.x", "bob.z")
    h, at = 1e-3, float(np.float32(thrown.t[k]))
    with three(path) as page:
        places = page.matrices(["bob"], [at - 2 * h, at - h, at, at + h, at + 2 * h])[:, 0, :3, 3]
    places = places @ UP
    # One-sided differences of second order; matrices are doubles of single-precision keys.
    left = (3 * places[2] - 4 * places[1] + places[0]) / (2 * h)
    right = (-3 * places[2] + 4 * places[3] - places[4]) / (2 * h)
    assert left[[0, 2]] == pytest.approx(before, abs=5e-3)
    assert right[[0, 2]] == pytest.approx(after, abs=5e-3)
