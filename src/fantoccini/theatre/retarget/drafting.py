"""Drafts of mapping files: a guess of the joints and bodies, and lists of all of them.

A mapping says which joint of a skeleton, and which body of a puppet, is which part of a person.
"""

from __future__ import annotations

from collections.abc import Iterator

from fantoccini.base import FileError, StateError
from fantoccini.base.documents import yaml_of
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import Role
from fantoccini.theatre.capture import Capture, Skeleton
from fantoccini.theatre.retarget.bodies import bodies_of_map
from fantoccini.theatre.retarget.figure import BUNDLED_BODIES
from fantoccini.theatre.retarget.finding import Doubt
from fantoccini.theatre.retarget.mapping import BODIES, PARTS, recognise

_COMMENT_COLUMN = 40
"""Column at which comments begin."""


def draft_mapping(clip: Capture, marionette: Marionette | None = None) -> str:
    """Text of a mapping file, with the joints and bodies that were identified.

    Other parts are empty. Comments contain doubts, all joints, and the bodies of a puppet whose
    names are not those of the bundled marionette.

    Args:
        clip: clip whose joints are mapped.
        marionette: puppet that will follow it.
    """
    name = clip.name or "clip"
    try:
        recognised = recognise(clip.skeleton, name, clip.positions)
        joints, doubts = dict(recognised.mapping.joints), recognised.doubts
        comment = "Found by shape." if recognised.by_shape else "Names are those of a bundled file."
    except FileError:
        joints, doubts, comment = {}, (), "No person has this shape: fill in the joints."
    lines = [
        f"# Joints of {name}. {comment}",
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
    return f"{text:<{_COMMENT_COLUMN}}  # {'; '.join(reasons)}" if reasons else text


def _indented(skeleton: Skeleton) -> Iterator[str]:
    """Names of joints, indented by their depth."""
    depths = list[int]()
    for name, parent in zip(skeleton.names, skeleton.parents, strict=True):
        depths.append(depths[parent] + 1 if parent >= 0 else 0)
        yield f"{'  ' * depths[-1]}{name}"


def _puppet_lines(marionette: Marionette) -> list[str]:
    """Lines of the puppet's bodies; none if their names are those of the bundled marionette."""
    body_names = [link.name for link in marionette.tree.links if link.role is Role.DYNAMIC]
    if all(body_file.body in body_names for body_file in BUNDLED_BODIES.values()):
        return []
    try:
        bodies = bodies_of_map(marionette)
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
    return [*lines, "", "# All bodies:", *(f"#   {body}" for body in body_names)]


def _quoted(name: str) -> str:
    """Name in YAML, in quotes if necessary."""
    return yaml_of([name]).strip()[1:-1]


def _numbers(values: tuple[float, float, float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
