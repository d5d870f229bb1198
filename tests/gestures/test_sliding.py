"""Slides of feet, and how long they stand: motions in closed form."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.model import BodyMap
from fantoccini.model.body_map import Limb
from fantoccini.motion import ContactPoints
from fantoccini.theatre import Gait, footfalls
from fantoccini.theatre.gaits import PREPARATION_STEPS, Footfalls
from fantoccini.theatre.gestures import BodyParts

pytestmark = pytest.mark.own_puppets

LENGTH, WIDTH, RADIUS = 0.08, 0.05, 0.03
FEET = {
    "sole": f"{{type: box, size: [{LENGTH}, {WIDTH}, 0.02], at: [0, 0, 0.01], density: 500}}",
    "disc": f"{{type: sphere, radius: {RADIUS}, density: 500}}",
}
PUPPET = """
puppet: biped
floor: 0.0
bodies:
- {{name: trunk, joint: {{type: free}}, mass: 1.0, inertia: [0.01, 0.01, 0.01]}}
- {{name: foot_left, parent: trunk, joint: {{type: revolute, axis: [0, 1, 0], at: [0, 0.1, 0]}},
   shapes: [{foot}]}}
- {{name: foot_right, parent: trunk, joint: {{type: revolute, axis: [0, 1, 0], at: [0, -0.1, 0]}},
   shapes: [{foot}]}}
"""
GAIT = Gait(stride=0.0, step_time=0.5)
YAW_RATE, PITCH_RATE = 0.3, 3.0
"""Rates at which soles and discs turn [rad/s]."""
CYCLE = 2.0 * GAIT.step_time
T = np.arange(0.0, GAIT.duration(5) + 0.1, 5e-3)
"""Duration of a cycle, and times of the samples [s]."""
NOTHING = 1e-8
"""Slide that counts as none [m]: terms of the third order in the turn between two samples."""

Curve = np.ndarray
Points = list[Curve]
"""Places (T, 3) of points that carry load [m]."""


def left_slide(foot: str, origin: Curve, **motion: Any) -> float:
    """Slide of the left foot in its first cycle [m]; arguments as for `feet_of`."""
    return float(feet_of(foot, origin, **motion).slide[0, 0])


def feet_of(
    foot: str,
    origin: Curve,
    *,
    yaw: Curve | float = 0.0,
    pitch: Curve | float = 0.0,
    loaded: Points | None,
    gait: Gait = GAIT,
    steps: int = 2,
) -> Footfalls:
    """Feet in a motion, as `footfalls` measures them.

    Args:
        foot: shape of the feet.
        origin: (T, 3) place of the left foot [m].
        yaw, pitch: turn of the trunk to the left, and of the foot in it [rad].
        loaded: points of the left foot that carry load; None for a run without contact forces.
        gait, steps: gait of the motion, and its number of steps.
    """
    puppet = fan.loads(PUPPET.format(foot=FEET[foot]))
    limbs = [Limb("leg", side, (f"foot_{side}",), (0, 0, 0), (), 0.1) for side in ("left", "right")]
    body_parts = BodyParts(puppet, "", BodyMap(("trunk",), None, tuple(limbs), (1.0, 0.0, 0.0)))
    turn = Rotation.from_rotvec(np.outer(np.broadcast_to(yaw, T.shape), (0.0, 0.0, 1.0)))
    trunk = origin - turn.apply((0.0, 0.1, 0.0))
    columns = dict(zip(("trunk.x", "trunk.y", "trunk.z"), trunk.T, strict=True))
    quaternion = turn.as_quat().T
    columns |= dict(zip(("trunk.qx", "trunk.qy", "trunk.qz", "trunk.qw"), quaternion, strict=True))
    columns["foot_left"] = np.broadcast_to(pitch, T.shape)
    q_D = np.zeros((len(T), puppet.coordinates.n_qD))
    for name, column in columns.items():
        q_D[:, puppet.coordinates.q_D.index(name)] = column
    run = SimpleNamespace(
        t=T,
        q_D=q_D,
        q_K=np.zeros((len(T), 0)),
        status=fan.Status.DONE,
        contact=None if loaded is None else contact_points(loaded),
    )
    return footfalls(body_parts, run, gait, steps)


def contact_points(loaded: Points) -> ContactPoints:
    """Contact points of the left foot on the floor, each with a force of 1 N."""
    n = len(T) * len(loaded)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    return ContactPoints(
        sample=np.repeat(np.arange(len(T)), len(loaded)),
        pair=np.zeros(n, dtype=int),
        gap=np.zeros(n),
        point=np.stack(loaded, axis=1).reshape(n, 3) if loaded else np.zeros((0, 3)),
        normal=up,
        force=up,
        velocity=np.zeros((n, 3)),
        names=(("foot_left", "floor"), ("foot_right", "floor")),
    )


def pivoting(corner: tuple[int, int]) -> tuple[Curve, Curve, Callable[[tuple[int, int]], Curve]]:
    """A sole that turns about a corner: places of its middle, its yaw, and places of its corners.

    A corner at a distance d from the pivot moves on an arc of length d YAW_RATE t.
    """
    yaw = YAW_RATE * T
    turn = Rotation.from_rotvec(np.outer(yaw, (0.0, 0.0, 1.0)))
    pivot = corner_of(corner)

    def place(at: tuple[int, int]) -> Curve:
        return pivot + turn.apply(corner_of(at) - pivot)

    return pivot + turn.apply(-pivot), yaw, place


def corner_of(signs: tuple[int, int]) -> Curve:
    """Place of a corner, from the middle of the sole [m]."""
    return np.array([0.5 * LENGTH * signs[0], 0.5 * WIDTH * signs[1], 0.0])


CORNERS = list(product((-1, 1), repeat=2))


@pytest.mark.parametrize("corner", CORNERS)
def test_a_sole_that_turns_about_one_loaded_corner_slides_with_the_others(corner):
    middle, yaw, place = pivoting(corner)
    slide = left_slide("sole", middle, yaw=yaw, loaded=[place(at) for at in CORNERS])
    arc = np.hypot(LENGTH, WIDTH) * YAW_RATE * CYCLE
    assert slide == pytest.approx(arc, rel=0.01)  # of a sample at the ends of the cycle


def test_of_the_loaded_corners_the_one_that_slides_farthest_counts():
    middle, yaw, place = pivoting((-1, -1))
    slide = left_slide("sole", middle, yaw=yaw, loaded=[place((-1, -1)), place((-1, 1))])
    assert slide == pytest.approx(WIDTH * YAW_RATE * CYCLE, rel=0.01)


def test_corners_on_the_floor_without_load_do_not_slide():
    middle, yaw, place = pivoting((-1, -1))
    assert left_slide("sole", middle, yaw=yaw, loaded=[place((-1, -1))]) < NOTHING


@pytest.mark.parametrize("rolling", [1.0, 0.0, 0.9, -0.5])
def test_a_disc_slides_by_what_it_does_not_roll(rolling):
    """A disc that turns by an angle phi advances by `rolling` R phi."""
    phi = PITCH_RATE * T
    x = rolling * RADIUS * phi
    centre = np.stack([x, 0.0 * T, np.full_like(T, RADIUS)], axis=1)
    point = centre - [0.0, 0.0, RADIUS]
    slide = left_slide("disc", centre, pitch=phi, loaded=[point])
    wanted = abs(1.0 - rolling) * RADIUS * PITCH_RATE * CYCLE
    assert slide == pytest.approx(wanted, rel=0.01, abs=NOTHING)


def test_a_foot_that_moves_above_the_floor_without_load_does_not_slide():
    above = np.stack([0.2 * T, 0.0 * T, np.full_like(T, 1e-5)], axis=1)
    assert left_slide("sole", above, loaded=[]) == 0.0


def test_without_contact_forces_the_lowest_point_of_a_foot_slides():
    above = np.stack([0.2 * T, 0.0 * T, np.full_like(T, 1e-5)], axis=1)
    assert left_slide("sole", above, loaded=None) == pytest.approx(0.2 * CYCLE, rel=0.01)


@pytest.mark.parametrize("corner", CORNERS)
def test_without_contact_forces_a_sole_that_pivots_slides_with_its_far_corner(corner):
    """Regression: the search for gaits followed one corner, which may be the pivot."""
    middle, yaw, _ = pivoting(corner)
    arc = np.hypot(LENGTH, WIDTH) * YAW_RATE * CYCLE
    slide = left_slide("sole", middle + np.array([0.0, 0.0, 1e-5]), yaw=yaw, loaded=None)
    assert slide == pytest.approx(arc, rel=0.01)


@pytest.mark.parametrize("steps", [4, 5])
def test_a_foot_stands_for_its_duty_in_all_cycles_before_it_closes_up(steps):
    """The right foot swings from 1 on and from 3 on; after 5 steps it closes up from 4.6 on."""
    gait = dataclasses.replace(GAIT, duty=0.3)
    clock, swing = T / gait.step_time - PREPARATION_STEPS, 2.0 * (1.0 - gait.duty)
    begins = np.minimum(np.arange(1.0, steps + 1.0, 2.0), steps + 1.0 - swing)
    up = np.any([(clock >= begin) & (clock < begin + swing) for begin in begins], axis=0)
    origin = np.stack([0.0 * T, 0.0 * T, 0.01 * up], axis=1)
    stands = feet_of("sole", origin, loaded=None, gait=gait, steps=steps).stands[:, 1]
    assert np.nanmin(stands) == pytest.approx(gait.duty, abs=0.01)
    assert np.isnan(stands[-1])
