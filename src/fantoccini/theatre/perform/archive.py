"""Recordings on disk: npz files without pickle.

A file contains the start, the motion of the hands, and a sample for each second. Simulating the
rest gives the same bits if the samples are reproduced; if they are not, on a machine with other
rounding, each second is simulated from the sample at its start.

acc_K are the accelerations of the driven coordinates q_K, which the hands move; q_D are the dynamic
coordinates. A tick is the interval at which a performance advances. A marionette is a puppet with
its compiled equations; `marionette.puppet` is the description in its file. A winch changes the
length of a string. A row is a string or a joint limit with its gap h <= 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, Status, npz
from fantoccini.dynamics.compiled import PortablePuppet
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.contract import CONTACT, EVENT_AT, EventCode, width
from fantoccini.kernel.runtime import Piece
from fantoccini.motion import RECORDING_FORMAT as FORMAT, State, restored

_STATE_ARRAYS = ("q_D", "v_D", "q_K", "v_K", "taut", "slip")
_MESH_PREFIX = "mesh:"
_CONTACT_EVENTS = (EventCode.TOUCH, EventCode.LIFT, EventCode.STICK, EventCode.SLIDE)
_SAMPLE_INTERVAL = 1.0
"""Time between saved samples [s]."""
_MAX_STEPS = 1_000_000
"""Largest number of time steps in a tick, which bounds the run of a damaged file."""


@dataclass(frozen=True, eq=False)
class RecordedOutput:
    """Output of a run, as the compiled code wrote it.

    Attributes:
        piece: samples, one a tick, events and contact points.
        status: end of the run.
    """

    piece: Piece
    status: Status = Status.DONE


@dataclass(frozen=True, eq=False)
class ReferenceSamples:
    """Samples of a saved recording.

    Attributes:
        ticks: (k,) numbers of ticks before each sample, from 0.
        samples: (k, width) samples.
        status: end of the run.
    """

    ticks: Indices
    samples: Array
    status: Status


def save(fields: Mapping[str, Any], path: str | Path) -> None:
    """Writes the fields of a recording."""
    marionette: Marionette = fields["marionette"]
    start: State = fields["start"]
    output: RecordedOutput = fields["output"]
    samples = output.piece.samples
    stride = max(1, round(_SAMPLE_INTERVAL / fields["tick"]))
    indices = np.unique(np.append(np.arange(0, len(samples), stride), len(samples) - 1))
    portable = PortablePuppet.from_puppet(marionette.puppet)
    metadata = {
        "format": FORMAT,
        "puppet": portable.text,
        "parameters": list(marionette.tree.parameters),
        "coordinates": list(marionette.coordinates.q_D + marionette.coordinates.q_K),
        "steps": fields["steps"],
        "ended": fields["end_reason"],
        "status": output.status.name,
    }
    arrays = {f"start_{name}": getattr(start, name) for name in _STATE_ARRAYS}
    arrays |= {
        "t": np.array(start.t),
        "tick": np.array(fields["tick"]),
        "acc_K": fields["acc_K"],
        "p": marionette.p,
        "winches": marionette.winches,
        "ticks": indices,
        "checks": samples[indices],
    }
    arrays |= npz.packed(_MESH_PREFIX, portable.meshes)
    npz.write(path, arrays, metadata, compressed=True)


def fields_of(arrays: Mapping[str, Array], metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a recording from the contents of its file.

    Raises:
        FantocciniError, LookupError, TypeError, ValueError: the contents are not those of a
            recording.
    """
    marionette = _marionette(metadata, arrays)
    table, tree = marionette.coordinates, marionette.tree
    sizes = (table.n_qD, table.n_vD, table.n_qK, table.n_vK, tree.n_rows, len(tree.strings))
    state: dict[str, Any] = {
        name: _state_array(arrays, f"start_{name}", size)
        for name, size in zip(_STATE_ARRAYS, sizes, strict=True)
    }
    start_time, tick = (float(npz.finite(arrays, name, ())) for name in ("t", "tick"))
    acc_K = npz.finite(arrays, "acc_K", (None, table.n_vK))
    status, output_fields = Status[metadata["status"]], dict[str, Any]()
    if metadata["format"] == FORMAT:
        output_fields["references"] = _references(marionette, arrays, len(acc_K), status)
    else:
        output_fields["output"] = RecordedOutput(_output(marionette, arrays), status)
    steps = metadata["steps"]
    if type(steps) is not int or not 1 <= steps <= _MAX_STEPS:
        raise ValueError(f"found {steps!r} steps in a tick; allowed: 1 to {_MAX_STEPS}")
    return {
        "marionette": marionette,
        "start": State(start_time, **state, coordinates=table),
        "acc_K": acc_K,
        "tick": tick,
        "steps": steps,
        "end_reason": str(metadata["ended"]),
        **output_fields,
    }


def _samples(marionette: Marionette, arrays: Mapping[str, Array], name: str) -> Array:
    width = sum(marionette.sample_layout.widths.values())
    samples = npz.finite(arrays, name, (None, width))
    if not len(samples) or np.any(np.diff(samples[:, 0]) < 0):
        raise ValueError(f"{name} must be one or more, none before the one it follows")
    return samples


def _references(
    marionette: Marionette, arrays: Mapping[str, Array], n_ticks: int, status: Status
) -> ReferenceSamples:
    samples = _samples(marionette, arrays, "checks")
    ticks: Indices = npz.checked(arrays, "ticks", (len(samples),), "i").astype(np.intp)
    if ticks[0] != 0 or np.any(np.diff(ticks) <= 0) or ticks[-1] > n_ticks:
        raise ValueError(f"ticks must increase from 0 and be at most {n_ticks}")
    return ReferenceSamples(ticks, samples, status)


def _output(marionette: Marionette, arrays: Mapping[str, Array]) -> Piece:
    """Samples, events and contact points of a file in the previous format."""
    samples = _samples(marionette, arrays, "rows")
    contacts = npz.finite(arrays, "contacts", (None, width(CONTACT, {})))
    pairs = _n_pairs(marionette, contacts, len(samples))
    events = _events(marionette, npz.finite(arrays, "events", (None, 5)), pairs)
    return Piece(samples, events, contacts)


def _state_array(arrays: Mapping[str, Array], name: str, size: int) -> Array:
    if name == "start_taut":
        return npz.checked(arrays, name, (size,), "b")
    return npz.finite(arrays, name, (size,))


def _n_pairs(marionette: Marionette, contacts: Array, n_samples: int) -> int:
    """Number of pairs that may touch; checks the indices in contact points."""
    contacts_of_puppet = marionette.contacts
    n_pairs = 0 if contacts_of_puppet is None else len(contacts_of_puppet.names)
    for name, column, upper in (("sample", 0, n_samples), ("pair", 1, n_pairs)):
        if not np.isin(contacts[:, column], np.arange(upper)).all():
            raise ValueError(f"contacts has a {name} that is not from 0 to {upper - 1}")
    return n_pairs


def _events(marionette: Marionette, events: Array, n_pairs: int) -> Array:
    """The events; checks their kinds and rows."""
    n_attributable = len(marionette.tree.attributable)
    for event in events:
        kind, row = event[EVENT_AT["kind"]], event[EVENT_AT["row"]]
        n_rows = n_attributable + n_pairs if kind in _CONTACT_EVENTS else n_attributable
        if kind not in list(EventCode) or row not in range(-1, n_rows):
            raise ValueError(f"found an event of the kind {kind:g} at the row {row:g}")
    return events


def _marionette(metadata: Mapping[str, Any], arrays: Mapping[str, Array]) -> Marionette:
    text = npz.text(metadata["puppet"], "puppet")
    marionette = Marionette(restored(text, "<recording>", npz.unpacked(_MESH_PREFIX, arrays)))
    table, parameters = marionette.coordinates, npz.texts(metadata["parameters"], "parameters")
    if list(table.q_D + table.q_K) != metadata["coordinates"]:
        raise ValueError("its puppet has other coordinates than were recorded")
    parameter_values = npz.finite(arrays, "p", (len(parameters),)).tolist()
    values = dict(zip(parameters, parameter_values, strict=True))
    winches = npz.checked(arrays, "winches", marionette.winches.shape)
    return marionette.with_parameters(values).with_winches(winches)
