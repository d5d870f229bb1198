"""Figures: the bodies of a puppet as parts of a person, with the places of its joints."""

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
        x = self.positions
        return float(
            np.linalg.norm(x["hip_left"] - x["knee_left"])
            + np.linalg.norm(x["knee_left"] - x["foot_left"])
        )

    @property
    def height(self) -> float:
        """Length from the feet over straight legs and trunk to the head's end [m]."""
        x = self.positions
        trunk = np.linalg.norm(x["neck"] - x["trunk"])
        return self.leg_length + float(trunk + np.linalg.norm(x["head"] - x["neck"]))

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
    names = [link.name for link in marionette.tree.links if link.role is Role.DYNAMIC]
    body_files = _of_member(marionette, {**BUNDLED_BODIES, **(bodies or {})}, names, of)
    if not bodies and not of and any(file.body not in names for file in body_files.values()):
        with contextlib.suppress(StateError):
            body_files = bodies_of_map(marionette)
    if missing := [part for part in BODIES if body_files[part].body not in names]:
        raise StateError(
            f"{marionette.name} has no body {body_files[missing[0]].body!r}, the {missing[0]} of a "
            f"person; name it under `puppet` in a mapping file: the bodies are {', '.join(names)}"
        )
    links = {part: marionette.link_index(body_files[part].body) for part in BODIES}
    links["hips"] = _hips(marionette, links)
    _check_joined(marionette, links)
    pose = marionette.poses(start.q_D[None], start.q_K[None])[0]
    points = _points(marionette, body_files, links, pose)
    places = {}
    for part, (body, point) in points.items():
        frame = pose[marionette.link_index(body)]
        places[part] = frame[:, :3] @ np.array(point) + frame[:, 3]
    named = {part: body_files[part].body for part in BODIES}
    if links["hips"] == links["trunk"]:
        lines = [points[f"{part}_{side}"][1] for part in ("shoulder", "hip") for side in SIDES]
        axes, lower = axes_of(*(np.array(x)[None] for x in lines))[0], None
    else:
        named["hips"] = marionette.tree.links[links["hips"]].name
        axes, lower = _with_waist(marionette, links, pose, places)
    forward = pose[links["trunk"]][:, :3] @ axes[:, 0]
    return Figure(marionette, named, points, axes, forward, places, lower)


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

    def within(part: str, other: str) -> Point:
        """Beginning of another part, in the frame of a part."""
        x, y, z = _in_frame(pose[links[part]], pose[links[other]][:, 3]).tolist()
        return tree.links[links[part]].name, (x, y, z)

    def end(part: str) -> Point:
        place = body_files[part].end
        if place is None:
            raise StateError(f"the mapping has no `end` of {part}: the point that is followed")
        return body_files[part].body, place

    points = {"neck": within("trunk", "head"), "head": end("head")}
    for side in SIDES:
        for (begin, middle, last, upper, lower), at in zip(LIMBS, ("trunk", "hips"), strict=True):
            upper, lower = f"{upper}_{side}", f"{lower}_{side}"
            points[f"{begin}_{side}"] = within(at, upper)
            points[f"{middle}_{side}"] = within(upper, lower)
            points[f"{last}_{side}"] = end(lower)
    hips = [np.array(points[f"hip_{side}"][1]) for side in SIDES]
    x, y, z = (0.5 * (hips[0] + hips[1])).tolist()
    points["trunk"] = tree.links[links["hips"]].name, (x, y, z)
    return points


def _with_waist(
    marionette: Marionette, links: Mapping[str, int], pose: Array, x: Mapping[str, Array]
) -> tuple[Array, LowerTrunk]:
    """Axes of the upper half of a trunk in its frame, and the lower half."""
    trunk, hips = pose[links["trunk"]], pose[links["hips"]]
    lines = [x[f"{part}_left"] - x[f"{part}_right"] for part in ("shoulder", "hip")]
    up = x["shoulder_left"] + x["shoulder_right"] - x["hip_left"] - x["hip_right"]
    upper, lower = (axes_along(up[None], line[None])[0] for line in lines)
    above = marionette.tree.ancestors(links["hips"])
    joint = links["trunk"]
    if joint in above:  # the trunk carries the hips
        joint = above[above.index(joint) - 1]
    waist = pose[joint][:, 3]
    return trunk[:, :3].T @ upper, LowerTrunk(
        hips[:, :3].T @ lower, _in_frame(hips, waist), _in_frame(trunk, waist)
    )


def _in_frame(frame: Array, point: Array) -> Array:
    """(3,) point in a frame (3, 4)."""
    return np.asarray(frame[:, :3].T @ (point - frame[:, 3]))


def _of_member(
    marionette: Marionette, bodies: Mapping[str, BodyFile], names: Sequence[str], of: str
) -> dict[str, BodyFile]:
    """The bodies, with the prefix of a scene's member where a name needs it."""
    members = marionette.puppet.members
    if of and of not in members:
        raise UnknownNameError("member of a scene", of, members)

    def within(member: str) -> dict[str, BodyFile]:
        renamed = {}
        for part, body_file in bodies.items():
            own = body_file.body if body_file.body in names else f"{member}.{body_file.body}"
            renamed[part] = body_file.model_copy(update={"body": own})
        return renamed

    if of:
        return within(of)
    persons = [m for m in members if all(within(m)[part].body in names for part in BODIES)]
    if len(persons) > 1 and within(persons[0]) != within(persons[1]):
        raise StateError(f"several members are persons: {', '.join(persons)}; name one with `of`")
    return within(persons[0]) if persons else dict(bodies)


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


def _hips(marionette: Marionette, links: Mapping[str, int]) -> int:
    """Link that carries both thighs: the trunk, or the body below a waist."""
    tree = marionette.tree
    left, right = (tree.ancestors(links[f"thigh_{side}"]) for side in SIDES)
    both = next((k for k in left if k in right and tree.links[k].role is Role.DYNAMIC), WORLD)
    trunk = links["trunk"]
    if both == WORLD or not set(tree.ancestors(both)) & set(tree.ancestors(trunk)):
        name = "the world" if both == WORLD else tree.links[both].name
        raise StateError(
            f"the thighs of a person are {tree.links[links['thigh_left']].name} and "
            f"{tree.links[links['thigh_right']].name}, which hang at {name}; needed: at "
            f"{tree.links[trunk].name}, the trunk, or at a body jointed to it"
        )
    return both


def _check_joined(marionette: Marionette, links: Mapping[str, int]) -> None:
    """Raises StateError if a part is joined to another part than in a person."""
    tree = marionette.tree
    above = {"head": "trunk"}
    for side in SIDES:
        for (*_, upper, lower), at in zip(LIMBS, ("trunk", "hips"), strict=True):
            above |= {f"{upper}_{side}": at, f"{lower}_{side}": f"{upper}_{side}"}
    for part, wanted in above.items():
        parent = next((k for k in tree.ancestors(links[part])[1:] if k in links.values()), WORLD)
        if parent != links[wanted]:
            name = "the world" if parent == WORLD else tree.links[parent].name
            raise StateError(
                f"{part} of a person is {tree.links[links[part]].name}, which hangs at {name}; "
                f"needed: at {tree.links[links[wanted]].name}, its {wanted}"
            )
