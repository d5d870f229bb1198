"""A puppet as MJCF text.

Bodies have explicit inertia; joints carry damping, springs and limits over. What MuJoCo has no word
for, but can be said exactly:

- a string is a spatial tendon of limited length; a wire is one whose length is a constraint,
- a driven length is a slide behind a pulley of its tendon: so MuJoCo knows how fast it is wound,
- a cone is a tendon between the tips of its axes:   |a - R b|^2 = 2 - 2 a.R b,
- a twist is one that whoever runs the model leads anew at every step: :mod:`.twists`,
- a chain's pieces are springs between its masses,
- a ball joint's spring is one between every axis before and after it turns:
      k/4 sum_i |e_i - R e_i|^2 = 2 k (1 - q_w^2),
- drag is an actuator on the velocity of the centre of mass.

A driven coordinate is a joint so heavy that nothing moves it but what is applied to it. Contacts,
obstacles and the floor are left out, as in every simulation of ours. All else that MuJoCo cannot do
is an error.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.arrays import Array, ConfigK
from fantoccini.errors import ExchangeError, Mistake
from fantoccini.exchange.joints import Joint, joints_of, pose_in_parent, winch_of
from fantoccini.exchange.twists import cord
from fantoccini.marionette import Marionette
from fantoccini.tree import WORLD, ChainRow, LimitRow, Link, Point, Role, StringRow

SPOOL = 1000.0
"""Length of a driven string and of what is wound in [m]; the longest that a string can be."""

_HEAVY = 1e6
"""Inertia of a driven coordinate, in masses of the puppet [1 or m^2]."""

_DUST = 1e-12, 1e-14
"""Mass [kg] and moments of inertia [kg m^2] of a body that has none: MuJoCo asks for some."""

_LOOSE = 3.0
"""More than a cord between two points a unit from a joint can be long."""

_FAR = 1e6
"""Bound of a side of a joint that has none [rad or m]."""


def mjcf(marionette: Marionette, still: ConfigK | None = None) -> str:
    """The text.

    Args:
        marionette: the puppet; parameters have its values.
        still: (n_qK,) where the driven coordinates stand; they are joints when not given.

    Raises:
        ExchangeError: the puppet has what MuJoCo cannot do.
    """
    return _Text(marionette, still).whole()


class _Text:
    """Text in the making.

    Attributes:
        inside: index of a link, or ``WORLD`` -> what stands in its body.
        tendons, wires, drags: what stands in these sections.
    """

    def __init__(self, marionette: Marionette, still: ConfigK | None):
        self.marionette, self.tree, self.number = (
            marionette,
            marionette.tree,
            marionette.model.number,
        )
        self.still = still
        problems = self._impossible()
        if problems:
            raise ExchangeError(problems)
        self.inside = {i: "" for i in range(-1, len(self.tree.links))}
        self.tendons = self.wires = self.drags = ""
        self._stands = self._standing()

    def whole(self) -> str:
        """Everything."""
        for string in self.tree.strings:
            self._string(string)
        for spring in self.tree.springs:
            springy = (
                f"springlength={self._text((spring.rest,))} "
                f"stiffness={self._text((spring.stiffness,))} "
                f"damping={self._text((spring.damping,))}"
            )
            self._tendon(f"{spring.name}.spring", spring.points, springy)
        for chain in self.tree.chains:
            self._chain(chain)
        for limit in self.tree.limits:
            if limit.b is not None:
                self._ball_limit(limit)
        # Links from the leaves inward: what a body holds is complete before its parent takes it.
        for i in reversed(range(len(self.tree.links))):
            link = self.tree.links[i]
            if i in self._stands:
                continue
            self._of_joint_and_air(i, link)
            carrier = WORLD if link.parent in self._stands else link.parent
            self.inside[carrier] += self._body(i, link)
        gravity = self._text(self.tree.gravity)
        return (
            '<mujoco model="puppet"><compiler angle="radian"/>'
            f'<option gravity={gravity}><flag contact="disable"/></option>'
            + _section("worldbody", self.inside[WORLD])
            + _section("tendon", self.tendons)
            + _section("equality", self.wires)
            + _section("actuator", self.drags)
            + "</mujoco>"
        )

    # -- bodies ------------------------------------------------------------------------------

    def _standing(self) -> dict[int, tuple[Array, Array]]:
        """World poses of the links that stand still."""
        found = {WORLD: (np.eye(3), np.zeros(3))}
        for i, link in enumerate(self.tree.links):
            if link.parent in found and not self._jointed(link):
                R, r = self._pose(link)
                R_up, r_up = found[link.parent]
                found[i] = R_up @ R, r_up + R_up @ r
        return found

    def _jointed(self, link: Link) -> bool:
        """Whether a link moves on its parent."""
        return link.role is Role.DYNAMIC or (link.role is Role.DRIVEN and self.still is None)

    def _pose(self, link: Link) -> tuple[Array, Array]:
        """A link's pose in its parent, where its joint is at zero or stands still."""
        stands = link.role is Role.DRIVEN and self.still is not None
        return pose_in_parent(link, self.still[link.q] if stands else np.zeros(0), self.number)

    def _body(self, i: int, link: Link) -> str:
        R, r = self._pose(link)
        if link.parent in self._stands:
            R_up, r_up = self._stands[link.parent]
            R, r = R_up @ R, r_up + R_up @ r
        motion = ""
        if self._jointed(link):
            motion = "".join(self._joint(link, joint) for joint in joints_of(link))
        return (
            f"<body name={quoteattr(link.name)} pos={_numbers(r)} quat={_quaternion(R)}>"
            f"{motion}{self._inertial(link)}{self.inside[i]}</body>"
        )

    def _joint(self, link: Link, joint: Joint) -> str:
        name = quoteattr(joint.name)
        if joint.kind == "free":
            return f"<freejoint name={name}/>"
        text = f'<joint name={name} type="{joint.kind}" damping={self._text((link.damping,))}'
        if joint.axis is not None:
            text += f" axis={_numbers(joint.axis)}"
        if joint.role is Role.DRIVEN:
            text += f" armature={_numbers((self._heavy,))}"
        if joint.kind != "ball" and self.number(link.stiffness):
            text += f" stiffness={self._text((link.stiffness,))}"
            text += f" springref={self._text((link.rest,))}"
        ends = {"lower": -_FAR, "upper": _FAR}
        ends |= {s.side: s.bound for s in self._limits(link) if s.side in ends}
        if set(ends.values()) != {-_FAR, _FAR}:
            text += f' limited="true" range={self._text(ends.values())}'
        return text + "/>"

    @property
    def _heavy(self) -> float:
        return _HEAVY * (self.marionette.mass or 1.0)

    def _limits(self, link: Link) -> list[LimitRow]:
        return [limit for limit in self.tree.limits if self.tree.links[limit.link] is link]

    def _inertial(self, link: Link) -> str:
        m, com, about_com = self._mass(link)
        moments, axes = np.linalg.eigh(about_com)
        if np.linalg.det(axes) < 0.0:
            axes[:, 2] *= -1.0
        if self._jointed(link):
            m, moments = max(m, _DUST[0]), np.maximum(moments, _DUST[1])
        elif not m:
            return ""
        return (
            f"<inertial mass={_numbers((m,))} pos={_numbers(com)} quat={_quaternion(axes)} "
            f"diaginertia={_numbers(np.maximum(moments, 0.0))}/>"
        )

    def _mass(self, link: Link) -> tuple[float, Array, Array]:
        """Mass, centre of mass and inertia about it, of the shapes unless they are given."""
        masses = [self.number(lump.amount) * lump.volume for lump in link.lumps]
        units = [lump.unit for lump in link.lumps]
        m = sum(masses)
        c = sum((a * np.array(u.com) for a, u in zip(masses, units, strict=True)), np.zeros(3))
        c = c / m if m else c
        about_com = np.zeros((3, 3))
        for a, u in zip(masses, units, strict=True):
            d = np.array(u.com) - c
            about_com += a * (np.array(u.inertia) + d @ d * np.eye(3) - np.outer(d, d))
        if link.mass is not None:
            about_com *= self.number(link.mass) / m if m else 0.0
            m = self.number(link.mass)
        if link.com is not None:
            c = np.array([self.number(x) for x in link.com])
        if link.inertia is not None:
            xx, yy, zz, xy, xz, yz = map(self.number, link.inertia)
            about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return m, c, about_com

    # -- strings, springs, cones, drag -------------------------------------------------------

    def _site(self, name: str, point: Point) -> str:
        """Puts a site on a link; its element in a tendon."""
        at = np.array([self.number(x) for x in point.at])
        link = point.link
        if link in self._stands:
            R, r = self._stands[link]
            link, at = WORLD, r + R @ at
        self.inside[link] += f"<site name={quoteattr(name)} pos={_numbers(at)}/>"
        return f"<site site={quoteattr(name)}/>"

    def _tendon(self, name: str, points: Iterable[Point], how: str, more: str = "") -> None:
        """A tendon through points of links."""
        sites = (self._site(f"{name}.{k}", point) for k, point in enumerate(points))
        self.tendons += f"<spatial name={quoteattr(name)} {how}>{''.join(sites)}{more}</spatial>"

    def _chain(self, chain: ChainRow) -> None:
        """The pieces of a chain as springs of MuJoCo."""
        index = chain.driven_length
        length = self.number(chain.length) if index is None else self.still[index[0]]
        piece = length / chain.pieces
        stiffness, damping = self.number(chain.stiffness), self.number(chain.damping)
        springy = (
            f"springlength={_numbers((piece,))} stiffness={_numbers((stiffness / piece,))} "
            f"damping={_numbers((damping / piece,))}"
        )
        for k, ends in enumerate(pairwise(chain.points)):
            self._tendon(f"{chain.name}.spring.{k}", ends, springy)

    def _string(self, string: StringRow) -> None:
        more, length = "", string.length
        if string.driven_length is not None:
            if self.still is None:
                more, length = self._winch(string), SPOOL
            else:
                length = self.still[string.driven_length[0]]
        limited = f'limited="true" range={self._text((0.0, length))}'
        if string.wire:
            name = quoteattr(string.name)
            limited = ""
            self.wires += f"<tendon name={name} tendon1={name}/>"
        self._tendon(string.name, string.points, limited, more)

    def _winch(self, string: StringRow) -> str:
        """A slide, as far from a place as string is wound in; the rest of the tendon."""
        joint = winch_of(string)
        spool, wound = (f"{string.name}.{end}" for end in ("spool", "wound"))
        mass, moment = _DUST
        self.inside[WORLD] += (
            f"<site name={quoteattr(spool)}/><body name={quoteattr(string.name + '.winch')} "
            f"pos={_numbers((SPOOL, 0.0, 0.0))}><joint name={quoteattr(joint.name)} type=\"slide\" "
            f"axis={_numbers(joint.axis)} armature={_numbers((self._heavy,))}/>"
            f'<inertial mass="{mass}" pos="0 0 0" diaginertia="{moment} {moment} {moment}"/>'
            f"<site name={quoteattr(wound)}/></body>"
        )
        ends = "".join(f"<site site={quoteattr(end)}/>" for end in (spool, wound))
        return f'<pulley divisor="1"/>{ends}'

    def _ball_limit(self, limit: LimitRow) -> None:
        """A cone or a twist."""
        if limit.side == "cone":
            begin, end, length = limit.a, limit.b, 2.0 * np.sin(0.5 * limit.bound)
        else:
            (begin, end), length = cord(limit.b), _LOOSE
        points = self._around(limit.link, begin), Point(limit.link, tuple(end))
        self._tendon(limit.name, points, f'limited="true" range={_numbers((0.0, length))}')

    def _around(self, i: int, at: Array) -> Point:
        """A point of a link's joint frame, on its parent."""
        link = self.tree.links[i]
        R, r = pose_in_parent(link, np.zeros(0), self.number)
        return Point(link.parent, tuple(r + R @ at))

    def _of_joint_and_air(self, i: int, link: Link) -> None:
        """A ball joint's spring, and drag."""
        half = 0.5 * self.number(link.stiffness)
        if half and link.kind == "ball":
            for axis, e in zip("xyz", np.eye(3), strict=True):
                self._tendon(
                    f"{link.joint}.spring.{axis}",
                    (self._around(i, e), Point(i, tuple(e))),
                    f'springlength="0" stiffness={_numbers((half,))}',
                )
        linear, _, angular = map(self.number, link.drag)
        if not linear and not angular:
            return
        m, com, _ = self._mass(link)
        if not self.drags:
            self.inside[WORLD] += '<site name="world"/>'
        air = f"{link.name}.air"
        self._site(air, Point(i, tuple(com if m else np.zeros(3))))
        for strength, gears in ((linear, np.eye(6)[:3]), (angular, np.eye(6)[3:])):
            for gear in gears if strength else ():
                self.drags += (
                    f'<general site={quoteattr(air)} refsite="world" gear={_numbers(gear)} '
                    f'gainprm="0" biastype="affine" biasprm={_numbers((0.0, 0.0, -strength))}/>'
                )

    # -- what cannot be said -----------------------------------------------------------------

    def _impossible(self) -> list[Mistake]:
        found = []
        for string in self.tree.strings:
            if string.max_tension is not None:
                found.append((string.name, "max_tension: MuJoCo has no winch that slips"))
            if self.number(string.restitution):
                found.append((string.name, "restitution: MuJoCo's strings are caught softly"))
        for chain in self.tree.chains:
            if chain.length_index is not None and self.still is None:
                found.append((chain.name, "a chain that is wound: MuJoCo's springs stay as long"))
        for link in self.tree.links:
            if self.number(link.drag[1]):
                found.append((link.name, "quadratic drag: MuJoCo has it for whole models only"))
            if link.role is Role.DRIVEN and self.still is None and link.kind in ("ball", "free"):
                found.append((link.joint, "a driven rotation: MuJoCo gets slides and hinges only"))
        for row in self.tree.drives:
            found.append((row.name, "a drive: MuJoCo gets driven coordinates without one"))
        return [_located(self.marionette, name, f"has {what}") for name, what in found]

    def _text(self, values: Any) -> str:
        return _numbers(map(self.number, values))


def _located(marionette: Marionette, name: str, message: str) -> Mistake:
    """What is the matter with a body, joint or string, with its place in the puppet's file."""
    file, line = marionette.puppet.locate(marionette.puppet.owner_of(name))
    return Mistake(file, line, name, message)


def _section(name: str, inside: str) -> str:
    return f"<{name}>{inside}</{name}>" if inside else ""


def _quaternion(R: Array) -> str:
    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return _numbers((w, x, y, z))


def _numbers(values: Iterable[float]) -> str:
    return '"' + " ".join(repr(float(v)) for v in values) + '"'
