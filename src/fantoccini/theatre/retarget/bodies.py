"""Bodies of a puppet that correspond to the parts of a person, by its body map."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import Limb
from fantoccini.model.tree import measure
from fantoccini.theatre.retarget.mapping import SIDES, BodyFile

_PARTS = {"arm": ("upper_arm", "forearm"), "leg": ("thigh", "shin")}


def bodies_of_map(marionette: Marionette) -> dict[str, BodyFile]:
    """Bodies of a person's parts: part -> body and end.

    A limb of several bodies bends at the joint nearest to its middle.

    Raises:
        StateError: the puppet has no body map, or lacks a part of a person.
    """
    body_map = marionette.body_map
    by_name = body_map.parts
    if missing := [
        part
        for part, exists in (
            ("head", body_map.head is not None),
            *((f"{kind}_{side}", f"{kind}_{side}" in by_name) for kind in _PARTS for side in SIDES),
        )
        if not exists
    ]:
        raise StateError(f"{marionette.name} has no {missing[0]}, unlike a person")
    assert body_map.head is not None
    poses = measure(marionette.tree, marionette.number).poses
    trunk = _carrier(marionette, by_name["arm_left"].bodies[0], body_map.trunk)
    out = {"trunk": BodyFile(body=trunk)}
    out["head"] = BodyFile(body=body_map.head.body, end=body_map.head.end)
    for kind, (upper, lower) in _PARTS.items():
        for side in SIDES:
            limb = by_name[f"{kind}_{side}"]
            out[f"{upper}_{side}"] = BodyFile(body=limb.bodies[0])
            out[f"{lower}_{side}"] = _lower_half(marionette, limb, poses)
    return out


def _carrier(marionette: Marionette, body: str, trunk: tuple[str, ...]) -> str:
    """Body of the trunk from which a body hangs."""
    tree = marionette.tree
    above = (tree.links[i].name for i in tree.ancestors(marionette.link_index(body)))
    return next(name for name in above if name in trunk)


def _lower_half(marionette: Marionette, limb: Limb, poses: Array) -> BodyFile:
    """Body with the joint nearest to the middle of a limb, and the limb's end in its frame."""
    limb_poses = [poses[marionette.link_index(name)] for name in limb.bodies]
    end = limb_poses[-1][:, :3] @ np.array(limb.end) + limb_poses[-1][:, 3]
    places = np.array([*(pose[:, 3] for pose in limb_poses), end])
    lengths = np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))
    if len(limb_poses) < 2:
        raise StateError(f"{limb.bodies[0]} of {marionette.name} does not bend, unlike a person's")
    k = 1 + int(np.argmin(np.abs(lengths[:-1] - 0.5 * lengths[-1])))
    R, origin = limb_poses[k][:, :3], limb_poses[k][:, 3]
    x, y, z = (R.T @ (end - origin)).tolist()
    return BodyFile(body=limb.bodies[k], end=(x, y, z))
