"""Figures: the bodies of a puppet as parts of a person, with the places of its joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, unit
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import Role
from fantoccini.motion import State
from fantoccini.theatre.retarget.mapping import BODIES, SIDES, BodyFile

_USUAL = {
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
LIMBS = (
    ("shoulder", "elbow", "hand", "upper_arm", "forearm"),
    ("hip", "knee", "foot", "thigh", "shin"),
)
"""Begin, middle and end of a limb, and the bodies between them."""

Point = tuple[str, tuple[float, float, float]]
"""A body, and a point in its frame."""


@dataclass(frozen=True, eq=False)
class Figure:
    """A puppet as a person: trunk, head, and limbs of two bodies.

    Attributes:
        marionette: puppet.
        bodies: part -> body.
        points: part of a person -> body and point on it; in addition to :data:`PARTS` there are
            ``neck``, and ``trunk`` between the hips.
        axes: (3, 3) columns forward, left, up in the frame of the trunk.
        forward: (3,) direction in which the puppet faces at the start.
        places: part of a person -> (3,) position at the start [m].
    """

    marionette: Marionette
    bodies: Mapping[str, str]
    points: Mapping[str, Point]
    axes: Array
    forward: Array
    places: Mapping[str, Array]

    @property
    def leg(self) -> float:
        """Length from hip over knee to foot [m]."""
        x = self.places
        return float(
            np.linalg.norm(x["hip_left"] - x["knee_left"])
            + np.linalg.norm(x["knee_left"] - x["foot_left"])
        )

    @property
    def height(self) -> float:
        """Length from the feet over straight legs and trunk to the head's end [m]."""
        x = self.places
        trunk = np.linalg.norm(x["neck"] - x["trunk"])
        return self.leg + float(trunk + np.linalg.norm(x["head"] - x["neck"]))

    def at(self, part: str) -> Array:
        """(3,) point of a part in the frame of its body [m]."""
        return np.array(self.points[part][1])


def figure_of(
    marionette: Marionette, start: State, bodies: Mapping[str, BodyFile] | None = None, of: str = ""
) -> Figure:
    """Figure of a puppet, or of the member of a scene that is a person.

    Args:
        marionette: puppet or scene.
        start: state at rest.
        bodies: part -> body, if their names differ from those of the bundled marionette.
        of: name of the scene's member; by default the only one that is a person.

    Raises:
        StateError: the puppet lacks a body, its limbs are not joined as a person's, a limb has no
            end, or several members are persons.
        UnknownNameError: the scene has no such member.
    """
    names = [link.name for link in marionette.tree.links if link.role is Role.DYNAMIC]
    body_files = _of_member(marionette, {**_USUAL, **(bodies or {})}, names, of)
    if missing := [part for part in BODIES if body_files[part].body not in names]:
        raise StateError(
            f"{marionette.name} has no body {body_files[missing[0]].body!r}, the {missing[0]} of a "
            f"person; name it under `puppet` in a mapping file: the bodies are {', '.join(names)}"
        )
    links = {part: marionette.link_index(body_files[part].body) for part in BODIES}
    pose = marionette.poses(start.q_D[None], start.q_K[None])[0]

    def within(part: str, other: str) -> Point:
        """Beginning of another part, in the frame of a part."""
        turn, at = pose[links[part]][:, :3], pose[links[part]][:, 3]
        x, y, z = (turn.T @ (pose[links[other]][:, 3] - at)).tolist()
        return body_files[part].body, (x, y, z)

    def end(part: str) -> Point:
        place = body_files[part].end
        if place is None:
            raise StateError(f"the mapping has no `end` of {part}: the point that is followed")
        return body_files[part].body, place

    points = {"neck": within("trunk", "head"), "head": end("head")}
    _check_parent(marionette, body_files, "head", "trunk")
    for side in SIDES:
        for begin, middle, last, upper, lower in LIMBS:
            upper, lower = f"{upper}_{side}", f"{lower}_{side}"
            _check_parent(marionette, body_files, upper, "trunk")
            _check_parent(marionette, body_files, lower, upper)
            points[f"{begin}_{side}"] = within("trunk", upper)
            points[f"{middle}_{side}"] = within(upper, lower)
            points[f"{last}_{side}"] = end(lower)
    a, b, c, d = (
        np.array(points[p][1]) for p in ("shoulder_left", "shoulder_right", "hip_left", "hip_right")
    )
    x, y, z = (0.5 * (c + d)).tolist()
    points["trunk"] = body_files["trunk"].body, (x, y, z)
    axes = axes_of(a[None], b[None], c[None], d[None])[0]
    places = {}
    for part, (body, at) in points.items():
        frame = pose[marionette.link_index(body)]
        places[part] = frame[:, :3] @ np.array(at) + frame[:, 3]
    forward = pose[links["trunk"]][:, :3] @ axes[:, 0]
    named = {part: body_files[part].body for part in BODIES}
    return Figure(marionette, named, points, axes, forward, places)


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
        raise StateError(f"several members are persons: {', '.join(persons)}; say which with `of`")
    return within(persons[0]) if persons else dict(bodies)


def axes_of(
    shoulder_left: Array, shoulder_right: Array, hip_left: Array, hip_right: Array
) -> Array:
    """(T, 3, 3) columns forward, left, up of trunks with these (T, 3) positions.

    Up points from between the hips to between the shoulders; left is the mean of both lines across.
    """
    up = unit(shoulder_left + shoulder_right - hip_left - hip_right)
    across = unit(shoulder_left - shoulder_right) + unit(hip_left - hip_right)
    forward = unit(np.cross(across, up))
    return np.stack([forward, np.cross(up, forward), up], axis=-1)


def _check_parent(
    marionette: Marionette, body_files: Mapping[str, BodyFile], part: str, above: str
) -> None:
    links = marionette.tree.links
    link = links[marionette.link_index(body_files[part].body)]
    parent = links[link.parent].name if link.parent >= 0 else "the world"
    if parent != body_files[above].body:
        raise StateError(
            f"{part} of a person is {link.name}, which hangs at {parent}; needed: at "
            f"{body_files[above].body}, its {above}"
        )
