"""linearise with contact: forces of event-driven runs, derivatives by differences."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import G, on_slope, thrown
from contact.files import BALL, BALLS, BOX, EGG
from fantoccini.dynamics.derivatives.contact_state import motion_with_contact
from oracles.differences import difference, moved, worst

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]


def check(puppet: fan.Marionette, x: fan.State, modes: list[str], bound: float) -> None:
    """Accelerations and forces, and all their derivatives with the modes held."""
    t = puppet.coordinates
    acc_K, u_D = np.zeros(t.n_vK), np.zeros(t.n_vD)
    lin = puppet.linearise(x)
    assert [point.mode for point in lin.contacts] == modes and lin.differentiable
    run = motion_with_contact(puppet, x, acc_K, u_D)
    forces = [point.force for point in run.contacts.points]
    assert worst(lin.acc_D, run.acc_D) < 1e-8
    assert worst(np.array([point.force for point in lin.contacts]), np.array(forces)) < 1e-8

    def at(q_D=0.0, v_D=0.0, u=0.0) -> np.ndarray:
        zeros = np.zeros(t.n_vD)
        moved_state = x.replace(
            q_D=moved(x.q_D, zeros + q_D, t.scalars_D, t.quaternions_D), v_D=x.v_D + v_D
        )
        changed = puppet.linearise(moved_state, acc_K, u_D + u, lin.rows, lin.contacts)
        return np.concatenate([changed.acc_D, *(point.force for point in changed.contacts)])

    for name in ("q_D", "v_D", "u_D"):
        derivative = np.concatenate([getattr(lin.acc, name), getattr(lin.force_partials, name)])
        key = name.removesuffix("_D") if name == "u_D" else name
        expected = difference(lambda d, key=key: at(**{key: d}), t.n_vD, 1e-4)
        assert worst(derivative, expected) < bound, name


def rolling(puppet: fan.Marionette, place: dict[str, float], w: np.ndarray, arm: np.ndarray):
    """A state that rolls about its point of contact, at `arm` from its frame."""
    v = -np.cross(w, arm)
    body = next(iter(place)).split(".")[0]
    names = ("x", "y", "z", "wx", "wy", "wz")
    speeds = dict(zip((f"{body}.{n}" for n in names), (*v, *w), strict=True))
    return thrown(puppet, place, speeds)


def test_a_ball_whose_mass_lies_off_its_frame_rolls_and_slides():
    ball = fan.loads(BALL)
    low, w, arm = {"body.z": 0.07}, np.array([3.0, 2.0, 1.0]), np.array([0.02, 0.01, -0.07])
    check(ball, rolling(ball, low, w, arm), ["stick"], 1e-8)
    slides = {"body.x": 1, "body.y": 0.2, "body.z": 0.01, "body.wx": 3, "body.wy": 2, "body.wz": 1}
    check(ball, thrown(ball, low, slides), ["slide"], 1e-9)


def test_an_egg_rolls_on_a_floor_and_on_a_dome():
    """The curvature of both surfaces changes along the path."""
    egg = fan.loads(EGG)
    arm = np.array([0.0, 0.0, -0.05])
    w = np.array([3.0, 2.0, 1.0])
    check(egg, rolling(egg, {"egg.z": -0.95}, w, arm), ["stick"], 1e-7)
    on_dome = {"egg.z": 0.35, "egg.x": 1.0}
    check(egg, rolling(egg, on_dome, np.array([0.0, 2.0, 1.0]), arm), ["stick"], 1e-8)
    slides = {"egg.x": 0.3, "egg.y": 0.1, "egg.wx": 3, "egg.wy": 2, "egg.wz": 1}
    check(egg, thrown(egg, on_dome, slides), ["slide"], 1e-8)


def test_a_rolling_ball_by_its_closed_form():
    """Its acceleration on a slope is 5/7 of gravity along it, independent of its velocity."""
    ball = on_slope(0.2, 0.5, "sphere")
    x = thrown(ball, {"body.z": 0.1}, {"body.x": 1.0, "body.wy": 10.0})
    lin = ball.linearise(x)
    assert lin.acc_D[0] == pytest.approx(5 / 7 * G * np.sin(0.2), rel=1e-10)
    # A force at its middle accelerates it by 5/7 of force/mass, a couple by 5/7 of couple/(mass
    # radius).
    assert lin.acc.u_D[0, 0] == pytest.approx(5 / 7, rel=1e-10)
    assert lin.acc.u_D[0, 4] == pytest.approx(5 / 7 / 0.1, rel=1e-10)
    assert np.max(np.abs(lin.acc.v_D[:, [0, 4]] @ [1.0, 10.0])) < 1e-9


def test_a_hanging_puppet_s_modes_are_named():
    """The bundled marionette on its soles: strings, knees and both feet constrain the motion.

    Flat soles touch with two or four corners, depending on the last bits of the pose.
    """
    puppet = fan.puppets.promenade()
    lin = puppet.linearise(puppet.rest())
    assert {point.mode for point in lin.contacts} == {"stick"} and len(lin.contacts) in (4, 8)
    assert {point.name for point in lin.contacts} == {"shin_left|floor", "shin_right|floor"}
    assert lin.differentiable and "head" in lin.rows
    assert np.max(np.abs(lin.acc_D)) < 1e-5  # to the accuracy of rest()


def test_states_without_a_derivative_are_refused():
    box = fan.loads(BOX)
    assert box.linearise(box.state({"body.z": 0.05})).differentiable
    with pytest.raises(fan.errors.StateError, match="share force among"):
        box.linearise(thrown(box, {"body.z": 0.05}, {"body.x": 1.0, "body.y": 0.5}))
    ball = fan.loads(BALL)
    with pytest.raises(fan.errors.StateError, match="strike at this state"):
        ball.linearise(thrown(ball, {"body.z": 0.07}, {"body.z": -1.0}))
    lift = np.zeros(6)
    lift[2] = 9.81
    assert ball.linearise(ball.state({"body.z": 0.07}), u_D=lift).edges == (
        "body|floor: touches without force",
    )
    balls = fan.loads(BALLS)
    floats = balls.state({"a.z": 1.0, "b.z": 2.0})
    assert balls.linearise(floats).contacts == ()


def test_a_block_that_is_pushed_begins_to_slide():
    """At rest, beyond its cone: its direction of sliding has no derivative."""
    block = fan.loads(BOX.replace("type: free", "type: translation, axes: [x, y, z]"))
    x = block.state({"body.z": 0.05})
    push = np.array([0.4 * 9.81 + 1.0, 0.0, 0.0])
    lin = block.linearise(x, u_D=push)
    assert {point.mode for point in lin.contacts} == {"slide"}
    assert lin.edges == ("body|floor: begins to slide, in a direction that has no derivative",)
    assert lin.acc_D[0] == pytest.approx(1.0, rel=1e-9)
    assert lin.acc.u_D[0, 0] == pytest.approx(1.0, rel=1e-9)
    assert lin.acc.u_D[0, 2] == pytest.approx(0.4, rel=1e-9)
