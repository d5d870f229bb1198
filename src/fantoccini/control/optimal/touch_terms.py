"""Touches of a motion on a grid: how far they are off, and what programs of stages have for them.

The moment t of a touch is an unknown that is eliminated. Of the augmented Lagrangian

    L = weight/2 |r|^2 - force . r,   f = weight r - force

of the distance r at the moment of nearest approach, a step that moves the point by a, and its
velocity v by b, leaves

    min over dt of f . (a + v dt) + weight/2 |a + v dt|^2 - force . (b dt + acc dt^2 / 2)
                   + rho dt^2 / 2
    = f . a - f . v w . (a, b) / s + 1/2 (a, b)^T K (a, b),   K = weight (1, 0) - w w^T / s
    w = (weight v, -force),   s = weight |v|^2 - force . acc + rho

so that where it is near, what is across its path alone counts. Of K the part that is not negative
is taken. rho = weight (|r| / share of the window)^2 keeps a point that is far, or slow, from being
promised what lies beyond the window. At an end of the window dt = 0, unless L falls into it.
Moments are looked for near those of the iterate before, so that they do not leap to another way
past a place.

Distances are those of the run. For the derivatives, coordinates between nodes are cubic in time,
through the positions and velocities there. As the interval of a moment leads from the state z_i
before it to the state after it,

    r + J_0 z_i + J_1 z_{i+1} = r + J_1 e_i + (J_0 + J_1 A_i) z_i + J_1 B_i u_i
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, Times, rotation, tangent
from fantoccini.control.optimal.dynamics import LinearEnds
from fantoccini.control.optimal.moments import Off, Window, nearest
from fantoccini.control.tasks import Chosen, Nodes, Task, Touched
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory

_STEP = 1e-5
"""Of differences [m, rad and their rates, and of intervals, relative to their length]."""
_MOMENT = 1e-3
"""Of differences of time, relative to an interval."""
_LOOKS = 6
"""In every interval, at which distances are measured first."""
_SHARE = 0.25
"""Of a window by which a step moves a moment at most."""
_NEARER = 0.25
"""Of the time between two moments, by which either may come nearer to the other in a step."""
_AT_EDGE = 1e-9
"""Of a window [s]."""

States = tuple[Array, Array, Array, Array]
"""q_D, v_D, q_K and v_K, (n, ...) each."""


@dataclass(frozen=True, eq=False)
class Model:
    """slope . d + 1/2 d^T bend d of the changes d of a point and, scaled, of its velocity.

    Attributes:
        by: (6, 2 n_z + 1 + n_p) their derivatives, as in :class:`Moments`.
        bend: (6, 6), not negative.
        slope: (6,).
        closed: (3, 2 n_z + 1 + n_p) derivatives of what a step closes of the distance.
        on: (3,) what the moment's own move closes of it.
    """

    by: Array
    bend: Array
    slope: Array
    closed: Array
    on: Array


@dataclass(frozen=True, eq=False)
class Moments:
    """Where touches are along a motion.

    Attributes:
        t: (T,) times [s].
        room: (T,) lengths of their windows [s].
        at: (T,) the intervals.
        edge: (T,) -1 or 1 where a moment is at the first or the last time that it may be at, NaN
            where these are one.
        r: (T, 3) from the places to the points [m].
        v: (T, 3) velocities of the points [m/s].
        acc: (T, 3) their accelerations [m/s^2].
        by, v_by: (T, 3, 2 n_z + 1 + n_p) derivatives of r and v by the states before and after, the
            length of the intervals and the parameters.
    """

    t: Times
    room: Times
    at: Indices
    edge: Array
    r: Array
    v: Array
    acc: Array
    by: Array
    v_by: Array

    def model(self, weight: float, force: Array) -> list[Model]:
        """What programs have for the touches.

        Args:
            weight: of half the squares of the distances.
            force: (T, 3) their multipliers.
        """
        out = []
        for j, (r, v) in enumerate(zip(self.r, self.v, strict=True)):
            f, scale = weight * r - force[j], _SHARE * self.room[j]
            bend, way, slope = np.zeros((6, 6)), np.zeros(6), np.append(f, np.zeros(3))
            on = np.zeros(3)
            bend[:3, :3] = weight * np.eye(3)
            if self.edge[j] == 0.0 or (f @ v) * self.edge[j] > 0.0:
                size = weight * (v @ v + r @ r / scale**2) + max(-force[j] @ self.acc[j], 0.0)
                if size > 0.0:
                    across = np.append(weight * v, -force[j] / scale)
                    way = across / size
                    bend -= np.outer(across, way)
                    slope -= way * (f @ v)
                    on = -v * (f @ v) / size
            values, vectors = np.linalg.eigh(bend)
            bend = (vectors * np.maximum(values, 0.0)) @ vectors.T
            both = np.concatenate([self.by[j], scale * self.v_by[j]])
            closed = self.by[j] - np.outer(v, way @ both)
            out.append(Model(both, bend, slope, closed, on))
        return out


class Touches:
    """The touches of a task.

    Args:
        task: see :class:`Task`.
        chosen: parameters along with the motion.
    """

    def __init__(self, task: Task, chosen: Chosen):
        marionette = task.marionette
        self._touches, self._chosen = task.touches, chosen
        self._links = [marionette.link_index(touch.body) for touch in task.touches]
        self._places = np.array([touch.place for touch in task.touches], float).reshape(-1, 3)
        self._points = np.array([touch.at for touch in task.touches], float).reshape(-1, 3)
        self._kept: tuple[Nodes, Moments] | None = None

    def __len__(self) -> int:
        return len(self._touches)

    def gap(self, nodes: Nodes) -> Array:
        """(3 T,) from the points to the places at the moments of nearest approach [m]."""
        return -np.ravel(self.moments(nodes).r) if len(self) else np.zeros(0)

    def closed(
        self, nodes: Nodes, z: Array, c: Array, weight: float, force: Array
    ) -> tuple[Array, Array]:
        """(3 T,) how much of the gap a step closes, and what moments that move without it do.

        Args:
            nodes, weight, force: see :meth:`add`.
            z, c: (N + 1, n_z) and (1 + n_p,) changes of the states and the constants.
        """
        if not len(self):
            return np.zeros(0), np.zeros(0)
        at = self.moments(nodes)
        moved = np.concatenate([z[at.at], z[at.at + 1], np.tile(c, (len(self), 1))], axis=1)
        models = at.model(weight, force.reshape(-1, 3))
        closed = [one.closed @ d for one, d in zip(models, moved, strict=True)]
        return np.ravel(closed), np.ravel([one.on for one in models])

    def marked(self, nodes: Nodes) -> Nodes:
        """The same nodes, whose steps look for moments near those of these nodes."""
        at = self.moments(nodes)
        self._kept = replace(nodes, moments=at.t), at
        return self._kept[0]

    def add(
        self,
        nodes: Nodes,
        linear: LinearEnds,
        c: Indices,
        weight: float,
        force: Array,
        H: Array,
        g: Array,
        cross: Array,
        Q: Array,
        q: Array,
    ) -> None:
        """Adds weight/2 r^T S r - force . r to a program.

        Args:
            nodes, linear: the motion, whose states go on with some of its constants.
            c: which.
            weight: of half the squares.
            force: (3 T,) multipliers.
            H, g, cross, Q, q: see :meth:`Objective.program`.
        """
        if not len(self):
            return
        at, k, n_z = self.moments(nodes), linear.B.shape[2], nodes.n_z
        for i, one in zip(at.at, at.model(weight, force.reshape(-1, 3)), strict=True):
            J_0 = np.pad(one.by[:, :n_z], ((0, 0), (0, len(c))))
            J_1 = np.concatenate([one.by[:, n_z : 2 * n_z], one.by[:, 2 * n_z + c]], axis=1)
            J_z, J_u = J_0 + J_1 @ linear.A[i], J_1 @ linear.B[i]
            bend, slope = one.bend, one.slope + one.bend @ (J_1 @ linear.e[i])
            H[i, :k, :k] += J_u.T @ bend @ J_u
            g[i, :k] += J_u.T @ slope
            cross[i, k:] += J_z.T @ bend @ J_u
            square, first = (Q, q) if i == 0 else (H[i - 1, k:, k:], g[i - 1, k:])
            square += J_z.T @ bend @ J_z
            first += J_z.T @ slope

    def along(self, run: Trajectory, parameters: Array) -> tuple[Touched, ...]:
        """How near a run comes to the places, and when."""
        if not len(self):
            return ()
        off = self._along(run, parameters)
        step = (run.t[-1] - run.t[0]) / (_LOOKS * len(run))
        times = nearest(off, self._windows(run.t[0], run.t[-1]), step)
        far = [float(np.linalg.norm(off(k, times[k : k + 1]))) for k in range(len(self))]
        return tuple(map(Touched, self._touches, times.tolist(), far))

    def _along(self, run: Trajectory, parameters: Array) -> Off:
        """How far touches are off along a run."""
        marionette, first, last = self._chosen.marionette(parameters), run.t[0], run.t[-1]

        def off(k: int, times: Times) -> Array:
            found = run.resample(np.clip(times, first, last))
            return self._off(k, marionette, found.q_D, found.q_K)

        return off

    def moments(self, nodes: Nodes) -> Moments:
        """The moments of nearest approach, with derivatives."""
        if self._kept is None or self._kept[0] is not nodes:
            self._kept = nodes, self._made(nodes)
        return self._kept[1]

    def _made(self, nodes: Nodes) -> Moments:
        h, N, n = nodes.interval, len(nodes), len(self)
        off = (
            self._along_nodes(nodes)
            if nodes.run is None
            else self._along(nodes.run, nodes.parameters)
        )
        end = nodes.start + N * h
        windows = self._windows(nodes.start, end)
        low, high = np.array([(window.low, window.high) for window in windows]).T
        room = np.maximum(high - low, h)
        times = nearest(off, self._near(nodes, windows, _SHARE * room), h / _LOOKS)
        edge = 1.0 * (times >= high - _AT_EDGE) - 1.0 * (times <= low + _AT_EDGE)
        edge[high - low <= 2.0 * _AT_EDGE] = np.nan
        at = np.clip(((times - nodes.start) / h).astype(int), 0, N - 1)
        share = (times - nodes.start) / h - at
        by, v_by = np.zeros((2, n, 3, 2 * nodes.n_z + 1 + len(self._chosen)))
        r, v, acc = np.zeros((3, n, 3))
        for k in range(n):
            moves_on = times[k] >= end  # with the end of the motion
            r[k] = off(k, times[k : k + 1])[0]
            found = self._by(k, nodes, int(at[k]), float(share[k]), moves_on)
            v[k], acc[k], by[k], v_by[k] = found
        return Moments(times, room, at, edge, r, v, acc, by, v_by)

    def _along_nodes(self, nodes: Nodes) -> Off:
        """How far touches are off along the curve between nodes."""
        marionette = self._chosen.marionette(nodes.parameters)
        states: States = (nodes.q_D, nodes.v_D, nodes.q_K, nodes.v_K)

        def off(k: int, times: Times) -> Array:
            share = (times - nodes.start) / nodes.interval
            at = np.clip(share.astype(int), 0, len(nodes) - 1)
            before, after = (tuple(a[at + later] for a in states) for later in (0, 1))
            q_D, q_K = _between(nodes, before, after, nodes.interval, share - at)
            return self._off(k, marionette, q_D, q_K)

        return off

    def _windows(self, start: float, end: float) -> list[Window]:
        """Those of the touches, within a motion."""
        return [
            Window(
                min(max(touch.between[0], start), end),
                max(min(touch.between[1], end), start),
                touch.in_turn,
            )
            for touch in self._touches
        ]

    def _near(self, nodes: Nodes, windows: list[Window], room: Times) -> list[Window]:
        """What windows leave near the moments before, if there are.

        Moments in turn, and those of one point, stay apart.
        """
        t = nodes.moments
        if t is None:
            return windows
        low, high = t - room, t + room
        for j, k in itertools.combinations(range(len(t)), 2):
            one, other = self._touches[j], self._touches[k]
            if (one.body, one.at) == (other.body, other.at) or (k == j + 1 and other.in_turn):
                early, late = (j, k) if t[j] <= t[k] else (k, j)
                nearer = _NEARER * (t[late] - t[early])
                high[early] = min(high[early], t[early] + nearer)
                low[late] = max(low[late], t[late] - nearer)
        return [
            Window(
                min(max(a, window.low), window.high), max(min(b, window.high), window.low), False
            )
            for window, a, b in zip(windows, low, high, strict=True)
        ]

    def _by(
        self, k: int, nodes: Nodes, i: int, share: float, moves_on: bool
    ) -> tuple[Array, Array, Array, Array]:
        """v, acc and the derivatives of r and v, by central differences of the interval's states.

        Args:
            k: the touch.
            nodes: the motion.
            i, share: the interval, and how far along it.
            moves_on: whether the moment moves with the nodes, where intervals get longer.
        """
        h, n_z, n_c = nodes.interval, nodes.n_z, 1 + len(self._chosen)
        z = np.zeros((4 * n_z + 3, 2 * n_z))
        z[: 2 * n_z], z[2 * n_z : 4 * n_z] = _STEP * np.eye(2 * n_z), -_STEP * np.eye(2 * n_z)
        hs = np.full(len(z), h)
        hs[-3:-1] *= [1.0 + _STEP, 1.0 - _STEP]
        shares = np.full(len(z), share) if moves_on else (i + share) * h / hs - i
        before, after = _moved(nodes, i, z[:, :n_z]), _moved(nodes, i + 1, z[:, n_z:])
        off, by = np.zeros((3, len(z), 3)), np.zeros((3, 3, 2 * n_z + n_c))
        for j, later in enumerate((-_MOMENT, 0.0, _MOMENT)):
            q_D, q_K = _between(nodes, before, after, hs, shares + later * h / hs)
            off[j] = self._off(k, self._chosen.marionette(nodes.parameters), q_D, q_K)
            by[j, :, : 2 * n_z] = (off[j, : 2 * n_z] - off[j, 2 * n_z : 4 * n_z]).T / (2.0 * _STEP)
            by[j, :, 2 * n_z] = (off[j, -3] - off[j, -2]) / (2.0 * _STEP * h)
            for m, (below, above) in enumerate(self._chosen.neighbours(nodes.parameters)):
                ends = [
                    self._off(k, self._chosen.marionette(p), q_D[-1:], q_K[-1:])[0]
                    for p in (below, above)
                ]
                by[j, :, 2 * n_z + 1 + m] = (ends[1] - ends[0]) / (above[m] - below[m])
        gap = _MOMENT * h
        v, acc = (off[2, -1] - off[0, -1]) / (2.0 * gap), off[2, -1] + off[0, -1] - 2.0 * off[1, -1]
        return v, acc / gap**2, by[1], (by[2] - by[0]) / (2.0 * gap)

    def _off(self, k: int, marionette: Marionette, q_D: Array, q_K: Array) -> Array:
        """(n, 3) from the place to the point at some configurations."""
        pose = marionette.poses(q_D, q_K)[:, self._links[k]]
        return np.asarray(pose[:, :, :3] @ self._points[k] + pose[:, :, 3] - self._places[k])


def _moved(nodes: Nodes, i: int, z: Array) -> States:
    """The state of a node moved by tangent vectors (n, n_z)."""
    dq_D, dv_D, dq_K, dv_K = np.split(z, nodes.splits, axis=1)
    t = nodes.table
    return (
        tangent.moved(t.scalars_D, t.quaternions_D, nodes.q_D[i], dq_D),
        nodes.v_D[i] + dv_D,
        tangent.moved(t.scalars_K, t.quaternions_K, nodes.q_K[i], dq_K),
        nodes.v_K[i] + dv_K,
    )


def _between(
    nodes: Nodes, before: States, after: States, h: Array | float, share: Array
) -> tuple[Array, Array]:
    """(n, n_qD) and (n, n_qK) between states h apart, cubic through places and velocities."""
    t = nodes.table
    s, h = share[:, None], np.broadcast_to(h, share.shape)[:, None]
    out = []
    for scalars, quaternions, q, v, p, w in (
        (t.scalars_D, t.quaternions_D, *before[:2], *after[:2]),
        (t.scalars_K, t.quaternions_K, *before[2:], *after[2:]),
    ):
        way, w = tangent.between(scalars, quaternions, q, p, v.shape[1]), w.copy()
        for _, at in quaternions:
            turn = slice(at, at + 3)
            rate = rotation.right_jacobian_inverse(way[:, turn]) @ w[:, turn, None]
            w[:, turn] = rate[..., 0]
        move = (3.0 - 2.0 * s) * s**2 * way + h * s * ((1.0 - s) ** 2 * v - s * (1.0 - s) * w)
        out.append(tangent.moved(scalars, quaternions, q, move))
    return out[0], out[1]
