"""Runs as lists of arrays, for caches."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array
from fantoccini.model.puppet import Puppet
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import archive
from fantoccini.motion.trajectory import Trajectory


def pack_run(run: Trajectory) -> list[Array]:
    """Arrays with all results of a run except its puppet; first one with names, as JSON."""
    fields = {field.name: getattr(run, field.name) for field in dataclasses.fields(run)}
    arrays, about = archive.contents_of(fields | {"puppet": None})
    text = json.dumps({"about": about, "arrays": [*arrays]})
    return [np.frombuffer(text.encode(), dtype=np.uint8), *arrays.values()]


def unpack_run(
    arrays: Sequence[Array], puppet: Puppet | None, coordinates: CoordinateTable
) -> Trajectory:
    """The run in the result of :func:`pack_run`, to the same bits.

    Args:
        arrays: result of :func:`pack_run`.
        puppet: puppet of the run.
        coordinates: its coordinates.

    Raises:
        LookupError, TypeError, ValueError: the arrays are not those of a run.
    """
    header = json.loads(arrays[0].tobytes())
    arrays_by_name = dict(zip(header["arrays"], arrays[1:], strict=True))
    fields = archive.fields_of(arrays_by_name, header["about"], "")
    return Trajectory(**fields | {"puppet": puppet, "coordinates": coordinates})
