"""Geoms of a compiled MuJoCo model as shapes, and notes about what a puppet does not have."""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.mujoco import library
from fantoccini.output.exchange import solids
from fantoccini.output.exchange.draft import number
from fantoccini.output.exchange.mjcf_bodies import Bodies, line_of

_SHOWN = 3
"""Groups below this one are drawn by MuJoCo's viewer."""

_SOLIDS = ("sphere", "capsule", "ellipsoid", "box", "cylinder")

_UP = np.array([0.0, 0.0, 1.0])

_UNSET = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
"""MuJoCo's colour of geoms without one."""

_PLAIN = {
    "actuators": ("actuator", "left out: what it moves is free"),
    "sensors": ("sensor", "left out"),
    "excludes": ("exclude", "left out: `pairs` of `contact` say what meets"),
    "pairs": ("pair", "left out: `pairs` of `contact` say what meets"),
    "cameras": ("camera", "left out"),
    "lights": ("light", "left out"),
    "flexes": ("flex", "left out: bodies are rigid"),
    "skins": ("skin", "left out"),
    "plugins": ("plugin", "left out"),
}
"""Elements of a model without counterpart: what the file calls them, and what becomes of them."""


def add_shapes(bodies: Bodies) -> None:
    """Adds the geoms that MuJoCo's viewer draws, or all of a body without such, as shapes."""
    m, draft = bodies.m, bodies.draft
    elements, made = bodies.compiled.elements("geoms"), {b["name"]: b for b in draft.bodies}
    for b in range(m.nbody):
        first = int(m.body_geomadr[b])
        geoms = list(range(first, first + int(m.body_geomnum[b])))
        seen = [g for g in geoms if m.geom_group[g] < _SHOWN and solids.is_seen(_colour(m, g))]
        for g in seen or geoms:
            shape = _shape(bodies, g, elements.get(g))
            if shape is None:
                continue
            shape, line = solids.coloured(shape, _colour(m, g)), line_of(elements.get(g))
            if _colour(m, g)[3] < 1.0:
                draft.note("geom", m.geom(g).name, "is transparent; here it is opaque", line)
            if m.geom_matid[g] >= 0 and np.any(m.mat_texid[m.geom_matid[g]] >= 0):
                draft.note("geom", m.geom(g).name, "has a texture, left out", line)
            if b:
                made[bodies.names[b]].setdefault("shapes", []).append(shape)
            else:
                name = draft.take("geom", m.geom(g).name, "obstacle", line)
                draft.obstacles.append({"name": name, **shape})


def add_notes(bodies: Bodies, keyframe: str | None) -> None:
    """Notes elements that no part of a puppet stands for."""
    m, draft, spec = bodies.m, bodies.draft, bodies.compiled.spec
    for kind, (word, text) in _PLAIN.items():
        for element in getattr(spec, kind, ()):
            name = getattr(element, "name", "") or getattr(element, "target", "")
            draft.note(word, name, text, line_of(element))
    for key in spec.keys:
        line = line_of(key) or draft.file.line_of("key", key.name)
        if key.name != keyframe or keyframe is None:
            draft.note("key", key.name, "left out: not the pose", line)
            continue
        more = {"velocities": key.qvel, "activations": key.act, "ctrl": key.ctrl}
        for what, values in more.items():
            if np.any(values):
                draft.note("key", key.name, f"has {what}, left out", line)
    option = m.opt
    for what, there in (("density", option.density), ("viscosity", option.viscosity)):
        if there:
            text = f"{there:g}, left out: bodies have `drag` instead"
            draft.note("option", what, text)
    touching = np.any(m.geom_contype) and np.any(m.geom_conaffinity)
    flags = library().mjtDisableBit
    if touching and not option.disableflags & int(flags.mjDSBL_CONTACT):
        draft.note("contact", "", "left out: add `contact: true`, and give bodies room to move")


def _colour(m: Any, g: int) -> Array:
    """A geom's own colour; that of its material where it has none."""
    material, found = int(m.geom_matid[g]), np.asarray(m.geom_rgba[g])
    own = material < 0 or not np.array_equal(found, _UNSET)
    return found if own else np.asarray(m.mat_rgba[material])


def _shape(bodies: Bodies, g: int, element: Any) -> dict[str, Any] | None:
    """A geom as a shape; None where it has no counterpart, which is noted."""
    m, draft, kinds = bodies.m, bodies.draft, library().mjtGeom
    body, size = int(m.geom_bodyid[g]), m.geom_size[g]
    at, turn = m.geom_pos[g] - bodies.shift[body], m.geom_quat[g]
    kind, line, name = kinds(int(m.geom_type[g])), line_of(element), m.geom(g).name
    axis = np.zeros(3)
    library().mju_rotVecQuat(axis, _UP, turn)
    match kind:
        case kinds.mjGEOM_PLANE:
            if body == 0 and axis[2] > 1.0 - 1e-12 and "floor" not in draft.top:
                draft.top["floor"] = number(at[2])
            else:
                draft.note("geom", name, "plane: left out; a puppet has one level floor", line)
            return None
        case kinds.mjGEOM_SPHERE if solids.fits(size[0]):
            return solids.sphere(size[0], at)
        case kinds.mjGEOM_CAPSULE if solids.fits(size[0]):
            return solids.capsule(size[0], size[1], at, axis)
        case kinds.mjGEOM_ELLIPSOID if solids.fits(*size):
            return solids.ellipsoid(size, at, turn)
        case kinds.mjGEOM_BOX if solids.fits(*size):
            return solids.box(2.0 * size, at, turn)
        case kinds.mjGEOM_CYLINDER if solids.fits(*size[:2]):
            return solids.cylinder(draft, size[0], 2.0 * size[1], at, turn)
        case kinds.mjGEOM_MESH | kinds.mjGEOM_SDF:
            return _mesh(bodies, int(m.geom_dataid[g]), at, turn)
    word = kind.name.removeprefix("mjGEOM_").lower()
    what = "of its size" if word in _SOLIDS else "of its kind"
    draft.note("geom", name, f"{word}: left out, has no counterpart {what}", line)
    return None


def _mesh(bodies: Bodies, k: int, at: Array, turn: Array) -> dict[str, Any]:
    m = bodies.m
    corners = slice(int(m.mesh_vertadr[k]), int(m.mesh_vertadr[k] + m.mesh_vertnum[k]))
    faces = slice(int(m.mesh_faceadr[k]), int(m.mesh_faceadr[k] + m.mesh_facenum[k]))

    def content() -> bytes:
        return solids.stl(m.mesh_vert[corners], m.mesh_face[faces])

    name = m.mesh(k).name or f"mesh_{k}"
    return solids.mesh(bodies.draft, k, content, at, turn, name)
