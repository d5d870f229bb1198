"""Trajectories: the results of many runs, lane first.

A lane is here one of these runs. q_D and q_K are the dynamic and driven coordinates, v and acc
their velocities and accelerations; the ledger is the table of energies and work. A taut string
pulls, a slack one does not. At a catch, a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import Array, Status, Times
from fantoccini.motion.columns import Columns
from fantoccini.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from fantoccini.model.puppet import Puppet
    from fantoccini.model.tree import CoordinateTable

MOTION = ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
TABLES = ("tension", "limit_force", "taut", "ledger", "slip")
RESIDUAL = "contact_residual"
UNDETERMINED = "undetermined"
SAVED = (*MOTION, *TABLES, RESIDUAL, UNDETERMINED)
"""Quantities that a batch can save."""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """n runs of one puppet at T times: ``batch.q_D[i, k]``, ``batch.tension["hand"][i, k]``.

    Quantities that were not saved are None. Samples that a run did not reach are NaN; their taut
    flags are False.

    Attributes:
        t: (T,) times [s].
        status: (n,) :class:`Status` numbers.
        reached: (n,) time that each run reached [s]; NaN if Ctrl-C came before its start.
        violation: (n,) largest h of all rows (fixed steps; 0 for event) [m, rad or 1].
        catches, releases: (n,) numbers of catches and releases of strings and limits.
        attribution: (n,) causes of each run's end, 0 to 1: share of each string and limit in
            stopping it; whether each coordinate's drive lost steps or ran away.
        method: event, timestepping or variational.
        coordinates: names and indices of the coordinates.
        puppet: puppet of the runs; None if unknown.
        parameters: (n,) values of each parameter.
        q_D, v_D, acc_D, q_K, v_K, acc_K: (n, T, ...) motion, as in :class:`Trajectory`.
        tension, limit_force, taut, ledger, slip: (n, T) columns, as in :class:`Trajectory`.
        contact_residual: (n, T) violation of the contact laws, as in :class:`Trajectory`.
        undetermined: (n, T) undetermined tensions and efforts, as in :class:`Trajectory`; None for
            puppets with contact, whose points a batch does not keep.
    """

    t: Times
    status: Array
    reached: Array
    violation: Array
    catches: Array
    releases: Array
    attribution: Columns
    method: str
    coordinates: CoordinateTable
    puppet: Puppet | None = None
    parameters: Columns | None = None
    q_D: Array | None = None
    v_D: Array | None = None
    acc_D: Array | None = None
    q_K: Array | None = None
    v_K: Array | None = None
    acc_K: Array | None = None
    tension: Columns | None = None
    limit_force: Columns | None = None
    taut: Columns | None = None
    ledger: Columns | None = None
    slip: Columns | None = None
    contact_residual: Array | None = None
    undetermined: Columns | None = None

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        endings = ", ".join(f"{n} {status.name}" for status, n in self.counts().items())
        return (
            f"<Trajectories {self.puppet.name if self.puppet else ''}: {len(self)} runs from "
            f"{self.t[0]:g} to {self.t[-1]:g} s, {len(self.t)} samples, {self.method}, {endings}>"
        )

    def __iter__(self) -> Iterator[Trajectory]:
        return (self.trajectory(i) for i in range(len(self)))

    @property
    def done(self) -> Array:
        """(n,) bool, whether each run ended with the status DONE."""
        return self.status == Status.DONE

    def counts(self) -> dict[Status, int]:
        """Number of runs by status, the most frequent first."""
        return {Status(s): n for s, n in Counter(self.status.tolist()).most_common()}

    def causes(self, i: int, min_share: float = 0.1) -> tuple[str, ...]:
        """Names whose share in ``attribution`` of run i exceeds ``min_share``."""
        return tuple(n for n in self.attribution.names if self.attribution[n][i] > min_share)

    def trajectory(self, i: int) -> Trajectory:
        """Run i as a trajectory without events, from a batch simulated with ``save="all"``.

        Raises:
            ValueError: a quantity was not saved, or the run did not begin.
        """
        missing = [name for name in (*MOTION, *TABLES) if getattr(self, name) is None]
        if missing:
            raise ValueError(
                f"{', '.join(missing)} of these runs were not saved; simulate with save='all'"
            )
        if not np.isfinite(self.reached[i]):
            raise ValueError(f"run {i} did not begin")
        samples = slice(0, max(1, int(np.searchsorted(self.t, self.reached[i], side="right"))))
        fields: dict[str, Any] = {name: getattr(self, name)[i, samples] for name in MOTION}
        fields |= {name: self._columns(name, i, samples) for name in TABLES}
        if self.contact_residual is not None:
            fields[RESIDUAL] = self.contact_residual[i, samples]
        if self.undetermined is not None:
            fields[UNDETERMINED] = self._columns(UNDETERMINED, i, samples)
        return Trajectory(
            t=self.t[samples],
            **fields,
            events=(),
            events_recorded=False,
            status=Status(int(self.status[i])),
            method=self.method,
            coordinates=self.coordinates,
            puppet=self._puppet(i),
            causes=self.causes(i),
        )

    def _puppet(self, i: int) -> Puppet | None:
        """The puppet with the parameters of run i."""
        if self.puppet is None or self.parameters is None:
            return self.puppet
        values = {name: float(self.parameters[name][i]) for name in self.parameters}
        return self.puppet.with_values(values) if values else self.puppet

    def _columns(self, name: str, i: int, samples: slice) -> Columns:
        table: Columns = getattr(self, name)
        return table.like(table.values[i, samples])
