"""Figures: the bodies of a puppet as parts of a person, with the places of its joints.

A waist is a joint that divides the trunk. A member is a puppet of a scene. A marionette is a puppet
with its compiled equations; `marionette.puppet` is the description in its file. In names, D stands
for dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and
lengths of strings, driven joints. A link is a body on its joint.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, unit
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import WORLD, Role
from fantoccini.motion import State
from fantoccini.theatre.retarget.bodies import bodies_of_map
from fantoccini.theatre.retarget.mapping import BODIES, LIMBS, SIDES, BodyFile

BUNDLED_BODIES = {
    "trunk": BodyFile(body="torso"),
    "head": BodyFile(body="skull", end=(0.0, 0.0, 0.137)),
    **{f"upper_arm_{side}": BodyFile(body=f"upper_arm_{side}") for side in SIDES},
    **{
        f"forearm_{side}": BodyFile(body=f"forearm_{side}", end=(0.0, 0.0, -0.09)) for side in SIDES
    },
    **{f"thigh_{side}": BodyFile(body=f"thigh_{side}") for side in SIDES},
    **{f"shin_{side}": BodyFile(body=f"shin_{side}", end=(0.0, 0.0, -0.126)) for side in SIDES},
}
"""Bodies of the bundled marionette."""
Point = tuple[str, tuple[float, float, float]]
"""A body, and a point in its frame."""


@dataclass(frozen=True, eq=False)
class LowerTrunk:
    """The body with the hips, if it is not that with the shoulders.

    Attributes:
        axes: (3, 3) columns forward, left, up in its frame.
        waist: (3,) joint at which the trunk turns, in its frame at the start [m].
        waist_in_trunk: (3,) the same joint, in the frame of the trunk [m].
    """

    axes: Array
    waist: Array
    waist_in_trunk: Array


@dataclass(frozen=True, eq=False)
class Figure:
    """A puppet as a person: trunk, head, and limbs.

    Bodies between two parts, such as those of a neck or of a hip of several joints, keep their
    pose of the start.

    Attributes:
        marionette: puppet.
        bodies: part -> body; with a waist, ``hips`` is the body with the hips.
        points: part of a person -> body and point on it; in addition to :data:`PARTS` there are
            ``neck``, and ``trunk`` between the hips.
        axes: (3, 3) columns forward, left, up in the frame of the trunk.
        forward: (3,) direction in which the puppet faces at the start.
        positions: part of a person -> (3,) position at the start [m].
        lower_trunk: the lower half of a trunk with a waist; None for a trunk of one body.
    """

    marionette: Marionette
    bodies: Mapping[str, str]
    points: Mapping[str, Point]
    axes: Array
    forward: Array
    positions: Mapping[str, Array]
    lower_trunk: LowerTrunk | None = None

    @property
    def leg_length(self) -> float:
        """Length from hip over knee to foot [m]."""
        positions = self.positions
        return float(
            np.linalg.norm(positions["hip_left"] - positions["knee_left"])
            + np.linalg.norm(positions["knee_left"] - positions["foot_left"])
        )

    @property
    def height(self) -> float:
        """Length from the feet over straight legs and trunk to the head's end [m]."""
        positions = self.positions
        trunk = np.linalg.norm(positions["neck"] - positions["trunk"])
        return self.leg_length + float(
            trunk + np.linalg.norm(positions["head"] - positions["neck"])
        )

    def local_point(self, part: str) -> Array:
        """(3,) point of a part in the frame of its body [m]."""
        return np.array(self.points[part][1])


def figure_of(
    marionette: Marionette, start: State, bodies: Mapping[str, BodyFile] | None = None, of: str = ""
) -> Figure:
    """Figure of a puppet, or of the member of a scene that is a person.

    Args:
        marionette: puppet or scene.
        start: state at rest.
        bodies: part -> body; by default those named as in the bundled marionette, else those
            of the body map.
        of: name of the scene's member; by default the only one that is a person.

    Raises:
        StateError: the puppet lacks a body, its limbs are not joined as a person's, a limb has no
            end, or several members are persons.
        UnknownNameError: the scene has no such member.
    """
    body_names = [link.name for link in marionette.tree.links if link.role is Role.DYNAMIC]
    body_files = _bodies_of_member(marionette, {**BUNDLED_BODIES, **(bodies or {})}, body_names, of)
    if not bodies and not of and any(file.body not in body_names for file in body_files.values()):
        with contextlib.suppress(StateError):
            body_files = bodies_of_map(marionette)
    if missing := [part for part in BODIES if body_files[part].body not in body_names]:
        raise StateError(
            f"{marionette.name} has no body {body_files[missing[0]].body!r}, the {missing[0]} of a "
            "person; name it under `puppet` in a mapping file: the bodies are "
            f"{', '.join(body_names)}"
        )
    links = {part: marionette.link_index(body_files[part].body) for part in BODIES}
    links["hips"] = _hips_link(marionette, links)
    _check_parents(marionette, links)
    pose = marionette.poses(start.q_D[None], start.q_K[None])[0]
    points = _points(marionette, body_files, links, pose)
    places = {}
    for part, (body, point) in points.items():
        frame = pose[marionette.link_index(body)]
        places[part] = frame[:, :3] @ np.array(point) + frame[:, 3]
    bodies_by_part = {part: body_files[part].body for part in BODIES}
    if links["hips"] == links["trunk"]:
        attachment_points = [
            points[f"{part}_{side}"][1] for part in ("shoulder", "hip") for side in SIDES
        ]
        axes, lower = axes_of(*(np.array(x)[None] for x in attachment_points))[0], None
    else:
        bodies_by_part["hips"] = marionette.tree.links[links["hips"]].name
        axes, lower = _with_waist(marionette, links, pose, places)
    forward = pose[links["trunk"]][:, :3] @ axes[:, 0]
    return Figure(marionette, bodies_by_part, points, axes, forward, places, lower)


def _points(
    marionette: Marionette,
    body_files: Mapping[str, BodyFile],
    links: Mapping[str, int],
    pose: Array,
) -> dict[str, Point]:
    """Part -> body and point on it; see :attr:`Figure.points`.

    Raises:
        StateError: a limb has no end.
    """
    tree = marionette.tree

    def start_of(part: str, carried_part: str) -> Point:
        """Beginning of another part, in the frame of a part."""
        x, y, z = _point_in_frame(pose[links[part]], pose[links[carried_part]][:, 3]).tolist()
        return tree.links[links[part]].name, (x, y, z)

    def end_of(part: str) -> Point:
        end_point = body_files[part].end
        if end_point is None:
            raise StateError(f"the mapping has no `end` of {part}: the point that is followed")
        return body_files[part].body, end_point

    points = {"neck": start_of("trunk", "head"), "head": end_of("head")}
    for side in SIDES:
        for (start_part, middle_part, end_part, upper_body, lower_body), carrier in zip(
            LIMBS, ("trunk", "hips"), strict=True
        ):
            upper_body, lower_body = f"{upper_body}_{side}", f"{lower_body}_{side}"
            points[f"{start_part}_{side}"] = start_of(carrier, upper_body)
            points[f"{middle_part}_{side}"] = start_of(upper_body, lower_body)
            points[f"{end_part}_{side}"] = end_of(lower_body)
    hips = [np.array(points[f"hip_{side}"][1]) for side in SIDES]
    x, y, z = (0.5 * (hips[0] + hips[1])).tolist()
    points["trunk"] = tree.links[links["hips"]].name, (x, y, z)
    return points


def _with_waist(
    marionette: Marionette, links: Mapping[str, int], pose: Array, positions: Mapping[str, Array]
) -> tuple[Array, LowerTrunk]:
    """Axes of the upper half of a trunk in its frame, and the lower half."""
    trunk, hips = pose[links["trunk"]], pose[links["hips"]]
    lines_across = [
        positions[f"{part}_left"] - positions[f"{part}_right"] for part in ("shoulder", "hip")
    ]
    up = (
        positions["shoulder_left"]
        + positions["shoulder_right"]
        - positions["hip_left"]
        - positions["hip_right"]
    )
    upper_axes, lower_axes = (axes_along(up[None], line[None])[0] for line in lines_across)
    ancestors = marionette.tree.ancestors(links["hips"])
    joint = links["trunk"]
    if joint in ancestors:  # the trunk carries the hips
        joint = ancestors[ancestors.index(joint) - 1]
    waist = pose[joint][:, 3]
    return trunk[:, :3].T @ upper_axes, LowerTrunk(
        hips[:, :3].T @ lower_axes, _point_in_frame(hips, waist), _point_in_frame(trunk, waist)
    )


def _point_in_frame(frame: Array, point: Array) -> Array:
    """(3,) point in a frame (3, 4)."""
    return np.asarray(frame[:, :3].T @ (point - frame[:, 3]))


def _bodies_of_member(
    marionette: Marionette, bodies: Mapping[str, BodyFile], names: Sequence[str], of: str
) -> dict[str, BodyFile]:
    """The bodies, with the prefix of a scene's member where a name needs it."""
    members = marionette.puppet.members
    if of and of not in members:
        raise UnknownNameError("member of a scene", of, members)

    def with_prefix(member: str) -> dict[str, BodyFile]:
        renamed = {}
        for part, body_file in bodies.items():
            body_name = body_file.body if body_file.body in names else f"{member}.{body_file.body}"
            renamed[part] = body_file.model_copy(update={"body": body_name})
        return renamed

    if of:
        return with_prefix(of)
    persons = [m for m in members if all(with_prefix(m)[part].body in names for part in BODIES)]
    if len(persons) > 1 and with_prefix(persons[0]) != with_prefix(persons[1]):
        raise StateError(f"several members are persons: {', '.join(persons)}; name one with `of`")
    return with_prefix(persons[0]) if persons else dict(bodies)


def axes_of(
    shoulder_left: Array, shoulder_right: Array, hip_left: Array, hip_right: Array
) -> Array:
    """(T, 3, 3) columns forward, left, up of trunks with these (T, 3) positions.

    Up points from between the hips to between the shoulders; left is the mean of both lines across.
    """
    across = unit(shoulder_left - shoulder_right) + unit(hip_left - hip_right)
    return axes_along(shoulder_left + shoulder_right - hip_left - hip_right, across)


def axes_along(up: Array, across: Array) -> Array:
    """(T, 3, 3) columns forward, left, up from (T, 3) vectors up, and across to the left."""
    up = unit(up)
    forward = unit(np.cross(across, up))
    return np.stack([forward, np.cross(up, forward), up], axis=-1)


def _hips_link(marionette: Marionette, links: Mapping[str, int]) -> int:
    """Link that carries both thighs: the trunk, or the body below a waist."""
    tree = marionette.tree
    left, right = (tree.ancestors(links[f"thigh_{side}"]) for side in SIDES)
    common = next((k for k in left if k in right and tree.links[k].role is Role.DYNAMIC), WORLD)
    trunk = links["trunk"]
    if common == WORLD or not set(tree.ancestors(common)) & set(tree.ancestors(trunk)):
        name = "the world" if common == WORLD else tree.links[common].name
        raise StateError(
            f"the thighs of a person are {tree.links[links['thigh_left']].name} and "
            f"{tree.links[links['thigh_right']].name}, which hang at {name}; needed: at "
            f"{tree.links[trunk].name}, the trunk, or at a body jointed to it"
        )
    return common


def _check_parents(marionette: Marionette, links: Mapping[str, int]) -> None:
    """Raises StateError if a part is joined to another part than in a person."""
    tree = marionette.tree
    parents = {"head": "trunk"}
    for side in SIDES:
        for (*_, upper, lower), carrier in zip(LIMBS, ("trunk", "hips"), strict=True):
            parents |= {f"{upper}_{side}": carrier, f"{lower}_{side}": f"{upper}_{side}"}
    for part, parent_part in parents.items():
        parent = next((k for k in tree.ancestors(links[part])[1:] if k in links.values()), WORLD)
        if parent != links[parent_part]:
            name = "the world" if parent == WORLD else tree.links[parent].name
            raise StateError(
                f"{part} of a person is {tree.links[links[part]].name}, which hangs at {name}; "
                f"needed: at {tree.links[links[parent_part]].name}, its {parent_part}"
            )
