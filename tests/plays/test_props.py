"""Props handed over, sat on, put down and picked up, in simulations with contact."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.marionette import link_index
from fantoccini.plays import props

RAISED = 0.02
"""Feet hang clear of the floor, which event-driven runs of feet just above it do not like [m]."""
RULES = {"friction": 0.6, "meets": ["floor", "obstacles", "props"]}
HUNG = {"head": 0.6225, "shoulder": 0.7658, "hand": 0.9154, "knee": 1.0609}
WIRE = {"type": "capsule", "radius": 0.004, "mass": 0.001}
METHOD = fan.TimeStepping(dt=1e-3)


def puppet(name: str, x: float, y: float, heading: float) -> dict:
    pose = {"torso.z": 0.345 + RAISED, "head.length": HUNG["head"] - RAISED}
    for side in ("left", "right"):
        for string in ("shoulder", "hand", "knee"):
            pose[f"{string}_{side}.length"] = HUNG[string] - RAISED
    return {
        "name": name, "puppet": "marionette", "at": [x, y, 0.0], "pose": pose,
        "orientation": {"axis": [0, 0, 1], "angle": heading},
    }  # fmt: skip


def seen(x: float, y: float, heading: float, forward: float, left: float) -> tuple[float, float]:
    """A place in front of a puppet, in the world [m]."""
    c, s = np.cos(heading), np.sin(heading)
    return x + c * forward - s * left, y + s * forward + c * left


def handle(height: float, low: float) -> list[dict]:
    """A bar and its two ends, down to a height [m]."""
    return [
        WIRE | {"from": [0, -0.07, height], "to": [0, 0.07, height]},
        *(WIRE | {"from": [0, y, height], "to": [0, y, low]} for y in (-0.07, 0.07)),
    ]


KINDS = {
    "ball": (0.13, [
        {"type": "sphere", "radius": 0.032, "mass": 0.02},
        *handle(0.13, 0.036),
        WIRE | {"from": [0, -0.07, 0.036], "to": [0, 0.07, 0.036]},
    ]),
    "basket": (0.145, [
        {"type": "box", "size": [0.06, 0.135, 0.045], "at": [0, 0, 0.0225], "mass": 0.02},
        *handle(0.145, 0.045),
    ]),
}  # fmt: skip
"""Prop -> height of its handle [m], and its shapes."""


def prop(kind: str, x: float, y: float, z: float, heading: float) -> dict:
    return {
        "name": kind, "at": [x, y, z], "drag": {"linear": 0.02, "angular": 1e-4},
        "orientation": {"axis": [0, 0, 1], "angle": heading}, "shapes": KINDS[kind][1],
    }  # fmt: skip


def hung(kind: str, x: float, y: float, heading: float, side: str) -> dict:
    """A prop on the forearm of a puppet that stands there."""
    forward, left, up = props.handle_place(side, raised=RAISED)
    return prop(kind, *seen(x, y, heading, forward, left), up - KINDS[kind][0], heading)


def stage(puppets: list, things: list, obstacles=(), pairs=()) -> fan.Marionette:
    free = [{"between": [one["name"], "floor"], "meet": False} for one in puppets]
    rules = RULES | {"pairs": [*free, *pairs]}
    return fan.Marionette(
        fan.Scene.model_validate({
            "scene": "props", "floor": 0, "contact": rules, "puppets": puppets, "props": things,
            "obstacles": list(obstacles),
        })
    )  # fmt: skip


def met(run, name: str) -> dict[str, tuple[float, float]]:
    """What pushes a body, and when first and last [s]."""
    found: dict[str, tuple[float, float]] = {}
    contact = run.contact
    for pair, sample, force in zip(contact.pair, contact.sample, contact.force, strict=True):
        names = contact.names[pair]
        if name in names and np.linalg.norm(force) > 1e-6:
            other = names[1 - names.index(name)]
            first = found.get(other, (float(run.t[sample]),) * 2)[0]
            found[other] = first, float(run.t[sample])
    return found


def handle_in(scene, run, kind: str, body: str) -> np.ndarray:
    """(T, 3) place of a handle's middle in the frame of a forearm [m]."""
    poses = scene.poses(run.q_D, run.q_K)
    thing, arm = (poses[:, link_index(scene.model, name)] for name in (kind, body))
    place = thing[:, :, 3] + KINDS[kind][0] * thing[:, :, 2]
    return np.einsum("tij,ti->tj", arm[:, :, :3], place - arm[:, :, 3])


def handed(kind: str, side: str, place: tuple[float, float, float]):
    """The scene, the pair of gestures and their sum."""
    forward, aside = 0.245, -0.032 if side == "right" else 0.032
    puppets = [
        puppet("pierrot", *place),
        puppet("columbine", *seen(*place, forward, aside), place[2] + np.pi),
    ]
    scene = stage(puppets, [hung(kind, *place, side)])
    pair = props.give(scene, "pierrot", "columbine", kind, side=side)
    assert (pair.forward, pair.left) == (forward, aside)
    return scene, pair


@pytest.mark.parametrize(
    ("kind", "side", "place"),
    [("ball", "right", (0.0, 0.0, 0.0)), ("basket", "left", (0.7, -0.4, 2.1))],
)
def test_a_prop_is_handed_over(kind, side, place):
    scene, pair = handed(kind, side, place)
    x0, both = scene.rest(), pair.giver + pair.receiver
    run = fan.simulate(scene, x0, both.inputs(x0), t_end=14.0, method=METHOD, save_every=10)
    assert run.status is fan.Status.DONE
    other = {"left": "right", "right": "left"}[side]
    his, hers = f"pierrot.forearm_{side}", f"columbine.forearm_{other}"
    touched = met(run, kind)
    assert set(touched) == {his, hers} == {arm for arm, _ in pair.touching}
    assert touched[his][0] == 0.0 and touched[his][1] < 9.0
    assert touched[hers][0] > 1.4 and touched[hers][1] == run.t[-1]
    where = handle_in(scene, run, kind, hers)
    assert 0.03 < -where[-1, 2] < 0.11
    assert np.abs(where[-1, 1]) < 0.06
    assert np.ptp(where[run.t > 12.0], axis=0).max() < 0.02


@pytest.mark.slow
def test_a_ball_is_handed_over_event_driven():
    """In a tenth of the motion's time."""
    scene, pair = handed("ball", "right", (0.0, 0.0, 0.0))
    x0, both = scene.rest(), pair.giver + pair.receiver
    run = fan.simulate(scene, x0, both.inputs(x0), t_end=13.0)
    assert run.status is fan.Status.DONE
    assert set(met(run, "ball")) == {"pierrot.forearm_right", "columbine.forearm_left"}
    assert met(run, "ball")["pierrot.forearm_right"][1] < 9.0
    assert np.abs(run.ledger["residual"]).max() < 1e-9
    assert 0.03 < -handle_in(scene, run, "ball", "columbine.forearm_left")[-1, 2] < 0.11


SEAT = 0.14
CHAIR = [
    {"type": "box", "size": [0.16, 0.18, 0.016], "at": [0, 0, SEAT - 0.008], "mass": 0.3},
    {"type": "box", "size": [0.16, 0.016, 0.124], "at": [0, 0.08, 0.062], "mass": 0.2},
    {"type": "box", "size": [0.16, 0.016, 0.124], "at": [0, -0.08, 0.062], "mass": 0.2},
    {"type": "box", "size": [0.016, 0.18, 0.18], "at": [-0.072, 0, 0.23], "mass": 0.2},
]


def test_a_seat_bears_who_sits_and_lets_her_stand_up():
    place = (0.3, 0.2, -1.2)
    x, y = seen(*place, -0.135, 0.0)
    chair = {
        "name": "chair", "at": [x, y, 0], "shapes": CHAIR,
        "orientation": {"axis": [0, 0, 1], "angle": place[2]},
    }  # fmt: skip
    scene = stage([puppet("columbine", *place)], [chair])
    x0 = scene.rest()
    sitting = props.sit(scene, "", "chair", SEAT)
    down, up = sitting.down, sitting.up
    run = fan.simulate(
        scene, x0, down.then(down.rest(scene, 2.0, everything=False), up).inputs(x0), t_end=11.0,
        method=METHOD, save_every=10,
    )  # fmt: skip
    assert run.status is fan.Status.DONE
    floor = run.contact.of("chair", "floor")
    bears = np.zeros(len(run))
    np.add.at(bears, floor.sample, np.abs(floor.force[:, 2]))
    own = 0.9 * 9.81
    hers = (bears - own) / (scene.weight - own)
    sits, stands = (run.t > 3.5) & (run.t < 4.9), run.t > 9.0
    assert hers[sits].min() > 0.3 and hers[sits].max() < 0.5
    assert np.abs(hers[stands]).max() < 1e-3
    assert set(met(run, "chair")) - {"floor"} <= {body for body, _ in sitting.touching}
    torso = scene.poses(run.q_D, run.q_K)[:, link_index(scene.model, "torso"), :, 3]
    assert np.linalg.norm(torso[-1] - torso[0]) < 0.02
    assert np.ptp(run["chair.x"]) < 5e-3


def test_a_basket_is_put_down_and_picked_up():
    side, place, top = "left", (0.3, 0.2, -1.2), 0.16
    x, y = seen(*place, 0.17, 0.07)
    table = {
        "name": "table", "type": "box", "size": [0.1, 0.2, top], "at": [x, y, top / 2],
        "orientation": {"axis": [0, 0, 1], "angle": place[2]},
    }  # fmt: skip
    scene = stage(
        [puppet("columbine", *place)], [hung("basket", *place, side)], [table],
        [{"between": ["table", "columbine"], "meet": False}],
    )  # fmt: skip
    x0 = scene.rest()
    putting = props.put_down(scene, "", "basket", top, side=side)
    drop = scene.pose(x0, "basket")[2, 3] - top
    back = props.pick_up(scene, "", "basket", drop, side=side)
    still = fan.Gesture.rest(scene, 2.0, everything=False)
    whole = putting.gesture.then(still, back.gesture)
    run = fan.simulate(scene, x0, whole.inputs(x0), t_end=20.0, method=METHOD, save_every=10)
    assert run.status is fan.Status.DONE
    touched = met(run, "basket")
    where = np.stack([run[f"basket.{axis}"] for axis in "xyz"], axis=1)
    c, s = np.cos(place[2]), np.sin(place[2])
    own = (where[:, :2] - place[:2]) @ np.array([[c, -s], [s, c]])
    stood = (run.t > 7.4) & (run.t < 9.0)
    assert np.ptp(where[stood], axis=0).max() < 1e-3
    assert where[stood, 2].mean() == pytest.approx(top, abs=2e-3)
    assert own[stood].mean(axis=0) == pytest.approx([putting.forward, putting.left], abs=0.01)
    assert set(touched) == {"table", f"forearm_{side}"}
    arm = handle_in(scene, run, "basket", f"forearm_{side}")[-1]
    assert 0.03 < -arm[2] < 0.1
