"""Trajectories on disk: npz without pickle, and files that appear whole or not at all."""

from __future__ import annotations

import dataclasses
import json
import os
import secrets
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.errors import FileError, Problem, Status
from fantoccini.motion.columns import Columns
from fantoccini.motion.state import Event
from fantoccini.puppet import Mesh, Puppet, loads
from fantoccini.tree import Coordinate, CoordinateTable, Role

if TYPE_CHECKING:
    from fantoccini.motion.trajectory import Trajectory

FORMAT = "fantoccini.trajectory.1"
RECORDING = "fantoccini.recording.1"
"""Format of a recorded performance, which is written by ``fantoccini.perform``."""
_ARRAYS = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
_TABLES = ("tension", "limit_force", "taut", "ledger", "effort", "violation", "slip")
_NUMBERS = ("t", "impulse", "speed")
_MESH = "mesh:"
UNREADABLE = (
    EOFError,
    MemoryError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""What NumPy and zipfile raise where an npz file is not one, or is damaged."""
_folders: list[TemporaryDirectory] = []


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name in the same folder, renamed to ``path`` when the block ends well."""
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path} cannot be written: there is no folder {path.parent}")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def save(run: Trajectory, path: str | Path) -> None:
    """Writes a trajectory: arrays as they are, names and puppet as JSON text."""
    tables = {name: getattr(run, name) for name in _TABLES if getattr(run, name) is not None}
    about = {
        "format": FORMAT,
        "method": run.method,
        "status": run.status.name,
        "blamed": run.blamed,
        "columns": {name: [table.what, *table.names] for name, table in tables.items()},
        "events": [[event.kind, event.name] for event in run.events],
        "coordinates": _table_to_json(run.coordinates),
        "puppet": None if run.puppet is None else run.puppet.to_yaml(),
    }
    arrays = {name: getattr(run, name) for name in _ARRAYS}
    arrays |= {name: table.values for name, table in tables.items()}
    arrays["events"] = np.array([[getattr(e, x) for x in _NUMBERS] for e in run.events]).reshape(
        -1, len(_NUMBERS)
    )
    arrays["start_D"], arrays["start_K"] = run.coordinates.start_D, run.coordinates.start_K
    for name, content in ({} if run.puppet is None else mesh_files(run.puppet)).items():
        arrays[_MESH + name] = np.frombuffer(content, dtype=np.uint8)
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


def load(path: str | Path) -> Trajectory:
    """Reads what :func:`save` wrote."""
    from fantoccini.motion.trajectory import Trajectory

    try:
        arrays, about = contents(path, FORMAT)
        tables = {
            name: Columns(names[1:], arrays[name], names[0])
            for name, names in about["columns"].items()
        }
        events = [
            Event(kind=kind, name=name, **dict(zip(_NUMBERS, numbers, strict=True)))
            for (kind, name), numbers in zip(about["events"], arrays["events"], strict=True)
        ]
        return Trajectory(
            **{name: arrays[name] for name in _ARRAYS},
            **tables,
            events=tuple(events),
            status=Status[about["status"]],
            blamed=about.get("blamed", ()),
            method=about["method"],
            coordinates=_table_from_json(about["coordinates"], arrays),
            puppet=_puppet(about["puppet"], str(path), arrays),
        )
    except FileNotFoundError:
        raise FileError([Problem(str(path), None, "", "there is no such file")]) from None
    except (*UNREADABLE, AttributeError, LookupError, TypeError) as error:
        message = f"is not a trajectory that this version can read ({error})"
        raise FileError([Problem(str(path), None, "", message)]) from error


def contents(path: str | Path, form: str) -> tuple[dict[str, np.ndarray], dict]:
    """The arrays of an npz file, and what its ``about`` says.

    Args:
        path: the file.
        form: the ``format`` that ``about`` must have.

    Raises:
        ValueError: it has another; and all of ``UNREADABLE``, LookupError and TypeError.
    """
    with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    about = json.loads(arrays["about"].tobytes())
    if about["format"] != form:
        raise ValueError(f"has the format {about['format']!r}; this version reads {form!r}")
    return arrays, about


def mesh_files(puppet: Puppet) -> dict[str, bytes]:
    """The content of a puppet's mesh files, by the name that its text has for them."""
    shapes = [shape for body in puppet.bodies for shape in body.shapes]
    meshes = [shape for shape in (*shapes, *puppet.obstacles) if isinstance(shape, Mesh)]
    return {mesh.file: mesh.path.read_bytes() for mesh in meshes}


def restored(text: str, source: str, meshes: Mapping[str, bytes]) -> Puppet:
    """The puppet of a text; its meshes are laid in a temporary folder that goes when Python ends.

    Args:
        text: YAML.
        source: what messages call the text.
        meshes: as :func:`mesh_files` gives them.

    Raises:
        ValueError: the name of a mesh leads out of its folder.
    """
    if not meshes:
        return loads(text, source)
    kept = TemporaryDirectory(prefix="fantoccini-", ignore_cleanup_errors=True)
    _folders.append(kept)
    folder = Path(kept.name).resolve()
    for name, content in meshes.items():
        place = (folder / name).resolve()
        if not place.is_relative_to(folder):
            raise ValueError(f"the mesh {name!r} leads out of its folder")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    return loads(text, source, folder)


def _puppet(text: str | None, source: str, arrays: dict[str, np.ndarray]) -> Puppet | None:
    if text is None:
        return None
    held = {n[len(_MESH) :]: x.tobytes() for n, x in arrays.items() if n.startswith(_MESH)}
    return restored(text, source, held)


def _table_to_json(table: CoordinateTable) -> dict:
    whole = {
        field.name: getattr(table, field.name)
        for field in dataclasses.fields(table)
        if field.name not in ("rows", "start_D", "start_K")
    }
    whole["rows"] = [[r.name, r.role, r.owner, r.unit, r.index] for r in table.rows]
    return whole


def _table_from_json(data: dict, arrays: dict[str, np.ndarray]) -> CoordinateTable:
    rows = tuple(
        Coordinate(name, Role(role), owner, unit, index)
        for name, role, owner, unit, index in data["rows"]
    )
    names = {key: tuple(data[key]) for key in ("q_D", "v_D", "q_K", "v_K")}
    places = {
        key: tuple(tuple(pair) for pair in data[key])
        for key in ("quaternions_D", "quaternions_K", "scalars_D", "scalars_K")
    }
    return CoordinateTable(
        rows=rows,
        **names,
        **places,
        rotations={name: tuple(place) for name, place in data["rotations"].items()},
        commands=data.get("commands", {}),
        start_D=arrays["start_D"],
        start_K=arrays["start_K"],
    )
