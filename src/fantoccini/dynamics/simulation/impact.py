"""Small changes of the state across an impact in which solids touch: the saltation matrix.

As across a catch (:mod:`fantoccini.dynamics.simulation.catch`), with points in their modes beside
strings:

    M (v+ - v-) + A_D^T Lambda - U^T X = 0,   hdot+ = -e max(hdot-, 0),
    u_n+ = e max(-u_n-, 0),   X = x_n n where u_T+ = 0, else x_n (n - mu u_T+/|u_T+|)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fantoccini.base import Array, Indices, SimulationError, Status
from fantoccini.dynamics.compiled import ROW_TOLERANCES, Evaluation, PairGeometry, Screws
from fantoccini.dynamics.derivatives import (
    TOLERANCES,
    ContactMode,
    ContactRows,
    HeldPoint,
    KKTSystem,
    ModeSystem,
    PointMode,
    closed_without_force,
    geometries,
    row_derivatives_at,
    solve_in_modes,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.catch import (
    NEGLIGIBLE,
    VELOCITY_ERROR,
    Passage,
    force_change,
    rate_change,
    restitution_change,
    string_restitution,
)
from fantoccini.dynamics.simulation.contact_pieces import AGREE, stacked
from fantoccini.dynamics.simulation.input_piece import InputVariation
from fantoccini.motion import State, pair_name

CLOSED = 1e-8
"""Gap at which a point takes part in an impact [m]: above what a run leaves at its event."""
SLIDES = 10.0
"""Speed of a point that slides after the impact, in speeds that are none."""
AT_TARGET = 1e-6
"""Difference of a velocity after the impact from the law's, relative to 1 or the largest."""


class Impact:
    """One impact of a run.

    Args:
        marionette: the puppet.
        before, after: the states on its two sides.
        held: rows taut before, and after.

    Raises:
        SimulationError: the run's velocities are not those of the impact's equations.
    """

    def __init__(
        self, marionette: Marionette, before: State, after: State, held: tuple[Indices, Indices]
    ):
        self._marionette, self._before = marionette, before
        self._at = at = Evaluation.of(marionette, before)
        n_rows = len(at.hdot)
        was, stays = (np.isin(np.arange(n_rows), rows) for rows in held)
        self._restitution = string_restitution(marionette, at)
        self.screws = Screws(marionette, before)
        later = Screws(marionette, before.replace(v_D=after.v_D))
        scale = max(1.0, float(np.max(np.abs(before.v_D))), float(np.max(np.abs(after.v_D))))
        self._still = TOLERANCES.speed * scale
        found = row_derivatives_at(marionette, before)
        ends = at.hdot + found["A_D"] @ (after.v_D - before.v_D)
        as_asked = np.abs(ends + self._restitution * at.hdot) <= AT_TARGET * scale
        closed = np.abs(at.h) <= ROW_TOLERANCES.start_gap * marionette.row_scales(
            before.q_D, before.q_K
        )
        self.rows = np.flatnonzero(((was | stays | closed) & as_asked) | marionette.two_sided)
        points, idle = self._points(later, AT_TARGET * scale)
        kick, impulse, points = self._kick(points, (1.0 + self._restitution) * at.hdot)
        self._kicked, self._impulse = kick, np.zeros(n_rows)
        self._impulse[self.rows] = impulse
        self._after = after.replace(v_D=before.v_D + kick)
        off = np.abs(self._after.v_D - after.v_D) / (1.0 + np.abs(after.v_D))
        if np.max(off, initial=0.0) > VELOCITY_ERROR:
            raise SimulationError(
                Status.NOT_SETTLED,
                f"the impact at t = {before.t:.6g} s cannot be differentiated: its velocities are "
                "not those of the points and strings that it strikes and holds, as when "
                "restitutions are scaled down",
            )
        self.later = Screws(marionette, before.replace(v_D=self._after.v_D))
        self.points = self._slid(points)
        struck = [p for p in self.points if _normal_speed(self.screws, p) < -self._still]
        fast = np.max(np.abs(at.hdot[self.rows]), initial=0.0)
        caught = [r for r in self.rows if not was[r] and at.hdot[r] > NEGLIGIBLE * fast]
        self._guards = [_Guard.of_point(self.screws, p) for p in struck]
        self._guards += [_Guard.of_row(self.screws, found, int(r), at.hdot[r]) for r in caught]
        self.names = tuple(dict.fromkeys([p.name for p in struck]))
        self.names += tuple(marionette.tree.row_names[r] for r in caught)
        self.speed = max((guard.speed for guard in self._guards), default=0.0)
        self.edges = closed_without_force(self.later, self.points, idle, self._still)
        self.edges += _weak(self.points)
        near = closed & ~was & (at.hdot > -ROW_TOLERANCES.rest_speed)
        near[self.rows] = False
        names = marionette.tree.row_names
        self.edges += [f"{names[r]}: at its bound" for r in np.flatnonzero(near)]

    def passage(self, acc: tuple[Array, Array], acc_K: Array, held: Array) -> Passage:
        """The impact with its saltation matrix.

        Args:
            acc: acc_D before and after.
            acc_K: (n_vK,) driven acceleration before it.
            held: (2 n_vD, k) changes before it that keep what is held there.
        """
        m = 2 * len(self._before.v_D)
        jump = self.carried(np.eye(m), InputVariation.none(self._marionette, m), acc, acc_K)
        changes = stacked(held, InputVariation.none(self._marionette, held.shape[1]))
        lates = np.array([guard.late(changes)[0] for guard in self._guards])
        apart = float(np.max(np.abs(lates - lates[:1]), initial=0.0))
        together = apart <= AGREE * float(np.max(np.abs(lates), initial=1e-9))
        sharp = len(lates) > 0 and together and not self.edges
        return Passage(self._before.t, self.names, self.speed, jump, sharp)

    def carried(
        self, Z: Array, by_input: InputVariation, acc: tuple[Array, Array], acc_K: Array
    ) -> Array:
        """Changes after the impact, at a fixed time; arguments as of ``Catch.carried``."""
        x, n, marionette = self._before, len(self._before.v_D), self._marionette
        D = stacked(Z, by_input)
        late = np.zeros((1, Z.shape[1]))
        if self._guards:
            late = max(self._guards, key=lambda guard: guard.speed).late(D)
        q_D, v_D = Z[:n] + x.v_D[:, None] * late, Z[n:] + acc[0][:, None] * late
        q_K, v_K = by_input.q_K + x.v_K[:, None] * late, by_input.v_K + acc_K[:, None] * late
        p = by_input.p
        D = stacked(
            np.concatenate([q_D, v_D]), InputVariation(q_K, v_K, by_input.acc_K, by_input.u_D, p)
        )
        before, after = (row_derivatives_at(marionette, side) for side in (x, self._after))
        speed = rate_change(before, q_D, q_K, v_K, p) + before["A_D"] @ v_D
        rate = rate_change(after, q_D, q_K, v_K, p) + after["A_D"] @ v_D
        rate += self._restitution[:, None] * speed
        rate += restitution_change(self._marionette, self._at) @ p
        force = force_change(self._marionette, x, self._kicked, self._impulse, q_D, q_K, p)
        kick = self._solve(force, rate[self.rows], D)
        q_D = q_D - self._after.v_D[:, None] * late
        return np.concatenate([q_D, v_D + kick - acc[1][:, None] * late])

    def _solve(self, force: Array, rate: Array, D: Array) -> Array:
        """(n_vD, m) changes of the kick."""
        if not self.points:
            return KKTSystem(self._at, self.rows).solve(force, rate)[0]

        marionette, x = self._marionette, self._before
        before = Screws(marionette, x, changes=D)
        later = Screws(marionette, x.replace(v_D=self._after.v_D), changes=D)

        def rows(points: Sequence[HeldPoint]) -> tuple[ContactRows, Array]:
            made, struck = ContactRows(later, points, 1.0), ContactRows(before, points, 0.0)
            return made, made.velocity_by() + struck.bounce_by()

        return solve_in_modes(self._at, self.rows, force, rate, rows, self.points)[0]

    def _points(
        self, later: Screws, tolerance: float
    ) -> tuple[list[HeldPoint], list[tuple[str, PairGeometry, int, float]]]:
        """Points that end at the law's normal velocity, and those that do not take part."""
        marionette = self._marionette
        assert marionette.contacts is not None
        taking_part: list[HeldPoint] = []
        idle: list[tuple[str, PairGeometry, int, float]] = []
        for pair in geometries(marionette, self.screws, self._before):
            name = pair_name(marionette.contacts.names[pair.pair])
            mu = float(marionette.contacts.friction[pair.pair])
            e = float(marionette.contacts.restitution[pair.pair])
            for feature, values in pair.points.items():
                if values[0] > CLOSED:
                    continue
                n = values[4:]
                u, v = (pair.velocity(s, values[1:4]) for s in (self.screws, later))
                strikes = n @ u < -self._still
                target = -e * (n @ u) if strikes else 0.0
                if abs(n @ v - target) > tolerance:
                    idle.append((name, pair, feature, float(n @ v)))
                    continue
                across = v - n * (n @ v)
                speed = float(np.linalg.norm(across))
                slides = mu == 0.0 or speed > SLIDES * self._still
                along = across / speed if slides and mu > 0.0 else np.zeros(3)
                mode = ContactMode.SLIDE if slides else ContactMode.STICK
                kept = PointMode(name, pair.pair, feature, mode, mu, along, slides and mu > 0.0)
                made = HeldPoint.of(kept, pair.touch(feature), np.zeros(3), v)
                taking_part.append(replace(made, bounces=e if strikes else 0.0))
        return taking_part, idle

    def _kick(
        self, points: list[HeldPoint], stopped: Array
    ) -> tuple[Array, Array, list[HeldPoint]]:
        """v+ - v-, the rows' impulses, and the points with theirs; none of them pulls."""
        none, marionette = np.zeros((len(self._before.v_D), 1)), self._marionette
        while True:
            rows = ContactRows(self.screws, points, 0.0)
            # -u along what is held; a normal that is struck also gives back e of it.
            closing = rows.rows @ self._before.v_D + self._driven(points)
            first = np.cumsum([0, *(len(p.directions) for p in points)])[:-1].astype(int)
            for k, point in zip(first, points, strict=True):
                closing[k] *= 1.0 + point.bounces
            system = ModeSystem(self._at, self.rows, rows)
            rate = np.concatenate([stopped[self.rows], closing])[:, None]
            kick, y = system.solve(none, rate)
            y = y[:, 0]
            own = y[len(self.rows) :]
            size = float(np.max(np.abs(y), initial=0.0))
            least = -TOLERANCES.force * size
            loose = (y[: len(self.rows)] < least) & ~marionette.two_sided[self.rows]
            if np.any(loose):
                self.rows = self.rows[~loose]
                continue
            pulls = [i for i, k in enumerate(first) if own[k] < least]
            if not pulls:
                break
            worst = min(pulls, key=lambda i: own[first[i]])
            points = [p for i, p in enumerate(points) if i != worst]
        ends = [*first[1:], len(own)]
        forces = [
            replace(p, force=p.pushes.T @ own[a:b])
            for p, a, b in zip(points, first, ends, strict=True)
        ]
        return kick[:, 0], y[: len(self.rows)], forces

    def _driven(self, points: Sequence[HeldPoint]) -> Array:
        """(k,) -u that driven solids make, along what is held."""
        parts = []
        for point in points:
            a, b = point.touch.links
            twist = self.screws.twist(a) - self.screws.twist(b)
            U = self.screws.subspace(a) - self.screws.subspace(b)
            twist = twist - U @ self._before.v_D
            u = twist[:3] + np.cross(twist[3:], point.touch.point)
            parts.append(-point.directions @ u)
        return np.concatenate([np.zeros(0), *parts])

    def _slid(self, points: Sequence[HeldPoint]) -> list[HeldPoint]:
        """The points with the velocities after the impact."""
        out = []
        for point in points:
            a, b = point.touch.links
            twist = self.later.twist(a) - self.later.twist(b)
            out.append(replace(point, velocity=twist[:3] + np.cross(twist[3:], point.touch.point)))
        return out


def _normal_speed(screws: Screws, point: HeldPoint) -> float:
    a, b = point.touch.links
    twist = screws.twist(a) - screws.twist(b)
    return float(point.touch.normal @ (twist[:3] + np.cross(twist[3:], point.touch.point)))


def _weak(points: Sequence[HeldPoint]) -> list[str]:
    """Points at the edge of their cone, or without an impulse."""
    size = max((float(np.linalg.norm(p.force)) for p in points), default=0.0)
    out = []
    for p in points:
        normal = float(p.touch.normal @ p.force)
        across = float(np.linalg.norm(p.force - normal * p.touch.normal))
        if normal <= TOLERANCES.force * size:
            out.append(f"{p.name}: touches without force")
        elif p.mode is ContactMode.STICK and across > (1.0 - TOLERANCES.cone) * p.friction * normal:
            out.append(f"{p.name}: sticks at the edge of its cone")
    return out


class _Guard:
    """What decides the time of an impact: a gap that closes.

    Args:
        by: (n_columns,) changes of -gap.
        speed: at which it closes [m/s or rad/s].
    """

    def __init__(self, by: Array, speed: float):
        self._by, self.speed = by, speed

    @classmethod
    def of_point(cls, screws: Screws, point: HeldPoint) -> _Guard:
        a, b = point.touch.links
        gap = point.touch.by[0] @ (screws.pose_by(a) - screws.pose_by(b))
        return cls(-gap, -_normal_speed(screws, point))

    @classmethod
    def of_row(cls, screws: Screws, found: dict[str, Array], row: int, speed: float) -> _Guard:
        n, k = screws.n_D, found["A_K"].shape[1]
        by = np.zeros(screws.n_columns)
        by[:n], by[2 * n : 2 * n + k] = found["A_D"][row], found["A_K"][row]
        by[screws.n_columns - found["h_p"].shape[1] :] = found["h_p"][row]
        return cls(by, float(speed))

    def late(self, D: Array) -> Array:
        """(1, m) change of the time [s]."""
        return np.asarray(-(self._by @ D)[None] / self.speed)
