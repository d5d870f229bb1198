"""The modes of a plan, led on past the events that end them and back before those that begin them.

A mode is the set of strings that pull. Its motion is smooth, so that it can be followed beyond the
plan's part of it, with the inputs of the plan: strings that pull are held, as wires if need be, the
others are left out. A puppet whose string is caught early or late is compared with that, and not
with a plan that is in another mode ("reference spreading": Rijnen, Saccon and Nijmeijer 2015)::

    caught early:  K from Riccati's recursion, with A and B of the mode, led into the plan
    caught late:   K = K_k S,   S = A_k-1 F^-1

where F are slopes of the old mode, A_k-1 those through the event, and S says how far the puppet
will be from the plan once its event has been as well: the saltation, taken to the node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.motion import State, tangent
from fantoccini.plan.funnels import before
from fantoccini.plan.goals import Rows
from fantoccini.plan.slopes import slopes_of, taut

_STEPS = 20
"""Of Runge and Kutta's method, in a segment."""

_SOFT = 1e-9
"""How much strings give beside one another, so that several may hold the same."""

_FAR = 1.0
"""Distance from the plan, as it is weighted, beyond which a mode's reference says nothing."""


@dataclass(frozen=True, eq=False)
class Path:
    """A plan, its modes, and its law by time.

    Attributes:
        marionette: the puppet.
        nodes: (m + 1,) states.
        pulling: (m + 1, n_strings) bool, the strings that pull after them.
        durations: (m,) of the segments [s].
        planned: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_a) slopes of the segments.
        gains: (m, n_a, n_z).
        P: (m + 1, n_z, n_z) of what is still to be paid.
        Q, R: weights.
        moves: (n_vK,) bool, the driven coordinates that gains are of.
    """

    marionette: Marionette
    nodes: Rows
    pulling: MaskRows
    durations: Array
    planned: Array
    A: Array
    B: Array
    gains: Array
    P: Array
    Q: Array
    R: Array
    moves: MaskRows


@dataclass(frozen=True, eq=False)
class Beyond:
    """What a puppet is compared with that is not in the plan's mode. Made by :meth:`of`.

    Attributes:
        segment: (e,) that the law is asked for.
        pulling: (e, n_strings) bool, the mode.
        late: (e,) by how many segments its part of the plan has ended, at most; negative where it
            is yet to begin.
        nodes: (e,) states that stand for the plan's.
        gains: (e, n_a, n_z).
    """

    segment: Array
    pulling: MaskRows
    late: Array
    nodes: Rows
    gains: Array
    P: Array

    @classmethod
    def of(cls, path: Path, window: int) -> Beyond:
        """The modes of a plan beyond their parts of it.

        Args:
            path: the plan.
            window: how far they are led, in segments.
        """
        events = np.flatnonzero(np.any(path.pulling[1:] != path.pulling[:-1], axis=1))
        strings = path.pulling.shape[1]
        parts = [*_early(path, events, window), *_late(path, events, window)]
        if not parts:
            none = np.zeros(0, dtype=int)
            return cls(none, np.zeros((0, strings), dtype=bool), none, path.nodes[:0], path.gains[:0], path.P[:0])
        segment, pulling, late, nodes, gains, P = zip(*parts, strict=True)
        rows = Rows(*(np.concatenate(a) for a in zip(*(x.parts.values() for x in nodes), strict=True)))
        return cls(*(np.concatenate(a) for a in (segment, pulling, late)), rows, np.concatenate(gains), np.concatenate(P))

    def nearest(self, k: int, pulling: MaskRows) -> int | None:
        """The one for a segment and a mode; None where no part of the plan near it has this mode.

        Args:
            k: the segment.
            pulling: (n_strings,) bool.
        """
        same = (self.segment == k) & np.all(self.pulling == pulling, axis=1)
        found = np.flatnonzero(same)
        return int(found[np.argmin(np.abs(self.late[found]))]) if len(found) else None


_Part = tuple[Array, MaskRows, Array, Rows, Array, Array]
"""Some of each attribute of :class:`Beyond`."""


def _early(path: Path, events: Array, window: int) -> list[_Part]:
    """Modes before the plan's events k, that lie between nodes k and k + 1, begin them."""
    parts, k, at, P = [], events, path.nodes[events + 1], path.P[events + 1]
    mode = path.pulling[events + 1]
    for back in range(window):
        goes = k >= 0
        goes[goes] = np.any(path.pulling[k[goes]] != mode[goes], axis=1)
        k, at, P, mode = k[goes], at[goes], P[goes], mode[goes]
        if not len(k):
            break
        at = led(path.marionette, at, mode, path.planned[k], -path.durations[k])
        near = _near(path, k, at)
        k, at, P, mode = k[near], at[near], P[near], mode[near]
        if not len(k):
            break
        A, B = _slopes(path, at, mode, k, taut(path.marionette, at, mode))
        K, P = before(A, B[..., path.moves], path.Q, path.R, P)
        parts.append((k, mode, np.full(len(k), -1 - back), at, K, P))
        k = k - 1
    return parts


def _late(path: Path, events: Array, window: int) -> list[_Part]:
    """Modes after the plan's events have ended them."""
    parts, k, at, mode = [], events, path.nodes[events], path.pulling[events]
    S = np.tile(np.eye(len(path.Q)), (len(k), 1, 1))
    for on in range(window):
        goes = k + 1 < len(path.planned)
        goes[goes] = np.any(path.pulling[k[goes] + 1] != mode[goes], axis=1)
        k, at, mode, S = k[goes], at[goes], mode[goes], S[goes]
        if not len(k):
            break
        F, _ = _slopes(path, at, mode, k)
        at = led(path.marionette, at, mode, path.planned[k], path.durations[k])
        near = _near(path, k + 1, at)
        k, at, mode, S, F = k[near], at[near], mode[near], S[near], F[near]
        S = path.A[k] @ S @ np.linalg.inv(F)
        k = k + 1
        P = S.swapaxes(1, 2) @ path.P[k] @ S
        parts.append((k, mode, np.full(len(k), 1 + on), at, path.gains[k] @ S, P))
    return parts


def _near(path: Path, k: Array, at: Rows) -> MaskRows:
    """(n,) bool, whether states are so near to nodes k that something can be said from there."""
    z = away(path.marionette, path.nodes[k], at)
    far = np.sqrt(np.einsum("ni,ij,nj->n", z, path.Q, z))
    return far < _FAR  # false where it is not a number


def away(marionette: Marionette, node: Rows, x: Rows | State) -> Array:
    """(..., n_z) tangent vectors from states to others."""
    table = marionette.coordinates
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    return np.concatenate(
        [
            tangent.between(*places_D, node.q_D, x.q_D, table.n_vD),
            x.v_D - node.v_D,
            tangent.between(*places_K, node.q_K, x.q_K, table.n_vK),
            x.v_K - node.v_K,
        ],
        axis=-1,
    )


def _slopes(
    path: Path, at: Rows, mode: MaskRows, k: Array, onto: Array | None = None
) -> tuple[Array, Array]:
    """Slopes of modes, from states over segments k."""

    def move(near: Rows, acc_K: Array) -> Rows:
        each = len(acc_K) // len(k)
        modes, times = (np.repeat(a, each, axis=0) for a in (mode, path.durations[k]))
        return led(path.marionette, near, modes, acc_K, times)

    return slopes_of(path.marionette, move, at, path.planned[k], onto)


def led(
    marionette: Marionette, at: Rows, pulling: MaskRows, acc_K: Array, duration: Array
) -> Rows:
    """Where states lead in a mode, Eqs. 10 and 11 with its strings held and no others.

    Limits and winches that slip are left out.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        at: (n,) where they begin.
        pulling: (n, n_strings) bool, the strings that are held.
        acc_K: (n, n_vK) of the driven coordinates.
        duration: (n,) [s]; negative: where they came from.
    """
    table = marionette.coordinates
    places, (to_K, from_K) = (table.scalars_D, table.quaternions_D), zip(*table.scalars_K, strict=True)
    to_K, from_K, dt = list(to_K), list(from_K), duration[:, None] / _STEPS
    q, v = at.q_D, at.v_D

    def driven(t: Array) -> tuple[Array, Array]:
        q_K = at.q_K.copy()
        q_K[:, to_K] += (t * (at.v_K + 0.5 * t * acc_K))[:, from_K]
        return q_K, at.v_K + t * acc_K

    def rate(t: Array, turn: Array, v: Array) -> Array:
        return _acceleration(marionette, tangent.moved(*places, q, turn), v, *driven(t), acc_K, pulling)

    for step in range(_STEPS):
        t = step * dt
        a1 = rate(t, 0.0 * v, v)
        a2 = rate(t + 0.5 * dt, 0.5 * dt * v, v + 0.5 * dt * a1)
        a3 = rate(t + 0.5 * dt, 0.5 * dt * (v + 0.5 * dt * a1), v + 0.5 * dt * a2)
        a4 = rate(t + dt, dt * (v + 0.5 * dt * a2), v + dt * a3)
        q = tangent.moved(*places, q, dt * v + dt**2 / 6.0 * (a1 + a2 + a3))
        v = v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return Rows(q, v, at.slip, *driven(duration[:, None]))


def _acceleration(
    marionette: Marionette,
    q_D: Array,
    v_D: Array,
    q_K: Array,
    v_K: Array,
    acc_K: Array,
    pulling: MaskRows,
) -> Array:
    """(n, n_vD) acc_D with some strings held: G tau = hddot without tension."""
    L, w0, W, G, _, _, gamma, a0, *_ = marionette.library.evaluate(
        "dynamics", [q_D, v_D, q_K, v_K, acc_K, np.zeros_like(v_D), marionette.p]
    )
    n, strings = pulling.shape
    unit, both = np.eye(strings), pulling[:, :, None] & pulling[:, None]
    G = np.where(both, G.reshape(n, strings, strings), unit * ~pulling[:, None])
    G = G + _SOFT * np.trace(G, axis1=1, axis2=2)[:, None, None] * unit
    tension = np.linalg.solve(G, (pulling * (gamma + a0))[..., None])
    w = w0 - (tension.swapaxes(1, 2) @ W.reshape(n, strings, -1))[:, 0]
    return marionette.library.evaluate("back", [L, w])[0]
