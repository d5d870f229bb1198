"""Advice of a stand's check passes the whole check."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.stand.hoist import STAND, stand

import fantoccini as fan
from fantoccini.stand import StandCheck, check_stand, remedies

SURE = {"speed: 1": "speed: 2", "acceleration: 20": "acceleration: 60"}
RATE = {"axes:": "controller: {type: grbl, step_rate: 85000}\naxes:"}
NUMBER = r"([\d.e+-]+)"
SPAN = rf"{NUMBER}(?: to {NUMBER})?"
PARTS = {
    "drum": ("type: drum, radius: 0.01", "type: drum, radius: {}", rf"drum, radius {SPAN} m"),
    "belt": (
        "type: drum, radius: 0.01",
        "type: belt, pitch: 0.002, teeth: {}",
        rf"pulley of {SPAN} teeth",
    ),
    "screw": ("type: drum, radius: 0.01", "type: screw, lead: {}", rf"lead of {SPAN} m"),
    "shaft": ("type: shaft", "type: shaft", rf"gear of {SPAN} instead"),
}
OWN = {"drum": 0.01, "belt": 31, "screw": 0.0628, "shaft": 1.0}


def stand_text(kind: str, number: float, torque: float, microsteps: int, rate: float | None) -> str:
    """The text of a stand for the hoist."""
    old, new, _ = PARTS[kind]
    text = STAND.replace("TORQUE", f"{torque}")
    for before, after in SURE.items():
        text = text.replace(before, after)
    if rate is not None:
        text = text.replace("axes:", f"controller: {{type: grbl, step_rate: {rate}}}\naxes:")
    text = text.replace("inertia: 1.0e-5}", f"inertia: 1.0e-5, microsteps: {microsteps}}}")
    if kind == "shaft":
        # For an axis that turns, lengths are 0.01 m per radian.
        text = text.replace("{type: drum, radius: 0.01}", "{type: shaft}")
        text = text.replace("line.length: 1", "line.length: 0.01").replace("[0.2, 0.9]", "[20, 90]")
        text = text.replace("speed: 2", "speed: 200")
        text = text.replace("acceleration: 60", "acceleration: 6000")
        return text.replace("    moves", f"    gear: {number}\n    moves")
    return text.replace(old, new.format(number))


def advised_values(check: StandCheck, kind: str) -> tuple[list[float], int | None]:
    """Smallest and largest advised number of the transmission, and microsteps."""
    (line,) = remedies(check)
    match = re.search(PARTS[kind][2] + r"[^;]*", line)
    if match is None:
        return [], None
    low, high = float(match[1]), float(match[2] or match[1])
    numbers = np.linspace(low, high, 7)
    numbers = sorted({round(x) for x in numbers}) if kind == "belt" else numbers.tolist()
    fewer = re.search(r"with (\d+) microsteps", match[0])
    return numbers, None if fewer is None else int(fewer[1])


@pytest.mark.parametrize("kind", PARTS)
@pytest.mark.parametrize("torque, rate", [(0.055, 85000), (0.055, 75000), (0.055, None)])
def test_every_transmission_that_is_advised_passes_the_whole_check(
    hoist, lifted, kind, torque, rate
):
    """A smaller drum has the torque, but needs a higher step rate than the controller has."""
    weak = check_stand(
        fan.stand.loads_stand(stand_text(kind, OWN[kind], torque, 16, rate)), lifted, hoist
    )
    assert weak.limits_of_axis("winch")["torque"].broken is not None
    numbers, microsteps = advised_values(weak, kind)
    assert numbers
    for number in numbers:
        text = stand_text(kind, number, torque, microsteps or 16, rate)
        better = check_stand(fan.stand.loads_stand(text), lifted, hoist)
        assert better.ok, f"{kind} {number}: {better.summary()}"
        assert better.limits_of_axis("winch")["torque"].margin > 9.99


def test_a_drum_with_too_high_a_step_rate_is_not_advised(hoist, lifted):
    """Radii from 3 mm would suffice for the torque; 8.7 mm already need too high a step rate."""
    weak = check_stand(stand("0.055", **SURE, **RATE), lifted, hoist)
    (line,) = remedies(weak)
    (low, *_, high), microsteps = advised_values(weak, "drum")
    rate = 1.5 * 200 * (microsteps or 16) / (2 * np.pi * low)
    assert rate <= 85000 and "smaller drum" in line and low < high


@pytest.mark.parametrize("microsteps", [3, 10, 16, 128])
@pytest.mark.parametrize("share", [0.97, 0.3, 0.13])
def test_advised_microsteps_exist_in_drivers(hoist, lifted, microsteps, share):
    """Powers of two, the largest that the controller allows; no advice if none suffices."""
    needs = 1.5 * 200 * microsteps / (2 * np.pi * 0.01)
    rate = share * needs
    check = check_stand(
        fan.stand.loads_stand(stand_text("drum", 0.01, 0.5, microsteps, rate)), lifted, hoist
    )
    (line,) = remedies(check)
    match = re.search(r"or (\d+) microsteps instead of (\d+)", line)
    possible = [2**k for k in range(9) if 2**k <= share * microsteps * (1 - 1e-4)]
    if not possible:
        assert match is None
        return
    assert (int(match[1]), int(match[2])) == (possible[-1], microsteps)
    text = stand_text("drum", 0.01, 0.5, int(match[1]), rate)
    assert check_stand(fan.stand.loads_stand(text), lifted, hoist).ok


def test_no_microsteps_are_advised_where_the_torque_lacks_too(hoist, lifted):
    """They would meet the step rate, but not pass the whole check."""
    weak = check_stand(
        fan.stand.loads_stand(stand_text("drum", 0.01, 0.055, 16, 60000)), lifted, hoist
    )
    assert {limit.quantity for limit in weak.broken} == {"torque", "step rate"}
    (line,) = remedies(weak)
    assert not re.search(r"or \d+ microsteps instead", line)
    assert re.search(r"smaller drum.* with \d+ microsteps instead of 16", line)


@pytest.mark.parametrize("torque", ["0.05", "[[0, 0.055], [12, 0.05], [24, 0.01]]"])
def test_numbers_of_advice_are_rounded_to_the_safe_side(hoist, lifted, torque):
    """Speed, step rate and torques of the advice suffice exactly as printed."""
    bounds = {"axes:": "controller: {type: grbl, step_rate: 76000}\naxes:"}
    weak = check_stand(stand(torque, **bounds), lifted, hoist)
    (line,) = remedies(weak)
    speed = re.search(rf"top speed of {NUMBER} m/s", line)[1]
    rate = re.search(rf"generates {NUMBER} steps/s", line)[1]
    torques = [float(x) for x in re.findall(rf"{NUMBER} N m at", line)]
    advised_keys = {
        "speed: 1": f"speed: {speed}",
        "acceleration: 20": "acceleration: 60",
        "axes:": f"controller: {{type: grbl, step_rate: {rate}}}\naxes:",
    }
    assert check_stand(stand(f"{max(torques)}", **advised_keys), lifted, hoist).ok
