"""Geoms of a compiled MuJoCo model as shapes, and notes about elements without counterpart.

A geom is a shape in MuJoCo.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.mujoco import library
from fantoccini.output.exchange import solids
from fantoccini.output.exchange.draft import written_number
from fantoccini.output.exchange.mjcf_bodies import BodyConverter, line_of

_VISIBLE_GROUPS = 3
"""Number of groups that MuJoCo's viewer draws by default."""

_SOLID_TYPES = ("sphere", "capsule", "ellipsoid", "box", "cylinder")

_UP = np.array([0.0, 0.0, 1.0])

_DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
"""Default colour of geoms in MuJoCo."""

_WITHOUT_COUNTERPART = {
    "actuators": ("actuator", "left out: the joint or body that it moves is free"),
    "sensors": ("sensor", "left out"),
    "excludes": ("exclude", "left out: use `pairs` of `contact`"),
    "pairs": ("pair", "left out: use `pairs` of `contact`"),
    "cameras": ("camera", "left out"),
    "lights": ("light", "left out"),
    "flexes": ("flex", "left out: bodies are rigid"),
    "skins": ("skin", "left out"),
    "plugins": ("plugin", "left out"),
}
"""Elements without counterpart: their word in the file, and the note."""


def add_shapes(converter: BodyConverter) -> None:
    """Adds as shapes the geoms that MuJoCo's viewer draws or, if a body has none, all its geoms."""
    m, draft = converter.m, converter.draft
    elements, data_by_body = (
        converter.compiled.elements("geoms"),
        {b["name"]: b for b in draft.bodies},
    )
    for b in range(m.nbody):
        first_geom = int(m.body_geomadr[b])
        geoms = list(range(first_geom, first_geom + int(m.body_geomnum[b])))
        visible = [
            g
            for g in geoms
            if m.geom_group[g] < _VISIBLE_GROUPS and solids.is_visible(_colour(m, g))
        ]
        for g in visible or geoms:
            shape = _geom_shape(converter, g, elements.get(g))
            if shape is None:
                continue
            shape, line = solids.with_colour(shape, _colour(m, g)), line_of(elements.get(g))
            if _colour(m, g)[3] < 1.0:
                draft.note("geom", m.geom(g).name, "is transparent; here it is opaque", line)
            if m.geom_matid[g] >= 0 and np.any(m.mat_texid[m.geom_matid[g]] >= 0):
                draft.note("geom", m.geom(g).name, "has a texture, left out", line)
            if b:
                data_by_body[converter.names[b]].setdefault("shapes", []).append(shape)
            else:
                name = draft.unique_name("geom", m.geom(g).name, "obstacle", line)
                draft.obstacles.append({"name": name, **shape})


def add_notes(converter: BodyConverter, keyframe: str | None) -> None:
    """Adds notes about elements without counterpart."""
    m, draft, spec = converter.m, converter.draft, converter.compiled.spec
    for kind, (tag, text) in _WITHOUT_COUNTERPART.items():
        for element in getattr(spec, kind, ()):
            name = getattr(element, "name", "") or getattr(element, "target", "")
            draft.note(tag, name, text, line_of(element))
    for key in spec.keys:
        line = line_of(key) or draft.file.line_of("key", key.name)
        if key.name != keyframe or keyframe is None:
            draft.note("key", key.name, "left out: the puppet starts in another pose", line)
            continue
        unused_values = {"velocities": key.qvel, "activations": key.act, "ctrl": key.ctrl}
        for quantity, values in unused_values.items():
            if np.any(values):
                draft.note("key", key.name, f"has {quantity}, left out", line)
    option = m.opt
    for quantity, value in (("density", option.density), ("viscosity", option.viscosity)):
        if value:
            text = f"{value:g}, left out: bodies have `drag` instead"
            draft.note("option", quantity, text)
    has_contacts = np.any(m.geom_contype) and np.any(m.geom_conaffinity)
    flags = library().mjtDisableBit
    if has_contacts and not option.disableflags & int(flags.mjDSBL_CONTACT):
        draft.note("contact", "", "left out: add `contact: true`, and keep bodies apart")


def _colour(m: Any, g: int) -> Array:
    """Colour of a geom; if it has none, that of its material."""
    material, rgba = int(m.geom_matid[g]), np.asarray(m.geom_rgba[g])
    has_colour = material < 0 or not np.array_equal(rgba, _DEFAULT_RGBA)
    return rgba if has_colour else np.asarray(m.mat_rgba[material])


def _geom_shape(converter: BodyConverter, g: int, element: Any) -> dict[str, Any] | None:
    """Geom as a shape; None, with a note, if it has no counterpart."""
    m, draft, geom_types = converter.m, converter.draft, library().mjtGeom
    body, size = int(m.geom_bodyid[g]), m.geom_size[g]
    position, orientation = m.geom_pos[g] - converter.origins[body], m.geom_quat[g]
    geom_type, line, name = geom_types(int(m.geom_type[g])), line_of(element), m.geom(g).name
    axis = np.zeros(3)
    library().mju_rotVecQuat(axis, _UP, orientation)
    match geom_type:
        case geom_types.mjGEOM_PLANE:
            if body == 0 and axis[2] > 1.0 - 1e-12 and "floor" not in draft.other_keys:
                draft.other_keys["floor"] = written_number(position[2])
            else:
                draft.note("geom", name, "plane: left out; a puppet has one level floor", line)
            return None
        case geom_types.mjGEOM_SPHERE if solids.is_valid_size(size[0]):
            return solids.sphere(size[0], position)
        case geom_types.mjGEOM_CAPSULE if solids.is_valid_size(size[0]):
            return solids.capsule(size[0], size[1], position, axis)
        case geom_types.mjGEOM_ELLIPSOID if solids.is_valid_size(*size):
            return solids.ellipsoid(size, position, orientation)
        case geom_types.mjGEOM_BOX if solids.is_valid_size(*size):
            return solids.box(2.0 * size, position, orientation)
        case geom_types.mjGEOM_CYLINDER if solids.is_valid_size(*size[:2]):
            return solids.cylinder(draft, size[0], 2.0 * size[1], position, orientation)
        case geom_types.mjGEOM_MESH | geom_types.mjGEOM_SDF:
            return _mesh_shape(converter, int(m.geom_dataid[g]), position, orientation)
    type_name = geom_type.name.removeprefix("mjGEOM_").lower()
    reason = "of its size" if type_name in _SOLID_TYPES else "of its kind"
    draft.note("geom", name, f"{type_name}: left out, has no counterpart {reason}", line)
    return None


def _mesh_shape(
    converter: BodyConverter, k: int, position: Array, orientation: Array
) -> dict[str, Any]:
    m = converter.m
    corners = slice(int(m.mesh_vertadr[k]), int(m.mesh_vertadr[k] + m.mesh_vertnum[k]))
    faces = slice(int(m.mesh_faceadr[k]), int(m.mesh_faceadr[k] + m.mesh_facenum[k]))

    def stl_content() -> bytes:
        return solids.stl(m.mesh_vert[corners], m.mesh_face[faces])

    name = m.mesh(k).name or f"mesh_{k}"
    return solids.mesh(converter.draft, k, stl_content, position, orientation, name)
