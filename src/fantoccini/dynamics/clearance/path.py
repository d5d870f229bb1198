"""Path: configurations along a motion, at its samples and between them.

Between samples of event-driven runs, coordinates are quintics, and rotations are interpolated in
the tangent space, as in :mod:`fantoccini.base.interpolate`. In runs of fixed steps, coordinates
are interpolated linearly.

q_D and q_K are the dynamic and driven coordinates, with velocities v and accelerations acc; a
quintic is a polynomial of degree 5. A link is a body on its joint.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, IndexPairs, Indices, Times, polynomial, rotation
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import Moves
from fantoccini.model.tree import Role
from fantoccini.motion import Trajectory

MIN_SLACK = 1.0 + 1e-6
"""Ratio of length to span above which a string sags, as in compiled code."""


class _Samples(NamedTuple):
    """Dynamic or driven coordinates at T samples: (T, n_q), (T, n_v), (T, n_v), and indices.

    Without velocities and accelerations, coordinates are interpolated linearly.
    """

    q: Array
    v: Array | None
    acc: Array | None
    scalars: IndexPairs
    quaternions: IndexPairs
    n_v: int


class Path:
    """Configurations along a motion of T samples, in T - 1 pieces.

    Attributes:
        marionette: the puppet or scene.
        t: (T,) times [s].
        q_D, q_K: (T, n_qD) dynamic and (T, n_qK) driven (kinematic) configurations.
        h: (T - 1,) durations of the pieces [s]; 0 at an impact.

    Args:
        marionette: a puppet or a scene.
        t: (T,) times of the samples, not decreasing [s].
        q_D, q_K: (T, n_qD), (T, n_qK) configurations.
        rates: (T, n) v_D, acc_D, v_K and acc_K; without them, interpolation is linear.
    """

    def __init__(
        self,
        marionette: Marionette,
        t: Times,
        q_D: Array,
        q_K: Array,
        rates: tuple[Array, Array, Array, Array] | None = None,
    ):
        self.marionette, self.t, self.q_D, self.q_K = marionette, t, q_D, q_K
        self.h = np.diff(t)
        self._rates, table = rates, marionette.coordinates
        v_D, acc_D, v_K, acc_K = (None,) * 4 if rates is None else rates
        self._samples = {
            Role.DYNAMIC: _Samples(
                q_D, v_D, acc_D, table.scalars_D, table.quaternions_D, table.n_vD
            ),
            Role.DRIVEN: _Samples(
                q_K, v_K, acc_K, table.scalars_K, table.quaternions_K, table.n_vK
            ),
        }
        self._coef = {
            role: _polynomials(self.h, samples) for role, samples in self._samples.items()
        }

    @classmethod
    def from_run(cls, marionette: Marionette, run: Trajectory, every: int = 1) -> Path:
        """The path of a run, or with ``every`` > 1 straight lines between some of its samples."""
        t, q_D, q_K = run.t[::every], run.q_D[::every], run.q_K[::every]
        if run.method != "event" or every > 1:
            return cls(marionette, t, q_D, q_K)
        return cls(marionette, t, q_D, q_K, (run.v_D, run.acc_D, run.v_K, run.acc_K))

    def __len__(self) -> int:
        return len(self.t)

    def part(self, begin: int, end: int) -> Path:
        """The path from sample ``begin`` up to, but not including, ``end``."""
        samples = slice(begin, end)
        rates = None
        if self._rates is not None:
            v_D, acc_D, v_K, acc_K = self._rates
            rates = v_D[samples], acc_D[samples], v_K[samples], acc_K[samples]
        return Path(self.marionette, self.t[samples], self.q_D[samples], self.q_K[samples], rates)

    def at(self, piece: Indices, s: Array) -> tuple[Array, Array]:
        """Configurations q_D, q_K (m, ...) in pieces (m,), s (m,) after their starts [s]."""
        configuration = []
        for role, samples in self._samples.items():
            values = polynomial.evaluate(self._coef[role][piece], s[:, None])[0]
            q = samples.q[piece].copy()
            for i, v in samples.scalars:
                q[:, i] = values[:, v]
            for i, v in samples.quaternions:
                wxyz = slice(i, i + 4)
                q[:, wxyz] = rotation.multiply(q[:, wxyz], rotation.exp(values[:, v : v + 3]))
            configuration.append(q)
        return configuration[0], configuration[1]

    def move_bounds(self, piece: Indices, start: Array, end: Array) -> Moves:
        """Upper bounds of the joints' travel in pieces (m,), between times (m,) within them [s].

        A polynomial's path is no longer than the polygon of its Bezier control points.
        """
        tree = self.marionette.tree
        steps = {
            role: np.diff(
                polynomial.control_points(
                    polynomial.shifted(coef[piece], start), (end - start)[:, None]
                )
            )
            for role, coef in self._coef.items()
        }
        m = len(piece)
        translation, rotation_ = np.zeros((2, m, len(tree.links)))
        for i, link in enumerate(tree.links):
            n_v = link.v.stop - link.v.start
            if not n_v:
                continue
            joint_steps = steps[link.role][:, link.v]
            n_rotations = {"revolute": 1, "ball": 3, "free": 3}.get(link.kind, 0)
            n_translations = n_v - n_rotations
            for travel, steps_of_kind in (
                (translation, joint_steps[:, :n_translations]),
                (rotation_, joint_steps[:, n_translations:]),
            ):
                travel[:, i] = np.sqrt(np.einsum("mvk,mvk->mk", steps_of_kind, steps_of_kind)).sum(
                    axis=1
                )
        wound_length = np.zeros((m, len(tree.strings)))
        for i, string in enumerate(tree.strings):
            if string.length_index is not None:
                wound_length[:, i] = np.abs(
                    steps[string.length_role][:, string.length_index[1]]
                ).sum(axis=1)
        return Moves(translation, rotation_, wound_length, self._slack_factors[piece])

    @cached_property
    def _slack_factors(self) -> Array:
        """(T - 1, n_strings) 1.0 for strings that are slack at an end of a piece, else 0.0."""
        marionette = self.marionette
        lengths = marionette.string_lengths(self.q_D, self.q_K)
        is_slack = np.zeros(lengths.shape, dtype=bool)
        for i, points in enumerate(marionette.string_points(self.q_D, self.q_K).values()):
            path_length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
            wire = marionette.tree.strings[i].wire
            is_slack[:, i] = (lengths[:, i] > path_length * MIN_SLACK) & (not wire)
        return np.array(is_slack[1:] | is_slack[:-1], dtype=float)

    @cached_property
    def midpoint_bounds(self) -> Moves:
        """Bounds (T, ...) of the moves from each sample to the middles of its adjacent pieces."""
        pieces, half_h = np.arange(len(self.h)), 0.5 * self.h
        before = self.move_bounds(pieces, half_h, self.h)
        after = self.move_bounds(pieces, np.zeros_like(half_h), half_h)
        bounds = []
        for to_end, from_start in zip(before, after, strict=True):
            zeros = np.zeros((1, to_end.shape[1]))
            bounds.append(
                np.maximum(np.concatenate([from_start, zeros]), np.concatenate([zeros, to_end]))
            )
        return Moves(*bounds)


def _polynomials(h: Array, samples: _Samples) -> Array:
    """Coefficients (T - 1, n_v, 6) of scalars, and of rotation vectors from the left samples."""
    T, has_duration = len(h) + 1, h > 0.0
    coef = np.zeros((T - 1, samples.n_v, polynomial.N_COEF))
    step = np.where(has_duration, h, 1.0)[:, None]
    for i, v in samples.scalars:
        q = samples.q[:, i]
        if samples.v is None or samples.acc is None:
            coef[:, v, 0], coef[:, v, 1] = q[:-1], np.diff(q) / step[:, 0]
        else:
            rate, acc = samples.v[:, v], samples.acc[:, v]
            start, end = (q[:-1], rate[:-1], acc[:-1]), (q[1:], rate[1:], acc[1:])
            coef[:, v] = polynomial.hermite(step[:, 0], start, end)
        coef[~has_duration, v, 1:] = 0.0
    for i, v in samples.quaternions:
        wxyz, columns = slice(i, i + 4), slice(v, v + 3)
        rotation_vector = rotation.between(samples.q[:-1, wxyz], samples.q[1:, wxyz])
        if samples.v is None or samples.acc is None:
            coef[:, columns, 1] = rotation_vector / step
        else:
            rate, rate_change = rotation.tangent_motion(
                rotation_vector, samples.v[1:, columns], samples.acc[1:, columns]
            )
            zeros = np.zeros_like(rotation_vector)
            coef[:, columns] = polynomial.hermite(
                step,
                (zeros, samples.v[:-1, columns], samples.acc[:-1, columns]),
                (rotation_vector, rate, rate_change),
            )
        coef[~has_duration, columns] = 0.0
    return coef
