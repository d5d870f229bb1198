"""The modes of a plan, led on past the events that end them and back before those that begin them.

A mode is the set of strings that pull. Its motion is smooth, so that it can be followed beyond the
plan's part of it, with the inputs of the plan: strings that pull are held, as wires if need be, the
others are left out. A puppet that is caught early or late is compared with that, and not with a
plan that is in another mode at that time ("reference spreading": Rijnen, Saccon, Nijmeijer)::

    early:  K from Riccati's recursion, with A and B of the mode, led into the plan
    late:   K = K_k S,   S = A_k-1 F^-1

where F are slopes of the old mode, A_k-1 those through the event, and S says how far from the plan
the puppet will be once its event has been as well: the saltation, taken to the node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.motion import State, tangent
from fantoccini.planning.funnels import before
from fantoccini.planning.goals import Rows
from fantoccini.planning.slopes import slopes_of, taut

_STEPS = 10
"""Of Runge and Kutta's method, in a segment."""

_APART = 1e-5
"""Size of the changes that slopes are made of [rad, m and their rates]."""

_SOFT = 1e-9
"""How much strings give beside one another, so that several may hold the same."""

_FAR = 1.0
"""Distance from the plan, as it is weighted, beyond which a mode's reference says nothing."""


@dataclass(frozen=True, eq=False)
class Course:
    """A plan, its modes, and its law by time.

    Attributes:
        marionette: the puppet.
        nodes: (m + 1,) states.
        pulling: (m + 1, n_strings) bool, the strings that pull after them.
        durations: (m,) of the segments [s].
        planned: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_vK) slopes of the segments.
        gains: (m, n_vK, n_z).
        P: (m + 1, n_z, n_z) of what is still to be paid.
        Q: (n_z, n_z) weights.
        R: those of the driven coordinates that move.
        moves: (n_vK,) bool, which these are.
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
        late: (e,) by how many segments its part of the plan has ended; negative where it is yet to
            begin.
        nodes: (e,) states that stand for the plan's.
        gains: (e, n_vK, n_z).
    """

    segment: Array
    pulling: MaskRows
    late: Array
    nodes: Rows
    gains: Array

    @classmethod
    def of(cls, course: Course, window: int) -> Beyond:
        """The modes of a plan beyond their parts of it.

        Args:
            course: the plan.
            window: how far they are led, in segments.
        """
        events = np.flatnonzero(np.any(course.pulling[1:] != course.pulling[:-1], axis=1))
        none = events[:0]
        parts = [cls(none, course.pulling[:0], none, course.nodes[:0], course.gains[:0])]
        with np.errstate(all="ignore"):  # what is led too far is left out afterwards
            parts += _early(course, events, window) + _late(course, events, window)
        nodes = [part.nodes.parts for part in parts]
        return cls(
            np.concatenate([part.segment for part in parts]),
            np.concatenate([part.pulling for part in parts]),
            np.concatenate([part.late for part in parts]),
            Rows(**{name: np.concatenate([a[name] for a in nodes]) for name in nodes[0]}),
            np.concatenate([part.gains for part in parts]),
        )

    def nearest(self, k: int, pulling: MaskRows) -> int | None:
        """The one for a segment and a mode; None where no part of the plan near it has this mode.

        Args:
            k: the segment.
            pulling: (n_strings,) bool.
        """
        found = np.flatnonzero((self.segment == k) & np.all(self.pulling == pulling, axis=1))
        return int(found[np.argmin(np.abs(self.late[found]))]) if len(found) else None


def _early(course: Course, events: Array, window: int) -> list[Beyond]:
    """Modes before the events that begin them, between nodes k and k + 1 for k of ``events``."""
    parts, k, mode = [], events, course.pulling[events + 1]
    at, P = course.nodes[events + 1], course.P[events + 1]
    for back in range(window):
        goes = k >= 0
        goes[goes] = np.any(course.pulling[k[goes]] != mode[goes], axis=1)
        k, at, P, mode = k[goes], at[goes], P[goes], mode[goes]
        at = led(course.marionette, at, mode, course.planned[k], -course.durations[k])
        near = _near(course, k, at)
        k, at, P, mode = k[near], at[near], P[near], mode[near]
        if not len(k):
            break
        A, B = _slopes(course, at, mode, k, taut(course.marionette, at, mode))
        gains = np.zeros_like(course.gains[k])
        gains[:, course.moves], P = before(A, B[:, :, course.moves], course.Q, course.R, P)
        parts.append(Beyond(k, mode, np.full(len(k), -1 - back), at, gains))
        k = k - 1
    return parts


def _late(course: Course, events: Array, window: int) -> list[Beyond]:
    """Modes after the events that end them."""
    parts, k, mode, at = [], events, course.pulling[events], course.nodes[events]
    S = np.tile(np.eye(len(course.Q)), (len(k), 1, 1))
    for on in range(window):
        goes = k + 1 < len(course.planned)
        goes[goes] = np.any(course.pulling[k[goes] + 1] != mode[goes], axis=1)
        k, at, mode, S = k[goes], at[goes], mode[goes], S[goes]
        begun, at = at, led(course.marionette, at, mode, course.planned[k], course.durations[k])
        near = _near(course, k + 1, at)
        k, begun, at, mode, S = k[near], begun[near], at[near], mode[near], S[near]
        if not len(k):
            break
        F, _ = _slopes(course, begun, mode, k)
        S = course.A[k] @ S @ np.linalg.inv(F)
        k = k + 1
        parts.append(Beyond(k, mode, np.full(len(k), 1 + on), at, course.gains[k] @ S))
    return parts


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


def _near(course: Course, k: Array, at: Rows) -> MaskRows:
    """(n,) bool, whether states are so near to nodes k that something can be said from there."""
    z = away(course.marionette, course.nodes[k], at)
    # False where it is not a number.
    return np.einsum("ni,ij,nj->n", z, course.Q, z) < _FAR**2


def _slopes(
    course: Course, at: Rows, mode: MaskRows, k: Array, onto: Array | None = None
) -> tuple[Array, Array]:
    return mode_slopes(
        course.marionette, at, mode, course.planned[k], course.durations[k], onto
    )


def mode_slopes(
    marionette: Marionette,
    at: Rows,
    pulling: MaskRows,
    acceleration: Array,
    duration: Array,
    onto: Array | None = None,
) -> tuple[Array, Array]:
    """Slopes of modes, A (m, n_z, n_z) and B (m, n_z, n_vK); arguments as of :func:`led`.

    Args:
        marionette: the puppet.
        at: (m,) states.
        pulling: (m, n_strings) bool.
        acceleration: (m, n_vK).
        duration: (m,) [s].
        onto: (m, n_z, n_z) project changes of the states; see
            :func:`fantoccini.planning.slopes.taut`.
    """

    def move(near: Rows, acc_K: Array) -> Rows:
        each = len(acc_K) // len(pulling)
        modes, times = (np.repeat(a, each, axis=0) for a in (pulling, duration))
        return led(marionette, near, modes, acc_K, times)

    return slopes_of(marionette, move, at, acceleration, onto, _APART)


def led(
    marionette: Marionette, at: Rows, pulling: MaskRows, acc_K: Array, duration: Array
) -> Rows:
    """Where states lead in a mode, Eqs. 10 and 11 with its strings held and no others.

    Limits are left out, and winches do not slip.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        at: (n,) where they begin.
        pulling: (n, n_strings) bool, the strings that are held.
        acc_K: (n, n_vK) of the driven coordinates.
        duration: (n,) [s]; negative: where they came from.
    """
    table, dt = marionette.coordinates, duration[:, None] / _STEPS
    places = table.scalars_D, table.quaternions_D
    q, v = at.q_D, at.v_D

    def driven(t: Array) -> tuple[Array, Array]:
        moved = t * (at.v_K + 0.5 * t * acc_K)
        return tangent.moved(table.scalars_K, (), at.q_K, moved), at.v_K + t * acc_K

    def rate(t: Array, turn: Array, v: Array) -> Array:
        q_D = tangent.moved(*places, q, turn)
        return _acceleration(marionette, Rows(q_D, v, at.slip, *driven(t)), acc_K, pulling)

    for step in range(_STEPS):
        t = step * dt
        a1 = rate(t, np.zeros_like(v), v)
        a2 = rate(t + 0.5 * dt, 0.5 * dt * v, v + 0.5 * dt * a1)
        a3 = rate(t + 0.5 * dt, 0.5 * dt * (v + 0.5 * dt * a1), v + 0.5 * dt * a2)
        a4 = rate(t + dt, dt * (v + 0.5 * dt * a2), v + dt * a3)
        q = tangent.moved(*places, q, dt * v + dt**2 / 6.0 * (a1 + a2 + a3))
        v = v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return Rows(q, v, at.slip, *driven(duration[:, None]))


def _acceleration(marionette: Marionette, at: Rows, acc_K: Array, pulling: MaskRows) -> Array:
    """(n, n_vD) acc_D with some strings held: G tau = hddot without tension."""
    found = marionette.model.library.evaluate(
        "dynamics", q_D=at.q_D, v_D=at.v_D, q_K=at.q_K, v_K=at.v_K, acc_K=acc_K,
        u_D=np.zeros_like(at.v_D), p=marionette.p,
    )  # fmt: skip
    strings = pulling.shape[1]
    unit, both = np.eye(strings), pulling[:, :, None] & pulling[:, None]
    G = np.where(both, found.G, unit * ~pulling[:, None])
    G = G + _SOFT * np.trace(G, axis1=1, axis2=2)[:, None, None] * unit
    tension = np.linalg.solve(G, (pulling * (found.gamma + found.a0))[..., None])
    w = found.w0 - (tension.swapaxes(1, 2) @ found.W.swapaxes(1, 2))[:, 0]
    return marionette.model.library.evaluate("back", L=found.L, x=w).y
