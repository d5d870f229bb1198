"""What a record measures: places of markers, scalar coordinates and tensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import OFFSETS, PARAMETER_STEP, WEIGHTS, relations


@dataclass(frozen=True)
class Marker:
    """A point of a body that is filmed.

    Attributes:
        name: of its columns, ``name.x``, ``name.y`` and ``name.z``.
        body: that carries it.
        at: its place in the body's frame [m], or where the search for it begins.
        find: whether its place is looked for.
    """

    name: str
    body: str
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    find: bool = False


@dataclass(frozen=True, eq=False)
class Looked:
    """The channels at N configurations, without tensions.

    Attributes:
        value: (N, n_c).
        by_D: (N, n_c, n_vD) by moves of the configuration.
        by_K: (N, n_c, n_vK) by moves of the driven one.
        by_p: (N, n_c, n_p) by parameters at fixed configurations; None where all are 0.
        frames: (N, n_markers, 3, 3) axes of the markers' bodies.
    """

    value: Array
    by_D: Array
    by_K: Array
    by_p: Array | None
    frames: Array


class Channels:
    """The numbers that are measured at a time: 3 a marker, then coordinates, then tensions.

    Args:
        marionette: the puppet.
        markers: that are filmed.
        coordinates: scalar dynamic coordinates.
        tensions: names of strings.

    Raises:
        UnknownNameError: a body, coordinate or string that the puppet does not have.
        StateError: two markers of one name.
    """

    def __init__(
        self,
        marionette: Marionette,
        markers: Sequence[Marker] = (),
        coordinates: Sequence[str] = (),
        tensions: Sequence[str] = (),
    ):
        table, strings = marionette.coordinates, [s.name for s in marionette.tree.strings]
        self.marionette, self.markers = marionette, tuple(markers)
        self.coordinates, self.tensions = tuple(coordinates), tuple(tensions)
        names = [one.name for one in self.markers]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise StateError(f"two markers are called {twice[0]}; each needs a name of its own")
        self._links = [marionette.link_index(one.body) for one in self.markers]
        scalars = {table.q_D[q]: (q, v) for q, v in table.scalars_D}
        for name in self.coordinates:
            if name not in scalars:
                raise UnknownNameError("scalar dynamic coordinate", name, tuple(scalars))
        for name in self.tensions:
            if name not in strings:
                raise UnknownNameError("string", name, tuple(strings))
        self._scalars = [scalars[name] for name in self.coordinates]
        self.rows = [strings.index(name) for name in self.tensions]
        axes = [f"{name}.{axis}" for name in names for axis in "xyz"]
        self.names = (*axes, *self.coordinates, *(f"{name}.tension" for name in self.tensions))
        groups = [name for name in names for _ in "xyz"]
        self.groups = (*groups, *self.names[len(axes) :])
        """Name of what shares a noise level, for every channel."""

    def __len__(self) -> int:
        return len(self.names)

    @property
    def n_places(self) -> int:
        """Channels that are no tensions."""
        return len(self.names) - len(self.rows)

    def look(self, q_D: Array, q_K: Array, p: Array, places: Array) -> Array:
        """(N, n_c) the channels at (N, n_qD) and (N, n_qK), with places (n_markers, 3)."""
        marionette = self.marionette
        found = marionette.library.evaluate("poses", q_D=q_D, q_K=q_K, p=p).poses.swapaxes(-1, -2)
        R, r = self._frames(found)
        at = (R @ places[..., None])[..., 0] + r
        numbers = q_D[:, [q for q, _ in self._scalars]]
        return np.concatenate([at.reshape(len(q_D), 3 * len(self._links)), numbers], axis=1)

    def look_by(self, q_D: Array, q_K: Array, p: Array, places: Array, of_p: bool) -> Looked:
        """The channels and their derivatives; ``of_p``: by the parameters, too."""
        marionette, N = self.marionette, len(q_D)
        n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
        found = marionette.library.evaluate("screws", q_D=q_D, q_K=q_K, p=p)
        R, r = self._frames(found.poses.swapaxes(-1, -2))
        at = (R @ places[..., None])[..., 0] + r
        screws = np.concatenate([found.screw_D, found.screw_K], axis=-1)
        moves = relations(marionette.tree)[0]
        by = np.zeros((N, self.n_places, n + k))
        for i, link in enumerate(self._links):
            twist = screws * moves[link]
            turn = np.cross(twist[:, 3:], at[:, i, :, None], axis=1)
            by[:, 3 * i : 3 * i + 3] = twist[:, :3] + turn
        m = 3 * len(self._links)
        for j, (_, v) in enumerate(self._scalars):
            by[:, m + j, v] = 1.0
        numbers = q_D[:, [q for q, _ in self._scalars]]
        value = np.concatenate([at.reshape(N, 3 * len(self._links)), numbers], axis=1)
        by_p = self._by_p(q_D, q_K, p, places) if of_p else None
        return Looked(value, by[..., :n], by[..., n:], by_p, R)

    def _frames(self, poses: Array) -> tuple[Array, Array]:
        """(N, n_markers, 3, 3) axes and (N, n_markers, 3) origins of the markers' bodies."""
        own = poses[:, self._links]
        return own[..., :9].reshape(*own.shape[:2], 3, 3).swapaxes(-1, -2), own[..., 9:]

    def _by_p(self, q_D: Array, q_K: Array, p: Array, places: Array) -> Array:
        """By central differences of sixth order, whose errors are those of rounding."""
        out = np.zeros((len(q_D), self.n_places, len(p)))
        for i in range(len(p)):
            step = PARAMETER_STEP * max(1.0, abs(p[i]))
            for offset, weight in zip(OFFSETS, WEIGHTS, strict=True):
                moved = p.copy()
                moved[i] += offset * step
                out[..., i] += weight / step * self.look(q_D, q_K, moved, places)
        return out

    def depends(self, q_D: Array, q_K: Array, p: Array, of_p: Sequence[int]) -> bool:
        """Whether one of these parameters moves a channel at fixed configurations.

        A joint's place does.
        """
        places = np.array([one.at for one in self.markers]).reshape(-1, 3)
        now = self.look(q_D[None], q_K[None], p, places)
        for i in of_p:
            moved = p.copy()
            moved[i] += PARAMETER_STEP * max(1.0, abs(p[i]))
            if np.any(self.look(q_D[None], q_K[None], moved, places) != now):
                return True
        return False
