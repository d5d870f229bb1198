"""Masses of links without inertia, computed from their solids.

URDF is the format of robots in ROS; a link is one of its bodies. A hull is the smallest convex
solid around a mesh or a piece of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.model.puppet import (
    MIN_MESH_VOLUME,
    Mesh,
    Shape,
    UnitInertia,
    load_mesh,
    shape_inertia,
)
from fantoccini.output.exchange.draft import Draft, inertia_data, number_or_zero, written_numbers

DENSITY = 1000.0
"""Default density for links without inertia if a joint would move no mass [kg/m^3]: water."""


def add_masses(draft: Draft, links: dict[str, Any], density: float | None) -> None:
    """Adds the mass and inertia of their solids to bodies without inertia.

    Without a density this is done only if a joint would otherwise move no mass. An open mesh counts
    as its convex hull. Overlaps of solids count twice.

    Args:
        draft: draft of the puppet.
        links: name of a body -> yourdfpy's link.
        density: density of the solids [kg/m^3].
    """
    if density is None and not _has_massless_joint(draft.bodies):
        return
    with draft.shape_reader() as read_shape:
        for body in draft.bodies:
            if body["name"] not in links or "mass" in body or "inertia" in body:
                continue
            link = links[body["name"]]
            line = draft.file.line_of("link", link.name)
            solids = [
                _solid_inertia(shape) for shape in map(read_shape, body.get("shapes", ())) if shape
            ]
            solid_density = DENSITY if density is None else density
            text = _add_mass(body, solid_density, [solid for solid in solids if solid[0] > 0.0])
            if text and any(from_hull for *_, from_hull in solids):
                text += "; a mesh that is not closed counts as its convex hull"
            if text:
                draft.note("link", link.name, text, line, body["name"])


def _add_mass(
    body: dict[str, Any], density: float, solids: list[tuple[float, UnitInertia, bool]]
) -> str:
    """Adds mass, centre of mass and inertia to a body; returns the note, empty without mass."""
    volume = sum(v for v, *_ in solids)
    if not number_or_zero(density * volume, "mass"):
        return ""
    com = sum((v * unit_inertia.com for v, unit_inertia, _ in solids), np.zeros(3)) / volume
    inertia = np.zeros((3, 3))
    for v, unit_inertia, _ in solids:
        d = unit_inertia.com - com
        inertia += density * v * (unit_inertia.inertia + d @ d * np.eye(3) - np.outer(d, d))
    body["mass"] = number_or_zero(density * volume, "mass")
    if any(com_position := written_numbers(com)):
        body["com"] = com_position
    body["inertia"] = inertia_data(inertia)
    return (
        f"has no inertia: {density * volume:.4g} kg here, of its solids at {density:g} kg/m^3 "
        "(--density)"
    )


def _solid_inertia(shape: Shape) -> tuple[float, UnitInertia, bool]:
    """Volume, inertia of unit mass, and whether they are those of the convex hull."""
    if not isinstance(shape, Mesh) or shape.read().closed:
        volume, unit_inertia = shape_inertia(shape)
        return volume if volume >= MIN_MESH_VOLUME else 0.0, unit_inertia, False
    zero = UnitInertia(np.zeros(3), np.zeros((3, 3)))
    try:
        hull = load_mesh(shape).convex_hull
    except Exception:  # from qhull, for a flat mesh
        return 0.0, zero, True
    volume = float(hull.volume)
    if volume < MIN_MESH_VOLUME:
        return 0.0, zero, True
    return volume, UnitInertia(hull.center_mass, np.array(hull.moment_inertia) / volume), True


def _has_massless_joint(bodies: list[dict[str, Any]]) -> bool:
    """Whether any joint moves no mass."""
    parents = {body["name"]: body.get("parent", "world") for body in bodies}
    with_mass = {"world"}
    for body in bodies:
        name = body["name"]
        while ("mass" in body or "inertia" in body) and name not in with_mass:
            with_mass.add(name)
            name = parents[name]
    return any(
        body["name"] not in with_mass
        for body in bodies
        if "joint" in body and body["joint"]["type"] != "fixed"
    )
