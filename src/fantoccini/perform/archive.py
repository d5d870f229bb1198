"""Recordings on disk: npz without pickle, whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import EVENT_AT, EventCode
from fantoccini.errors import Status
from fantoccini.marionette import Marionette, Parcel
from fantoccini.motion import State
from fantoccini.motion.archive import RECORDING as FORMAT, replacing
from fantoccini.motion.npz import checked, contents, finite, texts, understanding
from fantoccini.perform.recording import Recording, Written
from fantoccini.world import World

_STATE = ("q_D", "v_D", "q_K", "v_K", "taut", "slip")
_MESH = "mesh:"
_MOST_STEPS = 1_000_000
"""Of the time-stepper in a tick."""


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
    what = "a recording"
    arrays, about = contents(path, FORMAT, what)
    with understanding(path, what):
        marionette = _marionette(about, arrays)
        table, tree = marionette.coordinates, marionette.tree
        sizes = (table.n_qD, table.n_vD, table.n_qK, table.n_vK, tree.n_rows, len(tree.strings))
        state = {
            name: _of_state(arrays, f"start_{name}", size)
            for name, size in zip(_STATE, sizes, strict=True)
        }
        t, tick = (float(finite(arrays, name, ())) for name in ("t", "tick"))
        rows = finite(arrays, "rows", (None, sum(marionette.model.row_layout.widths.values())))
        if not len(rows) or np.any(np.diff(rows[:, 0]) < 0):
            raise ValueError("rows must be one or more, none before the one it follows")
        events = _events(marionette, finite(arrays, "events", (None, 5)))
        steps = about["steps"]
        if type(steps) is not int or not 1 <= steps <= _MOST_STEPS:
            raise ValueError(f"found {steps!r} steps in a tick; allowed: 1 to {_MOST_STEPS}")
        return Recording(
            marionette,
            State(t, **state, coordinates=marionette.coordinates),
            finite(arrays, "acc_K", (None, table.n_vK)),
            tick,
            steps,
            str(about["ended"]),
            Written(rows, events, Status[about["status"]]),
        )


def _of_state(arrays: dict[str, Array], name: str, size: int) -> Array:
    if name == "start_taut":
        return checked(arrays, name, (size,), "b")
    return finite(arrays, name, (size,))


def _events(marionette: Marionette, events: Array) -> Array:
    """Events of kinds and rows that there are."""
    n = len(marionette.tree.blamable)
    for event in events:
        kind, row = event[EVENT_AT["kind"]], event[EVENT_AT["row"]]
        if kind not in list(EventCode) or row not in range(-1, n):
            raise ValueError(f"found an event of the kind {kind:g} at the row {row:g}")
    return events


def _marionette(about: dict, arrays: dict[str, Array]) -> Marionette:
    puppets, meshes = texts(about["puppets"], "puppets"), []
    for i, _ in enumerate(puppets):
        mark = f"{_MESH}{i}:"
        mine = [name for name in arrays if name.startswith(mark)]
        meshes.append({name[len(mark) :]: arrays[name].tobytes() for name in mine})
    marionette = Marionette(Parcel(str(about["world"]), puppets, tuple(meshes)).world())
    table, parameters = marionette.coordinates, texts(about["parameters"], "parameters")
    if list(table.q_D + table.q_K) != about["coordinates"]:
        raise ValueError("its puppet has other coordinates than were recorded")
    values = dict(zip(parameters, finite(arrays, "p", (len(parameters),)).tolist(), strict=True))
    winches = checked(arrays, "winches", marionette.winches.shape)
    return marionette.with_parameters(values).with_winches(winches)
