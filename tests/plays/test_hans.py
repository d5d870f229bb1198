"""The bundled puppet of other proportions and names sits down, and stands up again."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.dynamics.clearance import StringDistances
from fantoccini.model import scene as scenes
from fantoccini.model.puppet import bundled
from fantoccini.theatre import cast
from fantoccini.theatre.cast import ContactBodies, sitting_pairs
from fantoccini.theatre.cast.contacts import contact_rules
from fantoccini.theatre.gestures import BodyParts, Ends, Step, step_gesture
from fantoccini.theatre.plays.sitting import sit

pytestmark = pytest.mark.slow

CHAIR = YAML(typ="safe").load(files(cast).joinpath("prop_files", "chair.yaml").read_text())
LIFT = 0.025
"""Length wound in at the start, as in plays [m]."""
BACK = 0.135 * 0.25824 / 0.26417
"""Distance of the seat behind a puppet with the legs of hans [m]."""


def on_a_chair() -> fan.Marionette:
    """Hans in front of a chair."""
    hans = fan.puppets.hans()
    pose, start = {}, hans.state()
    for name in (*hans.coordinates.q_D, *hans.coordinates.q_K):
        if name.endswith((".length", ".z")):
            pose[name] = float(start[name]) + (LIFT if name.endswith(".z") else -LIFT)
    pairs = sitting_pairs(ContactBodies.of("hans", hans.body_map), "chair")
    pairs |= {frozenset(("chair", "floor"))}
    scene = fan.Scene(
        scene="seat",
        floor=0.0,
        puppets=[{"name": "hans", "puppet": scenes.load(bundled("hans")), "pose": pose}],
        props=[{"name": "chair", "at": [-BACK, 0, 0], "shapes": CHAIR["shapes"]}],
        contact=contact_rules(pairs, lambda name: name.removeprefix("hans.")),
    )
    return fan.Marionette(scene)


def test_hans_sits_upright_and_his_head_stays_before_the_string_of_his_pelvis():
    stage = on_a_chair()
    x0 = stage.rest()
    sitting = sit(stage, "", "chair", CHAIR["seat"], start=x0)
    assert sitting.back == pytest.approx(BACK, abs=1e-6)
    motion = sitting.down.then(sitting.down.rest(stage, 1.5, everything=False), sitting.up)
    method = fan.TimeStepping(dt=1e-3)
    run = fan.simulate(
        stage, x0, motion.inputs(x0), t_end=motion.duration + 1.0, method=method, save_every=10
    )
    assert run.status is fan.Status.DONE
    poses = stage.poses(run.q_D, run.q_K)

    def points_along(name: str) -> np.ndarray:
        """(T, 60, 3) points along a string [m]."""
        row = next(row for row in stage.tree.strings if row.name == name)
        first, last = (
            poses[:, point.link, :, :3] @ np.array([float(x) for x in point.at])
            + poses[:, point.link, :, 3]
            for point in (row.points[0], row.points[-1])
        )
        return first[:, None] + np.linspace(0.0, 1.0, 60)[:, None] * (last - first)[:, None]

    crown, seat = points_along("crown"), points_along("seat")
    gaps = np.linalg.norm(crown[:, :, None] - seat[:, None], axis=3)
    assert gaps.min() > 0.015
    k = int(np.searchsorted(run.t, 5.0))
    for body in ("chest", "pelvis"):
        assert poses[k, stage.link_index(body)][2, 2] > np.cos(np.radians(35.0))
    floor = run.contact.involving("chair", "floor")
    chair_force = np.zeros(len(run))
    np.add.at(chair_force, floor.sample, np.abs(floor.force[:, 2]))
    mass = sum(shape["mass"] for shape in CHAIR["shapes"])
    weight_share = (chair_force - mass * 9.81) / (stage.weight - mass * 9.81)
    is_seated, is_standing = (run.t > 4.5) & (run.t < 5.4), run.t > motion.duration
    assert weight_share[is_seated].min() > 0.2
    assert abs(weight_share[is_standing].mean()) < 0.05


def test_hans_steps_away_from_a_chair_and_his_legs_do_not_swing_out():
    stage = on_a_chair()
    x0 = stage.rest()
    sits = sit(stage, "", "chair", CHAIR["seat"], start=x0)
    away = step_gesture(Ends(BodyParts.for_puppet(stage), x0), [Step(0.048)] * 6, 1.0)
    rises = sits.down.then(sits.down.rest(stage, 1.5, everything=False), sits.up)
    motion = rises.then(sits.up.rest(stage, 0.3, everything=False), away)
    run = fan.simulate(
        stage,
        x0,
        motion.inputs(x0),
        t_end=motion.duration + 1.0,
        method=fan.TimeStepping(dt=1e-3),
        save_every=10,
    )
    assert run.status is fan.Status.DONE
    walks = run.t > rises.duration
    q_D, q_K, t = run.q_D[walks], run.q_K[walks], run.t[walks]
    strings = StringDistances(stage).motion(q_D, q_K, t)
    assert not strings.crossings()
    # Knees lifted by 6 cm turn the pelvis by 39 degrees; strings of leg and shoulder then come
    # within 5.2 mm.
    assert min(near.distance for near in strings.nearest().strings) > 0.018
    poses = stage.poses(q_D, q_K)
    pelvis = poses[:, stage.link_index("pelvis"), :2, 0]
    assert np.abs(np.arctan2(pelvis[:, 1], pelvis[:, 0])).max() < np.radians(30.0)
