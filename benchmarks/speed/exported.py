"""A puppet as MJCF text, which every peer reads, and its states joint by joint.

Bodies, explicit inertia, joints and damping; strings as spatial tendons with a limited length,
their driven ends as sites that stand still. Limits of joints are left out: none is reached here,
and the peers need not watch them.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.puppet import Number, Parameter
from fantoccini.tree import Link, Role, Tree


@dataclass(frozen=True)
class Joint:
    """A joint's coordinates at a state.

    Attributes:
        kind: free, ball or revolute.
        q: position, then quaternion (w, x, y, z); or an angle [m], [rad].
        v: velocity of the origin in the world, then angular velocity in the body's axes; or a rate.
    """

    kind: str
    q: tuple[float, ...]
    v: tuple[float, ...]


@dataclass(frozen=True)
class Anchored:
    """A string between a point of a body and a place in the world.

    Attributes:
        name: the string's.
        body: the body's name.
        at: (3,) place in the body's frame [m].
        world: (3,) where its upper end stands [m].
        length: [m].
    """

    name: str
    body: str
    at: tuple[float, ...]
    world: tuple[float, ...]
    length: float


def joints(tree: Tree, q_D: Array, v_D: Array) -> dict[str, Joint]:
    """The dynamic joints by name."""
    return {
        link.joint: Joint(link.kind, tuple(map(float, q_D[link.q])), tuple(map(float, v_D[link.v])))
        for link in tree.links
        if link.role is Role.DYNAMIC
    }


def packed(tree: Tree, rates: dict[str, list[float]]) -> Array:
    """(n_vD,) velocities or accelerations from those of the joints."""
    out = np.zeros(tree.coordinates.n_vD)
    for link in tree.links:
        if link.role is Role.DYNAMIC:
            out[link.v] = rates[link.joint]
    return out


def strings(marionette: Marionette, x: State) -> list[Anchored]:
    """All strings of a puppet, each from one body to one place that does not move."""
    found = []
    places = marionette.string_points(x.q_D, x.q_K)
    lengths = marionette.string_lengths(x.q_K)
    for row, points, length in zip(marionette.tree.strings, places, lengths, strict=True):
        first, last = row.points
        link, at = marionette.tree.links[first.link], tuple(map(marionette.number, first.at))
        if link.role is not Role.DYNAMIC or len(row.points) != 2 or _moved(marionette, last.link):
            raise ValueError(f"{row.name} does not lead from a body to a driven end")
        end = np.reshape(points, (-1, 3))[-1]
        found.append(Anchored(row.name, link.name, at, tuple(map(float, end)), float(length)))
    return found


def mjcf(tree: Tree, hung: list[Anchored]) -> str:
    """The text.

    Args:
        tree: the bodies; driven ones are left out.
        hung: the strings.
    """
    sites = {link.name: "" for link in tree.links}
    world = tendons = ""
    for s in hung:
        sites[s.body] += f"<site name={quoteattr(s.name)} pos={_text(s.at)}/>"
        world += f"<site name={quoteattr(s.name + '.end')} pos={_text(s.world)}/>"
        tendons += (
            f'<spatial name={quoteattr(s.name)} limited="true" range={_text((0.0, s.length))}>'
            f"<site site={quoteattr(s.name + '.end')}/><site site={quoteattr(s.name)}/></spatial>"
        )
    world += "".join(_body(tree, i, sites) for i in _children(tree, -1))
    return (
        '<mujoco model="puppet"><compiler angle="radian"/>'
        f'<option gravity={_text(tree.gravity)}><flag contact="disable"/></option>'
        f"<worldbody>{world}</worldbody><tendon>{tendons}</tendon></mujoco>"
    )


def _children(tree: Tree, parent: int) -> list[int]:
    return [
        i
        for i, link in enumerate(tree.links)
        if link.parent == parent and link.role is Role.DYNAMIC
    ]


def _moved(marionette: Marionette, link: int) -> bool:
    """Whether a link moves when the dynamic coordinates do."""
    while link >= 0:
        if marionette.tree.links[link].role is Role.DYNAMIC:
            return True
        link = marionette.tree.links[link].parent
    return False


def _body(tree: Tree, i: int, sites: dict[str, str]) -> str:
    link = tree.links[i]
    name, joint = quoteattr(link.name), quoteattr(link.joint)
    x, y, z, w = Rotation.from_matrix(link.rotation).as_quat()
    damping = f"damping={_text((link.damping,))}"
    if link.kind == "free":
        if any(link.offset) or link.damping:
            raise ValueError(f"{link.joint}: a free joint with an offset or damping")
        motion = f"<freejoint name={joint}/>"
    elif link.kind == "ball":
        motion = f'<joint name={joint} type="ball" {damping}/>'
    elif link.kind == "revolute":
        axis = _text(link.axes[:, 0])
        motion = f'<joint name={joint} type="hinge" axis={axis} {damping}/>'
    else:
        raise ValueError(f"{link.joint}: a joint that is {link.kind}")
    inside = "".join(_body(tree, child, sites) for child in _children(tree, i))
    return (
        f"<body name={name} pos={_text(link.offset)} quat={_text((w, x, y, z))}>"
        f"{motion}{_inertial(link)}{sites[link.name]}{inside}</body>"
    )


def _inertial(link: Link) -> str:
    """Mass, centre of mass and inertia about it, of the shapes unless they are given."""
    m, c, about_com = _lumped(link)
    if link.mass is not None:
        about_com *= _number(link.mass) / m if m else 0.0
        m = _number(link.mass)
    if link.com is not None:
        c = np.array([_number(x) for x in link.com])
    if link.inertia is not None:
        xx, yy, zz, xy, xz, yz = map(_number, link.inertia)
        about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments, axes = np.linalg.eigh(about_com)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    x, y, z, w = Rotation.from_matrix(axes).as_quat()
    return (
        f"<inertial mass={_text((m,))} pos={_text(c)} quat={_text((w, x, y, z))} "
        f"diaginertia={_text(moments)}/>"
    )


def _lumped(link: Link) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it, of the shapes."""
    masses = [_number(lump.amount) * lump.volume for lump in link.lumps]
    units = [lump.unit for lump in link.lumps]
    m = sum(masses)
    c = sum((a * np.array(u.com) for a, u in zip(masses, units, strict=True)), np.zeros(3))
    c = c / m if m else c
    about_com = np.zeros((3, 3))
    for a, u in zip(masses, units, strict=True):
        d = np.array(u.com) - c
        about_com += a * (np.array(u.inertia) + d @ d * np.eye(3) - np.outer(d, d))
    return m, c, about_com


def _text(values) -> str:
    return '"' + " ".join(repr(_number(v)) for v in values) + '"'


def _number(value: Number) -> float:
    """A parameter has the value that the file gives it."""
    return value.value if isinstance(value, Parameter) else float(value)
