"""States joint by joint, for MuJoCo, Pinocchio and Drake, and strings for Drake."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base.arrays import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.mujoco import all_joints
from fantoccini.model.tree import Role, Tree
from fantoccini.motion import State


@dataclass(frozen=True)
class Joint:
    """A joint's coordinates at a state.

    Attributes:
        kind: free, ball, hinge or slide.
        q: position, then quaternion (w, x, y, z); or an angle [m], [rad].
        v: velocity of the origin in the world, then angular velocity in the body's axes; or a rate.
    """

    kind: str
    q: tuple[float, ...]
    v: tuple[float, ...]


@dataclass(frozen=True)
class AnchoredString:
    """A string between a point of a body and a place in the world.

    Attributes:
        name: name of the string.
        body: name of the body.
        at: (3,) point in the body's frame [m].
        world: (3,) position of its upper end [m].
        length: length [m].
    """

    name: str
    body: str
    at: tuple[float, ...]
    world: tuple[float, ...]
    length: float


def dynamic_joints(tree: Tree, q_D: Array, v_D: Array) -> dict[str, Joint]:
    """The dynamic joints by name."""
    return {
        j.name: Joint(j.kind, tuple(map(float, q_D[j.q])), tuple(map(float, v_D[j.v])))
        for j in all_joints(tree)
        if j.role is Role.DYNAMIC
    }


def pack_rates(tree: Tree, rates: dict[str, list[float]]) -> Array:
    """(n_vD,) velocities or accelerations from those of the joints."""
    out = np.zeros(tree.coordinates.n_vD)
    for joint in all_joints(tree):
        if joint.role is Role.DYNAMIC:
            out[joint.v] = rates[joint.name]
    return out


def anchored_strings(marionette: Marionette, x: State) -> list[AnchoredString]:
    """All strings of a puppet, each from one body to one fixed place."""
    anchored = []
    places = marionette.string_points(x.q_D, x.q_K).values()
    lengths = marionette.string_lengths(x.q_D, x.q_K)
    for row, points, length in zip(marionette.tree.strings, places, lengths, strict=True):
        first, _ = row.points
        link, at = marionette.tree.links[first.link], tuple(map(marionette.number, first.at))
        end = tuple(map(float, points[-1]))
        anchored.append(AnchoredString(row.name, link.name, at, end, float(length)))
    return anchored
