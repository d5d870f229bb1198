"""Masses of links without inertia, from their solids."""

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
from fantoccini.output.exchange.draft import Draft, numbers, six, sized

DENSITY = 1000.0
"""Default density for links without inertia if a joint would move no mass [kg/m^3]: water."""


def add_masses(draft: Draft, links: dict[str, Any], density: float | None) -> None:
    """Gives bodies without inertia the mass and inertia of their solids.

    Without a density this is done only if a joint would move no mass, since such a file lacks
    masses that it needs. An open mesh counts as its convex hull. Overlaps of solids count twice.

    Args:
        draft: of the puppet.
        links: name of a body -> yourdfpy's link.
        density: of the solids [kg/m^3].
    """
    if density is None and not _has_massless_joint(draft.bodies):
        return
    with draft.shapes() as read:
        for body in draft.bodies:
            if body["name"] not in links or "mass" in body or "inertia" in body:
                continue
            link = links[body["name"]]
            line = draft.file.line_of("link", link.name)
            solids = [_solid(shape) for shape in map(read, body.get("shapes", ())) if shape]
            own = DENSITY if density is None else density
            text = _weigh(body, own, [solid for solid in solids if solid[0] > 0.0])
            if text and any(hull for *_, hull in solids):
                text += "; a mesh that is not closed counts as its convex hull"
            if text:
                draft.note("link", link.name, text, line, body["name"])


def _weigh(
    body: dict[str, Any], density: float, solids: list[tuple[float, UnitInertia, bool]]
) -> str:
    """Adds mass, centre of mass and inertia to a body; what was done, or empty for nothing."""
    volume = sum(v for v, *_ in solids)
    if not sized(density * volume, "mass"):
        return ""
    com = sum((v * unit.com for v, unit, _ in solids), np.zeros(3)) / volume
    inertia = np.zeros((3, 3))
    for v, unit, _ in solids:
        d = unit.com - com
        inertia += density * v * (unit.inertia + d @ d * np.eye(3) - np.outer(d, d))
    body["mass"] = sized(density * volume, "mass")
    if any(place := numbers(com)):
        body["com"] = place
    body["inertia"] = six(inertia)
    return (
        f"has no inertia: {density * volume:.4g} kg here, of its solids at {density:g} kg/m^3 "
        "(--density)"
    )


def _solid(shape: Shape) -> tuple[float, UnitInertia, bool]:
    """Volume, unit inertia, and whether they belong to the convex hull."""
    if not isinstance(shape, Mesh) or shape.read().closed:
        volume, unit = shape_inertia(shape)
        return volume if volume >= MIN_MESH_VOLUME else 0.0, unit, False
    none = UnitInertia(np.zeros(3), np.zeros((3, 3)))
    try:
        hull = load_mesh(shape).convex_hull
    except Exception:  # from qhull, for a flat mesh
        return 0.0, none, True
    volume = float(hull.volume)
    if volume < MIN_MESH_VOLUME:
        return 0.0, none, True
    return volume, UnitInertia(hull.center_mass, np.array(hull.moment_inertia) / volume), True


def _has_massless_joint(bodies: list[dict[str, Any]]) -> bool:
    """Whether a joint moves no mass."""
    parents = {body["name"]: body.get("parent", "world") for body in bodies}
    heavy = {"world"}
    for body in bodies:
        name = body["name"]
        while ("mass" in body or "inertia" in body) and name not in heavy:
            heavy.add(name)
            name = parents[name]
    return any(
        body["name"] not in heavy
        for body in bodies
        if "joint" in body and body["joint"]["type"] != "fixed"
    )
