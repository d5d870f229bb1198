"""Motions from many states at once: every driven coordinate at a constant acceleration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, Status, UnknownNameError
from fantoccini.marionette import Marionette
from fantoccini.plan.clearance import Clearance
from fantoccini.plan.goals import Rows
from fantoccini.runtime import Batch


@dataclass(frozen=True, eq=False)
class Bounds:
    """What the driven coordinates may do.

    Attributes:
        speed: (n_vK,) largest |v_K| [m/s or rad/s].
        acceleration: (n_vK,) largest |acc_K| [m/s^2 or rad/s^2].
        low, high: (n_qK,) range of the coordinates [m or rad].
    """

    speed: Array
    acceleration: Array
    low: Array
    high: Array

    @property
    def moves(self) -> Array:
        """(n_vK,) bool, the coordinates that may move."""
        return (self.speed > 0.0) & (self.acceleration > 0.0)

    @classmethod
    def of(
        cls,
        marionette: Marionette,
        speed: float | Mapping[str, float],
        acceleration: float | Mapping[str, float],
        ranges: Mapping[str, tuple[float, float]],
    ) -> Bounds:
        """Bounds from what a user gives.

        Args:
            marionette: the puppet.
            speed, acceleration: of all driven coordinates, or name -> value; coordinates that are
                not named hold still.
            ranges: name -> (low, high); the others are free, but that lengths stay positive.

        Raises:
            UnknownNameError: a name that is no driven coordinate.
            StateError: a bound that is negative or not finite, no coordinate that may move, or a
                puppet with driven rotations.
        """
        table = marionette.coordinates
        if table.quaternions_K:
            raise StateError("plans move points and lengths; this puppet has a driven rotation")
        sizes = {
            "speed": _bounds(table.q_K, speed, "speed"),
            "acceleration": _bounds(table.q_K, acceleration, "acceleration"),
        }
        if not np.any((sizes["speed"] > 0.0) & (sizes["acceleration"] > 0.0)):
            raise StateError("no driven coordinate may move: speed or acceleration is 0 for all")
        low, high = np.full(table.n_qK, -np.inf), np.full(table.n_qK, np.inf)
        for string in marionette.tree.strings:
            if string.length_index:
                low[string.length_index[0]] = 1e-3
        for name, (least, most) in ranges.items():
            if name not in table.q_K:
                raise UnknownNameError("driven coordinate", name, list(table.q_K))
            if not least < most:
                raise StateError(f"the range of {name} is {least} to {most}; it must not be empty")
            k = table.q_K.index(name)
            low[k], high[k] = max(low[k], least), most
        return cls(**sizes, low=low, high=high)


def _bounds(names: tuple[str, ...], given: float | Mapping[str, float], what: str) -> Array:
    if not isinstance(given, Mapping):
        given = dict.fromkeys(names, given)
    found = np.zeros(len(names))
    for name, value in given.items():
        if name not in names:
            raise UnknownNameError("driven coordinate", name, list(names))
        if not 0.0 <= value < np.inf:
            raise StateError(f"the {what} of {name} is {value}; it must be finite and at least 0")
        found[names.index(name)] = value
    return found


@dataclass(frozen=True, eq=False)
class Swept:
    """Motions looked at in equal times.

    Attributes:
        rows: (n, m + 1, ...) states, the first those that the motions began at.
        good: (n, m + 1) bool: free of collisions, within the bounds and finite up to there.
        clearance: (n, m + 1) [m].
    """

    rows: Rows
    good: Array
    clearance: Array


class Motions:
    """Makes motions by time-stepping in lanes on all threads, and looks whether they are clear.

    Args:
        marionette: the puppet.
        clearance: what it keeps clear of.
        bounds: of the driven coordinates.
        margin: least clearance [m].
        dt: step [s].
        look: steps from one look to the next.
        threads: that share the work; the results do not depend on it.
    """

    def __init__(
        self,
        marionette: Marionette,
        clearance: Clearance,
        bounds: Bounds,
        *,
        margin: float,
        dt: float,
        look: int,
        threads: int,
    ):
        self.marionette, self.clearance, self.bounds = marionette, clearance, bounds
        self.margin, self.dt, self.look, self.threads = margin, dt, look, threads
        self._options = marionette.run_options(dt=dt, save_every=look)

    @property
    def interval(self) -> float:
        """From one look to the next [s]."""
        return self.dt * self.look

    def sweep(self, starts: Rows, acceleration: Array, looks: int) -> Swept:
        """Motions of equal duration.

        Args:
            starts: (n,) states.
            acceleration: (n, n_vK) of the driven coordinates.
            looks: m, how many times of ``interval`` they last.
        """
        n, m = len(acceleration), looks + 1
        table, tree = self.marionette.coordinates, self.marionette.tree
        # Whole steps, so that a motion that ends earlier has the same times.
        t = self.dt * (self.look * np.arange(m))
        parts = {
            "q_D": np.full((n, m, table.n_qD), np.nan),
            "v_D": np.full((n, m, table.n_vD), np.nan),
            "slip": np.full((n, m, len(tree.strings)), np.nan),
        }
        coef = np.zeros((n, 1, table.n_vK, 6))
        coef[:, 0, :, 0], coef[:, 0, :, 1] = starts.q_K, starts.v_K
        coef[:, 0, :, 2] = 0.5 * acceleration
        batch = Batch(
            n=n, t=0.0, t_end=t[-1],
            q_D=starts.q_D, v_D=starts.v_D, slip=starts.slip,
            breaks=np.array([[0.0, t[-1]]]), coef=coef,
            base=np.ascontiguousarray(starts.q_K[:, None]), force=None,
            p=self.marionette.p, winches=self.marionette.winches, options=self._options, times=t,
            parts=parts, status=np.full(n, Status.STOPPED, dtype=np.int32),
            reached=np.full(n, np.nan), violation=np.zeros(n),
            events=np.zeros((n, 2), dtype=np.int64), blame=np.zeros((n, tree.n_rows)),
        )  # fmt: skip
        library = self.marionette.lanes
        batch.run(library, min(self.threads, -(-n // library.width)))
        q_K = starts.q_K[:, None] + t[:, None] * (
            starts.v_K[:, None] + 0.5 * t[:, None] * acceleration[:, None]
        )
        v_K = starts.v_K[:, None] + t[:, None] * acceleration[:, None]
        rows = Rows(parts["q_D"], parts["v_D"], parts["slip"], q_K, v_K)
        return self._looked_at(rows)

    def _looked_at(self, rows: Rows) -> Swept:
        finite = np.isfinite(rows.q_D).all(axis=-1) & np.isfinite(rows.v_D).all(axis=-1)
        q_D = rows.q_D
        if not finite.all():
            # What a motion that stopped has not reached is looked at where it began.
            q_D = np.where(finite[..., None], q_D, q_D[:, :1])
        clear = self.clearance.at(q_D, rows.q_K, threads=self.threads)
        bounds = self.bounds
        within = (rows.q_K >= bounds.low) & (rows.q_K <= bounds.high)
        slow = np.abs(rows.v_K) <= bounds.speed * (1.0 + 1e-12)
        now = finite & (clear >= self.margin) & within.all(axis=-1) & slow.all(axis=-1)
        return Swept(rows, np.logical_and.accumulate(now, axis=-1), clear)
