"""Geoms of a compiled MuJoCo model as shapes, and notes about elements without counterpart."""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.mujoco import library
from fantoccini.output.exchange import solids
from fantoccini.output.exchange.draft import number
from fantoccini.output.exchange.mjcf_bodies import Bodies, line_of

_VISIBLE_GROUPS = 3
"""Number of groups that MuJoCo's viewer draws by default."""

_SOLIDS = ("sphere", "capsule", "ellipsoid", "box", "cylinder")

_UP = np.array([0.0, 0.0, 1.0])

_UNSET = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
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


def add_shapes(bodies: Bodies) -> None:
    """Adds as shapes the geoms that MuJoCo's viewer draws or, if a body has none, all its geoms."""
    m, draft = bodies.m, bodies.draft
    elements, data_of = bodies.compiled.elements("geoms"), {b["name"]: b for b in draft.bodies}
    for b in range(m.nbody):
        first = int(m.body_geomadr[b])
        geoms = list(range(first, first + int(m.body_geomnum[b])))
        visible = [
            g
            for g in geoms
            if m.geom_group[g] < _VISIBLE_GROUPS and solids.is_visible(_colour(m, g))
        ]
        for g in visible or geoms:
            shape = _shape(bodies, g, elements.get(g))
            if shape is None:
                continue
            shape, line = solids.coloured(shape, _colour(m, g)), line_of(elements.get(g))
            if _colour(m, g)[3] < 1.0:
                draft.note("geom", m.geom(g).name, "is transparent; here it is opaque", line)
            if m.geom_matid[g] >= 0 and np.any(m.mat_texid[m.geom_matid[g]] >= 0):
                draft.note("geom", m.geom(g).name, "has a texture, left out", line)
            if b:
                data_of[bodies.names[b]].setdefault("shapes", []).append(shape)
            else:
                name = draft.unique_name("geom", m.geom(g).name, "obstacle", line)
                draft.obstacles.append({"name": name, **shape})


def add_notes(bodies: Bodies, keyframe: str | None) -> None:
    """Adds notes about elements without counterpart."""
    m, draft, spec = bodies.m, bodies.draft, bodies.compiled.spec
    for kind, (word, text) in _WITHOUT_COUNTERPART.items():
        for element in getattr(spec, kind, ()):
            name = getattr(element, "name", "") or getattr(element, "target", "")
            draft.note(word, name, text, line_of(element))
    for key in spec.keys:
        line = line_of(key) or draft.file.line_of("key", key.name)
        if key.name != keyframe or keyframe is None:
            draft.note("key", key.name, "left out: the puppet starts in another pose", line)
            continue
        more = {"velocities": key.qvel, "activations": key.act, "ctrl": key.ctrl}
        for quantity, values in more.items():
            if np.any(values):
                draft.note("key", key.name, f"has {quantity}, left out", line)
    option = m.opt
    for quantity, value in (("density", option.density), ("viscosity", option.viscosity)):
        if value:
            text = f"{value:g}, left out: bodies have `drag` instead"
            draft.note("option", quantity, text)
    touching = np.any(m.geom_contype) and np.any(m.geom_conaffinity)
    flags = library().mjtDisableBit
    if touching and not option.disableflags & int(flags.mjDSBL_CONTACT):
        draft.note("contact", "", "left out: add `contact: true`, and keep bodies apart")


def _colour(m: Any, g: int) -> Array:
    """Colour of a geom; if it has none, that of its material."""
    material, rgba = int(m.geom_matid[g]), np.asarray(m.geom_rgba[g])
    has_colour = material < 0 or not np.array_equal(rgba, _UNSET)
    return rgba if has_colour else np.asarray(m.mat_rgba[material])


def _shape(bodies: Bodies, g: int, element: Any) -> dict[str, Any] | None:
    """Geom as a shape; None, with a note, if it has no counterpart."""
    m, draft, kinds = bodies.m, bodies.draft, library().mjtGeom
    body, size = int(m.geom_bodyid[g]), m.geom_size[g]
    at, turn = m.geom_pos[g] - bodies.origins[body], m.geom_quat[g]
    kind, line, name = kinds(int(m.geom_type[g])), line_of(element), m.geom(g).name
    axis = np.zeros(3)
    library().mju_rotVecQuat(axis, _UP, turn)
    match kind:
        case kinds.mjGEOM_PLANE:
            if body == 0 and axis[2] > 1.0 - 1e-12 and "floor" not in draft.other_keys:
                draft.other_keys["floor"] = number(at[2])
            else:
                draft.note("geom", name, "plane: left out; a puppet has one level floor", line)
            return None
        case kinds.mjGEOM_SPHERE if solids.is_valid_size(size[0]):
            return solids.sphere(size[0], at)
        case kinds.mjGEOM_CAPSULE if solids.is_valid_size(size[0]):
            return solids.capsule(size[0], size[1], at, axis)
        case kinds.mjGEOM_ELLIPSOID if solids.is_valid_size(*size):
            return solids.ellipsoid(size, at, turn)
        case kinds.mjGEOM_BOX if solids.is_valid_size(*size):
            return solids.box(2.0 * size, at, turn)
        case kinds.mjGEOM_CYLINDER if solids.is_valid_size(*size[:2]):
            return solids.cylinder(draft, size[0], 2.0 * size[1], at, turn)
        case kinds.mjGEOM_MESH | kinds.mjGEOM_SDF:
            return _mesh(bodies, int(m.geom_dataid[g]), at, turn)
    word = kind.name.removeprefix("mjGEOM_").lower()
    reason = "of its size" if word in _SOLIDS else "of its kind"
    draft.note("geom", name, f"{word}: left out, has no counterpart {reason}", line)
    return None


def _mesh(bodies: Bodies, k: int, at: Array, turn: Array) -> dict[str, Any]:
    m = bodies.m
    corners = slice(int(m.mesh_vertadr[k]), int(m.mesh_vertadr[k] + m.mesh_vertnum[k]))
    faces = slice(int(m.mesh_faceadr[k]), int(m.mesh_faceadr[k] + m.mesh_facenum[k]))

    def content() -> bytes:
        return solids.stl(m.mesh_vert[corners], m.mesh_face[faces])

    name = m.mesh(k).name or f"mesh_{k}"
    return solids.mesh(bodies.draft, k, content, at, turn, name)
