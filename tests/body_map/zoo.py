"""Puppets of other shapes, names, sizes and directions than the bundled ones."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from fantoccini import puppets
from fantoccini.model.puppet import Puppet, load, loads, plain

GERMAN = {
    "torso": "rumpf",
    "skull": "kopf",
    "upper_arm": "oberarm",
    "forearm": "unterarm",
    "thigh": "oberschenkel",
    "shin": "unterschenkel",
    "shoulder_joint": "achsel",
    "knee_joint": "kniegelenk",
    "elbow": "ellbogen",
    "hip": "huefte",
    "neck": "hals",
    "head": "kopffaden",
    "shoulder": "tragfaden",
    "hand": "armfaden",
    "knee": "beinfaden",
    "left": "links",
    "right": "rechts",
}
"""Word in the names of the bundled marionette -> the word in German, longer words first."""
LENGTHS = ("at", "from", "to", "radius", "radii", "size", "world", "com")


def hans(scale: float = 1.7) -> Puppet:
    """The bundled marionette with German names, without a mirror, and larger."""
    puppet = load(puppets.path("marionette"))
    text = json.dumps(plain(puppet.expanded()))
    for word, other in GERMAN.items():
        text = text.replace(word, other)
    data = _scaled(json.loads(text), scale)
    data["puppet"] = "hans"
    for name, value in data["pose"].items():
        if name.endswith((".length", ".z")):
            data["pose"][name] = scale * value
    return loads(json.dumps(data))


def waisted() -> Puppet:
    """A marionette with a waist: the pelvis carries chest and legs."""
    bodies = [
        body("pelvis", "world", [0, 0, 0], box([0.06, 0.09, 0.05]), joint={"type": "free"}),
        body("chest", "pelvis", [0, 0, 0.04], box([0.06, 0.1, 0.1], [0, 0, 0.06]), joint=ball()),
        body("pate", "chest", [0, 0, 0.13], box([0.07, 0.06, 0.09], [0.01, 0, 0.06]), joint=ball()),
    ]
    for side, y in (("l", 1.0), ("r", -1.0)):
        bodies += [
            body(f"ua_{side}", "chest", [0, 0.07 * y, 0.1], rod([0, 0, -0.09]), joint=ball()),
            body(
                f"fa_{side}",
                f"ua_{side}",
                [0, 0, -0.1],
                rod([0, 0, -0.1]),
                joint=hinge([0, -1, 0], 2),
            ),
            body(f"ul_{side}", "pelvis", [0, 0.03 * y, -0.03], rod([0, 0, -0.11]), joint=ball()),
            body(
                f"ll_{side}",
                f"ul_{side}",
                [0, 0, -0.12],
                [*rod([0, 0, -0.11]), *box([0.07, 0.03, 0.02], [0.015, 0, -0.12])],
                joint=hinge([0, 1, 0], 2),
            ),
        ]
    strings = [
        string("top", "pate", [0, 0, 0.1], slack=0.005),
        string("s_l", "chest", [0, 0.05, 0.1]),
        string("s_r", "chest", [0, -0.05, 0.1]),
        string("h_l", "fa_l", [0, 0, -0.1], [0.15, 0.07, 0]),
        string("h_r", "fa_r", [0, 0, -0.1], [0.15, -0.07, 0]),
        string("k_l", "ul_l", [0.01, 0, -0.11], [0.1, 0, 0]),
        string("k_r", "ul_r", [0.01, 0, -0.11], [0.1, 0, 0]),
    ]
    return puppet("waisted", bodies, strings, {"pelvis": 0.27})


def dachshund() -> Puppet:
    """A dachshund on nine strings that looks along +y; names say nothing of sides."""
    bodies = [
        body("sausage", "world", [0, 0, 0], box([0.07, 0.3, 0.07]), joint={"type": "free"}),
        body("nape", "sausage", [0, 0.15, 0.03], rod([0, 0.03, 0.04]), joint=ball()),
        body(
            "face", "nape", [0, 0.04, 0.05], box([0.05, 0.1, 0.05], [0, 0.03, 0.01]), joint=ball()
        ),
        body("wag", "sausage", [0, -0.15, 0.02], rod([0, -0.1, 0.03]), joint=ball()),
    ]
    strings = [
        string("a", "face", [0, 0.02, 0.035]),
        string("b", "sausage", [0.02, 0.12, 0.035]),
        string("c", "sausage", [-0.02, 0.12, 0.035]),
        string("d", "sausage", [0, -0.12, 0.035]),
        string("i", "wag", [0, -0.09, 0.027]),
    ]
    for k, (x, y) in enumerate(((1, 1), (-1, 1), (1, -1), (-1, -1))):
        at = [0.035 * x, 0.11 * y, -0.03]
        bodies.append(body(f"paw{k}", "sausage", at, rod([0, 0, -0.06], 0.012), joint=ball()))
        strings.append(string("efgh"[k], f"paw{k}", [0, 0.01, -0.055], [0, 0.02, 0]))
    return puppet("dachshund", bodies, strings, {"sausage": 0.12})


def heron() -> Puppet:
    """A bird that looks along -x: a neck of two bodies, wings, two legs and a tail."""
    bodies = [
        body("hull", "world", [0, 0, 0], box([0.2, 0.08, 0.08]), joint={"type": "free"}),
        body("neck1", "hull", [-0.09, 0, 0.03], rod([-0.03, 0, 0.09], 0.008), joint=ball()),
        body("neck2", "neck1", [-0.03, 0, 0.1], rod([0, 0, 0.09], 0.008), joint=ball()),
        body(
            "crest", "neck2", [0, 0, 0.1], box([0.06, 0.035, 0.035], [-0.01, 0, 0.02]), joint=ball()
        ),
        body(
            "beak",
            "crest",
            [-0.04, 0, 0.02],
            box([0.07, 0.01, 0.01], [-0.035, 0, 0]),
            joint=hinge([0, 1, 0], 1),
        ),
        body("fan", "hull", [0.1, 0, 0.02], box([0.08, 0.06, 0.006], [0.04, 0, 0]), joint=ball()),
    ]
    strings = [
        string("front", "hull", [-0.06, 0, 0.04]),
        string("back_l", "hull", [0.06, 0.03, 0.04]),
        string("back_r", "hull", [0.06, -0.03, 0.04]),
        string("beakstring", "crest", [0, 0, 0.04]),
        string("tailstring", "fan", [0.07, 0, 0]),
    ]
    for side, y in (("l", 1.0), ("r", -1.0)):
        bodies += [
            body(
                f"inner_{side}",
                "hull",
                [0, 0.04 * y, 0.03],
                box([0.1, 0.12, 0.006], [0, 0.06 * y, 0]),
                joint=ball(),
            ),
            body(
                f"outer_{side}",
                f"inner_{side}",
                [0, 0.12 * y, 0],
                box([0.08, 0.14, 0.006], [0, 0.07 * y, 0]),
                joint=hinge([y, 0, 0], 1),
            ),
            body(
                f"up_{side}",
                "hull",
                [0.01, 0.025 * y, -0.03],
                rod([0, 0, -0.1], 0.006),
                joint=ball(),
            ),
            body(
                f"down_{side}",
                f"up_{side}",
                [0, 0, -0.11],
                [*rod([0, 0, -0.12], 0.006), *box([0.06, 0.03, 0.01], [-0.015, 0, -0.125])],
                joint=hinge([0, 1, 0], 2),
            ),
        ]
        strings += [
            string(f"tip_{side}", f"outer_{side}", [0, 0.12 * y, 0]),
            string(f"leg_{side}", f"up_{side}", [0, 0, -0.1]),
        ]
    return puppet("heron", bodies, strings, {"hull": 0.28})


def spider() -> Puppet:
    """A body on six legs of two bodies each, with an abdomen at its rear, towards -x."""
    bodies = [
        body("core", "world", [0, 0, 0], box([0.16, 0.09, 0.06]), joint={"type": "free"}),
        body("abdomen", "core", [-0.08, 0, 0], box([0.12, 0.1, 0.08], [-0.06, 0, 0]), joint=ball()),
    ]
    strings = [
        string("c1", "core", [0.05, 0.03, 0.03]),
        string("c2", "core", [0.05, -0.03, 0.03]),
        string("c3", "core", [-0.06, 0, 0.03]),
        string("rear", "abdomen", [-0.07, 0, 0.04]),
    ]
    for k, x in enumerate((0.06, 0.0, -0.06)):
        for side, y in (("p", 1.0), ("q", -1.0)):
            bodies += [
                body(
                    f"femur{k}{side}",
                    "core",
                    [x, 0.045 * y, 0],
                    rod([0, 0.06 * y, 0.03], 0.006),
                    joint=ball(),
                ),
                body(
                    f"tibia{k}{side}",
                    f"femur{k}{side}",
                    [0, 0.07 * y, 0.03],
                    rod([0, 0.03 * y, -0.14], 0.006),
                    joint=hinge([1, 0, 0], 1),
                ),
            ]
            strings.append(string(f"l{k}{side}", f"tibia{k}{side}", [0, 0, 0]))
    return puppet("spider", bodies, strings, {"core": 0.12})


def puppet(
    name: str, bodies: list[dict[str, Any]], strings: list[dict[str, Any]], start: dict[str, float]
) -> Puppet:
    """A puppet on strings that are just taut and 1 m high, above the points where they are tied."""
    pose = {f"{root}.z": z for root, z in start.items()}
    places = {"world": np.zeros(3)}
    for each in bodies:
        at = np.array(each["joint"].get("at", [0, 0, 0]), dtype=float)
        places[each["name"]] = places[each["parent"]] + at
        places[each["name"]] += [0, 0, start.get(each["name"], 0.0)]
    for each in strings:
        first, last = each["path"]
        tied = places[first["body"]] + first["at"]
        last["at"] = [*(tied[:2] + last["at"][:2]).tolist(), 1.0]
        if slack := each.pop("slack"):
            pose[f"{each['name']}.length"] = float(np.linalg.norm(last["at"] - tied)) + slack
    data = {"puppet": name, "bodies": bodies, "strings": strings, "pose": pose, "floor": 0.0}
    return loads(json.dumps(data))


def body(
    name: str, parent: str, at: list[float], shapes: list[dict[str, Any]], joint: dict[str, Any]
) -> dict[str, Any]:
    """A body on a joint at a place of its parent."""
    if joint["type"] != "free":
        joint = joint | {"name": f"j_{name}", "at": at}
    return {"name": name, "parent": parent, "joint": joint, "shapes": shapes}


def ball() -> dict[str, Any]:
    """A damped ball joint that springs back weakly."""
    return {"type": "ball", "damping": 1e-3, "spring": {"stiffness": 0.02}}


def hinge(axis: list[float], bend: float) -> dict[str, Any]:
    """A damped hinge that bends one way, by up to ``bend`` [rad]."""
    limits = {"lower": -0.02, "upper": bend}
    return {"type": "revolute", "axis": axis, "damping": 1e-3, "limits": limits}


def box(size: list[float], at: list[float] | None = None) -> list[dict[str, Any]]:
    """A box of wood."""
    return [{"type": "box", "size": size, "at": at or [0, 0, 0], "density": 450}]


def rod(to: list[float], radius: float = 0.012) -> list[dict[str, Any]]:
    """A capsule of wood from the joint to a point."""
    return [{"type": "capsule", "from": [0, 0, 0], "to": to, "radius": radius, "density": 450}]


def string(
    name: str, tied_to: str, at: list[float], ahead: list[float] | None = None, slack: float = 0.0
) -> dict[str, Any]:
    """A string whose upper end is moved; ``ahead`` is the place of that end relative to the tie."""
    ends = [{"body": tied_to, "at": at}, {"driven": ["x", "y"], "at": ahead or [0, 0, 0]}]
    return {"name": name, "path": ends, "length": "driven", "slack": slack}


def _scaled(data: Any, scale: float) -> Any:
    """Plain data with all lengths of bodies and strings multiplied."""
    if isinstance(data, dict):
        return {k: _times(v, scale) if k in LENGTHS else _scaled(v, scale) for k, v in data.items()}
    return [_scaled(v, scale) for v in data] if isinstance(data, list) else data


def _times(value: Any, scale: float) -> Any:
    return [scale * x for x in value] if isinstance(value, list) else scale * value
