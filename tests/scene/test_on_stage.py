"""The bundled scenes: the marionette walks; Columbine sits down and Pierrot rolls a ball to her."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.perform.demo import walk

pytestmark = pytest.mark.slow

SOLE = np.array([[x, y, -0.141] for x in (-0.02, 0.034) for y in (-0.016, 0.016)])
"""Corners of a sole in the frame of its shin [m]."""
STEPS = [(0.9 + 0.575 * k, ("left", "right")[k % 2]) for k in range(6)]
"""Beginning of each step [s], and the foot that swings."""
STEP = 0.575
LOADED = 0.03
"""Part of the weight above which a foot counts as loaded."""


def corners(marionette, run, foot):
    """(T, 4, 3) corners of a sole in the world [m]."""
    pose = marionette.poses(run.q_D, run.q_K)[:, marionette.link_index(f"shin_{foot}")]
    return pose[:, None, :, 3] + np.einsum("tij,cj->tci", pose[:, :, :3], SOLE)


@pytest.fixture(scope="module", params=[1e-3, 5e-4])
def walked(request):
    stage = fan.puppets.promenade()
    dt = request.param
    method = fan.TimeStepping(dt=dt)
    run = fan.simulate(stage, *walk(stage), method=method, save_every=round(4e-3 / dt))
    return stage, run


def test_it_stands_at_the_start(walked):
    stage, run = walked
    begins = sum(run.contact.force_on(f"shin_{foot}", len(run))[20] for foot in ("left", "right"))
    assert 0.3 * stage.weight < begins[2] < stage.weight


def test_the_energies_of_the_walk_balance(walked):
    """The residual was a tenth of the exchanged energy when impulses counted as gravity."""
    _, run = walked
    exchanged = run.ledger["kinetic"].max() + np.ptp(run.ledger["potential"])
    assert np.max(np.abs(run.ledger["residual"])) < 0.02 * exchanged


@pytest.mark.parametrize("step", range(6))
def test_a_step_carries_swings_and_does_not_slip(walked, step):
    stage, run = walked
    begin, swings = STEPS[step]
    stands = {"left": "right", "right": "left"}[swings]
    during = (run.t >= begin + 0.15 * STEP) & (run.t < begin + 0.85 * STEP)
    load = run.contact.force_on(f"shin_{stands}", len(run))[:, 2] / stage.weight
    assert load[during].mean() > 0.1
    air = run.contact.force_on(f"shin_{swings}", len(run))[during, 2] == 0.0
    assert air.mean() > 0.45
    height = corners(stage, run, swings)[during][:, :, 2].min(axis=1)
    assert height.max() > 0.008
    # The lowest corner stays in place while the foot is loaded.
    whole = (run.t >= begin) & (run.t < begin + STEP)
    soles, carries = corners(stage, run, stands)[whole], load[whole] > LOADED
    lowest = soles[:, :, 2].argmin(axis=1)[:-1]
    moved = np.linalg.norm(np.diff(soles[:, :, :2], axis=0), axis=2)
    slipped = moved[np.arange(len(lowest)), lowest][carries[:-1] & carries[1:]].sum()
    assert slipped < 0.01


def test_the_feet_go_forward_one_after_the_other(walked):
    """The places where the feet land depend on the last bit, and so do the distances between them.
    Each step still carries its own foot forward.
    """
    stage, run = walked
    x = {foot: corners(stage, run, foot).mean(axis=1)[:, 0] for foot in ("left", "right")}
    for begin, foot in STEPS:
        first, last = np.searchsorted(run.t, [begin, begin + STEP])
        assert x[foot][last] - x[foot][first] > 0.02
    assert min(x[foot][-1] for foot in x) > 0.15


def test_the_trunk_stays_upright_and_it_stands_at_the_end(walked):
    stage, run = walked
    assert run.status is fan.Status.DONE
    torso = stage.poses(run.q_D, run.q_K)[:, stage.link_index("torso")]
    assert np.degrees(np.arccos(torso[:, 2, 2].min())) < 18.0
    assert np.degrees(np.abs(np.arctan2(torso[:, 1, 0], torso[:, 0, 0])).max()) < 22.0
    late = run.t > run.t[-1] - 1.0
    feet = [run.contact.force_on(f"shin_{foot}", len(run))[late, 2] for foot in ("left", "right")]
    assert sum(feet).mean() > 0.25 * stage.weight
    assert min(foot.mean() for foot in feet) > 0.03 * stage.weight
    assert np.ptp(torso[late, 0, 3]) < 0.05
    assert run.contact.gap.min() > -1e-3


@pytest.fixture(scope="module")
def visit():
    stage = fan.puppets.visit()
    inputs = fan.Input.load(stage, fan.puppets.performance("visit"))
    method = fan.TimeStepping(dt=1e-3)
    run = fan.simulate(stage, stage.rest(), inputs, method=method, save_every=4)
    assert run.status is fan.Status.DONE
    return stage, run


def test_columbine_sits_on_the_chair(visit):
    stage, run = visit
    late = run.t > 11.0
    chair = next(p for p in fan.puppets.visit().puppet.bodies if p.name == "chair")
    own = sum(shape.mass for shape in chair.shapes) * 9.81
    floor = run.contact.involving("chair", "floor")
    bears = np.zeros(len(run))
    np.add.at(bears, floor.sample, floor.force[:, 2])
    hers = 0.5 * (stage.weight - own - 0.024 * 9.81)
    assert (bears[late] - own).mean() > 0.4 * hers
    bodies = {name for pair in set(run.contact.involving("chair").names) for name in pair}
    assert {"columbine.thigh_left", "columbine.thigh_right"} <= bodies
    torso = stage.poses(run.q_D, run.q_K)[:, stage.link_index("columbine.torso")]
    assert torso[late, 2, 3].max() < 0.26 < 0.33 < torso[0, 2, 3]
    assert np.ptp(run["chair.x"]) < 0.01


def pushed(run, name: str, on: str) -> np.ndarray:
    """(T,) force along z from the contacts of one body on another [N]."""
    points = run.contact.involving(on, name)
    sign = np.array([1.0 if run.contact.names[p][0] == on else -1.0 for p in points.pair])
    total = np.zeros(len(run))
    np.add.at(total, points.sample, sign * points.force[:, 2])
    return total


def test_pierrot_hands_her_the_ball(visit):
    _, run = visit
    weight = 0.024 * 9.81
    his = pushed(run, "pierrot.forearm_right", "ball")
    hers = pushed(run, "columbine.forearm_left", "ball")
    before, after = run.t < 2.0, (run.t > 6.8) & (run.t < 7.6)
    assert his[before].mean() == pytest.approx(weight, rel=0.02)
    assert np.all(hers[before] == 0.0)
    assert hers[after].mean() == pytest.approx(weight, rel=0.02)
    assert np.all(his[after] == 0.0)
    # It never falls on the way: until she sits, it is more than 0.15 m above the floor.
    assert run["ball.z"][run.t < 7.6].min() > 0.15


def test_she_sits_with_it(visit):
    stage, run = visit
    torso = stage.poses(run.q_D, run.q_K)[-1, stage.link_index("columbine.torso"), :, 3]
    ball = np.array([run[f"ball.{axis}"][-1] for axis in "xyz"])
    assert np.linalg.norm(torso - ball) < 0.2
    assert ball[2] > 0.1
    assert np.all(pushed(run, "floor", "ball") == 0.0)
