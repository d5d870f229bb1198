"""Contact modes of an event-driven run, step by step, and changes of mode without an impact.

A run's samples end its steps. If only some points of two parts change their modes, there is no
second sample at that time; so the modes of each step are derived from the points at its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, StateError
from fantoccini.dynamics.compiled import Evaluation, PairGeometry, Screws
from fantoccini.dynamics.derivatives import (
    TOLERANCES,
    ContactMode,
    ContactRows,
    FrozenModes,
    HeldPoint,
    PointMode,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.input_piece import InputVariation
from fantoccini.motion import State, Trajectory, pair_name

SAME_PLACE = 1e-7
"""Largest distance of a run's point from the narrow phase's at the same state [m]."""
TIME_AGREEMENT = 1e-5
"""Largest relative difference of changes of event times that count as equal."""
MAX_SMOOTH_CHANGE = 1e-7
"""Largest change of accelerations that is no jump, relative to max(1, |acc|)."""

Key = frozenset[tuple[int, int, ContactMode]]


@dataclass(frozen=True, eq=False)
class _SampledPoint:
    """A point at a sample: its velocity across the normal and the direction of its friction."""

    name: str
    speed: float
    across: Array
    friction: Array
    mu: float


class ContactPieces:
    """Contact modes along a run.

    Args:
        marionette: the puppet.
        run: event-driven run of the puppet, with all samples.
    """

    def __init__(self, marionette: Marionette, run: Trajectory):
        self._marionette, self._run = marionette, run
        self._by_sample: dict[int, dict[tuple[int, int], _SampledPoint]] = {}

    def mode_ranges(self, first: int, last: int) -> list[tuple[int, int, tuple[PointMode, ...]]]:
        """Ranges of samples with equal modes, from first to last: (first, last, modes).

        A step in which a point begins or stops sliding is a range of its own: its direction is
        that of its friction while at rest.
        """
        if self._marionette.contacts is None:
            return [(first, last, ())]
        out: list[tuple[int, int, tuple[PointMode, ...]]] = []
        is_separate = False
        for i in range(first, last):
            modes, is_transition = self._modes(i)
            if (
                out
                and not is_separate
                and not is_transition
                and modes_key(out[-1][2]) == modes_key(modes)
            ):
                out[-1] = (out[-1][0], i + 1, out[-1][2])
            else:
                out.append((i, i + 1, modes))
            is_separate = is_transition
        return out

    def touches(self, i: int) -> bool:
        """Whether any contact point pushes at a sample."""
        return self._marionette.contacts is not None and bool(self._points(i))

    def is_stopping(self, i: int, modes: Sequence[PointMode]) -> bool:
        """Whether a point that slides in ``modes`` is at rest at a sample."""
        sliding = [p for p in modes if p.mode is ContactMode.SLIDE and p.friction > 0.0]
        if not sliding:
            return False
        seen, rest_speed = self._points(i), self._rest_speed(i)
        at = [seen.get((p.pair, p.feature)) for p in sliding]
        return any(own is not None and own.speed <= rest_speed for own in at)

    def _rest_speed(self, i: int) -> float:
        """Speed that counts as zero at a sample [m/s]."""
        return TOLERANCES.speed * max(1.0, float(np.max(np.abs(self._run.v_D[i]), initial=0.0)))

    def _modes(self, i: int) -> tuple[tuple[PointMode, ...], bool]:
        """Modes of the step from sample i to the next; whether sliding begins or ends in it."""
        before, after = self._points(i), self._points(i + 1)
        rest_speed = self._rest_speed(i)
        modes, is_transition = [], False
        for (pair, feature), own in after.items():
            old = before.get((pair, feature))
            begins = old is None or old.speed <= rest_speed
            ends = own.speed <= rest_speed
            mode, along, turns = ContactMode.STICK, np.zeros(3), False
            if own.mu == 0.0:
                mode = ContactMode.SLIDE
            elif not (begins and ends):
                mode, turns = ContactMode.SLIDE, True
                is_transition = is_transition or begins or ends
                along = -own.friction if ends or old is None else -old.friction
            modes.append(PointMode(own.name, pair, feature, mode, own.mu, along, turns))
        return tuple(modes), is_transition

    def _points(self, i: int) -> dict[tuple[int, int], _SampledPoint]:
        """Points that push at a sample: (pair, feature) -> point."""
        if i in self._by_sample:
            return self._by_sample[i]
        run, contacts = self._run, self._marionette.contacts
        assert run.contact is not None and contacts is not None
        pushing = run.contact.at_sample(i)
        screws = Screws(self._marionette, run.state(i)) if len(pushing) else None
        out: dict[tuple[int, int], _SampledPoint] = {}
        for k in range(len(pushing)):
            assert screws is not None
            number, name = int(pushing.pair[k]), pair_name(contacts.names[pushing.pair[k]])
            pair = PairGeometry(self._marionette, screws.poses, number)
            feature = pair.nearest(pushing.point[k], SAME_PLACE)
            if feature is None:
                raise StateError(f"{name} touch at t = {run.t[i]:.6g} s away from all solids")
            n, u, f = pushing.normal[k], pushing.velocity[k], pushing.force[k]
            across, friction = u - n * (n @ u), f - n * (n @ f)
            size = float(np.linalg.norm(friction))
            out[number, feature] = _SampledPoint(
                name,
                float(np.linalg.norm(across)),
                across,
                friction / (size or 1.0),
                float(contacts.friction[number]),
            )
        self._by_sample[i] = out
        return out


def modes_key(modes: Sequence[PointMode]) -> Key:
    """Key that is equal for equal modes."""
    return frozenset((point.pair, point.feature, point.mode) for point in modes)


@dataclass(frozen=True, eq=False)
class Change:
    """A change of modes at which velocities do not jump.

    If a point stops, accelerations may jump: with its speed s falling to 0 at sdot < 0,

        dv+ = dv- + (acc- - acc+) (-ds / sdot)

    Attributes:
        names: names of the points that stop.
        time_change: (1, m) change of the time of the stop [s].
        jump: (n_vD,) difference acc- - acc+.
        differentiable: whether they stop together for nearby motions, too.
    """

    names: tuple[str, ...]
    time_change: Array
    jump: Array
    differentiable: bool

    @classmethod
    def of(
        cls,
        marionette: Marionette,
        x: State,
        acc_K: Array,
        u_D: Array,
        before: tuple[Indices, Sequence[PointMode]],
        after: tuple[Indices, Sequence[PointMode]],
        D: Array,
    ) -> Change | None:
        """The change at a state; None if accelerations do not jump.

        Args:
            marionette: the puppet.
            x: the state.
            acc_K, u_D: driven accelerations and user forces.
            before, after: held rows and points.
            D: (n_columns, m) changes of q_D, v_D, q_K, v_K, acc_K, u_D and p.
        """
        at = Evaluation.of(marionette, x, acc_K, u_D)
        acc, _, points = FrozenModes(marionette, before[1]).moving(at, x, acc_K, before[0])
        new, _, _ = FrozenModes(marionette, after[1]).moving(at, x, acc_K, after[0])
        size = max(1.0, float(np.max(np.abs(acc))), float(np.max(np.abs(new))))
        if np.max(np.abs(acc - new)) <= MAX_SMOOTH_CHANGE * size:
            return None
        screws = Screws(marionette, x, acc, acc_K)
        time_changes, names = [], []
        for point in points:
            if point.mode is ContactMode.SLIDE and point.friction > 0.0 and not point.turns:
                speed, by = _slowing(screws, point)
                if speed < 0.0:
                    time_changes.append(-(by @ D)[None] / speed)
                    names.append(point.name)
        if not time_changes:
            return cls((), np.zeros((1, D.shape[1])), acc - new, False)
        spread = max(
            float(np.max(np.abs(time_change - time_changes[0]), initial=0.0))
            for time_change in time_changes
        )
        differentiable = spread <= TIME_AGREEMENT * float(
            np.max(np.abs(time_changes[0]), initial=1e-9)
        )
        return cls(tuple(dict.fromkeys(names)), time_changes[0], acc - new, differentiable)


def _slowing(screws: Screws, point: HeldPoint) -> tuple[float, Array]:
    """Rate of the speed of a sliding point, and changes of this rate (n_columns,)."""
    rows = ContactRows(screws, [replace(point, mode=ContactMode.STICK, closes=0.0)], 0.0)
    parts = replace(point, mode=ContactMode.STICK).directions @ point.along
    parts[0] = 0.0
    return -float(parts @ rows.accelerations()), -parts @ rows.velocity_by()


def stacked(Z: Array, input_change: InputVariation) -> Array:
    """Changes (n_columns, m) of q_D, v_D, q_K, v_K, acc_K, u_D and p in one array."""
    b = input_change
    return np.concatenate([Z, b.q_K, b.v_K, b.acc_K, b.u_D, b.p])
