"""Conversion of a URDF file, read by yourdfpy, to a puppet file.

URDF is the format of robots in ROS: links (bodies) connected by joints.
"""

from __future__ import annotations

import io
import logging
import math
from types import ModuleType
from typing import Any

import numpy as np

from fantoccini.base import (
    Array,
    ExchangeError,
    MissingLibraryError,
    Mistake,
    did_you_mean,
    rotation,
)
from fantoccini.output.exchange.draft import (
    Draft,
    body_data,
    inertia_data,
    number_or_zero,
    pose_keys,
    written_number,
    written_numbers,
)
from fantoccini.output.exchange.imported import ImportedPuppet
from fantoccini.output.exchange.model_file import XACRO, Element, ModelFile
from fantoccini.output.exchange.urdf_masses import add_masses
from fantoccini.output.exchange.urdf_shapes import add_shapes
from fantoccini.output.exchange.urdf_text import SOLIDS, reduce_urdf

_JOINT_TYPES = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "floating": "free",
    "planar": "revolute",
    "fixed": "fixed",
}
"""Joint type of URDF -> joint type of a puppet."""

_VALUE_COUNTS = {
    ("origin", "xyz"): (3,),
    ("origin", "rpy"): (3,),
    ("axis", "xyz"): (3,),
    ("box", "size"): (3,),
    ("mesh", "scale"): (1, 3),
    ("color", "rgba"): (4,),
    ("mass", "value"): (1,),
    ("cylinder", "radius"): (1,),
    ("cylinder", "length"): (1,),
    ("sphere", "radius"): (1,),
    ("capsule", "radius"): (1,),
    ("capsule", "length"): (1,),
    ("limit", "lower"): (1,),
    ("limit", "upper"): (1,),
    ("limit", "effort"): (1,),
    ("limit", "velocity"): (1,),
    ("dynamics", "damping"): (1,),
    ("dynamics", "friction"): (1,),
    ("mimic", "multiplier"): (1,),
    ("mimic", "offset"): (1,),
    **{("inertia", f"i{ab}"): (1,) for ab in ("xx", "yy", "zz", "xy", "xz", "yz")},
}
"""(tag, attribute) -> allowed numbers of values."""

_REQUIRED_ATTRIBUTES = {
    "robot": ("name",),
    "link": ("name",),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "mesh": ("filename",),
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}
"""Required attributes of elements; for links and joints only at the top level."""

_INERTIA_TOLERANCE = 1e-9
"""Relative error of a moment of inertia that a puppet file accepts as rounding."""

_OMITTED_TAGS = {
    "transmission": "left out: joints move freely",
    "gazebo": "left out",
    "ros2_control": "left out",
    "sensor": "left out",
}
"""Elements without counterpart."""


def urdf_puppet(file: ModelFile, density: float | None = None) -> ImportedPuppet:
    """Converts a URDF file to a puppet file.

    Args:
        file: file of the model.
        density: see :func:`add_masses` [kg/m^3].

    Raises:
        ExchangeError: the file is not URDF, or has something that no puppet can have.
        MissingLibraryError: yourdfpy is not installed.
    """
    _check_elements(file)
    urdf_text = reduce_urdf(file)
    robot = _parse_robot(file, urdf_text.text)
    draft = Draft(file, robot.name)
    for name, message, line in urdf_text.left_out:
        draft.note("link", name, message, line)
    converter = _RobotConverter(draft, robot, urdf_text.capsules)
    converter.add_bodies()
    links = {converter.names[link.name]: link for link in robot.links}
    add_masses(draft, links, density)
    for element in file.elements:
        if element.depth == 1 and element.tag in _OMITTED_TAGS:
            name = element.attributes.get("name", element.attributes.get("reference", ""))
            draft.note(element.tag, name, _OMITTED_TAGS[element.tag], element.line)
    header = [
        f"{draft.name}: converted from the URDF file {file.path.name}.",
        "The first link is fixed to the world; give its body `joint: {type: free}` to release it.",
    ]
    return draft.finish(header)


class _RobotConverter:
    """Converter of a robot's links and joints to a puppet's bodies.

    Args:
        draft: draft of the puppet.
        robot: robot of yourdfpy.
        capsules: see :class:`UrdfText`.
    """

    def __init__(self, draft: Draft, robot: Any, capsules: set[tuple[str, str, int]]):
        self.draft, self.robot, self.file = draft, robot, draft.file
        self.capsules = capsules
        self.names: dict[str, str] = {}
        visual_materials = (v.material for link in robot.links for v in link.visuals)
        self.materials: dict[str, Any] = {}
        for material in (*robot.materials, *visual_materials):
            if material is None or not material.name:
                continue  # it belongs to its visual only
            if material.color or material.texture:
                self.materials.setdefault(material.name, material)

    def add_bodies(self) -> None:
        """Adds all bodies. URDF has no strings."""
        links = {link.name: link for link in self.robot.links}
        children = self._joints_by_child(links)
        roots = [link for name, link in links.items() if name not in children]
        for link in self.robot.links:
            is_empty = link.inertial is None and not link.visuals and not link.collisions
            if link.name == "world" and is_empty and link in roots:
                self.names["world"] = "world"
                continue
            line = self.file.line_of("link", link.name)
            self.names[link.name] = self.draft.unique_name("link", link.name, line=line)
        for root in roots:
            if self.names[root.name] != "world":
                self._add_body(root, {"name": self.names[root.name]})
        for joint in self.robot.joints:
            self._add_joint(joint, links[joint.child])

    def _joints_by_child(self, links: dict[str, Any]) -> dict[str, Any]:
        """Child -> its joint; raises ExchangeError if links and joints are not a tree."""
        mistakes: list[Mistake] = []
        joint_of: dict[str, Any] = {}

        def add_mistake(joint: Any, text: str) -> None:
            line = self.file.line_of("joint", joint.name)
            mistakes.append(Mistake(self.file.name, line, f"joint {joint.name}", text))

        for joint in self.robot.joints:
            for link_name in (joint.parent, joint.child):
                if link_name not in links:
                    add_mistake(
                        joint,
                        f"no link is called {link_name!r}{did_you_mean(str(link_name), links)}",
                    )
            if joint.child in joint_of:
                add_mistake(
                    joint, f"{joint.child!r} is carried by {joint_of[joint.child].name!r} already"
                )
            if joint.type not in _JOINT_TYPES:
                add_mistake(
                    joint, f"found the type {joint.type!r}; allowed: {', '.join(_JOINT_TYPES)}"
                )
            joint_of.setdefault(joint.child, joint)
        for joint in [] if mistakes else self.robot.joints:
            ancestor, visited = joint, {joint.child}
            while ancestor is not None and ancestor.parent not in visited:
                visited.add(ancestor.parent)
                ancestor = joint_of.get(ancestor.parent)
            if ancestor is not None:
                add_mistake(joint, "carries itself: links and joints form a cycle")
        if mistakes:
            raise ExchangeError(mistakes)
        return joint_of

    def _add_joint(self, joint: Any, link: Any) -> None:
        line = self.file.line_of("joint", joint.name)
        name, parent_frame = self.names[link.name], self.names[joint.parent]
        rotation_matrix, position = _rotation_and_position(joint.origin)
        orientation = rotation.quaternion(rotation_matrix)
        axis = np.asarray(joint.axis, float)
        if joint.type == "planar":
            for k, direction in enumerate(_perpendicular(axis, self.file, line)):
                frame = self.draft.unique_name("link", "", f"{name}_{'xy'[k]}")
                name_key = self.draft.joint_name(frame, f"{joint.name}_{'xy'[k]}", line)
                slide = {
                    "type": "prismatic",
                    **name_key,
                    "axis": written_numbers(direction),
                    **pose_keys(position, orientation),
                }
                slide |= _damping_key(joint)
                self.draft.bodies.append(body_data(frame, parent_frame, slide))
                parent_frame, orientation, position = frame, np.eye(4)[0], np.zeros(3)
        joint_type = _JOINT_TYPES[joint.type]
        data: dict[str, Any] = {"type": joint_type}
        if joint_type != "fixed":
            data |= self.draft.joint_name(name, joint.name, line)
        if joint_type in ("revolute", "prismatic"):
            if not np.any(axis):
                raise self.file.error_at(
                    "found an axis of zero length", line, f"joint {joint.name}"
                )
            data["axis"] = written_numbers(axis)
        data |= pose_keys(position, orientation)
        if joint_type != "fixed":
            data |= self._passive_keys(joint, joint_type, line, data.get("name", name))
        self._add_body(link, body_data(name, parent_frame, data))

    def _passive_keys(
        self, joint: Any, joint_type: str, line: int | None, part: str
    ) -> dict[str, Any]:
        """Damping and limits of a joint; the report notes the rest."""
        data: dict[str, Any] = {}

        def note(text: str) -> None:
            self.draft.note("joint", joint.name, text, line, part)

        dynamics, limit = joint.dynamics, joint.limit
        data |= _damping_key(joint)
        if dynamics is not None and float(dynamics.friction or 0.0):
            note("has friction, left out")
        if limit is not None and joint.type in ("revolute", "prismatic"):
            low, high = (float(x or 0.0) for x in (limit.lower, limit.upper))
            if low < high:
                data["limits"] = {"lower": written_number(low), "upper": written_number(high)}
            else:
                note(f"has the limits {low:g} and {high:g}, left out")
        if limit is not None and (limit.effort or limit.velocity):
            note("has limits of effort and velocity, left out: it has no motor")
        if joint.mimic is not None:
            note(f"mimics {joint.mimic.joint!r}; here it moves freely")
        if joint.safety_controller is not None:
            note("has a safety controller, left out")
        return data

    def _add_body(self, link: Any, data: dict[str, Any]) -> None:
        """Adds the body of a link, with inertia and shapes."""
        inertial = link.inertial
        if inertial is not None:
            R, r = _rotation_and_position(inertial.origin)
            inertia = np.zeros((3, 3)) if inertial.inertia is None else inertial.inertia
            if mass := number_or_zero(inertial.mass or 0.0, "mass"):
                data["mass"] = mass
                if any(com := written_numbers(r)):
                    data["com"] = com
            if inertial.mass or np.any(inertia):
                data["inertia"] = inertia_data(
                    R @ self._physical_inertia(inertia, link.name, data["name"]) @ R.T
                )
        add_shapes(self.draft, link, data, self.materials, self.capsules)
        self.draft.bodies.append(data)

    def _physical_inertia(self, inertia: Array, link: str, part: str) -> Array:
        """The inertia (3, 3), changed to one that a solid can have; the report notes changes.

        If products make it singular or negative, as in six equal numbers, only the moments stay.
        A moment larger than the sum of the other two is then reduced to that sum.
        """
        line = self.file.line_of("link", link)
        (a, b, c), axes = np.linalg.eigh(inertia)
        tolerance, products = (
            _INERTIA_TOLERANCE * max(abs(c), abs(a)),
            inertia - np.diag(np.diag(inertia)),
        )
        if a + b >= c - tolerance and a >= -tolerance:
            return inertia
        if a <= tolerance and np.any(products) and np.all(np.diag(inertia) > 0.0):
            text = "has products of inertia that no solid has; here it has its moments alone"
            self.draft.note("link", link, text, line, part)
            return self._physical_inertia(np.diag(np.diag(inertia)), link, part)
        if a < 0.0:
            return inertia
        text = (
            f"has the principal moments {a:g}, {b:g} and {c:g} kg m^2; here the largest is the sum "
            f"of the others, {a + b:g}: no solid has more"
        )
        self.draft.note("link", link, text, line, part)
        reduced: Array = axes @ np.diag([a, b, a + b]) @ axes.T
        return reduced


def _damping_key(joint: Any) -> dict[str, Any]:
    """Key ``damping`` of a joint with damping; for a planar joint, of each coordinate."""
    damping = 0.0 if joint.dynamics is None else float(joint.dynamics.damping or 0.0)
    return {"damping": value} if (value := number_or_zero(damping, "damping")) else {}


def _parse_robot(file: ModelFile, text: bytes) -> Any:
    """Robot of yourdfpy for a text."""
    yourdfpy, log = _library(), logging.getLogger("yourdfpy.urdf")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(text), build_scene_graph=False, load_meshes=False
        ).robot
    except Exception as reason:  # yourdfpy raises any error of its parsing
        message = f"yourdfpy cannot read it: {type(reason).__name__}: {reason}"
        raise file.error_at(message[:500]) from None
    finally:
        log.setLevel(level)


def _library() -> ModuleType:
    try:
        import yourdfpy
    except ImportError:
        raise MissingLibraryError("a model in URDF", "yourdfpy", "urdf") from None
    return yourdfpy


def _check_elements(file: ModelFile) -> None:
    """Raises ExchangeError for missing attributes, invalid numbers and repeated names."""
    mistakes: list[Mistake] = []
    first_lines: dict[tuple[str, str], int] = {}

    def add_mistake(element: Element, text: str) -> None:
        mistakes.append(Mistake(file.name, element.line, element.tag, text))

    for element in file.elements:
        tag, attributes = element.tag, element.attributes
        required_here = element.depth == 1 or tag not in ("link", "joint")
        for key in _REQUIRED_ATTRIBUTES.get(tag, ()) if required_here and element.in_model else ():
            if key not in attributes:
                add_mistake(element, f"{key} is missing")
        if element.depth == 1 and tag in ("link", "joint") and "name" in attributes:
            first_line = first_lines.setdefault((tag, attributes["name"]), element.line)
            if first_line != element.line:
                add_mistake(element, f"{attributes['name']!r} occurs already, in line {first_line}")
            for end_tag in ("parent", "child") if tag == "joint" else ():
                if end_tag not in element.child_tags:
                    add_mistake(element, f"<{end_tag}> is missing")
        solid_tags = {name for name in element.child_tags if not name.startswith(XACRO)}
        if tag == "geometry" and element.in_model and solid_tags and len(solid_tags & SOLIDS) != 1:
            tag_names = ", ".join(sorted(solid_tags))
            add_mistake(
                element, f"found {tag_names[:60]}; needed: one of {', '.join(sorted(SOLIDS))}"
            )
        for key, text in attributes.items():
            allowed_counts = _VALUE_COUNTS.get((tag, key))
            separated = text.replace(",", " ") if tag in ("box", "mesh") else text
            if allowed_counts and element.in_model and not _are_numbers(separated, allowed_counts):
                count = " or ".join(map(str, allowed_counts))
                needed = f"{count} finite number{'' if allowed_counts == (1,) else 's'}"
                add_mistake(element, f"{key}: found {text[:60]!r}; needed: {needed}")
    if mistakes:
        raise ExchangeError(mistakes)


def _are_numbers(text: str, allowed_counts: tuple[int, ...]) -> bool:
    try:
        values = [float(x) for x in text.split()]
    except ValueError:
        return False
    return len(values) in allowed_counts and all(map(math.isfinite, values))


def _rotation_and_position(origin: Array | None) -> tuple[Array, Array]:
    """(3, 3) orientation and (3,) position of an origin."""
    if origin is None:
        return np.eye(3), np.zeros(3)
    return origin[:3, :3], origin[:3, 3]


def _perpendicular(axis: Array, file: ModelFile, line: int | None) -> tuple[Array, Array]:
    """Two unit vectors that form a right-handed frame with an axis."""
    if not np.any(axis):
        raise file.error_at("found an axis of zero length", line, "joint")
    z = axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[1], z)
    x = np.eye(3)[0] if np.linalg.norm(x) < 0.5 else x / np.linalg.norm(x)
    x = x - z * (x @ z)
    x /= np.linalg.norm(x)
    return x, np.cross(z, x)
