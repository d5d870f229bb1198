"""Mapping files to fill in: a guess of the joints and bodies, and lists of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from fantoccini.base import FileError, StateError
from fantoccini.base.documents import yaml_of
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import Role, measure, shape_box
from fantoccini.theatre.capture import Capture, Skeleton
from fantoccini.theatre.retarget.figure import LIMBS, USUAL
from fantoccini.theatre.retarget.finding import Doubt, guess_joints
from fantoccini.theatre.retarget.mapping import BODIES, PARTS, SIDES, BodyFile, recognise
from fantoccini.theatre.retarget.naming import END

_MAX_NAME = 40
"""Width of a line before its comment."""


def draft_mapping(clip: Capture, marionette: Marionette | None = None) -> str:
    """Text of a mapping file, with the joints and bodies that are found.

    Parts that are not found stay empty, and doubts stand beside them as comments. Comments list all
    joints, and the bodies of a puppet whose names are not those of the bundled marionette.

    Args:
        clip: clip whose joints are mapped.
        marionette: puppet that will follow it.
    """
    name = clip.name or "clip"
    try:
        recognised = recognise(clip.skeleton, name, clip.positions)
        joints, doubts = dict(recognised.mapping.joints), recognised.doubts
        about = "Found by shape." if recognised.by_shape else "Joints called as in a bundled file."
    except FileError:
        joints, doubts, about = {}, (), "No person has this shape: fill in the joints."
    lines = [
        f"# Joints of {name}. {about}",
        *(f"# Doubtful: {doubt}" for doubt in doubts if not doubt.part),
        "mapping: mine",
        "joints:",
        *(_line(part, joints.get(part), doubts) for part in PARTS),
    ]
    if marionette is not None:
        lines += _puppet_lines(marionette)
    lines += ["", "# All joints:", *(f"#   {joint}" for joint in _indented(clip.skeleton))]
    return "\n".join(lines) + "\n"


def _line(part: str, joint: str | None, doubts: tuple[Doubt, ...]) -> str:
    """Line of a part, with its doubts as a comment."""
    text = f"  {part}:" if joint is None else f"  {part}: {_quoted(joint)}"
    reasons = [doubt.reason for doubt in doubts if doubt.part == part]
    if joint is None:
        reasons.append("which joint?")
    return f"{text:<{_MAX_NAME}}  # {'; '.join(reasons)}" if reasons else text


def _indented(skeleton: Skeleton) -> Iterator[str]:
    depths = list[int]()
    for name, parent in zip(skeleton.names, skeleton.parents, strict=True):
        depths.append(depths[parent] + 1 if parent >= 0 else 0)
        yield f"{'  ' * depths[-1]}{name}"


def _puppet_lines(marionette: Marionette) -> list[str]:
    """Lines of the puppet's bodies; none if they are called as those of the bundled marionette."""
    names = [link.name for link in marionette.tree.links if link.role is Role.DYNAMIC]
    if all(body_file.body in names for body_file in USUAL.values()):
        return []
    try:
        bodies = _guessed_bodies(marionette)
    except StateError:
        bodies = {}
    lines = ["puppet:"]
    for part in BODIES:
        if part not in bodies:
            lines.append(f"  {part}:  # which body? {{body: NAME}}")
            continue
        body_file = bodies[part]
        end = "" if body_file.end is None else f", end: [{_numbers(body_file.end)}]"
        lines.append(f"  {part}: {{body: {_quoted(body_file.body)}{end}}}")
    return [*lines, "", "# All bodies:", *(f"#   {body}" for body in names)]


def _quoted(name: str) -> str:
    """A name in YAML, in quotes where it needs them."""
    return yaml_of([name]).strip()[1:-1]


def _numbers(values: tuple[float, float, float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


def _guessed_bodies(marionette: Marionette) -> dict[str, BodyFile]:
    """Part -> body and end, by the shape of the puppet in its start pose.

    Raises:
        StateError: the puppet has not the shape of a person.
    """
    tree = marionette.tree
    poses = measure(tree, marionette.number).poses
    bodies = [k for k, link in enumerate(tree.links) if link.role is Role.DYNAMIC]
    index = {k: i for i, k in enumerate(bodies)}
    tips = {k: tip for k in bodies if (tip := _tip(marionette, k)) is not None}
    names = [tree.links[k].name for k in bodies] + [f"{tree.links[k].name}{END}" for k in tips]
    parents = [index.get(tree.links[k].parent, -1) for k in bodies] + [index[k] for k in tips]
    places = [poses[k][:, 3] for k in bodies]
    places += [poses[k][:, :3] @ tip + poses[k][:, 3] for k, tip in tips.items()]
    offsets = [
        at - places[parent] if parent >= 0 else np.zeros(3)
        for at, parent in zip(places, parents, strict=True)
    ]
    joints = guess_joints(Skeleton(tuple(names), tuple(parents), np.array(offsets))).joints
    return dict(_body_files(joints, names, bodies, tips, parents))


def _body_files(
    joints: Mapping[str, int],
    names: list[str],
    bodies: list[int],
    tips: Mapping[int, np.ndarray],
    parents: list[int],
) -> Iterator[tuple[str, BodyFile]]:
    """Parts with their bodies, which begin at the joints of a person."""

    def file(joint: int, has_end: bool) -> BodyFile:
        tip = tips.get(bodies[joint]) if has_end else None
        end = None if tip is None else (float(tip[0]), float(tip[1]), float(tip[2]))
        return BodyFile(body=names[joint], end=end)

    yield "trunk", file(parents[joints["shoulder_left"]], False)
    yield "head", file(joints["head"], True)
    for side in SIDES:
        for begin, middle, _, upper, lower in LIMBS:
            yield f"{upper}_{side}", file(joints[f"{begin}_{side}"], False)
            yield f"{lower}_{side}", file(joints[f"{middle}_{side}"], True)


def _tip(marionette: Marionette, link: int) -> np.ndarray | None:
    """(3,) end of a body opposite its origin, in its frame [m]; None if it has no shapes."""
    boxes = [shape_box(shape, np.eye(3, 4)) for shape in marionette.tree.links[link].shapes]
    if not boxes:
        return None
    corners = np.array(boxes)
    return np.asarray(corners[:, 0].min(axis=0) + corners[:, 1].max(axis=0))
