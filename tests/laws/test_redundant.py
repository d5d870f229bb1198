"""Redundant strings: the motion is unique, and the tensions have least norm.

A bob on strings from points of one line swings about that line. Two strings suffice; any others
share the load. The total pull follows from the bob's acceleration; the result is the shortest
vector of non-negative tensions with this pull, found by trying every set of strings.
"""

from __future__ import annotations

import itertools
import json
from functools import cache

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import Marionette, State, Trajectory

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

GRAVITY = np.array([0.0, 0.0, -9.81])
MASS = 0.7
HEIGHT = 2.0
START = np.array([0.0, 0.6, 0.8])


def bob(anchors: list[float], limits: dict[int, float] | None = None) -> Marionette:
    """A bob at START on strings that just reach, from points (x, 0, HEIGHT).

    Args:
        anchors: x of the points.
        limits: string number -> largest tension of its winch.
    """
    x = np.array(anchors)
    lengths = np.hypot(START[0] - x, np.hypot(START[1], START[2] - HEIGHT))
    named = {f"x{i}": float(at) for i, at in enumerate(x)}
    named |= {f"length{i}": float(length) for i, length in enumerate(lengths)}
    marionette = bob_on_strings(len(anchors)).with_parameters(named)
    winches = marionette.winches.copy()
    for i, tension in (limits or {}).items():
        winches[i, 0] = tension
    return marionette.with_winches(winches)


@cache
def bob_on_strings(n: int) -> Marionette:
    """A bob on n strings with points and lengths as parameters, compiled once for all bobs."""
    strings = [
        {
            "name": f"s{i}",
            "path": [
                {"world": [{"parameter": f"x{i}", "value": 0.0}, 0.0, HEIGHT]},
                {"body": "bob"},
            ],
            "length": {"parameter": f"length{i}", "value": 1.0},
        }
        for i in range(n)
    ]
    joint = {"type": "translation", "axes": ["x", "y", "z"]}
    pose = {f"bob.{axis}": float(at) for axis, at in zip("xyz", START, strict=True)}
    body = {"name": "bob", "joint": joint, "mass": MASS}
    return fan.loads(
        json.dumps({"puppet": "bob", "bodies": [body], "strings": strings, "pose": pose})
    )


def hanging_plate(places: np.ndarray, length: float = 1.0) -> Marionette:
    """A plate whose upper face is at z = 0, on vertical strings at (x, y) of the plate."""
    joint = {"type": "free"}
    plate = {"type": "box", "size": [0.8, 0.6, 0.04], "at": [0, 0, -0.02], "mass": 2.0}
    strings = [
        {
            "name": f"s{i}",
            "path": [{"world": [*place, length]}, {"body": "plate", "at": [*place, 0.0]}],
            "length": length,
        }
        for i, place in enumerate(places.tolist())
    ]
    bodies = [{"name": "plate", "joint": joint, "shapes": [plate]}]
    return fan.loads(json.dumps({"puppet": "table", "bodies": bodies, "strings": strings}))


def least_norm(U: np.ndarray, f: np.ndarray, upper: np.ndarray | None = None) -> np.ndarray:
    """The shortest x with U x = f and 0 <= x <= upper, by trying every set of columns within their
    bounds; each other entry of x is 0 or its upper bound.
    """
    upper = np.full(U.shape[1], np.inf) if upper is None else upper
    places = [(0, 1, 2) if np.isfinite(bound) else (0, 1) for bound in upper]
    best, scale = None, np.linalg.norm(f)
    for choice in itertools.product(*places):
        inside = np.array(choice) == 1
        x = np.where(np.array(choice) == 2, upper, 0.0)
        if np.any(inside):
            x[inside] = np.linalg.lstsq(U[:, inside], f - U @ x, rcond=1e-10)[0]
        allowed = np.min(x) >= -1e-9 * scale and np.max(x - upper) <= 1e-9 * scale
        fits = allowed and np.linalg.norm(U @ x - f) <= 1e-8 * scale
        if fits and (best is None or np.linalg.norm(x) < np.linalg.norm(best)):
            best = x
    return best


def directions(q: np.ndarray, anchors: list[float]) -> np.ndarray:
    """(3, n) unit vectors from the bob to the points."""
    tops = np.array([[x, 0.0, HEIGHT] for x in anchors])
    return ((tops - q) / np.linalg.norm(tops - q, axis=1)[:, None]).T


def swing(marionette: Marionette, speed: float, t_end: float) -> Trajectory:
    x0: State = marionette.state({"v:bob.y": speed * 0.8, "v:bob.z": speed * 0.4})
    return fan.simulate(marionette, marionette.project(x0), t_end=t_end, effort=False)


ANCHORS = {
    "symmetric": [-0.7, 0.0, 0.7],
    "lopsided": [-0.4, 0.3, 0.9],
    "one string best left out": [-0.2, 0.5, 1.9, 2.0],
    "five": [-1.0, -0.6, 0.1, 0.5, 1.3],
}


@pytest.mark.parametrize("anchors", ANCHORS.values(), ids=ANCHORS)
def test_a_swinging_bob_has_the_tensions_of_least_norm(anchors):
    marionette = bob(anchors)
    run = swing(marionette, 0.5, 4.0)
    assert run.events == (), "nothing is released or caught"
    worst, left_out = 0.0, 0
    for q, acc, tension in zip(run.q_D, run.acc_D, run.tension.values, strict=True):
        U, f = directions(q, anchors), MASS * (acc - GRAVITY)
        expected = least_norm(U, f)
        worst = max(worst, np.max(np.abs(tension - expected)) / np.linalg.norm(f))
        left_out += np.min(np.linalg.lstsq(U, f, rcond=1e-10)[0]) < -1e-3
    assert worst <= 1e-9, f"{worst:.2e} of the strings' force apart"
    assert (left_out > 0) == (anchors == ANCHORS["one string best left out"])
    assert np.max(run.violation.values) <= 1e-13
    # The motion is that of the pendulum on two of the strings.
    two = swing(bob([anchors[0], anchors[-1]]), 0.5, 4.0)
    apart = np.max(np.abs(run.q_D[-1] - two.q_D[-1]))
    assert apart <= 1e-7, f"{apart:.2e} m from the motion on two strings"


@pytest.mark.parametrize("n", [2, 3, 5])
def test_strings_between_the_same_points_share_the_load(n):
    run = swing(bob([0.0] * n), 0.7, 3.0)
    assert run.events == ()
    tension = run.tension.values
    worst = np.max(np.ptp(tension, axis=1) / np.max(tension, axis=1))
    assert worst <= 1e-12, f"{worst:.2e}"
    assert np.min(tension) > 0


@pytest.mark.parametrize("anchors", ANCHORS.values(), ids=ANCHORS)
def test_a_bob_at_rest_on_redundant_strings_stays(anchors):
    marionette = bob(anchors)
    x0 = marionette.rest()
    run = fan.simulate(marionette, x0, t_end=5.0, effort=False)
    assert run.events == ()
    assert np.max(np.abs(run.v_D)) <= 1e-9


TABLES = {
    "4": np.array([[0.4, 0.3], [0.4, -0.3], [-0.4, 0.3], [-0.4, -0.3]]),
    "5": np.array([[0.4, 0.3], [0.4, -0.3], [-0.4, 0.3], [-0.4, -0.3], [0.1, 0.05]]),
    "6": np.array([[0.4, 0.3], [0.4, -0.3], [-0.4, 0.3], [-0.4, -0.3], [0.0, 0.3], [0.2, -0.1]]),
}


@pytest.mark.parametrize("places", TABLES.values(), ids=TABLES)
def test_a_plate_hangs_still_on_its_strings(places):
    """Three strings suffice; all pull, with tensions of least norm that balance the weight."""
    marionette = hanging_plate(places)
    x0 = marionette.project(marionette.state())
    run = fan.simulate(marionette, x0, t_end=5.0, effort=False)
    assert run.events == ()
    assert np.max(np.abs(run.v_D)) <= 1e-9
    balance = np.vstack([np.ones(len(places)), places.T])
    expected = least_norm(balance, np.array([marionette.weight, 0.0, 0.0]))
    error = np.max(np.abs(run.tension.values - expected)) / marionette.weight
    assert error <= 1e-9, f"{error:.2e} of the weight"


@pytest.mark.parametrize("places", TABLES.values(), ids=TABLES)
def test_a_table_swings_on_its_strings_without_chatter(places):
    """Parallel strings of one length: the table moves like a bob on one of them."""
    marionette = hanging_plate(places)
    x0 = marionette.state({"v:plate.x": 0.5})
    run = fan.simulate(marionette, x0, t_end=4.0, effort=False)
    assert run.events == ()
    x, z = run.q_D[:, 0], run.q_D[:, 2]
    error = np.max(np.abs(x**2 + (z - 1.0) ** 2 - 1.0))
    assert error <= 1e-12, f"{error:.2e} m^2 off the circle"
    turned = np.max(np.abs(run.q_D[:, 4:7]))
    assert turned <= 1e-9, f"the table turned by {turned:.2e}"


@pytest.mark.parametrize(
    ("anchors", "largest_tensions"),
    [
        ([0.0, 0.0], {0: 2.0}),
        ([0.0, 0.0], {0: 3.5}),
        ([-0.7, 0.0, 0.7], {1: 2.0}),
        ([-0.4, 0.3, 0.9], {1: 3.0}),
        ([-1.0, -0.6, 0.1, 0.5, 1.3], {1: 1.2, 2: 1.5}),
    ],
)
def test_a_winch_at_its_largest_tension_leaves_the_rest_to_other_strings(anchors, largest_tensions):
    """The others hold the bob: nothing slips, and the tensions are the shortest within bounds."""
    run = swing(bob(anchors, largest_tensions), 1.5, 4.0)
    assert run.events == ()
    assert np.max(run.slip.values) == 0.0
    upper = np.array([largest_tensions.get(i, np.inf) for i in range(len(anchors))])
    worst, n_at_bound = 0.0, 0
    for q, acc, tension in zip(run.q_D, run.acc_D, run.tension.values, strict=True):
        f = MASS * (acc - GRAVITY)
        expected = least_norm(directions(q, anchors), f, upper)
        worst = max(worst, np.max(np.abs(tension - expected)) / np.linalg.norm(f))
        n_at_bound += np.any(tension >= upper)
    assert worst <= 1e-9, f"{worst:.2e} of the strings' force apart"
    assert n_at_bound >= 10, (
        f"a winch has its largest tension in {n_at_bound} of {len(run.t)} samples"
    )
