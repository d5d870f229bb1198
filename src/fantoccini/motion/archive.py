"""Trajectories on disk: npz files without pickle.

q_D and q_K are the dynamic and driven coordinates, v and acc their velocities and accelerations. A
driven coordinate of a drive, a motor with a controller, is its command. A row of the tree describes
a string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

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
_COLUMN_FIELDS = (
    "tension",
    "limit_force",
    "taut",
    "ledger",
    "effort",
    "violation",
    "slip",
    "undetermined",
)
_FLAG_FIELDS = ("taut", "undetermined")
"""Tables whose values are flags."""
_POINT_SHAPES = {
    "sample": (),
    "pair": (),
    "gap": (),
    "point": (3,),
    "normal": (3,),
    "force": (3,),
    "velocity": (3,),
}
"""Arrays of contact points -> their shapes without the first axis."""
_INDEX_ARRAYS = ("sample", "pair")
_EVENT_NUMBERS = ("t", "impulse", "speed")
_MESH = "mesh:"
_CONTACT = "contact:"
_RESIDUAL = "contact_residual"
_temporary_folders: list[TemporaryDirectory[str]] = []


def save(fields: Mapping[str, Any], path: str | Path) -> None:
    """Writes the fields of a trajectory: arrays, and names and puppet as JSON."""
    npz.write(path, *contents_of(fields))


def contents_of(fields: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, Any]]:
    """The fields of a trajectory as arrays by name, and the others as values for JSON."""
    tables: dict[str, Columns] = {n: fields[n] for n in _COLUMN_FIELDS if fields[n] is not None}
    table: CoordinateTable = fields["coordinates"]
    events: tuple[EventRecord, ...] = fields["events"]
    puppet: Puppet | None = fields["puppet"]
    about = {
        "format": FORMAT,
        "method": fields["method"],
        "status": fields["status"].name,
        "blamed": fields["causes"],
        "columns": {name: [columns.noun, *columns.names] for name, columns in tables.items()},
        "events": [[event.kind, event.name] for event in events],
        "events_recorded": fields["events_recorded"],
        "coordinates": table_to_json(table),
        "puppet": None if puppet is None else puppet.to_yaml(),
    }
    arrays = {name: fields[name] for name in _ARRAYS}
    arrays |= {name: columns.values for name, columns in tables.items()}
    arrays["events"] = np.array(
        [[getattr(e, number) for number in _EVENT_NUMBERS] for e in events]
    ).reshape(-1, len(_EVENT_NUMBERS))
    arrays["start_D"], arrays["start_K"] = table.start_D, table.start_K
    if fields[_RESIDUAL] is not None:
        arrays[_RESIDUAL] = fields[_RESIDUAL]
    contact: ContactPoints | None = fields["contact"]
    if contact is not None:
        about["contact"] = contact.names
        arrays |= {f"{_CONTACT}{name}": getattr(contact, name) for name in _POINT_SHAPES}
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
    if unknown := set(about["columns"]) - set(_COLUMN_FIELDS):
        raise ValueError(f"columns has {', '.join(map(repr, unknown))}")
    tables = {}
    for name, labels in about["columns"].items():
        noun, *names = npz.texts(labels, f"columns.{name}")
        column = npz.checked(arrays, name, (n, len(names)), "b" if name in _FLAG_FIELDS else "f")
        tables[name] = Columns(tuple(names), column, noun)
    events = []
    numbers = npz.checked(arrays, "events", (len(about["events"]), len(_EVENT_NUMBERS)))
    for event, row in zip(about["events"], numbers, strict=True):
        kind, name = npz.texts(event, "an event")
        event_numbers = dict(zip(_EVENT_NUMBERS, row, strict=True))
        events.append(EventRecord(kind=EventKind(kind), name=name, **event_numbers))
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


def _contact(arrays: Mapping[str, Array], pairs: Any, n: int) -> ContactPoints | None:
    """The contact points of a file with n samples; None if the file has no contact points."""
    if pairs is None:
        return None
    names: list[tuple[str, str]] = []
    for pair in pairs:
        first, second = npz.texts(pair, "contact")
        names.append((first, second))
    n_points = len(arrays[f"{_CONTACT}sample"])
    points: dict[str, Any] = {
        name: npz.checked(
            arrays, f"{_CONTACT}{name}", (n_points, *width), "i" if name in _INDEX_ARRAYS else "f"
        )
        for name, width in _POINT_SHAPES.items()
    }
    for name, n_allowed in zip(_INDEX_ARRAYS, (n, len(names)), strict=True):
        if n_points and not (points[name].min() >= 0 and points[name].max() < n_allowed):
            raise ValueError(f"contact has a {name} that is not from 0 to {n_allowed - 1}")
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
    _temporary_folders.append(temporary)  # keeps the folder until Python ends
    folder = Path(temporary.name).resolve()
    for name, content in meshes.items():
        mesh_path = (folder / name).resolve()
        if not mesh_path.is_relative_to(folder):
            raise ValueError(f"the mesh {name!r} leads out of its folder")
        mesh_path.parent.mkdir(parents=True, exist_ok=True)
        mesh_path.write_bytes(content)
    return loads(yaml, file, folder)


def table_to_json(table: CoordinateTable) -> dict[str, Any]:
    """The coordinates as JSON, without their start values."""
    data = {
        field.name: getattr(table, field.name)
        for field in dataclasses.fields(table)
        if field.name not in ("rows", "start_D", "start_K")
    }
    data["rows"] = [[row.name, row.role, row.owner, row.unit, row.index] for row in table.rows]
    return data


def table_from_json(data: dict[str, Any], arrays: Mapping[str, Array]) -> CoordinateTable:
    """The coordinates from JSON, with the start values in ``arrays``."""
    rows = tuple(
        Coordinate(npz.text(name, "a coordinate"), Role(role), owner, unit, index)
        for name, role, owner, unit, index in data["rows"]
    )
    vectors = ("q_D", "v_D", "q_K", "v_K")
    names = {key: npz.texts(data[key], f"coordinates.{key}") for key in vectors}
    index_pairs: dict[str, Any] = {
        f"{part}_{kind}": _index_pairs(data[f"{part}_{kind}"], names, kind, widths)
        for part, widths in (("quaternions", (4, 3)), ("scalars", (1, 1)))
        for kind in ("D", "K")
    }
    rotations = data["rotations"]
    rotation_pairs = _index_pairs(list(rotations.values()), names, "K", (4, 3))
    commands = data.get("commands", {})
    npz.texts(list(commands.values()), "coordinates.commands")
    return CoordinateTable(
        rows=rows,
        **(index_pairs | names),
        rotations=dict(zip(rotations, rotation_pairs, strict=True)),
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


def _index_pairs(
    pairs: list[Any], names: dict[str, tuple[str, ...]], kind: str, widths: tuple[int, int]
) -> tuple[tuple[int, int], ...]:
    """Indices (q, v) of coordinates with given widths; raises ValueError for one out of range."""
    index_pairs = tuple(tuple(pair) for pair in pairs)
    last_indices = [len(names[f"{part}_{kind}"]) - n for part, n in zip("qv", widths, strict=True)]
    for q, v in index_pairs:
        for index, last in ((q, last_indices[0]), (v, last_indices[1])):
            if type(index) is not int or not 0 <= index <= last:
                raise ValueError(f"coordinates has the index {index!r}; it must be 0 to {last}")
    return index_pairs
