"""Small puppets of every kind for the property tests.

A puppet is a description with the keys of a puppet file; `ALL` lists them by name. To add one,
write its description and put it into `ALL`: inputs and start states are generated for all of its
coordinates.
"""

from __future__ import annotations

import functools
import json

import numpy as np

import fantoccini as fan
from oracles import random_trees

_PLANE = {"type": "translation", "axes": ["x", "z"]}
_SPACE = {"type": "translation", "axes": ["x", "y", "z"]}


def _string(
    name: str, first_point: dict, last_point: dict, length="driven", *middle_points: dict, **options
) -> dict:
    return {
        "name": name,
        "path": [first_point, *middle_points, last_point],
        "length": length,
        **options,
    }


def _body_point(body: str, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict:
    return {"body": body, "at": [x, y, z]}


def _driven_point(axes: str, x: float, y: float, z: float) -> dict:
    return {"driven": list(axes), "at": [x, y, z]}


def _world_point(x: float, y: float, z: float) -> dict:
    return {"world": [x, y, z]}


def _link(name: str, parent: str, joint: dict, length: float, mass: float) -> dict:
    """A capsule that hangs from its joint along -z."""
    shape = {"type": "capsule", "from": [0, 0, 0], "to": [0, 0, -length], "radius": 0.012}
    return {"name": name, "parent": parent, "joint": joint, "shapes": [shape | {"mass": mass}]}


def _hinge(z: float = 0.0, **options) -> dict:
    return {"type": "revolute", "axis": [0, -1, 0], "at": [0, 0, z], **options}


def _box(name: str, size: list[float], mass: float, **joint) -> dict:
    shapes = [{"type": "box", "size": size, "mass": mass}]
    return {"name": name, "joint": {"type": "free", **joint}, "shapes": shapes}


def _bob() -> dict:
    """A weight in a plane, on one string."""
    return {
        "bodies": [{"name": "bob", "joint": _PLANE, "mass": 0.2}],
        "strings": [_string("line", _body_point("bob"), _driven_point("xz", 0, 0, 0.8))],
    }


def _ball() -> dict:
    """A sphere in space that hangs from its surface, with damping and drag."""
    body = {
        "name": "ball",
        "joint": {"type": "free", "damping": 1e-3},
        "shapes": [{"type": "sphere", "radius": 0.05, "density": 400}],
        "drag": {"linear": 0.02, "quadratic": 0.05, "angular": 1e-4},
    }
    line = _string("line", _body_point("ball", 0, 0, 0.05), _driven_point("xyz", 0, 0, 0.7))
    return {"bodies": [body], "strings": [line]}


def _planar_three() -> dict:
    """A weight in a plane on three strings, one of them redundant."""
    ends = {"left": -0.5, "middle": 0.0, "right": 0.6}
    strings = [
        _string(n, _body_point("bob"), _driven_point("x", x, 0, 0.6)) for n, x in ends.items()
    ]
    return {"bodies": [{"name": "bob", "joint": _PLANE, "mass": 0.3}], "strings": strings}


def _twins() -> dict:
    """A weight in space on two equal strings between the same two points."""
    hand = {"name": "hand", "joint": {**_SPACE, "at": [0, 0, 0.6], "driven": True}}
    strings = [
        _string(name, _body_point("bob"), _body_point("hand"), 0.6) for name in ("one", "other")
    ]
    return {"bodies": [{"name": "bob", "joint": _SPACE, "mass": 0.25}, hand], "strings": strings}


def _rod() -> dict:
    """A rod in a plane on two strings inside its radius of gyration: catches accumulate."""
    rod = {"name": "rod", "parent": "slide", "joint": _hinge(), "mass": 0.3, "com": [0, 0, 0]}
    ends = {"left": -0.08, "right": 0.08}
    strings = [
        _string(n, _body_point("rod", x), _driven_point("z", 1.2 * x, 0, 0.5))
        for n, x in ends.items()
    ]
    bodies = [{"name": "slide", "joint": _PLANE}, rod | {"inertia": [1e-4, 9e-3, 9e-3]}]
    return {"bodies": bodies, "strings": strings}


def _beam() -> dict:
    """A beam in space on two strings of fixed length, inside its radius of gyration."""
    beam = {
        "name": "beam",
        "joint": {"type": "free"},
        "mass": 0.5,
        "com": [0, 0, -0.01],
        "inertia": [5e-4, 0.02, 0.02],
    }
    ends = {"left": -0.1, "right": 0.1}
    strings = [
        _string(n, _body_point("beam", x), _driven_point("xyz", x, 0, 0.6), 0.6)
        for n, x in ends.items()
    ]
    return {"bodies": [beam], "strings": strings}


def _tray() -> dict:
    """A tray in space on four strings, at its corners."""
    corners = {"a": (1, 1), "b": (-1, 1), "c": (-1, -1), "d": (1, -1)}
    strings = [
        _string(
            n, _body_point("tray", 0.15 * i, 0.1 * j), _driven_point("xz", 0.2 * i, 0.15 * j, 0.5)
        )
        for n, (i, j) in corners.items()
    ]
    return {"bodies": [_box("tray", [0.3, 0.2, 0.02], 0.4)], "strings": strings}


def _cable_robot() -> dict:
    """A platform held by four strings from above and two from below: they may be contradictory."""
    above = {"a": (1, 1), "b": (-1, 1), "c": (-1, -1), "d": (1, -1)}
    strings = [
        _string(
            n, _body_point("plate", 0.08 * i, 0.06 * j, 0.03), _world_point(0.5 * i, 0.4 * j, 0.5)
        )
        for n, (i, j) in above.items()
    ]
    strings += [
        _string("e", _body_point("plate", 0.08, 0, -0.03), _world_point(0.5, 0.1, -0.5)),
        _string("f", _body_point("plate", -0.08, 0, -0.03), _world_point(-0.5, -0.1, -0.5)),
    ]
    return {"bodies": [_box("plate", [0.16, 0.12, 0.06], 0.6, damping=0.01)], "strings": strings}


def _figure() -> dict:
    """A trunk with an arm below a control bar, on three strings."""
    bar = {"name": "bar", "joint": {"type": "free", "at": [0, 0, 0.6], "driven": True}}
    arm = _link("arm", "trunk", _hinge(0.0, limits={"lower": -0.5, "upper": 2.0}), 0.2, 0.05)
    strings = [
        _string("front", _body_point("trunk", 0.06, 0, 0.1), _body_point("bar", 0.12), 0.52),
        _string("back", _body_point("trunk", -0.06, 0, 0.1), _body_point("bar", -0.12), 0.52),
        _string("wrist", _body_point("arm", 0, 0, -0.2), _body_point("bar", 0, 0.15)),
    ]
    trunk = _box("trunk", [0.08, 0.12, 0.2], 0.3)
    return {"bodies": [bar, trunk, arm], "strings": strings, "pose": {"arm": 0.4}}


def _tackle() -> dict:
    """A string over pulleys in the world and on a hanging block, with a counterweight."""
    block = {"name": "block", "joint": _PLANE, "mass": 0.5}
    weight = {"name": "weight", "joint": {**_SPACE, "at": [0.6, 0, 0]}, "mass": 0.3}
    strings = [
        _string(
            "rope",
            _body_point("weight"),
            _driven_point("z", -0.2, 0, 0.6),
            "driven",
            _world_point(0.5, 0, 0.6),
            _world_point(0.2, 0, 0.6),
            _body_point("block"),
        ),
        _string("stay", _body_point("block"), _world_point(0, 0, -0.5), 0.7),
        _string("guard", _body_point("weight"), _world_point(0.6, 0, 0.9), 1.1),
    ]
    return {"bodies": [block, weight], "strings": strings}


def _wire() -> dict:
    """A weight on a rigid wire, with a string of its own and one to a second weight."""
    strings = [
        _string("wire", _body_point("bob"), _driven_point("xy", 0, 0, 0.5), 0.5, wire=True),
        _string("side", _body_point("bob"), _driven_point("x", 0.4, 0, 0.3)),
        _string("below", _body_point("bob"), _body_point("tail"), 0.2),
    ]
    tail = {"name": "tail", "joint": {**_SPACE, "at": [0, 0, -0.2]}, "mass": 0.1}
    bob = {"name": "bob", "joint": _SPACE, "mass": 0.2}
    return {"bodies": [bob, tail], "strings": strings}


def _springs() -> dict:
    """Two weights with springs, dampers and drag between two strings."""
    drag = {"linear": 0.3, "quadratic": 0.5}
    upper = {"name": "upper", "joint": {**_SPACE, "damping": 0.05}, "mass": 0.2, "drag": drag}
    lower = {"name": "lower", "joint": {**_SPACE, "at": [0.05, 0, -0.3]}, "mass": 0.15}
    between = [_body_point("upper"), _body_point("lower")]
    spring = {"name": "spring", "between": between, "stiffness": 25, "rest": 0.2, "damping": 0.1}
    elastic = {"name": "elastic", "between": [_body_point("lower"), _world_point(0.3, 0.2, -0.3)]}
    strings = [
        _string("line", _body_point("upper"), _driven_point("xz", 0, 0, 0.4)),
        _string("stop", *between, 0.32),
    ]
    springs = [spring, elastic | {"stiffness": 8, "rest": 0.3}]
    return {"bodies": [upper, lower], "strings": strings, "springs": springs}


def _trolley() -> dict:
    """A heavy driven trolley with a hinged boom and a load on a winch."""
    rail = {"type": "prismatic", "axis": [1, 0, 0], "at": [0, 0, 0.7], "driven": True}
    boom = _link("boom", "trolley", _hinge(-0.02, damping=1e-3), 0.25, 0.2)
    strings = [
        _string("hoist", _body_point("load"), _body_point("trolley", 0.1)),
        _string("tie", _body_point("load"), _body_point("boom", 0, 0, -0.25), 0.5),
    ]
    bodies = [
        {"name": "trolley", "joint": rail, "mass": 2.0, "inertia": [0.01, 0.01, 0.01]},
        boom,
        {"name": "load", "joint": _SPACE, "mass": 0.4},
    ]
    return {"bodies": bodies, "strings": strings}


def _dozen() -> dict:
    """One free body on a dozen strings."""
    rng, strings = np.random.default_rng(12), []
    for k in range(12):
        x, y, z = (float(v) for v in rng.uniform([-0.15, -0.1, 0.0], [0.15, 0.1, 0.04]))
        upper_position = (2.2 * x, 2.2 * y, float(rng.uniform(0.4, 0.7)))
        driven = k % 2 == 0
        distance = float(np.linalg.norm(np.subtract(upper_position, (x, y, z))))
        upper_end = (
            _driven_point("z", *upper_position) if k % 3 == 0 else _world_point(*upper_position)
        )
        length = "driven" if driven else round(1.002 * distance, 6)
        strings.append(_string(f"s{k}", _body_point("hull", x, y, z), upper_end, length))
    return {"bodies": [_box("hull", [0.3, 0.2, 0.08], 0.8)], "strings": strings}


def _arm() -> dict:
    """A planar arm with limits on two strings."""
    bodies = [
        _link("upper", "world", _hinge(limits={"lower": -1.2, "upper": 1.5}), 0.25, 0.1),
        _link("lower", "upper", _hinge(-0.25, limits={"lower": 0.0, "upper": 2.2}), 0.22, 0.08),
    ]
    strings = [
        _string("elbow", _body_point("upper", 0, 0, -0.25), _driven_point("x", 0.15, 0, 0.5)),
        _string("hand", _body_point("lower", 0, 0, -0.22), _driven_point("xz", 0.3, 0, 0.5)),
    ]
    pose = {"upper": 0.3, "lower": 0.6}
    return {"bodies": bodies, "strings": strings, "pose": pose}


def _limb() -> dict:
    """An arm in space: a ball joint with cone and twist, an elbow with limits and a spring."""
    ball = {
        "type": "ball",
        "damping": 2e-4,
        "spring": {"stiffness": 0.02},
        "cone": {"max": 0.9, "axis": [0, 0, -1]},
        "twist": {"lower": -0.8, "upper": 0.6},
    }
    elbow = _hinge(-0.22, limits={"lower": -0.1, "upper": 2.0})
    bodies = [_link("upper", "world", ball, 0.22, 0.1), _link("lower", "upper", elbow, 0.2, 0.07)]
    strings = [
        _string("elbow", _body_point("upper", 0.01, 0, -0.2), _driven_point("xy", 0.1, 0.1, 0.4)),
        _string("hand", _body_point("lower", 0, 0.01, -0.2), _driven_point("xyz", 0.2, 0, 0.4)),
    ]
    return {"bodies": bodies, "strings": strings, "pose": {"lower": 0.5}}


def _neck() -> dict:
    """A head alone: a ball joint with cone and twist that strings pull over its limits."""
    ball = {
        "type": "ball",
        "cone": {"max": 0.5, "axis": [0, 0, 1]},
        "twist": {"lower": -0.4, "upper": 0.4},
    }
    head = {"name": "head", "joint": ball, "mass": 0.3, "com": [0, 0, 0.06]}
    strings = [
        _string("left", _body_point("head", 0.02, 0.06, 0.08), _driven_point("z", 0.02, 0.1, 0.4)),
        _string(
            "right", _body_point("head", 0.02, -0.06, 0.08), _driven_point("z", 0.02, -0.1, 0.4)
        ),
    ]
    return {"bodies": [head | {"inertia": [4e-4, 5e-4, 3e-4]}], "strings": strings}


def _chain() -> dict:
    """A planar chain of five links on three strings."""
    bodies = [_link("l0", "world", _hinge(), 0.12, 0.05)]
    bodies += [_link(f"l{k}", f"l{k - 1}", _hinge(-0.12), 0.12, 0.05) for k in range(1, 5)]
    strings = [
        _string(
            f"s{k}", _body_point(f"l{k}", 0, 0, -0.12), _driven_point("xz", 0.1 + 0.08 * k, 0, 0.3)
        )
        for k in (1, 3, 4)
    ]
    pose = {"l0": 0.4, "l1": 0.3, "l2": 0.2, "l3": 0.2}
    return {"bodies": bodies, "strings": strings, "pose": pose}


def _beads() -> dict:
    """Three beads strung one below the other in a plane: one catch causes the next."""
    names = ("first", "second", "third")
    bodies = [
        {"name": n, "joint": {**_PLANE, "at": [0, 0, -0.2 * k]}, "mass": 0.05 * 3**k}
        for k, n in enumerate(names)
    ]
    strings = [
        _string("top", _body_point("first"), _driven_point("xz", 0, 0, 0.3)),
        _string("middle", _body_point("first"), _body_point("second"), 0.2),
        _string("bottom", _body_point("second"), _body_point("third"), 0.2),
        _string("bypass", _body_point("first"), _body_point("third"), 0.4),
    ]
    return {"bodies": bodies, "strings": strings}


def _winches() -> dict:
    """A weight on winches that slip, one of which rewinds, and a plain string."""
    strings = [
        _string("slips", _body_point("load"), _driven_point("x", -0.4, 0, 0.5), max_tension=6),
        _string(
            "rewinds",
            _body_point("load"),
            _driven_point("x", 0.4, 0, 0.5),
            max_tension=5,
            rewind_speed=0.4,
        ),
        _string("holds", _body_point("load"), _driven_point("z", 0, 0.2, 0.6)),
    ]
    return {"bodies": [{"name": "load", "joint": _SPACE, "mass": 0.4}], "strings": strings}


def _bouncers() -> dict:
    """A board on strings with different restitutions."""
    board = _box("board", [0.4, 0.2, 0.02], 0.5)
    corners = [(0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1), (0.2, -0.1)]
    strings = [
        _string(
            f"s{i}",
            _body_point("board", x, y),
            _driven_point("z", 1.1 * x, 1.2 * y, 0.5),
            restitution=0.3 * i,
        )
        for i, (x, y) in enumerate(corners)
    ]
    return {"bodies": [board], "strings": strings}


def _gate() -> dict:
    """Slides and a hinge between their limits; without drives and strings."""
    slide = {"type": "prismatic", "limits": {"lower": -0.15, "upper": 0.1}}
    bodies = [
        {"name": "lift", "joint": {**slide, "axis": [0, 0, 1]}, "mass": 0.4},
        {"name": "door", "parent": "lift", "joint": {**slide, "axis": [1, 0, 0]}, "mass": 0.3},
        _link("flap", "door", _hinge(limits={"lower": -0.4, "upper": 0.5}), 0.2, 0.1),
    ]
    return {"bodies": bodies}


def _tree(seed: int, dof: int, strings: int) -> dict:
    """A random tree with strings, limits, springs and drag.

    All lengths are driven: a fixed one may be too short for any state.
    """
    kinds = ("revolute", "prismatic", "translation", "ball")
    puppet = random_trees.description(
        seed, dof, driven=0.25, kinds=kinds, strings=strings, limits=True, drag=True
    )
    for string in puppet["strings"]:
        string["length"] = "driven"
    return puppet


ALL = {
    "bob": _bob(),
    "ball": _ball(),
    "planar_three": _planar_three(),
    "twins": _twins(),
    "rod": _rod(),
    "beam": _beam(),
    "tray": _tray(),
    "cable_robot": _cable_robot(),
    "figure": _figure(),
    "tackle": _tackle(),
    "wire": _wire(),
    "springs": _springs(),
    "trolley": _trolley(),
    "dozen": _dozen(),
    "arm": _arm(),
    "limb": _limb(),
    "neck": _neck(),
    "chain": _chain(),
    "beads": _beads(),
    "gate": _gate(),
    "winches": _winches(),
    "bouncers": _bouncers(),
    "tree_a": _tree(3, 4, 2),
    "tree_b": _tree(9, 6, 3),
}
"""Name -> description, with the keys of a puppet file."""


@functools.cache
def load(name: str) -> fan.Marionette:
    """The marionette of a name, compiled or from the cache."""
    return fan.Marionette(fan.model.loads(json.dumps(ALL[name] | {"puppet": name})))
