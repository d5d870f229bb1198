"""Bodies of a puppet that correspond to the parts of a person, by its body map.

A body map says which bodies and strings are the trunk, head and limbs of a puppet.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import Limb
from fantoccini.model.tree import measure
from fantoccini.theatre.retarget.mapping import SIDES, BodyFile

_BODIES_OF_LIMBS = {"arm": ("upper_arm", "forearm"), "leg": ("thigh", "shin")}


def bodies_of_map(marionette: Marionette) -> dict[str, BodyFile]:
    """Bodies of a person's parts: part -> body and end.

    A limb of several bodies bends at the joint nearest to its middle.

    Raises:
        StateError: the puppet has no body map, or lacks a part of a person.
    """
    body_map = marionette.body_map
    limbs = body_map.parts
    if missing := [
        part
        for part, exists in (
            ("head", body_map.head is not None),
            *(
                (f"{kind}_{side}", f"{kind}_{side}" in limbs)
                for kind in _BODIES_OF_LIMBS
                for side in SIDES
            ),
        )
        if not exists
    ]:
        raise StateError(f"{marionette.name} has no {missing[0]}, unlike a person")
    assert body_map.head is not None
    poses = measure(marionette.tree, marionette.number).poses
    trunk = _trunk_body_above(marionette, limbs["arm_left"].bodies[0], body_map.trunk)
    bodies = {"trunk": BodyFile(body=trunk)}
    bodies["head"] = BodyFile(body=body_map.head.body, end=body_map.head.end)
    for kind, (upper, lower) in _BODIES_OF_LIMBS.items():
        for side in SIDES:
            limb = limbs[f"{kind}_{side}"]
            bodies[f"{upper}_{side}"] = BodyFile(body=limb.bodies[0])
            bodies[f"{lower}_{side}"] = _lower_body(marionette, limb, poses)
    return bodies


def _trunk_body_above(marionette: Marionette, body: str, trunk: tuple[str, ...]) -> str:
    """Body of the trunk from which a body hangs."""
    tree = marionette.tree
    ancestors = (tree.links[i].name for i in tree.ancestors(marionette.link_index(body)))
    return next(name for name in ancestors if name in trunk)


def _lower_body(marionette: Marionette, limb: Limb, poses: Array) -> BodyFile:
    """Body with the joint nearest to the middle of a limb, and the limb's end in its frame."""
    limb_poses = [poses[marionette.link_index(name)] for name in limb.bodies]
    end = limb_poses[-1][:, :3] @ np.array(limb.end) + limb_poses[-1][:, 3]
    positions = np.array([*(pose[:, 3] for pose in limb_poses), end])
    distances = np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))
    if len(limb_poses) < 2:
        raise StateError(f"{limb.bodies[0]} of {marionette.name} does not bend, unlike a person's")
    joint = 1 + int(np.argmin(np.abs(distances[:-1] - 0.5 * distances[-1])))
    R, origin = limb_poses[joint][:, :3], limb_poses[joint][:, 3]
    x, y, z = (R.T @ (end - origin)).tolist()
    return BodyFile(body=limb.bodies[joint], end=(x, y, z))
