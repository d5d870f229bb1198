"""The bundled scenes: the marionette walks; Columbine sits down and Pierrot rolls a ball to her."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.demo import walk
from fantoccini.marionette import link_index

PERFORMANCES = Path(fan.puppets.__file__).parent / "performances"
SOLE = np.array([[x, y, -0.141] for x in (-0.02, 0.034) for y in (-0.016, 0.016)])
"""Corners of a sole in the frame of its shin [m]."""
STEPS = [(0.9 + 0.575 * k, ("left", "right")[k % 2]) for k in range(6)]
"""Beginning of each step [s], and the foot that swings."""
STEP = 0.575
LOADED = 0.03
"""Part of the weight from which on a foot stands."""


def corners(marionette, run, foot):
    """(T, 4, 3) corners of a sole in the world [m]."""
    pose = marionette.poses(run.q_D, run.q_K)[:, link_index(marionette.model, f"shin_{foot}")]
    return pose[:, None, :, 3] + np.einsum("tij,cj->tci", pose[:, :, :3], SOLE)


@pytest.fixture(scope="module", params=[1e-3, 5e-4])
def promenade(request):
    stage = fan.puppets.promenade()
    dt = request.param
    method = fan.TimeStepping(dt=dt)
    run = fan.simulate(stage, *walk(stage), method=method, save_every=round(4e-3 / dt))
    return stage, run


def test_it_stands_at_the_start(promenade):
    stage, run = promenade
    begins = sum(run.contact.force_on(f"shin_{foot}", len(run))[20] for foot in ("left", "right"))
    assert 0.3 * stage.weight < begins[2] < stage.weight


@pytest.mark.parametrize("step", range(6))
def test_a_step_carries_swings_and_does_not_slip(promenade, step):
    stage, run = promenade
    begin, swings = STEPS[step]
    stands = {"left": "right", "right": "left"}[swings]
    during = (run.t >= begin + 0.15 * STEP) & (run.t < begin + 0.85 * STEP)
    load = run.contact.force_on(f"shin_{stands}", len(run))[:, 2] / stage.weight
    assert load[during].mean() > 0.1
    air = run.contact.force_on(f"shin_{swings}", len(run))[during, 2] == 0.0
    assert air.mean() > 0.45
    height = corners(stage, run, swings)[during][:, :, 2].min(axis=1)
    assert height.max() > 0.008
    # The corner that stands lowest stays where it is while the foot carries.
    whole = (run.t >= begin) & (run.t < begin + STEP)
    soles, carries = corners(stage, run, stands)[whole], load[whole] > LOADED
    lowest = soles[:, :, 2].argmin(axis=1)[:-1]
    moved = np.linalg.norm(np.diff(soles[:, :, :2], axis=0), axis=2)
    slipped = moved[np.arange(len(lowest)), lowest][carries[:-1] & carries[1:]].sum()
    assert slipped < 0.01


def test_the_feet_go_forward_one_after_the_other(promenade):
    stage, run = promenade
    ends = np.searchsorted(run.t, [begin + STEP for begin, _ in STEPS])
    x = [corners(stage, run, foot)[k].mean(axis=0)[0]
         for k, (_, foot) in zip(ends, STEPS, strict=True)]  # fmt: skip
    assert np.all(np.diff(x[:5]) > 0.015)
    assert x[-1] > 0.2


def test_the_trunk_stays_upright_and_it_stands_at_the_end(promenade):
    stage, run = promenade
    assert run.status is fan.Status.DONE
    torso = stage.poses(run.q_D, run.q_K)[:, link_index(stage.model, "torso")]
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
    inputs = fan.Input.load(stage, PERFORMANCES / "visit.yaml")
    method = fan.TimeStepping(dt=1e-3)
    run = fan.simulate(stage, stage.rest(), inputs, method=method, save_every=4)
    assert run.status is fan.Status.DONE
    return stage, run


def test_columbine_sits_on_the_chair(visit):
    stage, run = visit
    late = run.t > 7.0
    chair = next(p for p in fan.puppets.visit().puppet.bodies if p.name == "chair")
    own = sum(shape.mass for shape in chair.shapes) * 9.81
    floor = run.contact.of("chair", "floor")
    bears = np.zeros(len(run))
    np.add.at(bears, floor.sample, floor.force[:, 2])
    hers = 0.5 * (stage.weight - own - 0.03 * 9.81)
    assert (bears[late] - own).mean() > 0.4 * hers
    bodies = {name for pair in set(run.contact.of("chair").names) for name in pair}
    assert {"columbine.thigh_left", "columbine.thigh_right"} <= bodies
    torso = stage.poses(run.q_D, run.q_K)[:, link_index(stage.model, "columbine.torso")]
    assert torso[late, 2, 3].max() < 0.26 < 0.33 < torso[0, 2, 3]
    assert np.ptp(run["chair.x"]) < 0.01


def test_pierrot_s_hand_gives_the_ball_to_her(visit):
    _, run = visit
    name = {"ball", "pierrot.forearm_right"}
    pushed = [e.t for e in run.events if e.kind == "touch" and set(e.name.split("|")) == name]
    assert pushed and 2.4 < pushed[0] < 3.2
    still = run.t < pushed[0]
    assert run["ball.x"][still] == pytest.approx(0.16, abs=1e-6)
    hers = {"ball", "columbine.forearm_left"}
    assert any(e.t > 4.0 and set(e.name.split("|")) == hers for e in run.events)
    # It comes to lie in the hollow between sill and rim, on the table.
    late = run.t > 7.0
    assert np.all((run["ball.x"][late] > 0.41) & (run["ball.x"][late] < 0.46))
    assert run["ball.z"][late] == pytest.approx(0.268, abs=2e-3)
    hand = fan.puppets.visit()
    pose = hand.poses(run.q_D, run.q_K)[:, link_index(hand.model, "columbine.forearm_left")]
    palm = pose[-1, :, 3] + pose[-1, :, :3] @ [0, 0, -0.102]
    ball = [run["ball.x"][-1], run["ball.y"][-1], run["ball.z"][-1]]
    assert np.linalg.norm(palm - ball) < 0.06
