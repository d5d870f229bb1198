"""The drives that the puppet's file has, as they are: how far they take it from the mixed model.

Gears, friction, bounds of motors and controllers are those of the file. Coordinates that have no
drive there stay inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError
from fantoccini.marionette import Event, Marionette
from fantoccini.reduction.mechanism import Mechanism
from fantoccini.reduction.motions import Motion
from fantoccini.simulation import simulate

_RTOL = 1e-8


@dataclass(frozen=True, eq=False)
class Own:
    """The puppet on its own drives beside the mixed model.

    Attributes:
        drives: names of the coordinates with a drive.
        t: (T,) times [s].
        puppet: (T,) largest difference of a coordinate of the puppet, both counted from their own
            rest [m or rad].
        lag: (T, n) what each drive's coordinate lacks of the mixed model's [m or rad], the largest
            of an orientation's three.
        force: (n,) largest force of each motor [N or N m].
        status: how the run ended, where it stopped before its end; else empty.
    """

    drives: tuple[str, ...]
    t: Array
    puppet: Array
    lag: Array
    force: Array
    status: str = ""

    @property
    def worst(self) -> float:
        """Largest difference of the puppet."""
        return float(np.max(self.puppet))


def own(mechanism: Mechanism, marionette: Marionette, motion: Motion) -> Own:
    """A motion of the mixed model on the file's drives.

    Args:
        mechanism: the puppet without drives.
        marionette: it with those of its file.
        motion: of the mixed model.

    Raises:
        StateError: a drive has no controller, or no rest was found.
    """
    tree, table = marionette.tree, marionette.coordinates
    idle = [row.name for row in tree.drives if row.command is None]
    if idle:
        raise StateError(f"{', '.join(idle)} has a drive that follows nothing; needed: a control")
    start = marionette.rest(mechanism.values(motion.x0))
    commands = mechanism.commanded(marionette, motion.inputs)
    run = simulate(
        marionette,
        start,
        commands,
        motion.inputs.end,
        method=Event(rtol=_RTOL, atol=_RTOL),
        throw=False,
    )
    times = np.linspace(run.t[0], min(run.t[-1], motion.run.t[-1]), 300)
    puppet, drives = mechanism.away(motion.run.resample(times), run.resample(times))
    lags, forces = [], []
    v_K = mechanism.mixed.coordinates.v_K
    for row in tree.drives:
        names = table.v_D[row.v]
        lags.append(np.max(np.abs(drives[:, [v_K.index(n) for n in names]]), axis=1))
        places = [table.v_K[row.command[1] + k] for k in range(len(names))]
        forces.append(max(float(np.max(np.abs(run.effort[n]))) for n in places))
    return Own(
        tuple(row.name for row in tree.drives),
        times,
        np.max(np.abs(puppet - puppet[0]), axis=1, initial=0.0),
        np.stack(lags, axis=1),
        np.array(forces),
        "" if run.t[-1] >= motion.inputs.end - 1e-9 else run.status.message,
    )
