"""Recordings on disk: npz without pickle, whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from fantoccini.errors import FantocciniError, FileError, Problem, Status
from fantoccini.marionette import Marionette, Parcel
from fantoccini.motion import State
from fantoccini.motion.archive import RECORDING as FORMAT
from fantoccini.motion.archive import UNREADABLE, contents, replacing
from fantoccini.perform.recording import Recording, Written
from fantoccini.world import World

_STATE = ("q_D", "v_D", "q_K", "v_K", "taut", "slip")
_MESH = "mesh:"


def save(recording: Recording, path: str | Path) -> None:
    """Writes a recording; an edited one is simulated first."""
    recording = recording.kept()
    marionette, written = recording.marionette, recording.written
    # Obstacles that no puppet has do not move it; they are not kept.
    parcel = Parcel.of(World.of(*marionette.world.puppets, name=marionette.name))
    about = {
        "format": FORMAT,
        "world": marionette.name,
        "puppets": parcel.puppets,
        "parameters": list(marionette.tree.parameters),
        "coordinates": list(marionette.coordinates.q_D + marionette.coordinates.q_K),
        "steps": recording.steps,
        "ended": recording.ended,
        "status": written.status.name,
    }
    arrays = {f"start_{name}": getattr(recording.start, name) for name in _STATE}
    arrays |= {
        "t": np.array(recording.start.t),
        "tick": np.array(recording.tick),
        "acc_K": recording.acc_K,
        "p": marionette.p,
        "winches": marionette.winches,
        "rows": written.rows,
        "events": written.events,
        "about": np.frombuffer(json.dumps(about).encode(), dtype=np.uint8),
    }
    for i, meshes in enumerate(parcel.meshes):
        for name, content in meshes.items():
            arrays[f"{_MESH}{i}:{name}"] = np.frombuffer(content, dtype=np.uint8)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


def load(path: str | Path) -> Recording:
    """Reads what :func:`save` wrote."""
    try:
        arrays, about = contents(path, FORMAT)
        marionette = _marionette(about, arrays)
        state = {name: arrays[f"start_{name}"] for name in _STATE}
        written = Written(arrays["rows"], arrays["events"], Status[about["status"]])
        _check(marionette, state, written)
        return Recording(
            marionette,
            State(float(arrays["t"]), **state, coordinates=marionette.coordinates),
            arrays["acc_K"],
            float(arrays["tick"]),
            int(about["steps"]),
            str(about["ended"]),
            written,
        )
    except FileNotFoundError:
        raise FileError([Problem(str(path), None, "", "there is no such file")]) from None
    except (*UNREADABLE, AttributeError, LookupError, TypeError, FantocciniError) as error:
        message = f"is not a recording that this version can read ({error})"
        raise FileError([Problem(str(path), None, "", message)]) from error


def _marionette(about: dict, arrays: dict[str, np.ndarray]) -> Marionette:
    meshes = []
    for i, _ in enumerate(about["puppets"]):
        mark = f"{_MESH}{i}:"
        mine = [name for name in arrays if name.startswith(mark)]
        meshes.append({name[len(mark) :]: arrays[name].tobytes() for name in mine})
    marionette = Marionette(Parcel(about["world"], about["puppets"], tuple(meshes)).world())
    table = marionette.coordinates
    if list(table.q_D + table.q_K) != about["coordinates"]:
        raise ValueError("its puppet has other coordinates than were recorded")
    values = dict(zip(about["parameters"], arrays["p"].tolist(), strict=True))
    return marionette.with_parameters(values).with_winches(arrays["winches"])


def _check(marionette: Marionette, state: dict[str, np.ndarray], written: Written) -> None:
    """Raises ValueError unless what was recorded has the puppet's sizes."""
    table, n = marionette.coordinates, len(marionette.tree.strings)
    sizes = (table.n_qD, table.n_vD, table.n_qK, table.n_vK, marionette.tree.n_rows, n)
    wanted = {f"start_{name}": (size,) for name, size in zip(_STATE, sizes, strict=True)}
    wanted |= {"rows": (len(written.rows), sum(marionette.row_layout.widths.values()))}
    wanted |= {"events": (len(written.events), 5)}
    found = {f"start_{name}": x.shape for name, x in state.items()}
    found |= {"rows": written.rows.shape, "events": written.events.shape}
    for name, shape in wanted.items():
        if found[name] != shape:
            raise ValueError(f"{name} has the shape {found[name]}; it must be {shape}")
    if not len(written.rows):
        raise ValueError("it has no rows")
