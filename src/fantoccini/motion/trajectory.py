"""Trajectory: all results of a run over time. An impact is two samples at one time.

q_D are the dynamic coordinates and q_K the driven ones, v and acc their velocities and
accelerations. The ledger is the table of energies and work; slip is the length that a winch has let
out. A taut string pulls, a slack one does not. A drive moves a coordinate by a motor towards its
command. At a catch, a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fantoccini.base import (
    Array,
    Indices,
    StateError,
    Status,
    Times,
    UnknownNameError,
    floats,
    interpolate,
    npz,
    output,
    read_only,
    write_table,
)
from fantoccini.motion import archive
from fantoccini.motion.columns import Columns
from fantoccini.motion.contacts import ContactPoints
from fantoccini.motion.overload import Overload, overloads
from fantoccini.motion.state import EventRecord, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fantoccini.model.puppet import Puppet
    from fantoccini.model.tree import CoordinateTable

LEDGER = ("kinetic", "potential", "damping", "impact", "slip", "friction", "work", "residual")
"""Entries of the energy ledger [J], in order."""

_MOTION_FIELDS = ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
_MAX_TIME_OUTSIDE = 1e-9
"""Largest time before or after the run that counts as its start or end [s]: rounding."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The results of a run at T samples. The arrays are read-only copies.

    Attributes:
        t: (T,) times [s], not decreasing.
        q_D: (T, n_qD) dynamic configuration [rad, m or 1].
        v_D: (T, n_vD) dynamic velocity [rad/s or m/s].
        acc_D: (T, n_vD) dynamic acceleration [rad/s^2 or m/s^2].
        q_K: (T, n_qK) driven configuration [rad, m or 1].
        v_K: (T, n_vK) driven velocity [rad/s or m/s].
        acc_K: (T, n_vK) driven acceleration [rad/s^2 or m/s^2].
        tension: tension of each string, >= 0 [N].
        limit_force: force of each limit, >= 0 [N or N m].
        taut: whether each string is taut (bool).
        ledger: kinetic and potential energy; damping, impact, slip, friction, work and residual
            since the start [J].
        events: events in order of time.
        status: reason for the run's end.
        causes: names to which the status is attributed: strings and limits that no motion
            satisfies together, or beyond the tension cap; coordinates with overloaded drives.
        method: event, timestepping, variational or mujoco.
        coordinates: names and indices of the coordinates.
        puppet: puppet of the run; None if unknown.
        effort: force that drives each driven velocity [N or N m]; None if not computed.
        violation: max(h, 0) of each string and limit [m, rad or 1]; None if not computed.
        slip: slip of each string's winch, >= 0 [m]; None if not computed.
        undetermined: whether the motion leaves a string's tension or a driven velocity's effort
            undetermined: other values give the same motion (bool); None if not computed.
        seconds: computing time [s]; None if unknown, as after loading.
        contact_residual: (T,) error of the contact laws in the step before each sample, relative
            to the largest speed in them; 0 if nothing touches; None without contact.
        contact: points with contact forces; None without contact, and for runs of batches.
        events_recorded: whether ``events`` was recorded; it is not for runs of batches.
    """

    t: Times
    q_D: Array
    v_D: Array
    acc_D: Array
    q_K: Array
    v_K: Array
    acc_K: Array
    tension: Columns
    limit_force: Columns
    taut: Columns
    ledger: Columns
    events: tuple[EventRecord, ...]
    status: Status
    method: str
    coordinates: CoordinateTable
    puppet: Puppet | None = None
    effort: Columns | None = None
    violation: Columns | None = None
    slip: Columns | None = None
    undetermined: Columns | None = None
    causes: tuple[str, ...] = ()
    seconds: float | None = None
    contact: ContactPoints | None = None
    contact_residual: Array | None = None
    events_recorded: bool = True

    def __repr__(self) -> str:
        events = f"{len(self.events)} events" if self.events_recorded else "events not recorded"
        return (
            f"<Trajectory {self.puppet.name if self.puppet else ''}: {self.t[0]:g} to "
            f"{self.t[-1]:g} s, {len(self)} samples, {events}, {self.method}, {self.status.name}>"
        )

    def _repr_html_(self) -> str | None:
        """Poses over time and the summary as HTML, for notebooks; compiles nothing."""
        return output().run_html(self)

    def __post_init__(self) -> None:
        table, n = self.coordinates, len(self.t)
        widths = (table.n_qD, table.n_vD, table.n_vD, table.n_qK, table.n_vK, table.n_vK)
        for name, width in zip(("t", *_MOTION_FIELDS), (None, *widths), strict=True):
            value = read_only(getattr(self, name))
            shape = (n,) if width is None else (n, width)
            if value.shape != shape:
                raise ValueError(f"{name} has the shape {value.shape}; it must be {shape}")
            object.__setattr__(self, name, value)
        for name, columns in self._tables().items():
            if len(columns.values) != n:
                raise ValueError(f"{name} has {len(columns.values)} samples; it must have {n}")
        if self.contact_residual is not None:
            object.__setattr__(self, "contact_residual", read_only(self.contact_residual))
            if self.contact_residual.shape != (n,):
                raise ValueError(
                    f"contact_residual has the shape {self.contact_residual.shape}; it must be "
                    f"{(n,)}"
                )
        if n == 0 or not (np.all(np.isfinite(self.t)) and np.all(np.diff(self.t) >= 0)):
            raise ValueError("t must hold one time or more, not decreasing")
        object.__setattr__(self, "events", tuple(self.events))
        object.__setattr__(self, "status", Status(self.status))
        object.__setattr__(self, "causes", tuple(self.causes))

    # Without this, Python would iterate over a trajectory by number.
    __iter__ = None

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, name: str) -> Array:
        """A column (T,) by its name in :meth:`columns`: ``elbow``, ``v:elbow``, ``tension:hand``.

        Raises:
            UnknownNameError: there is no such column.
        """
        columns = self.columns()
        if name not in columns:
            raise UnknownNameError("column", str(name), columns)
        return columns[name]

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def impulse(self) -> Columns:
        """Impulse of each string and limit [N s or N m s], at the first sample after it; else 0.

        Raises:
            ValueError: the events were not recorded.
        """
        if not self.events_recorded:
            raise ValueError(
                "a batch keeps no events; see catches of the batch, or simulate this run by itself"
            )
        names = self.tension.names + self.limit_force.names
        values = np.zeros((len(self.t), len(names)))
        for event in self.events:
            if event.impulse and event.name in names:
                # The last of several samples at its time, or the next one.
                i = max(int(np.searchsorted(self.t, event.t, side="right")) - 1, 0)
                i += self.t[i] < event.t and i + 1 < len(self.t)
                values[i, names.index(event.name)] += event.impulse
        return Columns(names, values, "string or limit")

    @property
    def overloads(self) -> dict[str, Overload]:
        """Coordinate -> overload of its drive, the earliest first."""
        return overloads(self.events, self.coordinates, self.q_D[-1], self.q_K[-1])

    # -- between the samples -----------------------------------------------------------------

    def resample(self, times: Times, side: Literal["right", "left"] = "right") -> Trajectory:
        """The run at other times, with the events between the first and the last of them.

        Motion between two samples is the quintic through their positions, velocities and
        accelerations; tension, forces, effort and ledger are linear; the active set is that of the
        left sample.

        Args:
            times: (m,) times [s], not decreasing, inside the run.
            side: ``right`` for the sample after an impact at its time, ``left`` for the one before.
        """
        times = self._clipped_times(floats(times))
        if times.ndim != 1 or not len(times) or np.any(np.diff(times) < 0):
            raise ValueError("times must be a list of one time or more, not decreasing")
        return self._interpolated(times, *interpolate.bracket(self.t, times, side))

    def between(self, start: float, end: float) -> Trajectory:
        """The part of the run between two times [s], with the samples and events there.

        It begins after an impact at its start, and ends before an impact at its end. Times, and
        ledger entries that accumulate, still count from the start of the whole run.

        Raises:
            StateError: a time is outside of the run.
            ValueError: the end is not after the start.
        """
        interval = self._clipped_times(floats([start, end]))
        if not interval[0] < interval[1]:
            raise ValueError(f"found {start:g} s to {end:g} s; the end must be after the start")
        inside = np.arange(
            np.searchsorted(self.t, interval[0], "right"),
            np.searchsorted(self.t, interval[1], "left"),
        )
        at_start = interpolate.bracket(self.t, interval[:1], "right")
        at_end = interpolate.bracket(self.t, interval[1:], "left")
        at_samples = inside, inside, np.zeros(len(inside))
        left, right, s = (
            np.concatenate(parts) for parts in zip(at_start, at_samples, at_end, strict=True)
        )
        times = np.concatenate([interval[:1], self.t[inside], interval[1:]])
        return self._interpolated(times, left, right, s)

    def _interpolated(self, times: Times, left: Indices, right: Indices, s: Array) -> Trajectory:
        """The run at times (m,), from the results of :func:`interpolate.bracket` for them."""
        table = self.coordinates
        changes: dict[str, Any] = {}
        spaces = {
            "D": (table.scalars_D, table.quaternions_D),
            "K": (table.scalars_K, table.quaternions_K),
        }
        for kind, (scalars, quaternions) in spaces.items():
            q, v, acc = names = tuple(f"{part}_{kind}" for part in ("q", "v", "acc"))
            samples = getattr(self, q), getattr(self, v), getattr(self, acc)
            motion = interpolate.motion(self.t, samples, scalars, quaternions, left, right, s)
            changes.update(zip(names, motion, strict=True))
        for name, columns in self._tables().items():
            if columns.values.dtype == bool:
                changes[name] = columns.like(columns.values[np.where(s < 1, left, right)])
            else:
                changes[name] = columns.like(interpolate.linear(columns.values, left, right, s))
        samples_at = np.where(s < 1, left, right)
        if self.contact is not None:
            changes["contact"] = self.contact.resampled(samples_at)
        if self.contact_residual is not None:
            changes["contact_residual"] = self.contact_residual[samples_at]
        events = tuple(e for e in self.events if times[0] <= e.t <= times[-1])
        return dataclasses.replace(self, t=times, events=events, **changes)

    def at(self, t: float, side: Literal["right", "left"] = "right") -> State:
        """The state at a time [s]; ``side`` as in :meth:`resample`."""
        if np.ndim(t):
            raise ValueError(f"t is {t}; it must be one time; resample takes several")
        return self.resample(np.array([t]), side).state(0)

    def state(self, i: int) -> State:
        """The state of sample ``i``; a negative number counts from the end."""
        active = np.concatenate([self.taut.values[i], self.limit_force.values[i] > 0])
        slip = np.zeros(0) if self.slip is None else self.slip.values[i]
        return State(
            self.t[i],
            self.q_D[i],
            self.v_D[i],
            self.q_K[i],
            self.v_K[i],
            active,
            slip,
            self.coordinates,
        )

    # -- export ------------------------------------------------------------------------------

    def columns(self) -> dict[str, Array]:
        """Name -> column (T,); ``pandas.DataFrame(run.columns())`` works.

        Names are ``t``; coordinates (``elbow``, ``torso.qw``); ``v:elbow``, ``acc:elbow``;
        ``tension:hand``, ``taut:hand``, ``force:elbow.upper``, ``effort:hand.length``,
        ``violation:hand``, ``slip:hand``, ``undetermined:hand``, ``energy:kinetic``;
        ``impulse:hand`` if the events were recorded; ``contact_residual`` with contact.
        """
        table, columns = self.coordinates, {"t": self.t}
        for names, values in ((table.q_D, self.q_D), (table.q_K, self.q_K)):
            columns.update(zip(names, values.T, strict=True))
        for prefix, names, values in (
            ("v", table.v_D, self.v_D),
            ("v", table.v_K, self.v_K),
            ("acc", table.v_D, self.acc_D),
            ("acc", table.v_K, self.acc_K),
        ):
            columns.update((f"{prefix}:{n}", x) for n, x in zip(names, values.T, strict=True))
        for prefix, table_columns in (
            ("tension", self.tension),
            ("taut", self.taut),
            ("force", self.limit_force),
            ("impulse", self.impulse if self.events_recorded else None),
            ("effort", self.effort),
            ("violation", self.violation),
            ("slip", self.slip),
            ("undetermined", self.undetermined),
            ("energy", self.ledger),
        ):
            if table_columns is not None:
                columns.update((f"{prefix}:{name}", x) for name, x in table_columns.items())
        if self.contact_residual is not None:
            columns["contact_residual"] = self.contact_residual
        return columns

    def to_dict(self) -> dict[str, list[Any]]:
        """:meth:`columns` as lists of numbers, for JSON."""
        return {name: values.tolist() for name, values in self.columns().items()}

    def to_csv(self, path: str | Path) -> None:
        """Writes :meth:`columns` as CSV: numbers with all bits, flags as 0 and 1."""
        write_table(self.columns(), path)

    def save(self, path: str | Path) -> None:
        """Writes an npz file with all results and the puppet, whole or not at all.

        Args:
            path: path that ends in ``.npz``.

        Raises:
            ValueError: the path has another ending.
        """
        if Path(path).suffix.lower() != ".npz":
            raise ValueError(
                f"found {str(path)!r}; a trajectory is saved as .npz. to_csv writes CSV, "
                "fantoccini.export animations (.glb, .usda, .usdc, .bvh, .mcap), and "
                "fantoccini.output.film films"
            )
        archive.save({f.name: getattr(self, f.name) for f in dataclasses.fields(self)}, path)

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Reads a file written by :meth:`save`, to the same bits.

        Raises:
            FileError: the file is not a trajectory.
        """
        with npz.opened(path, archive.FORMAT, "a trajectory") as (arrays, about):
            for array in arrays.values():
                array.setflags(write=False)  # so that they are not copied
            return cls(**archive.fields_of(arrays, about, str(path)))

    def summary(self) -> dict[str, Any]:
        """Key numbers: duration [s], seconds, samples, events by kind, tensions, ledger [J].

        If ``seconds`` exceeds ``duration``, the run was slower than real time; method
        ``timestepping`` is faster.

        ``summary()["tension"]["hand"]`` has min and max [N], slack [s], catches, the largest
        impulse [N s], and undetermined [s] if computed. ``summary()["drives"]`` has ``since`` [s],
        ``lost_steps``, ``ran_away`` and ``error`` at the end [m or rad] of overloaded drives.
        ``events``, ``catches``, ``impulse`` and ``drives`` are None if the events were not
        recorded.
        """
        h = np.diff(self.t, append=self.t[-1])
        recorded = self.events_recorded
        strings = {}
        for name, values in self.tension.items():
            catch_impulses = [
                e.impulse for e in self.events if e.name == name and e.kind == "catch"
            ]
            strings[name] = {
                "min": float(np.min(values)),
                "max": float(np.max(values)),
                "slack": float(np.sum(h[~self.taut.flags(name)])),
                "catches": len(catch_impulses) if recorded else None,
                "impulse": max(catch_impulses, default=0.0) if recorded else None,
            }
            if self.undetermined is not None:
                seconds = float(np.sum(h[self.undetermined.flags(name)]))
                strings[name]["undetermined"] = seconds
        drives = {name: vars(overload) for name, overload in self.overloads.items()}
        return {
            "duration": self.duration,
            "seconds": self.seconds,
            "samples": len(self.t),
            "status": self.status,
            "events": dict(Counter(event.kind for event in self.events)) if recorded else None,
            "tension": strings,
            "drives": drives if recorded else None,
            "ledger": {name: float(values[-1]) for name, values in self.ledger.items()},
        }

    def plot(self, path: str | Path | None = None, **look: Any) -> Figure:
        """Tensions, slack and taut, energy and driven lengths against time, as a matplotlib figure.

        Args:
            path: file for the figure (png, svg or pdf); by default none is written.
            look: theme, size and scale, as in :func:`fantoccini.output.plot`.
        """
        return output().plot(self, path, **look)

    # -- helpers -----------------------------------------------------------------------------

    def _tables(self) -> dict[str, Columns]:
        names = (
            "tension",
            "limit_force",
            "taut",
            "ledger",
            "effort",
            "violation",
            "slip",
            "undetermined",
        )
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def _clipped_times(self, times: Times) -> Times:
        first, last = self.t[0], self.t[-1]
        is_outside = ~((times >= first - _MAX_TIME_OUTSIDE) & (times <= last + _MAX_TIME_OUTSIDE))
        if np.any(is_outside):
            raise StateError(
                f"t = {times[is_outside][0]:g} s is outside of the run, {first:g} s to {last:g} s"
            )
        return np.clip(times, first, last)
