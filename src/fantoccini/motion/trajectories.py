"""Trajectories: the results of many runs, lane first."""

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
SAVED = (*MOTION, *TABLES, RESIDUAL)
"""What a batch can save."""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """n runs of one puppet on the same T times: ``many.q_D[i, k]``, ``many.tension["hand"][i, k]``.

    Quantities that were not saved are None. Samples that a run did not reach are NaN, and not taut.

    Attributes:
        t: (T,) times [s].
        status: (n,) :class:`Status` numbers.
        reached: (n,) time that each reached [s]; NaN if Ctrl-C came before its start.
        violation: (n,) largest h of all rows (fixed steps; 0 for event)
            [m, rad or 1].
        catches, releases: (n,) of strings and limits.
        blame: (n,) by string and limit, its share in stopping each run; by coordinate with a drive,
            whether it lost steps or ran away; 0 to 1.
        method: event, timestepping or variational.
        coordinates: names and places of the coordinates.
        puppet: what moved.
        parameters: (n,) by name, of each run.
        q_D, v_D, acc_D, q_K, v_K, acc_K: (n, T, ...) as of :class:`Trajectory`.
        tension, limit_force, taut, ledger, slip: (n, T) by name, as of :class:`Trajectory`.
        contact_residual: (n, T) of the laws of contact, as of :class:`Trajectory`.
    """

    t: Times
    status: Array
    reached: Array
    violation: Array
    catches: Array
    releases: Array
    blame: Columns
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

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        ended = ", ".join(f"{n} {status.name}" for status, n in self.counts().items())
        return (
            f"<Trajectories {self.puppet.name if self.puppet else ''}: {len(self)} runs from "
            f"{self.t[0]:g} to {self.t[-1]:g} s, {len(self.t)} samples, {self.method}, {ended}>"
        )

    def __iter__(self) -> Iterator[Trajectory]:
        return (self.trajectory(i) for i in range(len(self)))

    @property
    def done(self) -> Array:
        """(n,) bool, the runs that reached their end and held."""
        return self.status == Status.DONE

    def counts(self) -> dict[Status, int]:
        """Number of runs by status, the most frequent first."""
        return {Status(s): n for s, n in Counter(self.status.tolist()).most_common()}

    def blamed(self, i: int, least: float = 0.1) -> tuple[str, ...]:
        """Names whose share of the blame for the end of run i exceeds ``least``."""
        return tuple(n for n in self.blame.names if self.blame[n][i] > least)

    def trajectory(self, i: int) -> Trajectory:
        """Run i by itself; its events were not recorded. Everything must have been saved.

        Simulate with ``save="all"``.

        Raises:
            ValueError: naming what was not saved; or the run was not begun.
        """
        missing = [name for name in (*MOTION, *TABLES) if getattr(self, name) is None]
        if missing:
            raise ValueError(
                f"{', '.join(missing)} of these runs were not saved; simulate with save='all'"
            )
        if not np.isfinite(self.reached[i]):
            raise ValueError(f"run {i} was not begun")
        samples = slice(0, max(1, int(np.searchsorted(self.t, self.reached[i], side="right"))))
        own: dict[str, Any] = {name: getattr(self, name)[i, samples] for name in MOTION}
        own |= {name: self._columns(name, i, samples) for name in TABLES}
        if self.contact_residual is not None:
            own[RESIDUAL] = self.contact_residual[i, samples]
        return Trajectory(
            t=self.t[samples],
            **own,
            events=(),
            events_recorded=False,
            status=Status(int(self.status[i])),
            method=self.method,
            coordinates=self.coordinates,
            puppet=self._puppet(i),
            blamed=self.blamed(i),
        )

    def _puppet(self, i: int) -> Puppet | None:
        """The puppet with the parameters of run i."""
        if self.puppet is None or self.parameters is None:
            return self.puppet
        own = {name: float(self.parameters[name][i]) for name in self.parameters}
        return self.puppet.with_values(own) if own else self.puppet

    def _columns(self, name: str, i: int, samples: slice) -> Columns:
        table: Columns = getattr(self, name)
        return table.like(table.values[i, samples])
