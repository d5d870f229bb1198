"""Names that other programs use for joints, shapes and keys, for hints in error messages."""

from __future__ import annotations

from collections.abc import Collection

from fantoccini.base.documents import Words

OWN_WORDS = {
    **dict.fromkeys(("hinge", "pin", "rotary", "rotational", "rotation", "continuous"), "revolute"),
    **dict.fromkeys(("slider", "slide", "sliding", "linear"), "prismatic"),
    **dict.fromkeys(("translational", "planar", "cartesian"), "translation"),
    **dict.fromkeys(("spherical", "socket", "ball-and-socket", "ball-socket", "point"), "ball"),
    **dict.fromkeys(("floating", "6dof", "freejoint", "root"), "free"),
    **dict.fromkeys(("weld", "rigid", "static"), "fixed"),
    **dict.fromkeys(("cube", "cuboid", "brick"), "box"),
    **dict.fromkeys(("cylinder", "rod", "pill"), "capsule"),
    **dict.fromkeys(("ball", "circle"), "sphere"),
    **dict.fromkeys(("stl", "obj", "ply", "glb", "gltf", "dae"), "mesh"),
}
"""Other programs' joint and shape names -> ours. `ball` is our joint; elsewhere it is a sphere."""

PLACE_WORDS = ("at", "orientation", "origin", "pos", "position", "quat", "rpy", "xyz")
"""Keys of a body's place in other programs; here its joint has the place."""


def _placed_by_joint(key: str, allowed: Collection[str]) -> str | None:
    if key in PLACE_WORDS and {"joint", "parent"} <= set(allowed):
        return "a body is placed by its joint: joint: {at: [x, y, z], orientation: ...}"
    return None


def _advice(key: str, allowed: Collection[str]) -> str | None:
    """Advice for a key that has another place; None for other keys."""
    if key == "mirror":
        rule = "mirror: {plane: xz, from: left, to: right}"
        return f"`mirror` is a key of the puppet file as a whole: {rule}"
    return _placed_by_joint(key, allowed)


WORDS = Words(OWN_WORDS, _advice)
"""Hints for every file that describes bodies, joints or shapes."""
