"""Error of the mixed model for the drives of the puppet's own file.

Gears, friction, motor limits and controllers are those of the file. Coordinates without a drive
there stay inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.section_vi.deviation import Deviation, deviation
from benchmarks.section_vi.mechanism import Mechanism
from benchmarks.section_vi.reference import Reference

from fantoccini.base.arrays import Array
from fantoccini.base.errors import StateError
from fantoccini.dynamics.compiled import Event
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate

_EVENT = Event(rtol=1e-8, atol=1e-8)


@dataclass(frozen=True, eq=False)
class FileDrives:
    """A run on the drives of the puppet's file.

    Attributes:
        drives: names of the coordinates with a drive.
        deviation: deviation from the mixed model, each motion relative to its own rest.
        lag: (T, n) tracking error of each drive's coordinate [m or rad], the largest of an
            orientation's three.
        force: (n,) largest force of each motor [N or N m].
    """

    drives: tuple[str, ...]
    deviation: Deviation
    lag: Array
    force: Array


def follow_on_file_drives(
    mechanism: Mechanism, marionette: Marionette, reference: Reference
) -> FileDrives:
    """A motion of the mixed model, followed by the file's drives.

    Args:
        mechanism: the puppet without drives.
        marionette: the puppet with those of its file.
        reference: motion of the mixed model.

    Raises:
        StateError: a drive has no controller, or no rest was found.
    """
    table = marionette.coordinates
    drives = [(row, row.command) for row in marionette.tree.drives]
    idle = [row.name for row, command in drives if command is None]
    if idle:
        raise StateError(f"the drives of {', '.join(idle)} have no control and follow nothing")
    x0 = marionette.rest(mechanism.values(reference.x0))
    commands = mechanism.translated(reference.inputs, marionette)
    end = reference.inputs.end
    run = simulate(marionette, x0, commands, end, method=_EVENT, throw=False)
    apart = deviation(mechanism, reference.run, run, from_rest=True)
    errors = mechanism.difference(reference.run.resample(apart.t), run.resample(apart.t))[1]
    lags, forces = [], []
    v_K = mechanism.mixed.coordinates.v_K
    for row, command in drives:
        names = table.v_D[row.v]
        lags.append(np.max(np.abs(errors[:, [v_K.index(n) for n in names]]), axis=1))
        if command is not None and run.effort is not None:
            motors = [table.v_K[command[1] + k] for k in range(len(names))]
            forces.append(max(float(np.max(np.abs(run.effort[n]))) for n in motors))
    return FileDrives(
        tuple(row.name for row, _ in drives), apart, np.stack(lags, axis=1), np.array(forces)
    )
