"""Axes and driven coordinates: a linear map, virtual work, and motions impossible for a stand."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import FileError
from fantoccini.stand import AxisMap, loads_stand

MOTOR = """
    motor: {type: servo, torque: 5, inertia: 1.0e-5}
    transmission: {type: drum, radius: 0.02}
    travel: [-5, 5]
    speed: 5
    acceleration: 50
"""
CRANE = f"""
stand: crane
axes:
  carriage:{MOTOR}    moves: {{trolley: 1, hoist.length: -1}}
  winch:{MOTOR}    moves: {{hoist.length: 1}}
zero: {{hoist.length: 0.5}}
"""


@pytest.fixture(scope="module")
def hoisted(crane):
    inputs = fan.Input.waypoints(
        crane, {"hoist.length": [(0, 2.5), (1, 2.0), (2, 2.2)], "trolley": [(0.3, 0), (1.5, 0.4)]}
    )
    return fan.simulate(crane, crane.rest({"hoist.length": 2.5}), inputs, t_end=2.5)


def test_a_carriage_that_takes_string(crane, hoisted):
    """The closed form is trolley = p_c, length = 0.5 - p_c + p_w."""
    axis_map = AxisMap.from_stand(loads_stand(CRANE), crane.coordinates)
    motion = axis_map.motion_of(hoisted)
    trolley, length = (
        hoisted.q_K[:, hoisted.coordinates.q_K.index(n)] for n in ("trolley", "hoist.length")
    )
    assert np.allclose(motion.series_of_axis("carriage")[0], trolley, atol=1e-14)
    assert np.allclose(motion.series_of_axis("winch")[0], length - 0.5 + trolley, atol=1e-14)
    rates = np.gradient(motion.position, motion.t, axis=0)
    assert np.allclose(rates[5:-5], motion.velocity[5:-5], atol=0.05)


def test_the_power_of_axes_is_that_of_coordinates(crane, hoisted):
    """Virtual work: F . pdot = f_K . v_K, for any map."""
    axis_map = AxisMap.from_stand(loads_stand(CRANE), crane.coordinates)
    motion, effort = axis_map.motion_of(hoisted), hoisted.effort.values
    by_axes = np.sum(axis_map.forces(effort) * motion.velocity, axis=1)
    by_coordinates = np.sum(effort * hoisted.v_K, axis=1)
    assert np.allclose(by_axes, by_coordinates, atol=1e-9 * np.max(np.abs(by_coordinates)))
    assert np.max(np.abs(by_axes)) > 1.0


def test_coordinates_without_an_axis_must_be_constant(crane, hoisted):
    without_winch = CRANE.replace("moves: {trolley: 1, hoist.length: -1}", "moves: {trolley: 1}")
    without_winch = without_winch[: without_winch.index("  winch")]
    axis_map = AxisMap.from_stand(loads_stand(without_winch), crane.coordinates)
    assert axis_map.held == ("hoist.length",)
    with pytest.raises(FileError, match=r":3: axes: no axis moves hoist\.length.* by up to 0\.5"):
        axis_map.motion_of(hoisted)


def test_coordinates_that_one_axis_moves_must_go_together(crane):
    text = CRANE.replace("{trolley: 1, hoist.length: -1}", "{trolley: 2, hoist.length: 1}")
    text = text[: text.index("  winch")] + "zero: {hoist.length: 2.5}\n"
    axis_map = AxisMap.from_stand(loads_stand(text), crane.coordinates)
    start = crane.rest({"hoist.length": 2.5})
    times = np.linspace(0, 2, 50)
    along = {"hoist.length": [(0, 2.5), (1, 2.0)], "trolley": [(0, 0), (1, -1.0)]}
    inputs = fan.Input.waypoints(crane, along).bound(start.q_K)
    assert np.allclose(axis_map.motion_of(inputs, times).position[-1], -0.5)
    independent = fan.Input.waypoints(crane, along | {"trolley": [(0, 0), (1, -0.8)]}).bound(
        start.q_K
    )
    with pytest.raises(FileError, match=r"cannot move .* independently of their other coordinates"):
        axis_map.motion_of(independent, times)
