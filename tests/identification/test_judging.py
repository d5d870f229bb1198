"""Doubts about estimates: none if only noise remains, and some if the model is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.identify.cases import arm, record
from benchmarks.identify.turned import turned_record

import fantoccini as fan
from fantoccini.lab.identification.judging import biased_jumps, column_fits, doubts, prior_shares
from fantoccini.lab.identification.unit_names import parameter_units

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def good_record():
    return record(arm(), 12.0, 3, gaps=0.1)


@pytest.mark.parametrize("seed", [3, 20, 21])
def test_noise_alone_is_not_doubted(seed):
    estimate = fan.identify(record(arm(), 12.0, seed, gaps=0.1))
    assert doubts(estimate) == ()
    assert all(
        abs(column.within_two - 0.954) < 0.03 for column in column_fits(estimate)
    )  # 4 deviations of 700


def test_a_turned_camera_is_doubted(good_record):
    """The camera is turned by 1 degree: chi2 and drift do not show it, residuals and jumps do."""
    estimate = fan.identify(turned_record(good_record, 1.0))
    assert estimate.chi2 < 1.15 and estimate.drift < 0.5
    text = " ".join(doubts(estimate))
    assert "are correlated" in text and "tip.z" in text
    assert "go mostly to one side" in text and biased_jumps(estimate)


def test_a_noise_level_that_is_wrong_is_doubted(good_record):
    low_noise = fan.identify(replace(good_record, noise={"wrist": 1e-3}))
    assert any(
        "wrist.x, wrist.y, wrist.z are more than the noise" in doubt for doubt in doubts(low_noise)
    )
    high_noise = fan.identify(replace(good_record, noise={"wrist": 5e-3}))
    assert any(
        "wrist.x, wrist.y, wrist.z are less than the noise" in doubt for doubt in doubts(high_noise)
    )
    assert [column.doubtful for column in column_fits(low_noise)] == [False] * 3 + [True] * 3 + [
        False
    ] * 3


def test_neighbours_are_samples_of_a_column(good_record):
    """The turned camera with every second row: its neighbours are two rows apart."""
    is_even = np.arange(len(good_record.t)) % 2 == 0
    data = turned_record(good_record, 1.0)
    columns = {name: np.where(is_even, x, np.nan) for name, x in data.columns.items()}
    estimate = fan.identify(replace(data, columns=columns))
    assert any("are correlated" in text for text in doubts(estimate))


def test_a_wrong_known_value_is_doubted(good_record):
    """0.13 kg is claimed to 1 g, and the true mass is 0.16 kg."""
    known = [
        replace(unknown, known=1e-3) if unknown.name == "upper_mass" else unknown
        for unknown in good_record.unknown
    ]
    estimate = fan.identify(replace(good_record, unknown=known))
    assert any(
        "upper_mass" in doubt and "the value known beforehand" in doubt
        for doubt in doubts(estimate)
    )
    assert 0.0 < prior_shares(estimate)["upper_mass"] <= 1.0


CART_YAML = """
puppet: cart
bodies:
- name: cart
  joint: {name: rail, type: prismatic, axis: [1, 0, 0], damping: {parameter: d, value: 1}}
  mass: 1
strings:
- {name: line, path: [{body: cart}, {driven: [x], at: [0, 0, 0.1]}], length: 50}
"""


def test_a_missing_acceleration_is_estimated():
    """A cart pulled by a force outside of the model, x = a t^2 / 2.

    Its residuals are partly in the jumps of the position and at the ends: 20 %.
    """
    cart = fan.loads(CART_YAML)
    t, rng = np.arange(0.2, 7.8, 1 / 60), np.random.default_rng(0)
    x = 0.5 * 0.05 * t**2 + 1e-4 * rng.standard_normal(len(t))
    known_damping = fan.lab.Unknown("d", about=1e-6, known=1e-6)
    data = fan.lab.Record(cart, fan.Input.hold(cart, 8.0), t, {"rail": x}, unknown=[known_damping])
    jump = biased_jumps(fan.identify(data))[0]
    assert jump.name == "velocity of rail" and jump.unit == "m/s²"
    assert abs(jump.acceleration - 0.05) < 0.2 * 0.05
    assert "m/s² were missing" in str(jump)


def test_units_follow_from_the_keys_of_numbers():
    def parameter(name):
        return {"parameter": name, "value": 1.0}

    data = {
        "gravity": [0, 0, parameter("g")],
        "bodies": [
            {
                "name": "a",
                "mass": parameter("m"),
                "com": [0, 0, parameter("c")],
                "inertia": [parameter("i"), 1, 1],
                "drag": {"quadratic": parameter("q")},
                "joint": {"type": "ball", "damping": parameter("turning")},
                "shapes": [{"density": parameter("rho")}],
            },
            {
                "name": "b",
                "joint": {
                    "type": "prismatic",
                    "damping": parameter("sliding"),
                    "spring": {"stiffness": parameter("k"), "rest": parameter("r")},
                },
            },
            {"name": "c", "joint": {"type": "free", "damping": parameter("both")}},
        ],
        "strings": [
            {
                "length": parameter("l"),
                "restitution": parameter("e"),
                "chain": {"stiffness": parameter("EA"), "mass": parameter("cord")},
            }
        ],
        "springs": [{"stiffness": parameter("rubber")}],
        "drives": [
            {
                "on": ["s.length"],
                "drum": 0.01,
                "friction": {"viscous": parameter("wound")},
                "control": {"stiffness": parameter("pd")},
            },
            {"on": "s.x", "friction": {"coulomb": parameter("carriage")}},
            {"on": "bar", "control": {"stiffness": parameter("turned")}},
        ],
    }
    coordinate_units = {"s.length": "m", "s.x": "m", "bar": "rad"}
    assert parameter_units(data, coordinate_units) == {
        "g": "m/s²",
        "m": "kg",
        "c": "m",
        "i": "kg m²",
        "q": "N s²/m²",
        "turning": "N m s/rad",
        "rho": "kg/m³",
        "sliding": "N s/m",
        "k": "N/m",
        "r": "m",
        "both": "N s/m or N m s/rad",
        "l": "m",
        "e": "",
        "EA": "N",
        "cord": "kg",
        "rubber": "N/m",
        "wound": "N m s/rad",
        "pd": "N/m",
        "carriage": "N",
        "turned": "N m/rad",
    }
