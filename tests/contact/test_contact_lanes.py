"""Batches with contact: a lane equals a single run, with any neighbours."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import Status

pytestmark = pytest.mark.slow

DT = 2e-3
LAW = 1e-10
"""Residual of the law below which a solution is accepted."""


@pytest.fixture(scope="module")
def stage() -> fan.Marionette:
    """A figure with feet on two strings, a tipping box and a bouncing ball: three groups that
    merge on contact.
    """
    return fan.loads("""
puppet: stage
floor: 0
contact:
  friction: 0.5
  pairs: [{between: [ball, floor], restitution: 0.6}]
obstacles:
- {name: wall, type: box, size: [0.1, 4, 1], at: [0.7, 0, 0.5]}
bodies:
- {name: hips, joint: {type: free}, shapes: [{type: box, size: [0.12, 0.2, 0.1], mass: 2}]}
- name: left
  parent: hips
  joint: {type: revolute, axis: [0, 1, 0], at: [0, 0.09, -0.05], limits: {lower: -1, upper: 1}}
  shapes: [{type: box, size: [0.16, 0.06, 0.2], at: [0.02, 0, -0.1], mass: 0.5}]
- name: right
  parent: hips
  joint: {type: revolute, axis: [0, 1, 0], at: [0, -0.09, -0.05], limits: {lower: -1, upper: 1}}
  shapes: [{type: box, size: [0.16, 0.06, 0.2], at: [0.02, 0, -0.1], mass: 0.5}]
- {name: crate, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.2, 0.2], mass: 1}]}
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 0.2}]}
strings:
- {name: front, path: [{body: hips, at: [0.05, 0, 0.05]}, {world: [0.05, 0, 1.3]}], length: 1.0}
- {name: rear, path: [{body: hips, at: [-0.05, 0, 0.05]}, {world: [-0.05, 0, 1.3]}], length: 1.0}
pose: {hips.z: 0.25, crate.x: 0.4, crate.z: 0.1, ball.x: -0.4, ball.z: 0.05}
""")


def states(stage: fan.Marionette, n: int, seed: int = 0) -> list[fan.State]:
    """Standing figures, some with slipping feet, the crate on the ground or falling onto a foot,
    a thrown ball, strings that snap taut.
    """
    rng, starts, x = np.random.default_rng(seed), [], stage.state()
    names = stage.coordinates.v_D
    for i in range(n):
        place = {"crate.x": 0.35 + 0.2 * rng.random(), "crate.z": 0.1 + 0.05 * (i % 3)}
        place |= {"ball.x": -0.4 + 0.1 * rng.random(), "ball.z": 0.05 + 0.02 * (i % 4)}
        v = 0.3 * rng.normal(size=len(x.v_D)) * (1.0 if i % 2 else 0.05)
        v[names.index("ball.z")] -= 1.0 * (i % 4 == 1)
        v[names.index("hips.x")] += 0.8 * (i % 3 == 2)
        starts.append(stage.state(place).replace(v_D=v))
    return starts


def stepped(stage: fan.Marionette, starts: list[fan.State], steps: int) -> fan.Trajectories:
    method = fan.TimeStepping(dt=DT)
    return fan.simulate_batch(
        stage, starts, t_end=steps * DT, method=method, save="all", save_every=1
    )


def test_lanes_keep_the_law_with_any_neighbours(stage):
    """The bits are the same in another order, with other neighbours and alone, in 60 steps."""
    starts = states(stage, 21)
    full_batch = stepped(stage, starts, 60)
    assert np.all(full_batch.status == Status.DONE)
    assert np.nanmax(full_batch.contact_residual) < LAW
    others = [
        (stepped(stage, starts[::-1], 60), slice(None, None, -1)),
        (stepped(stage, starts[6:11], 60), slice(6, 11)),
        (stepped(stage, starts[3:4], 60), slice(3, 4)),
    ]
    for other, part in others:
        for name in ("q_D", "v_D", "tension", "contact_residual"):
            a, b = getattr(full_batch, name), getattr(other, name)
            a, b = getattr(a, "values", a), getattr(b, "values", b)
            assert np.array_equal(a[part], b), name
        assert np.array_equal(full_batch.ledger.values[part], other.ledger.values)


def test_a_step_of_a_lane_is_that_of_a_single_run(stage):
    """The states have impacts, slipping feet, bounces and catches. If several points slide,
    Coulomb's law may not determine the shares of their load; in one of these cases feet slide
    lightly under two strings, or push against and slacken one of them.
    """
    method, touched, exact, several = fan.TimeStepping(dt=DT), 0, 0, 0
    run = stepped(stage, states(stage, 8, seed=1), 40)
    for k in (5, 20, 39):
        starts = [run.trajectory(i).state(k).replace(t=0.0) for i in range(8)]
        lanes = stepped(stage, starts, 1)
        for i, x in enumerate(starts):
            single = fan.simulate(stage, x, t_end=DT, method=method)
            contact = single.contact.at_sample(len(single) - 1)
            touched += len(contact) > 3
            shared = np.sum(np.linalg.norm(contact.velocity, axis=1) > 1e-5) > 1
            exact += not shared
            atol = 1e-5 if shared else 1e-8
            same = np.allclose(lanes.v_D[i, 1], single.v_D[1], atol=atol) and np.allclose(
                lanes.tension.values[i, 1], single.tension.values[1], atol=1e3 * atol
            )
            if not same:
                # Two motions, and the law holds for both.
                assert shared, (k, i)
                assert max(single.contact_residual[1], lanes.contact_residual[i, 1]) < LAW, (k, i)
                several += 1
    assert touched > 8 and exact > 5 and several <= 1


def test_a_box_that_lands_and_rocks_in_lanes_is_that_of_a_single_run():
    """Contact from corner to edge to face: the same motion, impacts and ledger in 150 steps."""
    box = fan.loads("""
puppet: box
floor: 0
contact: {friction: 1.5}
bodies:
- name: body
  joint: {type: free}
  shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]
pose: {body.z: 0.08}
""")
    rng, x, names = np.random.default_rng(3), box.state(), box.coordinates.v_D
    starts = []
    for i in range(8):
        v = np.zeros(len(names))
        v[names.index("body.z")] = -0.2 * (i % 2)
        v[3:] = 0.4 * rng.normal(size=len(names) - 3) * (i > 1)
        starts.append(x.replace(v_D=v))
    lanes = stepped(box, starts, 150)
    assert np.nanmax(lanes.contact_residual) < LAW
    for i, start in enumerate(starts):
        single = fan.simulate(box, start, t_end=150 * DT, method=fan.TimeStepping(dt=DT))
        assert np.allclose(lanes.v_D[i], single.v_D, rtol=0, atol=1e-8), i
        assert lanes.ledger.values[i] == pytest.approx(single.ledger.values, abs=1e-8), i
        assert single.ledger["impact"][-1] > 1e-3
