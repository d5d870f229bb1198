"""Contact modes of an event-driven run, step by step, and changes of mode without an impact.

A run's samples end its steps. If only some points of two parts change their modes, there is no
second sample at that time; so the modes of each step are derived from the points at its end.

A contact point is open, sticks or slides: its mode. q_D are the dynamic and q_K the driven
coordinates; acc_K are the driven accelerations. A twist is a velocity of a link, linear and
angular; a screw is the twist per unit of one joint velocity.
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

MAX_POINT_DISTANCE = 1e-7
"""Largest distance of a run's point from the narrow phase's at the same state [m]."""
TIME_AGREEMENT = 1e-5
"""Largest relative difference of changes of event times that count as equal."""
MAX_SMOOTH_CHANGE = 1e-7
"""Largest change of accelerations that is no jump, relative to max(1, |acc|)."""

ModesKey = frozenset[tuple[int, int, ContactMode]]


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
        ranges: list[tuple[int, int, tuple[PointMode, ...]]] = []
        is_separate = False
        for i in range(first, last):
            modes, is_transition = self._modes(i)
            if (
                ranges
                and not is_separate
                and not is_transition
                and modes_key(ranges[-1][2]) == modes_key(modes)
            ):
                ranges[-1] = (ranges[-1][0], i + 1, ranges[-1][2])
            else:
                ranges.append((i, i + 1, modes))
            is_separate = is_transition
        return ranges

    def touches(self, i: int) -> bool:
        """Whether any contact point pushes at a sample."""
        return self._marionette.contacts is not None and bool(self._points(i))

    def is_stopping(self, i: int, modes: Sequence[PointMode]) -> bool:
        """Whether a point that slides in ``modes`` is at rest at a sample."""
        sliding = [p for p in modes if p.mode is ContactMode.SLIDE and p.friction > 0.0]
        if not sliding:
            return False
        points, rest_speed = self._points(i), self._rest_speed(i)
        sampled = [points.get((p.pair, p.feature)) for p in sliding]
        return any(point is not None and point.speed <= rest_speed for point in sampled)

    def _rest_speed(self, i: int) -> float:
        """Speed that counts as zero at a sample [m/s]."""
        return TOLERANCES.speed * max(1.0, float(np.max(np.abs(self._run.v_D[i]), initial=0.0)))

    def _modes(self, i: int) -> tuple[tuple[PointMode, ...], bool]:
        """Modes of the step from sample i to the next; whether sliding begins or ends in it."""
        before, after = self._points(i), self._points(i + 1)
        rest_speed = self._rest_speed(i)
        modes, is_transition = [], False
        for (pair, feature), point in after.items():
            previous = before.get((pair, feature))
            begins_sliding = previous is None or previous.speed <= rest_speed
            ends_sliding = point.speed <= rest_speed
            mode, along, turns = ContactMode.STICK, np.zeros(3), False
            if point.mu == 0.0:
                mode = ContactMode.SLIDE
            elif not (begins_sliding and ends_sliding):
                mode, turns = ContactMode.SLIDE, True
                is_transition = is_transition or begins_sliding or ends_sliding
                along = -point.friction if ends_sliding or previous is None else -previous.friction
            modes.append(PointMode(point.name, pair, feature, mode, point.mu, along, turns))
        return tuple(modes), is_transition

    def _points(self, i: int) -> dict[tuple[int, int], _SampledPoint]:
        """Points that push at a sample: (pair, feature) -> point."""
        if i in self._by_sample:
            return self._by_sample[i]
        run, contacts = self._run, self._marionette.contacts
        assert run.contact is not None and contacts is not None
        loaded = run.contact.at_sample(i)
        screws = Screws(self._marionette, run.state(i)) if len(loaded) else None
        out: dict[tuple[int, int], _SampledPoint] = {}
        for k in range(len(loaded)):
            assert screws is not None
            pair_index, name = int(loaded.pair[k]), pair_name(contacts.names[loaded.pair[k]])
            pair = PairGeometry(self._marionette, screws.poses, pair_index)
            feature = pair.nearest(loaded.point[k], MAX_POINT_DISTANCE)
            if feature is None:
                raise StateError(f"{name} touch at t = {run.t[i]:.6g} s away from all solids")
            n, u, f = loaded.normal[k], loaded.velocity[k], loaded.force[k]
            across, friction = u - n * (n @ u), f - n * (n @ f)
            friction_force = float(np.linalg.norm(friction))
            out[pair_index, feature] = _SampledPoint(
                name,
                float(np.linalg.norm(across)),
                across,
                friction / (friction_force or 1.0),
                float(contacts.friction[pair_index]),
            )
        self._by_sample[i] = out
        return out


def modes_key(modes: Sequence[PointMode]) -> ModesKey:
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
    def between_modes(
        cls,
        marionette: Marionette,
        x: State,
        acc_K: Array,
        u_D: Array,
        before: tuple[Indices, Sequence[PointMode]],
        after: tuple[Indices, Sequence[PointMode]],
        changes: Array,
    ) -> Change | None:
        """The change at a state; None if accelerations do not jump.

        Args:
            marionette: the puppet.
            x: the state.
            acc_K, u_D: driven accelerations and user forces.
            before, after: held rows and points.
            changes: (n_columns, m) changes of q_D, v_D, q_K, v_K, acc_K, u_D and p.
        """
        evaluation = Evaluation.at_state(marionette, x, acc_K, u_D)
        acc, _, points = FrozenModes(marionette, before[1]).accelerations_and_forces(
            evaluation, x, acc_K, before[0]
        )
        acc_after, _, _ = FrozenModes(marionette, after[1]).accelerations_and_forces(
            evaluation, x, acc_K, after[0]
        )
        acc_scale = max(1.0, float(np.max(np.abs(acc))), float(np.max(np.abs(acc_after))))
        if np.max(np.abs(acc - acc_after)) <= MAX_SMOOTH_CHANGE * acc_scale:
            return None
        screws = Screws(marionette, x, acc, acc_K)
        time_changes, names = [], []
        for point in points:
            if point.mode is ContactMode.SLIDE and point.friction > 0.0 and not point.turns:
                speed, speed_rate_by = _speed_rate(screws, point)
                if speed < 0.0:
                    time_changes.append(-(speed_rate_by @ changes)[None] / speed)
                    names.append(point.name)
        if not time_changes:
            return cls((), np.zeros((1, changes.shape[1])), acc - acc_after, False)
        spread = max(
            float(np.max(np.abs(time_change - time_changes[0]), initial=0.0))
            for time_change in time_changes
        )
        differentiable = spread <= TIME_AGREEMENT * float(
            np.max(np.abs(time_changes[0]), initial=1e-9)
        )
        return cls(tuple(dict.fromkeys(names)), time_changes[0], acc - acc_after, differentiable)


def _speed_rate(screws: Screws, point: HeldPoint) -> tuple[float, Array]:
    """Rate of the speed of a sliding point, and changes of this rate (n_columns,)."""
    rows = ContactRows(screws, [replace(point, mode=ContactMode.STICK, closing_rate=0.0)], 0.0)
    along_components = replace(point, mode=ContactMode.STICK).directions @ point.along
    along_components[0] = 0.0
    return -float(along_components @ rows.accelerations()), -along_components @ rows.velocity_by()


def state_and_input_changes(Z: Array, input_change: InputVariation) -> Array:
    """Changes (n_columns, m) of q_D, v_D, q_K, v_K, acc_K, u_D and p in one array."""
    b = input_change
    return np.concatenate([Z, b.q_K, b.v_K, b.acc_K, b.u_D, b.p])
