"""Props handed over, sat on, put down and picked up, in simulations with contact."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.marionette import link_index
from fantoccini.plays import props

RAISED = 0.02
"""Feet hang clear of the floor, which event-driven runs of feet just above it do not like [m]."""
RULES = {"friction": 0.9, "meets": ["floor", "obstacles", "props"]}
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


PLACES = [(0.0, 0.0, 0.0), (0.7, -0.4, 2.1)]


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


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_prop_is_handed_over(kind, side, place):
    scene, pair = handed(kind, side, place)
    x0, both = scene.rest(), pair.giver + pair.receiver
    run = fan.simulate(
        scene, x0, both.inputs(x0), t_end=14.0, method=METHOD, save_every=10
    )
    assert run.status is fan.Status.DONE
    other = {"left": "right", "right": "left"}[side]
    his, hers = f"pierrot.forearm_{side}", f"columbine.forearm_{other}"
    touched = met(run, kind)
    print(kind, side, place, touched)
    assert set(touched) == {his, hers} == {arm for arm, _ in pair.touching}
    assert touched[his][0] == 0.0 and touched[his][1] < 9.0
    assert touched[hers][0] > 1.4 and touched[hers][1] == run.t[-1]
    where = handle_in(scene, run, kind, hers)
    print(where[[0, 600, 700, -1]].round(3), run[f"{kind}.z"].min())
    assert 0.03 < -where[-1, 2] < 0.11
    assert np.abs(where[-1, 1]) < 0.06
    assert np.ptp(where[run.t > 12.0], axis=0).max() < 0.02
