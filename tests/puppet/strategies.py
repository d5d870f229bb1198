"""Random puppets for hypothesis: every kind of joint, shape, point and limit."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

KINDS = ("fixed", "revolute", "prismatic", "translation", "ball", "free")
numbers = st.floats(-2, 2, allow_nan=False).map(lambda x: round(x, 6))
sizes = st.floats(0.01, 2).map(lambda x: round(x, 6))
vectors = st.lists(numbers, min_size=3, max_size=3)
directions = vectors.filter(lambda v: sum(x * x for x in v) > 0.01)
quaternions = st.lists(numbers, min_size=4, max_size=4).filter(lambda v: sum(map(abs, v)) > 0.1)
orientations = st.one_of(
    st.builds(lambda q: {"quaternion": q}, quaternions),
    st.builds(lambda a, x: {"axis": a, "angle": x}, directions, numbers),
    st.builds(lambda v: {"rpy": v}, vectors),
)


def bounds(reach: float) -> st.SearchStrategy[dict[str, float]]:
    """A lower and an upper bound."""
    side = st.floats(0.01, reach).map(lambda x: round(x, 6))
    return st.builds(lambda a, b: {"lower": -a, "upper": b}, side, side)


@st.composite
def joints(draw: Any, kind: str | None = None) -> dict[str, Any]:
    """A joint as data of a file."""
    kind = kind or draw(st.sampled_from(KINDS))
    joint: dict[str, Any] = {"type": kind, "at": draw(vectors)}
    if draw(st.booleans()):
        joint["orientation"] = draw(orientations)
    if kind in ("revolute", "prismatic"):
        joint["axis"] = draw(directions)
        joint["limits"] = draw(bounds(3))
        joint["spring"] = {"stiffness": draw(sizes), "rest": draw(numbers)}
    if kind == "translation":
        joint["axes"] = draw(st.sampled_from((["x"], ["x", "z"], ["x", "y", "z"])))
    if kind == "ball":
        joint["cone"] = {"max": draw(sizes), "axis": draw(directions), "of": draw(directions)}
        joint["twist"] = draw(bounds(3)) | {"axis": draw(directions)}
    if kind != "fixed":
        joint["damping"] = draw(sizes)
        joint["armature"] = draw(sizes)
    return joint


@st.composite
def shapes(draw: Any) -> dict[str, Any]:
    """A shape as data of a file."""
    kind = draw(st.sampled_from(("capsule", "box", "sphere", "ellipsoid")))
    shape: dict[str, Any] = {"type": kind, "density": draw(sizes), "colour": "#a0b0c0"}
    if kind == "capsule":
        return shape | {"from": draw(vectors), "to": draw(vectors), "radius": draw(sizes)}
    if kind == "sphere":
        return shape | {"radius": draw(sizes), "at": draw(vectors)}
    key = "size" if kind == "box" else "radii"
    size = draw(st.lists(sizes, min_size=3, max_size=3))
    return shape | {key: size, "at": draw(vectors), "orientation": draw(orientations)}


@st.composite
def bodies(draw: Any, name: str = "a_left", parent: str = "world") -> dict[str, Any]:
    """A body with mass as data of a file."""
    body: dict[str, Any] = {"name": name, "parent": parent, "joint": draw(joints())}
    body["shapes"] = draw(st.lists(shapes(), max_size=2))
    body["mass"] = draw(
        st.one_of(sizes, sizes.map(lambda x: {"parameter": f"m_{name}", "value": x}))
    )
    if draw(st.booleans()):
        a = draw(sizes)
        full = [a, 1.2 * a, 1.4 * a, 0.1 * a, -0.05 * a, 0.02 * a]
        body["inertia"] = full if draw(st.booleans()) else [a, a, a]
        body["com"] = draw(vectors)
    if draw(st.booleans()):
        body["drag"] = {"linear": draw(sizes)}
    return body


def start(body: dict[str, Any], draw: Any) -> dict[str, Any]:
    """Start values for a body's joint."""
    name, joint = body["name"], body["joint"]
    match joint["type"]:
        case "revolute" | "prismatic":
            return {name: draw(numbers)}
        case "translation":
            return {f"{name}.{a}": draw(numbers) for a in joint["axes"]}
        case "ball":
            return {f"{name}.rotation": draw(quaternions)}
        case "free":
            place = {f"{name}.{a}": draw(numbers) for a in "xyz"}
            return place | {f"{name}.rotation": draw(quaternions)}
    return {}


@st.composite
def files(draw: Any) -> dict[str, Any]:
    """A puppet as data of a file, with a mirror and a string on every body."""
    names = ["trunk", *draw(st.lists(st.sampled_from(("a_left", "b_left", "c")), unique=True))]
    parts = []
    for k, name in enumerate(names):
        parent = draw(st.sampled_from(["world", *names[:k]]))
        parts.append(draw(bodies(name, parent)))
    strings = [
        {
            "name": f"s_{name}",
            "path": [{"body": name, "at": draw(vectors)}, draw(ends())],
            "length": draw(st.one_of(sizes, st.just("driven"))),
            **draw(winches()),
        }
        for name in names
    ]
    pose: dict[str, Any] = {}
    for body in parts:
        pose |= start(body, draw)
    data = {
        "puppet": "p",
        "bodies": parts,
        "strings": strings,
        "pose": pose,
        "floor": draw(numbers),
    }
    if any("left" in name for name in names):
        plane = draw(st.sampled_from(("xy", "yz", "xz")))
        data["mirror"] = {"plane": plane, "from": "left", "to": "right"}
    return data


def ends() -> st.SearchStrategy[dict[str, Any]]:
    """The far end of a string."""
    return st.one_of(
        st.builds(lambda p: {"world": p}, vectors),
        st.builds(lambda p: {"driven": ["x", "y"], "at": p}, vectors),
    )


def winches() -> st.SearchStrategy[dict[str, Any]]:
    """Keys of a string's winch and of its catches."""
    return st.one_of(
        st.just({}),
        st.builds(lambda e: {"restitution": e}, st.floats(0, 1)),
        st.builds(lambda m: {"max_tension": m}, sizes),
        st.builds(lambda m, v: {"max_tension": m, "rewind_speed": v}, sizes, sizes),
    )
