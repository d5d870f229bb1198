"""Impacts of solids: points and rows with an impulse, or held after it.

A row is a string or a joint limit. A saltation describes how small changes of the state pass an
impulse; v_D are the dynamic velocities. In names, K stands for driven coordinates: ends and lengths
of strings, driven joints. h is the gap of a string, path length minus string length; hdot and hddot
are its rates. A twist is a velocity of a link, linear and angular; a screw is the twist per unit of
one joint velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.dynamics.compiled import ROW_TOLERANCES, Evaluation, PairGeometry, Screws
from fantoccini.dynamics.derivatives import (
    TOLERANCES,
    ContactMode,
    ContactRows,
    HeldPoint,
    ModeSystem,
    PointMode,
    closed_without_force,
    geometries,
    row_derivatives_at,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.saltation import (
    RELATIVE_ROUNDING,
    Guard,
    Saltation,
    normal_speed,
    string_restitution,
)
from fantoccini.motion import State, pair_name

MAX_CLOSED_GAP = 1e-8
"""Largest gap of a point in an impact [m]: above the gaps of a run at its events."""
MIN_SLIDING_SPEED = 10.0
"""Minimum speed of a sliding point after the impact, relative to the speed at rest."""
VELOCITY_TOLERANCE = 1e-6
"""Largest error of velocities after an impact, relative to max(1, |v|)."""


def impact_at(
    marionette: Marionette, before: State, after: State, held: tuple[Indices, Indices]
) -> Saltation:
    """Saltation of an impact of a run.

    Args:
        marionette: the puppet.
        before, after: states on its two sides.
        held: taut rows before and after.

    Raises:
        SimulationError: the run's velocities do not satisfy the equations of the impact.
    """
    return _Impact(marionette, before, after, held).saltation


class _Impact:
    """Points and rows that take part in an impact; arguments as in :func:`impact_at`."""

    def __init__(
        self, marionette: Marionette, before: State, after: State, held: tuple[Indices, Indices]
    ):
        self._marionette, self._before = marionette, before
        self._at = evaluation = Evaluation.at_state(marionette, before)
        n_rows = len(evaluation.hdot)
        taut_before, taut_after = (np.isin(np.arange(n_rows), rows) for rows in held)
        restitution = string_restitution(marionette, evaluation)
        self.screws = Screws(marionette, before)
        screws_after = Screws(marionette, before.replace(v_D=after.v_D))
        scale = max(1.0, float(np.max(np.abs(before.v_D))), float(np.max(np.abs(after.v_D))))
        self._rest_speed = TOLERANCES.speed * scale
        row_derivatives = row_derivatives_at(marionette, before)
        hdot_after = evaluation.hdot + row_derivatives["A_D"] @ (after.v_D - before.v_D)
        obeys_law = np.abs(hdot_after + restitution * evaluation.hdot) <= VELOCITY_TOLERANCE * scale
        is_closed = np.abs(evaluation.h) <= ROW_TOLERANCES.start_gap * marionette.row_scales(
            before.q_D, before.q_K
        )
        self.rows = np.flatnonzero(
            ((taut_before | taut_after | is_closed) & obeys_law) | marionette.two_sided
        )
        points, open_points = self._points(screws_after, VELOCITY_TOLERANCE * scale)
        velocity_jump, row_impulse, points = self._solve(
            points, (1.0 + restitution) * evaluation.hdot
        )
        impulse = np.zeros(n_rows)
        impulse[self.rows] = row_impulse
        self.screws_after = Screws(marionette, before.replace(v_D=before.v_D + velocity_jump))
        points = self._with_velocities_after(points)
        struck_points = [p for p in points if normal_speed(self.screws, p) < -self._rest_speed]
        max_speed = np.max(np.abs(evaluation.hdot[self.rows]), initial=0.0)
        caught_rows = [
            r
            for r in self.rows
            if not taut_before[r] and evaluation.hdot[r] > RELATIVE_ROUNDING * max_speed
        ]
        guards = [Guard.of_point(self.screws, p) for p in struck_points]
        guards += [Guard.of_row(row_derivatives, int(r), evaluation.hdot[r]) for r in caught_rows]
        row_names = marionette.tree.row_names
        names = (
            *dict.fromkeys(p.name for p in struck_points),
            *(row_names[r] for r in caught_rows),
        )
        edges = closed_without_force(
            self.screws_after, points, open_points, self._rest_speed
        ) + _edge_texts(points)
        is_near = is_closed & ~taut_before & (evaluation.hdot > -ROW_TOLERANCES.rest_speed)
        is_near[self.rows] = False
        edges += [f"{row_names[r]}: at its bound" for r in np.flatnonzero(is_near)]
        self.saltation = Saltation(
            marionette,
            before,
            evaluation,
            self.rows,
            points,
            restitution,
            velocity_jump,
            impulse,
            guards,
            names,
            edges,
        )
        self.saltation.check(
            after.v_D,
            f"impact at t = {before.t:.6g} s cannot be differentiated: its velocities are not "
            "those of the points and strings that it strikes and holds",
        )

    def _points(
        self, screws_after: Screws, tolerance: float
    ) -> tuple[list[HeldPoint], list[tuple[str, PairGeometry, int, float]]]:
        """Points whose normal velocity after the impact obeys the law, and the other ones."""
        marionette = self._marionette
        assert marionette.contacts is not None
        held_points: list[HeldPoint] = []
        open_points: list[tuple[str, PairGeometry, int, float]] = []
        for pair in geometries(marionette, self.screws, self._before):
            name = pair_name(marionette.contacts.names[pair.pair])
            mu = float(marionette.contacts.friction[pair.pair])
            e = float(marionette.contacts.restitution[pair.pair])
            for feature, values in pair.points.items():
                if values[0] > MAX_CLOSED_GAP:
                    continue
                n = values[4:]
                u, v = (pair.velocity(s, values[1:4]) for s in (self.screws, screws_after))
                is_struck = n @ u < -self._rest_speed
                target = -e * (n @ u) if is_struck else 0.0
                if abs(n @ v - target) > tolerance:
                    open_points.append((name, pair, feature, float(n @ v)))
                    continue
                tangential = v - n * (n @ v)
                speed = float(np.linalg.norm(tangential))
                is_sliding = mu == 0.0 or speed > MIN_SLIDING_SPEED * self._rest_speed
                along = tangential / speed if is_sliding and mu > 0.0 else np.zeros(3)
                mode = ContactMode.SLIDE if is_sliding else ContactMode.STICK
                point_mode = PointMode(
                    name, pair.pair, feature, mode, mu, along, is_sliding and mu > 0.0
                )
                held_point = HeldPoint.in_mode(point_mode, pair.touch(feature), np.zeros(3), v)
                held_points.append(replace(held_point, restitution=e if is_struck else 0.0))
        return held_points, open_points

    def _solve(
        self, points: list[HeldPoint], row_closing_speed: Array
    ) -> tuple[Array, Array, list[HeldPoint]]:
        """Change of velocity v+ - v-, impulses of rows, and pushing points with their impulses."""
        zeros, marionette = np.zeros((len(self._before.v_D), 1)), self._marionette
        while True:
            rows = ContactRows(self.screws, points, 0.0)
            # -u along held directions; with the rebound e of struck normals.
            point_closing_speed = rows.rows @ self._before.v_D + self._driven_closing_speed(points)
            first_multiplier = np.cumsum([0, *(len(p.directions) for p in points)])[:-1].astype(int)
            for k, point in zip(first_multiplier, points, strict=True):
                point_closing_speed[k] *= 1.0 + point.restitution
            system = ModeSystem(self._at, self.rows, rows)
            rate = np.concatenate([row_closing_speed[self.rows], point_closing_speed])[:, None]
            velocity_jump, y = system.solve(zeros, rate)
            y = y[:, 0]
            point_impulses = y[len(self.rows) :]
            max_impulse = float(np.max(np.abs(y), initial=0.0))
            threshold = -TOLERANCES.force * max_impulse
            pushes_row = (y[: len(self.rows)] < threshold) & ~marionette.two_sided[self.rows]
            if np.any(pushes_row):
                self.rows = self.rows[~pushes_row]
                continue
            pulling_points = [
                i for i, k in enumerate(first_multiplier) if point_impulses[k] < threshold
            ]
            if not pulling_points:
                break
            most_pulling = min(pulling_points, key=lambda i: point_impulses[first_multiplier[i]])
            points = [p for i, p in enumerate(points) if i != most_pulling]
        last_multiplier = np.cumsum([len(p.directions) for p in points], dtype=int)
        forces = [
            replace(p, force=p.pushes.T @ point_impulses[a:b])
            for p, a, b in zip(points, first_multiplier, last_multiplier, strict=True)
        ]
        return velocity_jump[:, 0], y[: len(self.rows)], forces

    def _driven_closing_speed(self, points: Sequence[HeldPoint]) -> Array:
        """Part of -u (k,) from driven solids, along the held directions."""
        parts = []
        for point in points:
            a, b = point.touch.links
            twist = self.screws.twist(a) - self.screws.twist(b)
            U = self.screws.subspace(a) - self.screws.subspace(b)
            twist = twist - U @ self._before.v_D
            u = twist[:3] + np.cross(twist[3:], point.touch.point)
            parts.append(-point.directions @ u)
        return np.concatenate([np.zeros(0), *parts])

    def _with_velocities_after(self, points: Sequence[HeldPoint]) -> list[HeldPoint]:
        """The points with the velocities after the impact."""
        out = []
        for point in points:
            a, b = point.touch.links
            twist = self.screws_after.twist(a) - self.screws_after.twist(b)
            out.append(replace(point, velocity=twist[:3] + np.cross(twist[3:], point.touch.point)))
        return out


def _edge_texts(points: Sequence[HeldPoint]) -> list[str]:
    """Points at the edge of their friction cone, or without an impulse, in words."""
    size = max((float(np.linalg.norm(p.force)) for p in points), default=0.0)
    texts = []
    for p in points:
        normal = float(p.touch.normal @ p.force)
        tangential = float(np.linalg.norm(p.force - normal * p.touch.normal))
        if normal <= TOLERANCES.force * size:
            texts.append(f"{p.name}: touches without force")
        elif (
            p.mode is ContactMode.STICK
            and tangential > (1.0 - TOLERANCES.cone) * p.friction * normal
        ):
            texts.append(f"{p.name}: sticks at the edge of its cone")
    return texts
