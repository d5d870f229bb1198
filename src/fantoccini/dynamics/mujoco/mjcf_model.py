"""A puppet as MJCF text.

Bodies have explicit inertia. Joints keep damping, springs and limits. Parts of a puppet that MuJoCo
lacks have exact equivalents:

- A string is a spatial tendon of limited length. A wire is a tendon of constrained length.
- A driven length is a slide joint behind a pulley of its tendon, so that MuJoCo knows its velocity.
- A cone is a tendon between the tips of its axes:   |a - R b|^2 = 2 - 2 a.R b.
- A limit of a ball joint's twist is a tendon that is updated before every step: :mod:`.twists`.
- The pieces of a chain are springs between its masses.
- The spring of a ball joint is one spring between each axis before and after the rotation:
      k/4 sum_i |e_i - R e_i|^2 = 2 k (1 - q_w^2).
- Drag is an actuator on the velocity of the centre of mass.

A driven coordinate is a joint so heavy that only the force applied to it moves it. Contacts,
obstacles and the floor are left out, as in fantoccini's simulations. Anything else that MuJoCo
cannot model is an error.

q_D are the dynamic coordinates and q_K the driven ones, given as functions of time. A twist is the
rotation about the joint's own axis. A marionette is a puppet with its compiled equations;
`marionette.puppet` is the description in its file. A winch changes the length of a string. A drive
moves a coordinate by a motor towards its command. A row of the tree describes a string, limit,
spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from fantoccini.base import Array, ConfigK, ExchangeError, Mistake, rotation
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.mujoco.joints import Joint, joints_of, pose_in_parent, winch_of
from fantoccini.dynamics.mujoco.twists import tendon_ends
from fantoccini.model.tree import (
    WORLD,
    ChainRow,
    LimitRow,
    Link,
    Point,
    Role,
    StringRow,
    link_poses,
    path_lengths,
)

_Value = str | Number | Sequence[Number] | Array
"""Value of an attribute."""


@dataclass(frozen=True)
class Substitutes:
    """Finite values for MuJoCo in place of 0 or infinity."""

    spool: float = 1000.0
    """Length of a driven string plus the length wound up [m]: longer than any string."""
    driven_inertia: float = 1e6
    """Inertia of a driven coordinate, relative to the mass of the puppet [1 or m^2]. The puppet's
    forces accelerate it by about a millionth of the puppet's own accelerations."""
    puppet_mass: float = 1.0  # Mass used for a massless puppet in driven_inertia [kg]
    min_mass: float = 1e-12  # Mass of a massless moving body [kg]: MuJoCo refuses 0
    min_moment: float = 1e-14  # Moments of inertia of a massless moving body [kg m^2]
    twist_length: float = 3.0
    """Largest length of a twist's tendon before its first update [m]: more than the distance of any
    two points 1 m from the joint, so that the limit does not act."""
    joint_range: float = 1e6  # Largest |q| of a joint that is limited on the other side [rad or m]


SUBSTITUTES = Substitutes()


def mjcf(marionette: Marionette, fixed_q_K: ConfigK | None = None) -> str:
    """The puppet as MJCF text.

    Args:
        marionette: the puppet, with the present values of its parameters.
        fixed_q_K: (n_qK,) fixed values of the driven coordinates; if None, they are joints.

    Raises:
        ExchangeError: MuJoCo cannot model a part of the puppet.
    """
    return _Document(marionette, fixed_q_K).text()


class _Document:
    """The XML elements of a puppet.

    Attributes:
        fixed_poses: poses in the world of the links that cannot move, and of ``WORLD``, by index.
        bodies: elements of all other links, and of ``WORLD``, by index, parents first.
        tendons, wires, actuators: sections of the document.
    """

    def __init__(self, marionette: Marionette, fixed_q_K: ConfigK | None):
        self.marionette, self.tree, self.fixed_q_K = marionette, marionette.tree, fixed_q_K
        self.number = marionette.number
        mistakes = [_mistake(marionette, name, text) for name, text in self._unsupported()]
        if mistakes:
            raise ExchangeError(mistakes)
        self.fixed_poses = {WORLD: (np.eye(3), np.zeros(3))}
        self.bodies = {WORLD: Element("worldbody")}
        self.tendons, self.wires, self.actuators = map(Element, ("tendon", "equality", "actuator"))
        for i, link in enumerate(self.tree.links):
            R, r = self._pose(link)
            if link.parent in self.fixed_poses and not self._has_joints(link):
                self.fixed_poses[i] = R, r
            else:
                self.bodies[i] = self._body_element(i, link, R, r)

    def text(self) -> str:
        """The whole document."""
        for string in self.tree.strings:
            self._add_string(string)
        for s in self.tree.springs:
            spring = {"springlength": s.rest, "stiffness": s.stiffness, "damping": s.damping}
            self._add_tendon(f"{s.name}.spring", s.points, **spring)
        for chain in self.tree.chains:
            self._add_chain(chain)
        for limit in self.tree.limits:
            if limit.b is not None:
                self._add_ball_limit(limit, limit.b)
        for i, body in reversed(self.bodies.items()):
            if i != WORLD:
                link = self.tree.links[i]
                self._add_ball_spring(i, link)
                self._add_drag(i, link)
                self.bodies[WORLD if link.parent in self.fixed_poses else link.parent].append(body)
        root = Element("mujoco", model="puppet")
        self._add(root, "compiler", angle="radian")
        option = self._add(root, "option", gravity=self.tree.gravity)
        self._add(option, "flag", contact="disable")
        sections = self.bodies[WORLD], self.tendons, self.wires, self.actuators
        root.extend(section for section in sections if len(section))
        indent(root)
        return tostring(root, encoding="unicode")

    def _element(self, tag: str, **attributes: _Value) -> Element:
        """New element; numbers have all 17 digits."""
        return Element(tag, {name: self._attribute_text(x) for name, x in attributes.items()})

    def _add(self, parent: Element, tag: str, **attributes: _Value) -> Element:
        """Appends a new element to another, and returns it."""
        parent.append(element := self._element(tag, **attributes))
        return element

    def _attribute_text(self, value: _Value) -> str:
        if isinstance(value, str):
            return value
        numbers = (value,) if isinstance(value, float | Parameter) else value
        return " ".join(repr(self.number(x)) for x in numbers)

    # -- bodies ------------------------------------------------------------------------------

    def _has_joints(self, link: Link) -> bool:
        """Whether a link moves relative to its parent."""
        return link.role is Role.DYNAMIC or (link.role is Role.DRIVEN and self.fixed_q_K is None)

    def _pose(self, link: Link) -> tuple[Array, Array]:
        """Pose of a link in its parent, or in the world if that is fixed, with joints at zero."""
        q = np.zeros(0)
        if self.fixed_q_K is not None and link.role is Role.DRIVEN:
            q = self.fixed_q_K[link.q]
        R, r = pose_in_parent(link, q, self.number)
        if link.parent not in self.fixed_poses:
            return R, r
        R_parent, r_parent = self.fixed_poses[link.parent]
        return R_parent @ R, r_parent + R_parent @ r

    def _body_element(self, i: int, link: Link, R: Array, r: Array) -> Element:
        """A link's body with its joints and inertia."""
        body = self._element("body", name=link.name, pos=r, quat=rotation.quaternion(R))
        if self._has_joints(link):
            for joint in joints_of(link):
                self._add_link_joint(body, i, link, joint)
        self._add_inertial(body, link)
        return body

    def _add_link_joint(self, body: Element, i: int, link: Link, joint: Joint) -> None:
        """A joint with its damping, spring and range."""
        if joint.kind == "free":
            self._add(body, "freejoint", name=joint.name)
            return
        attributes: dict[str, _Value] = {"damping": link.damping}
        if self.number(link.armature):
            attributes["armature"] = link.armature
        if joint.kind != "ball" and self.number(link.stiffness):
            attributes |= {"stiffness": link.stiffness, "springref": link.rest}
        bounds = {limit.side: limit.bound for limit in self.tree.limits if limit.link == i}
        if "lower" in bounds or "upper" in bounds:
            offset = SUBSTITUTES.joint_range
            joint_range = bounds.get("lower", -offset), bounds.get("upper", offset)
            attributes |= {"limited": "true", "range": joint_range}
        self._add_joint(body, joint, **attributes)

    def _add_joint(self, body: Element, joint: Joint, **attributes: _Value) -> None:
        if joint.axis is not None:
            attributes["axis"] = joint.axis
        if joint.role is Role.DRIVEN:
            mass = self.marionette.mass or SUBSTITUTES.puppet_mass
            attributes["armature"] = SUBSTITUTES.driven_inertia * mass
        self._add(body, "joint", name=joint.name, type=joint.kind, **attributes)

    def _add_inertial(self, body: Element, link: Link) -> None:
        m, com, about_com = self._mass_and_inertia(link)
        moments, axes = np.linalg.eigh(about_com)
        if np.linalg.det(axes) < 0.0:
            axes[:, 2] *= -1.0
        moments = np.maximum(moments, 0.0)
        if self._has_joints(link):
            m = max(m, SUBSTITUTES.min_mass)
            moments = np.maximum(moments, SUBSTITUTES.min_moment)
        if m:
            quat = rotation.quaternion(axes)
            self._add(body, "inertial", mass=m, pos=com, quat=quat, diaginertia=moments)

    def _mass_and_inertia(self, link: Link) -> tuple[float, Array, Array]:
        """Mass, centre of mass and inertia about it: the link's own values, or its shapes'."""
        masses = [self.number(share.amount) * share.volume for share in link.mass_shares]
        unit_bodies = [share.unit for share in link.mass_shares]
        m = sum(masses)
        com = sum(
            (
                share_mass * np.array(unit_body.com)
                for share_mass, unit_body in zip(masses, unit_bodies, strict=True)
            ),
            np.zeros(3),
        )
        com = com / m if m else com
        about_com = np.zeros((3, 3))
        for share_mass, unit_body in zip(masses, unit_bodies, strict=True):
            offset = np.array(unit_body.com) - com
            about_com += share_mass * (
                np.array(unit_body.inertia) + offset @ offset * np.eye(3) - np.outer(offset, offset)
            )
        if link.mass is not None:
            about_com *= self.number(link.mass) / m if m else 0.0
            m = self.number(link.mass)
        if link.com is not None:
            com = np.array([self.number(x) for x in link.com])
        if link.inertia is not None:
            xx, yy, zz, xy, xz, yz = map(self.number, link.inertia)
            about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return m, com, about_com

    # -- strings, springs, limits, drag ------------------------------------------------------

    def _add_site(self, name: str, point: Point) -> None:
        """Adds a site to the body that carries a point."""
        position, link = np.array([self.number(x) for x in point.at]), point.link
        if link in self.fixed_poses:
            R, r = self.fixed_poses[link]
            link, position = WORLD, r + R @ position
        self._add(self.bodies[link], "site", name=name, pos=position)

    def _add_tendon(self, name: str, points: Iterable[Point], **attributes: _Value) -> Element:
        """A tendon through points of links."""
        tendon = self._add(self.tendons, "spatial", name=name, **attributes)
        for k, point in enumerate(points):
            self._add_site(f"{name}.{k}", point)
            self._add(tendon, "site", site=f"{name}.{k}")
        return tendon

    def _add_chain(self, chain: ChainRow) -> None:
        """A spring for each piece of a chain."""
        piece = self._length_of(chain) / chain.pieces
        stiffness = self.number(chain.stiffness) / piece
        damping = self.number(chain.damping) / piece
        for k, ends in enumerate(pairwise(chain.points)):
            name = f"{chain.name}.spring.{k}"
            self._add_tendon(name, ends, springlength=piece, stiffness=stiffness, damping=damping)

    def _add_string(self, string: StringRow) -> None:
        has_winch = string.driven_length is not None and self.fixed_q_K is None
        if has_winch:
            self._add_winch(string)
        if string.wire:
            # MuJoCo measures a wire's length relative to that in its zero pose; MuJoCoPuppet sets
            # the length of one with a winch.
            tendon = self._add_tendon(string.name, string.points)
            length_offset = (
                0.0 if has_winch else self._length_of(string) - self.zero_lengths[string.name]
            )
            polycoef = np.array([length_offset, 0.0, 0.0, 0.0, 0.0])
            name = string.name
            self._add(self.wires, "tendon", name=name, tendon1=name, polycoef=polycoef)
        else:
            length_range = 0.0, self._length_of(string)
            tendon = self._add_tendon(
                string.name, string.points, limited="true", range=length_range
            )
        if has_winch:
            self._add(tendon, "pulley", divisor=1.0)
            for site_name in ("spool", "wound"):
                self._add(tendon, "site", site=f"{string.name}.{site_name}")

    def _add_winch(self, string: StringRow) -> None:
        """A slide joint whose distance from its spool is the length wound up."""
        offset, world = (SUBSTITUTES.spool, 0.0, 0.0), self.bodies[WORLD]
        mass, moments = SUBSTITUTES.min_mass, np.full(3, SUBSTITUTES.min_moment)
        self._add(world, "site", name=f"{string.name}.spool")
        body = self._add(world, "body", name=f"{string.name}.winch", pos=offset)
        self._add_joint(body, winch_of(string))
        self._add(body, "inertial", mass=mass, pos=np.zeros(3), diaginertia=moments)
        self._add(body, "site", name=f"{string.name}.wound")

    @cached_property
    def zero_lengths(self) -> dict[str, float]:
        """Lengths of the strings' paths with all of MuJoCo's joints at zero [m]."""
        table = self.tree.coordinates
        q_D = np.zeros(table.n_qD)
        q_K = np.zeros(table.n_qK) if self.fixed_q_K is None else self.fixed_q_K.copy()
        q_D[[q for q, _ in table.quaternions_D]] = 1.0
        if self.fixed_q_K is None:
            q_K[[q for q, _ in table.quaternions_K]] = 1.0
        poses = link_poses(self.tree.links, q_D[None], q_K[None], self.number)[0]
        return path_lengths(self.tree, poses, self.number)

    def _length_of(self, row: StringRow | ChainRow) -> float:
        """Length L [m]; for a driven length that is a joint, L plus the length wound up."""
        if row.driven_length is not None:
            return (
                SUBSTITUTES.spool
                if self.fixed_q_K is None
                else self.fixed_q_K[row.driven_length[0]]
            )
        assert row.length is not None
        return self.number(row.length)

    def _add_ball_limit(self, limit: LimitRow, b: Array) -> None:
        """A limit of a ball joint: a cone or a twist."""
        if limit.side == "cone":
            assert limit.a is not None
            start, end, length = limit.a, b, 2.0 * np.sin(0.5 * limit.bound)
        else:
            (start, end), length = tendon_ends(b), SUBSTITUTES.twist_length
        tie_points = self._in_parent(limit.link, start), Point(limit.link, tuple(end))
        self._add_tendon(limit.name, tie_points, limited="true", range=(0.0, length))

    def _in_parent(self, i: int, position: Array) -> Point:
        """A point of a link's joint frame, as a point fixed on the parent."""
        link = self.tree.links[i]
        R, r = pose_in_parent(link, np.zeros(0), self.number)
        return Point(link.parent, tuple(r + R @ position))

    def _add_ball_spring(self, i: int, link: Link) -> None:
        half_stiffness = 0.5 * self.number(link.stiffness)
        if half_stiffness and link.kind == "ball":
            for axis, e in zip("xyz", np.eye(3), strict=True):
                tie_points = self._in_parent(i, e), Point(i, tuple(e))
                name = f"{link.joint}.spring.{axis}"
                self._add_tendon(name, tie_points, springlength=0.0, stiffness=half_stiffness)

    def _add_drag(self, i: int, link: Link) -> None:
        linear, _, angular = map(self.number, link.drag)
        if not linear and not angular:
            return
        if not len(self.actuators):
            self._add(self.bodies[WORLD], "site", name="world")
        m, com, _ = self._mass_and_inertia(link)
        site = f"{link.name}.air"
        self._add_site(site, Point(i, tuple(com if m else np.zeros(3))))
        axes = np.eye(6)
        for coefficient, gears in ((linear, axes[:3]), (angular, axes[3:])):
            for gear in gears if coefficient else ():
                self._add(
                    self.actuators,
                    "general",
                    site=site,
                    refsite="world",
                    gear=gear,
                    gainprm=0.0,
                    biastype="affine",
                    biasprm=(0.0, 0.0, -coefficient),
                )

    # -- errors ------------------------------------------------------------------------------

    def _unsupported(self) -> Iterator[tuple[str, str]]:
        """Name of each part that MuJoCo cannot model, and the reason."""
        for string in self.tree.strings:
            if string.max_tension is not None:
                yield string.name, "has max_tension: MuJoCo cannot model a winch that slips"
            if self.number(string.restitution):
                yield string.name, "has restitution: MuJoCo's strings have none"
        for chain in self.tree.chains:
            if chain.length_index is not None and self.fixed_q_K is None:
                text = (
                    "is a chain with a driven length: MuJoCo's springs have constant rest lengths"
                )
                yield chain.name, text
        for link in self.tree.links:
            if self.number(link.drag[1]):
                yield link.name, "has quadratic drag: MuJoCo supports it only for whole models"
            if (
                link.role is Role.DRIVEN
                and self.fixed_q_K is None
                and link.kind in ("ball", "free")
            ):
                text = "has a driven rotation: MuJoCo supports driven slides and hinges only"
                yield link.joint, text
        for row in self.tree.drives:
            yield row.name, "has a drive: MuJoCo supports driven coordinates without drives only"


def _mistake(marionette: Marionette, name: str, message: str) -> Mistake:
    """A mistake with the file and line of a body, joint or string."""
    file, line = marionette.puppet.locate(marionette.puppet.owner_of(name))
    return Mistake(file, line, name, message)
