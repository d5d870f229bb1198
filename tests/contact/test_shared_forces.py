"""Points with undetermined shares of a load have forces of least norm."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import G, on_slope, stepped

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

DT = 1e-3


def test_a_box_on_four_corners_has_four_equal_forces():
    """At rest on a floor, and sliding: undetermined forces are shared."""
    block = on_slope(0.0, 0.5)
    x0 = block.state({"body.z": 0.05, "body.rotation": (0.9, 0.0, 0.0, 0.4359)})
    run = stepped(block, x0, 0.2, DT)
    for k in (1, 50, 200):
        corners = run.contact.at_sample(k)
        assert len(corners) == 4
        assert np.allclose(corners.force, [0.0, 0.0, G / 4], atol=1e-6)
    slope = on_slope(0.3, 0.6)
    corners = stepped(slope, slope.state({"body.z": 0.05}), 0.2, DT).contact.at_sample(150)
    force = np.array([-G * np.sin(0.3), 0.0, G * np.cos(0.3)])
    assert np.allclose(corners.force.sum(axis=0), force, atol=1e-6)
    # The moment of friction about the middle is balanced by the difference of front and rear.
    front = corners.point[:, 0] > 0
    shift = G * np.sin(0.3) * 0.05 / 0.2
    assert np.allclose(corners.normal_force[front], force[2] / 4 + shift / 2, atol=1e-6)
    assert np.allclose(corners.normal_force[~front], force[2] / 4 - shift / 2, atol=1e-6)
    assert np.allclose(np.ptp(corners.force[:, :2], axis=0), 0.0, atol=1e-6)


def test_a_table_shares_its_load_among_its_legs_and_a_plank_among_its_trestles():
    legs = "".join(
        f"  - {{type: sphere, radius: 0.03, at: [{x}, {y}, -0.2], mass: 0.1}}\n"
        for x in (-0.3, 0.3)
        for y in (-0.2, 0.2)
    )
    table = fan.loads(f"""
puppet: table
floor: 0
contact: true
obstacles:
- {{name: left, type: box, size: [0.1, 0.3, 0.2], at: [1.6, 0, 0.1]}}
- {{name: right, type: box, size: [0.1, 0.3, 0.2], at: [2.4, 0, 0.1]}}
bodies:
- name: table
  joint: {{type: free}}
  shapes:
  - {{type: box, size: [0.8, 0.6, 0.04], mass: 3}}
{legs}- name: plank
  joint: {{type: free}}
  shapes: [{{type: box, size: [1.2, 0.2, 0.04], mass: 2}}]
pose: {{table.z: 0.23, plank.x: 2.0, plank.z: 0.22}}
""")
    run = stepped(table, table.state(), 0.2, DT)
    for k in (2, 200):
        feet = run.contact.involving("table", "floor").at_sample(k)
        assert len(feet) == 4
        assert np.allclose(feet.force, [0.0, 0.0, 3.4 * G / 4], atol=1e-5)
        for trestle in ("left", "right"):
            points = run.contact.involving("plank", trestle).at_sample(k)
            assert np.allclose(points.force.sum(axis=0), [0.0, 0.0, G], atol=1e-5)
            assert np.allclose(points.normal_force, G / len(points), atol=1e-5)
