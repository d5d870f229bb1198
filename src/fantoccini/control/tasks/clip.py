"""Clips: what a run did, as the path of a track."""

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
    """path(t) = what the run did at its time start + speed (t - begin); its ends hold beyond it.

    The run may be of another puppet, whose bodies, coordinates and strings are found by name.

    Attributes:
        run: a simulated run, or one that was saved: ``fan.Trajectory.load("take.npz")``.
        of: name in the run of what is followed, where it has another one there.
        begin: time at which the run begins [s]; its own first time when not given.
        speed: of its time; 2 is twice as fast.
        by: (3,) added to the places of points [m].
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
            kind, name, at: of the track; see :class:`fantoccini.control.tasks.costs.Track`.
            t: times that do not fall [s].

        Raises:
            UnknownNameError: the run has no such body, coordinate, velocity or string.
        """
        first, last = self.run.t[0], self.run.t[-1]
        begin = first if self.begin is None else self.begin
        times = first + self.speed * (np.asarray(t) - begin)
        run, name = self.run.resample(np.clip(times, first, last)), self.of or name
        if kind == "tension":
            return run.tension[name][:, None]
        if kind == "coordinate":
            return self._column(run, "q", "scalar coordinate", [name])
        if kind == "velocity":
            names = list(marionette.coordinates.v_D) if name == "*" else [name]
            moves = self.speed * ((times >= first) & (times <= last))
            return moves[:, None] * self._column(run, "v", "velocity", names)
        puppet = self._performer or marionette
        pose = puppet.poses(run.q_D, run.q_K)[:, puppet.link_index(name)]
        if kind == "orientation":
            return rotation.quaternion(pose[:, :, :3])
        return np.asarray(pose[:, :, :3] @ np.array(at) + pose[:, :, 3] + np.asarray(self.by))

    @cached_property
    def _performer(self) -> Marionette | None:
        """The puppet of the run; None where the run does not know it."""
        return None if self.run.puppet is None else Marionette(self.run.puppet)

    @staticmethod
    def _column(run: Trajectory, part: str, what: str, names: Sequence[str]) -> Array:
        """(n, len(names)) numbers of the run's states."""
        t = run.coordinates
        if part == "q":
            places = {t.q_D[q]: run.q_D[:, q] for q, _ in t.scalars_D}
            places |= {t.q_K[q]: run.q_K[:, q] for q, _ in t.scalars_K}
        else:
            places = dict(zip(t.v_D, run.v_D.T, strict=True))
            places |= dict(zip(t.v_K, run.v_K.T, strict=True))
        for name in names:
            if name not in places:
                raise UnknownNameError(what, name, list(places))
        return np.stack([places[name] for name in names], axis=1)
