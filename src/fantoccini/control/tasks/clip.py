"""Clips: motions of a run as paths of tracks.

A track is a quantity that should follow a path. q_D are dynamic and q_K driven coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, StateError, Times, UnknownNameError, check_positive, rotation
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory


@dataclass(frozen=True, eq=False)
class Clip:
    """Motion of a part in a run: path(t) is that at time start + speed (t - begin) of the run.

    It is constant beyond the run's ends. The run may be of another puppet, whose bodies,
    coordinates and strings are found by name.

    Attributes:
        run: a simulated run, or one that was saved: ``fan.Trajectory.load("take.npz")``.
        of: name of the followed part in the run; by default the track's name.
        begin: time in the new motion at which the run begins [s]; the run's first time by default.
        speed: speed of the run's time; 2 is twice as fast.
        by: (3,) displacement added to points [m].
    """

    run: Trajectory
    of: str | None = None
    begin: float | None = None
    speed: float = 1.0
    by: Sequence[float] | Array = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_positive(speed=self.speed)
        if np.shape(self.by) != (3,) or not np.all(np.isfinite(np.asarray(self.by, dtype=float))):
            raise StateError(f"a clip is moved by {self.by!r}; needed: 3 finite numbers")

    def values(
        self, marionette: Marionette, kind: str, name: str, at: tuple[float, float, float], t: Times
    ) -> Array:
        """(len(t), width) the path of a track.

        Args:
            marionette: the puppet that follows.
            kind, name, at: fields of the track, a :class:`fantoccini.control.tasks.costs.Track`.
            t: times in ascending order [s].

        Raises:
            UnknownNameError: name of a body, coordinate, velocity or string that is not in the run.
        """
        first, last = self.run.t[0], self.run.t[-1]
        begin = first if self.begin is None else self.begin
        times = first + self.speed * (np.asarray(t) - begin)
        run, name = self.run.resample(np.clip(times, first, last)), self.of or name
        if kind == "tension":
            return run.tension[name][:, None]
        if kind == "coordinate":
            return self._columns(run, "q", "scalar coordinate", [name])
        if kind == "velocity":
            names = list(marionette.coordinates.v_D) if name == "*" else [name]
            speed = self.speed * ((times >= first) & (times <= last))
            return speed[:, None] * self._columns(run, "v", "velocity", names)
        puppet = self._puppet_of_run or marionette
        pose = puppet.poses(run.q_D, run.q_K)[:, puppet.link_index(name)]
        if kind == "orientation":
            return rotation.quaternion(pose[:, :, :3])
        return np.asarray(pose[:, :, :3] @ np.array(at) + pose[:, :, 3] + np.asarray(self.by))

    @cached_property
    def _puppet_of_run(self) -> Marionette | None:
        """The puppet of the run; None if it is not saved with the run."""
        return None if self.run.puppet is None else Marionette(self.run.puppet)

    @staticmethod
    def _columns(run: Trajectory, symbol: str, label: str, names: Sequence[str]) -> Array:
        """(n, len(names)) coordinates or velocities of the run's states."""
        table = run.coordinates
        if symbol == "q":
            columns = {table.q_D[q]: run.q_D[:, q] for q, _ in table.scalars_D}
            columns |= {table.q_K[q]: run.q_K[:, q] for q, _ in table.scalars_K}
        else:
            columns = dict(zip(table.v_D, run.v_D.T, strict=True))
            columns |= dict(zip(table.v_K, run.v_K.T, strict=True))
        for name in names:
            if name not in columns:
                raise UnknownNameError(label, name, list(columns))
        return np.stack([columns[name] for name in names], axis=1)
