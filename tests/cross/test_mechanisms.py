"""Mechanisms with published end values: the car axis and IFToMM's A02."""

from __future__ import annotations

import json

import numpy as np
import pytest

import fantoccini as fan
from harness import polynomial_input, start
from oracles import mechanisms

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]


def load(description: dict, folder):
    path = folder / f"{description['puppet']}.yaml"
    path.write_text(json.dumps(description))
    return fan.load(path)


def test_scipy_reaches_the_published_values():
    """The oracles' own integration of both problems."""
    np.testing.assert_allclose(mechanisms.car_axis_scipy(), mechanisms.CAR_AXIS_END, atol=1e-11)
    np.testing.assert_allclose(mechanisms.a02_scipy(), mechanisms.A02_END, atol=1e-10)


def test_car_axis(tmp_path):
    """A driven support and a rod between two points, after 3 s, to 1e-8."""
    car = load(mechanisms.car_axis(), tmp_path)
    breaks = np.linspace(0.0, 3.0, 301)
    pieces = mechanisms.hermite(breaks, *mechanisms.road(breaks))
    x0 = start(car, {"road": 0.0}, mechanisms.CAR_AXIS_START)
    drive = polynomial_input(car, breaks, {"road": pieces}, x0.q_K)
    run = fan.simulate(car, x0, drive, t_end=3.0, method=fan.Event(rtol=1e-11, atol=1e-12))
    q = dict(zip(car.coordinates.q_D, run.q_D[-1], strict=True))
    angle = run.q_K[-1, 0]
    end = mechanisms.car_axis_points(angle, q["left"], q["right.x"], q["right.z"])
    np.testing.assert_allclose(end, mechanisms.CAR_AXIS_END, atol=1e-8)


def test_two_windows_of_rods(tmp_path):
    """A02 with N = 2: five rods, redundant wires, through every flat position, to 1e-8 at 10 s."""
    windows = load(mechanisms.a02(), tmp_path)
    x0 = start(windows, {}, mechanisms.A02_START)
    still = fan.Input.hold(windows)
    run = fan.simulate(windows, x0, still, t_end=10.0, method=fan.Event(rtol=1e-12, atol=1e-12))
    angle = run.q_D[-1, windows.coordinates.q_D.index("crank0")]
    np.testing.assert_allclose([np.cos(angle), np.sin(angle)], mechanisms.A02_END, atol=1e-8)
