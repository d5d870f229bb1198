"""Trajectories on disk: npz files without pickle."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fantoccini.base import Array, Status, npz
from fantoccini.model.puppet import Mesh, Puppet, loads
from fantoccini.model.tree import Coordinate, CoordinateTable, Role
from fantoccini.motion.columns import Columns
from fantoccini.motion.contacts import ContactPoints
from fantoccini.motion.state import EventKind, EventRecord

FORMAT = "fantoccini.trajectory.1"
RECORDING_FORMAT = "fantoccini.recording.3"
"""Format of recorded performances, which ``fantoccini.theatre.perform`` writes."""
RECORDING_FORMATS = (RECORDING_FORMAT, "fantoccini.recording.2")
"""Formats of recordings that can be read."""
_ARRAYS = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
_TABLES = (
    "tension",
    "limit_force",
    "taut",
    "ledger",
    "effort",
    "violation",
    "slip",
    "undetermined",
)
_FLAGS = ("taut", "undetermined")
"""Tables whose values are flags."""
_POINTS = {
    "sample": (),
    "pair": (),
    "gap": (),
    "point": (3,),
    "normal": (3,),
    "force": (3,),
    "velocity": (3,),
}
"""Arrays of contact points -> their shapes without the first axis."""
_WHOLE = ("sample", "pair")
_NUMBERS = ("t", "impulse", "speed")
_MESH = "mesh:"
_CONTACT = "contact:"
_RESIDUAL = "contact_residual"
_folders: list[TemporaryDirectory[str]] = []


def save(fields: Mapping[str, Any], path: str | Path) -> None:
    """Writes the fields of a trajectory: arrays, and names and puppet as JSON."""
    npz.write(path, *contents_of(fields))


def contents_of(fields: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, Any]]:
    """The fields of a trajectory as arrays by name, and the others as values for JSON."""
    tables: dict[str, Columns] = {n: fields[n] for n in _TABLES if fields[n] is not None}
    table: CoordinateTable = fields["coordinates"]
    events: tuple[EventRecord, ...] = fields["events"]
    puppet: Puppet | None = fields["puppet"]
    about = {
        "format": FORMAT,
        "method": fields["method"],
        "status": fields["status"].name,
        "blamed": fields["causes"],
        "columns": {name: [named.what, *named.names] for name, named in tables.items()},
        "events": [[event.kind, event.name] for event in events],
        "events_recorded": fields["events_recorded"],
        "coordinates": table_to_json(table),
        "puppet": None if puppet is None else puppet.to_yaml(),
    }
    arrays = {name: fields[name] for name in _ARRAYS}
    arrays |= {name: named.values for name, named in tables.items()}
    arrays["events"] = np.array([[getattr(e, x) for x in _NUMBERS] for e in events]).reshape(
        -1, len(_NUMBERS)
    )
    arrays["start_D"], arrays["start_K"] = table.start_D, table.start_K
    if fields[_RESIDUAL] is not None:
        arrays[_RESIDUAL] = fields[_RESIDUAL]
    contact: ContactPoints | None = fields["contact"]
    if contact is not None:
        about["contact"] = contact.names
        arrays |= {f"{_CONTACT}{name}": getattr(contact, name) for name in _POINTS}
    if puppet is not None:
        arrays |= npz.packed(_MESH, mesh_files(puppet))
    return arrays, about


def fields_of(arrays: Mapping[str, Array], about: Mapping[str, Any], path: str) -> dict[str, Any]:
    """The fields of a trajectory from the contents of its file.

    Raises:
        LookupError, TypeError, ValueError: the file does not contain a trajectory.
    """
    table = table_from_json(about["coordinates"], arrays)
    n = len(npz.finite(arrays, "t", (None,)))
    widths = (table.n_qD, table.n_vD, table.n_vD, table.n_qK, table.n_vK, table.n_vK)
    motion = {
        name: npz.checked(arrays, name, (n, width))
        for name, width in zip(_ARRAYS[1:], widths, strict=True)
    }
    if unknown := set(about["columns"]) - set(_TABLES):
        raise ValueError(f"columns has {', '.join(map(repr, unknown))}")
    tables = {}
    for name, named in about["columns"].items():
        what, *names = npz.texts(named, f"columns.{name}")
        column = npz.checked(arrays, name, (n, len(names)), "b" if name in _FLAGS else "f")
        tables[name] = Columns(tuple(names), column, what)
    events = []
    numbers = npz.checked(arrays, "events", (len(about["events"]), len(_NUMBERS)))
    for event, row in zip(about["events"], numbers, strict=True):
        kind, name = npz.texts(event, "an event")
        values = dict(zip(_NUMBERS, row, strict=True))
        events.append(EventRecord(kind=EventKind(kind), name=name, **values))
    puppet = about["puppet"]
    if puppet is not None:
        puppet = restored(npz.text(puppet, "puppet"), path, npz.unpacked(_MESH, arrays))
    residual = npz.checked(arrays, _RESIDUAL, (n,)) if _RESIDUAL in arrays else None
    return {
        "t": arrays["t"],
        **motion,
        **tables,
        "events": tuple(events),
        "contact": _contact(arrays, about.get("contact"), n),
        _RESIDUAL: residual,
        "events_recorded": bool(about.get("events_recorded", True)),
        "status": Status[about["status"]],
        "causes": npz.texts(about.get("blamed", []), "blamed"),
        "method": npz.text(about["method"], "method"),
        "coordinates": table,
        "puppet": puppet,
    }


def _contact(arrays: Mapping[str, Array], listed: Any, n: int) -> ContactPoints | None:
    """The contact points of a file with n samples; None if the file has no contact points."""
    if listed is None:
        return None
    names: list[tuple[str, str]] = []
    for pair in listed:
        first, second = npz.texts(pair, "contact")
        names.append((first, second))
    size = len(arrays[f"{_CONTACT}sample"])
    points: dict[str, Any] = {
        name: npz.checked(
            arrays, f"{_CONTACT}{name}", (size, *width), "i" if name in _WHOLE else "f"
        )
        for name, width in _POINTS.items()
    }
    for name, end in zip(_WHOLE, (n, len(names)), strict=True):
        if size and not (points[name].min() >= 0 and points[name].max() < end):
            raise ValueError(f"contact has a {name} that is not from 0 to {end - 1}")
    return ContactPoints(**points, names=tuple(names))


def mesh_files(puppet: Puppet) -> dict[str, bytes]:
    """Paths relative to the puppet file -> contents of its mesh files and the files they name."""
    shapes = [shape for body in puppet.bodies for shape in body.shapes]
    meshes = [shape for shape in (*shapes, *puppet.obstacles) if isinstance(shape, Mesh)]
    return {name: content for mesh in meshes for name, content in mesh.contents().items()}


def restored(yaml: str, file: str, meshes: Mapping[str, bytes]) -> Puppet:
    """A puppet from its YAML; its meshes are in a temporary folder until Python ends.

    Args:
        yaml: YAML text.
        file: name of the text in messages.
        meshes: result of :func:`mesh_files`.

    Raises:
        ValueError: the path of a mesh lies outside the folder.
    """
    if not meshes:
        return loads(yaml, file)
    temporary = TemporaryDirectory(prefix="fantoccini-", ignore_cleanup_errors=True)
    _folders.append(temporary)  # keeps the folder until Python ends
    folder = Path(temporary.name).resolve()
    for name, content in meshes.items():
        place = (folder / name).resolve()
        if not place.is_relative_to(folder):
            raise ValueError(f"the mesh {name!r} leads out of its folder")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    return loads(yaml, file, folder)


def table_to_json(table: CoordinateTable) -> dict[str, Any]:
    """The coordinates as JSON, without their start values."""
    whole = {
        field.name: getattr(table, field.name)
        for field in dataclasses.fields(table)
        if field.name not in ("rows", "start_D", "start_K")
    }
    whole["rows"] = [[r.name, r.role, r.owner, r.unit, r.index] for r in table.rows]
    return whole


def table_from_json(data: dict[str, Any], arrays: Mapping[str, Array]) -> CoordinateTable:
    """The coordinates from JSON, with the start values in ``arrays``."""
    rows = tuple(
        Coordinate(npz.text(name, "a coordinate"), Role(role), owner, unit, index)
        for name, role, owner, unit, index in data["rows"]
    )
    vectors = ("q_D", "v_D", "q_K", "v_K")
    names = {key: npz.texts(data[key], f"coordinates.{key}") for key in vectors}
    places: dict[str, Any] = {
        f"{part}_{kind}": _places(data[f"{part}_{kind}"], names, kind, widths)
        for part, widths in (("quaternions", (4, 3)), ("scalars", (1, 1)))
        for kind in ("D", "K")
    }
    rotations = data["rotations"]
    turns = _places(list(rotations.values()), names, "K", (4, 3))
    commands = data.get("commands", {})
    npz.texts(list(commands.values()), "coordinates.commands")
    return CoordinateTable(
        rows=rows,
        **(places | names),
        rotations=dict(zip(rotations, turns, strict=True)),
        commands=commands,
        carried=npz.texts(data.get("carried", []), "coordinates.carried"),
        axes={name: _axis(axis) for name, axis in data.get("axes", {}).items()},
        start_D=npz.checked(arrays, "start_D", (len(names["q_D"]),)),
        start_K=npz.checked(arrays, "start_K", (len(names["q_K"]),)),
    )


def _axis(numbers: Any) -> tuple[float, ...]:
    """An axis of three numbers."""
    x, y, z = map(float, numbers)
    return x, y, z


def _places(
    pairs: list[Any], names: dict[str, tuple[str, ...]], kind: str, widths: tuple[int, int]
) -> tuple[tuple[int, int], ...]:
    """Indices (q, v) of coordinates with given widths; raises ValueError for one out of range."""
    places = tuple(tuple(pair) for pair in pairs)
    ends = [len(names[f"{part}_{kind}"]) - n for part, n in zip("qv", widths, strict=True)]
    for q, v in places:
        for index, end in ((q, ends[0]), (v, ends[1])):
            if type(index) is not int or not 0 <= index <= end:
                raise ValueError(f"coordinates has the index {index!r}; it must be 0 to {end}")
    return places
