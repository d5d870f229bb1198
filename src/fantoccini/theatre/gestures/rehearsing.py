"""Rehearsals: a score is simulated repeatedly, and the hands learn from the limbs' errors.

    u_{k+1} = u_k + g S[a_0 e + a_1 de/dt + a_2 d^2e/dt^2],    e = x_hang - x_k

x_k is the position of a string's end under the hands' motion u_k, x_hang its hanging position under
the score's motion; S smooths. The a_i fit u = a_0 x + a_1 dx/dt + a_2 d^2x/dt^2 to the first run:
the equation of a pendulum on a string. (Iterative learning control: Arimoto, Kawamura and
Miyazaki, 1984.)

g is the learning gain. A limb is on time if its string end turns back at the mark, the named time
of its gesture. In names, D stands for dynamic coordinates, which move by the equations of motion,
and K for driven ones: ends and lengths of strings, driven joints. Breaks are the times at which the
pieces of a motion meet, and `coef` their coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from fantoccini.base import Array, SimulationError, StateError, Times, polynomial
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory, pieces
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.score import Score
from fantoccini.theatre.gestures.timekeeping import (
    AXIS_OF_COORDINATE,
    LimbLateness,
    hanging_poses,
    measure_lateness,
    point_paths,
    point_positions,
    tied_points,
)
from fantoccini.theatre.gestures.transitions import motion_bounds

_SAMPLE_INTERVAL = 0.02
"""Time between the samples of the learnt motion [s]."""
_EXTRA_LEARNING_TIME = 0.4
"""Time after the score's end in which hands still learn [s]."""
_SMOOTHING_TIME = 0.11
"""Standard deviation of the smoothing of errors [s]."""
_GAIN = 0.7
"""Gain g of the first round."""
_MIN_OFFSET = 1e-3
"""Least offset of a moved coordinate [m]."""
_MARGIN_TIME = 0.3
"""Time before and after its motion in which a coordinate learns, too [s]."""
_MIN_EXPLAINED_SHARE = 0.4
"""Least share of the variance that a useful fit explains."""
_MAX_FINAL_LATENESS = 0.012
"""Lateness at which rehearsals end [s]."""
_MAX_LEAD = 0.06
"""Largest lead of a target, and lateness below which a target is shifted [s]."""
_LEAD_GAIN = 0.4
"""Change of a target's lead in a round, relative to the lateness."""
_MAX_SHRINKS = 12
"""Number of reductions of a step to keep the bounds, before it is dropped."""
_SHRINK_SHARE = 0.5
"""Share by which a step is reduced where it exceeds a bound."""
_BOUND_TOLERANCE = 2e-3
"""Relative tolerance of bounds."""


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """Rehearsed score.

    Attributes:
        score: the score.
        inputs: learnt motion of the hands.
        run: event-driven run under this motion.
        initial_lateness: lateness of limbs in the score as written.
        final_lateness: lateness of limbs after the rehearsal.
        rounds: number of simulated rounds.
    """

    score: Score
    inputs: Input
    run: Trajectory
    initial_lateness: tuple[LimbLateness, ...]
    final_lateness: tuple[LimbLateness, ...]
    rounds: int

    def __repr__(self) -> str:
        worst_ms = [
            1e3 * max_lateness(limbs) for limbs in (self.initial_lateness, self.final_lateness)
        ]
        return (
            f"<Rehearsal of {self.score.name!r}: at most {worst_ms[1]:.0f} ms off the beat, "
            f"{worst_ms[0]:.0f} before>"
        )


def max_lateness(lateness: tuple[LimbLateness, ...]) -> float:
    """Largest lateness or earliness [s]; 0 if there is none."""
    return max((abs(limb.seconds) for limb in lateness), default=0.0)


@dataclass
class _Channel:
    """Learning channel: a driven coordinate, and the string's end and direction that it moves.

    Attributes:
        v, point, axis: indices of the coordinate, the end and the direction.
        weight: (T,) weight of learning, from 0 to 1.
        fit: (3,) a_0, a_1 and a_2.
        gain: g; halved after a round that was worse.
        best_offset: (T,) learnt offset in its best round [m].
        best_position: (T,) position of its end in that round [m].
    """

    v: int
    point: int
    axis: int
    weight: Array
    fit: Array = field(default_factory=lambda: np.zeros(3))
    gain: float = _GAIN
    best_offset: Array = field(default_factory=lambda: np.zeros(0))
    best_position: Array = field(default_factory=lambda: np.zeros(0))

    def learn(self, offset: Array, target: Array, positions: Array) -> None:
        """Stores the offset (T,) of a round if its error is the least so far.

        Args:
            offset: (T,) offset [m].
            target, positions: (T, n_points, 3) wanted and actual positions of the ends [m].
        """
        position = positions[:, self.point, self.axis]
        if not len(self.best_position) or self._error(target, position) < self._error(
            target, self.best_position
        ):
            self.best_offset, self.best_position = offset, position
        else:
            self.gain *= 0.5

    def correction(self, target_positions: Array) -> Array:
        """(T,) next change of the learnt offset [m]."""
        error = target_positions[:, self.point, self.axis] - self.best_position
        smooth_error = gaussian_filter1d(error, _SMOOTHING_TIME / _SAMPLE_INTERVAL, mode="nearest")
        return np.asarray(self.weight * (_with_rates(smooth_error) @ self.fit))

    def _error(self, target_positions: Array, position: Array) -> float:
        return float(
            np.sum(np.square(self.weight * (target_positions[:, self.point, self.axis] - position)))
        )


class _Target:
    """Wanted positions of the strings' ends: hanging positions, shifted in time near the marks.

    Args:
        hanging_positions: (T, n_points, 3) hanging positions [m].
        t: (T,) times [s].
        strings: names of the points' strings.
    """

    def __init__(self, hanging_positions: Array, t: Times, strings: list[str]):
        self._hanging_positions, self._t, self._strings = hanging_positions, t, strings
        self._leads: dict[str, dict[float, float]] = {}
        self.positions = hanging_positions

    def shift(self, lateness: tuple[LimbLateness, ...]) -> None:
        """Shifts the targets of limbs that are nearly in time, against their lateness."""
        for limb in lateness:
            if abs(limb.seconds) < _MAX_LEAD:
                leads = self._leads.setdefault(limb.string, {})
                mark_time = limb.cue.marks[limb.mark]
                lead = leads.get(mark_time, 0.0) + _LEAD_GAIN * limb.seconds
                leads[mark_time] = float(np.clip(lead, -_MAX_LEAD, _MAX_LEAD))
        positions = np.array(self._hanging_positions)
        for string, leads in self._leads.items():
            i, marks = self._strings.index(string), sorted(leads)
            knots = np.array([marks[0] - _MARGIN_TIME, *marks, marks[-1] + _MARGIN_TIME])
            values = np.array([0.0, *(leads[mark] for mark in marks), 0.0])
            shift: Array = np.interp(self._t, knots, values)
            shift = gaussian_filter1d(shift, 0.25 * _MARGIN_TIME / _SAMPLE_INTERVAL, mode="nearest")
            positions[:, i] = CubicSpline(self._t, self._hanging_positions[:, i])(
                np.clip(self._t + shift, self._t[0], self._t[-1])
            )
        self.positions = positions


def rehearse(score: Score, x0: State | None = None, rounds: int = 20) -> Rehearsal:
    """Rehearsal of a score, until its limbs are in time in the simulation.

    The hands lead by the lag of the limbs, and excite and brake swing, within the score's bounds.
    The best round is used; rehearsals end after a round with a lateness of at most 12 ms.

    Args:
        score: score of a puppet without contact, whose strings are driven.
        x0: state at the start; rest by default.
        rounds: largest number of rounds.

    Raises:
        StateError: the puppet has contact, cannot hang at rest along the score's motion, or the
            score moves no string that ends on a body.
        SimulationError: the score as written cannot be simulated.
    """
    marionette = score.marionette
    x0 = marionette.rest() if x0 is None else x0
    n = int(np.ceil((score.duration + _EXTRA_LEARNING_TIME) / _SAMPLE_INTERVAL))
    t = _SAMPLE_INTERVAL * np.arange(n + 1, dtype=float)
    hanging_positions = _hanging_positions(score, x0, t)
    channels = _channels(score, t)
    if not channels:
        raise StateError(f"the score {score.name} moves no string that ends on a body")
    learnt = np.zeros((len(t), marionette.coordinates.n_vK))
    run, positions = _simulate_learnt(score, x0, t, learnt)
    initial_lateness = measure_lateness(score, run)
    best = run, learnt, initial_lateness
    score_offsets = np.array([score.offsets(instant)[0] for instant in t])
    string_names = list(tied_points(marionette))
    late_points = {
        string_names.index(limb.string)
        for limb in initial_lateness
        if abs(limb.seconds) > _MAX_FINAL_LATENESS
    }
    channels = [
        channel
        for channel in channels
        if channel.point in late_points and _fit(channel, score_offsets[:, channel.v], positions)
    ]
    target = _Target(hanging_positions, t, string_names)
    for channel in channels:
        channel.learn(learnt[:, channel.v], target.positions, positions)
    n_rounds = 1
    while channels and n_rounds < rounds and max_lateness(best[2]) > _MAX_FINAL_LATENESS:
        trial = _next_offsets(channels, target.positions, score, t)
        try:
            run, positions = _simulate_learnt(score, x0, t, trial)
        except SimulationError:
            for channel in channels:
                channel.gain *= 0.5
            continue
        finally:
            n_rounds += 1
        for channel in channels:
            channel.learn(trial[:, channel.v], target.positions, positions)
        final_lateness = measure_lateness(score, run)
        target.shift(final_lateness)
        if _lateness_norm(final_lateness) < _lateness_norm(best[2]):
            best = run, trial, final_lateness
    run, learnt, final_lateness = best
    return Rehearsal(
        score, _learnt_inputs(score, x0, t, learnt), run, initial_lateness, final_lateness, n_rounds
    )


def _lateness_norm(lateness: tuple[LimbLateness, ...]) -> float:
    """Root of the sum of squared lateness [s]."""
    return float(np.sqrt(np.sum([limb.seconds**2 for limb in lateness])))


def _next_offsets(
    channels: list[_Channel], target_positions: Array, score: Score, t: Times
) -> Array:
    """(T, n_vK) learnt offsets after one more step, within bounds."""
    bounds = motion_bounds(score.gesture.coordinates, score.speed, score.acceleration)
    bounds = np.maximum(bounds, score.gesture.peaks) * (1.0 + _BOUND_TOLERANCE)
    trial: Array = np.zeros((len(t), bounds.shape[1]))
    for channel in channels:
        trial[:, channel.v] = channel.best_offset
    steps = np.zeros_like(trial)
    for channel in channels:
        steps[:, channel.v] = channel.gain * channel.correction(target_positions)
    for _ in range(_MAX_SHRINKS):
        gesture = _learnt_gesture(score, t, trial + steps)
        exceeds = np.any(gesture.peaks_of_pieces > bounds, axis=1)
        if not exceeds.any():
            return trial + steps
        piece_middles = 0.5 * (gesture.breaks[1:] + gesture.breaks[:-1])
        for v in np.flatnonzero(exceeds.any(axis=0)):
            distance = np.min(np.abs(t[:, None] - piece_middles[exceeds[:, v]]), axis=1)
            steps[:, v] *= 1.0 - _SHRINK_SHARE * np.exp(
                -0.5 * np.square(distance / _SMOOTHING_TIME)
            )
    steps[:, exceeds.any(axis=0)] = 0.0
    return trial + steps


def _hanging_positions(score: Score, x0: State, t: Times) -> Array:
    """(T, n_points, 3) positions of the strings' ends that hang under the score's motion [m]."""
    marionette, inputs = score.marionette, score.inputs(x0)
    coarse_times = np.append(t[:-1:2], t[-1])
    q_K = inputs.evaluate(np.minimum(x0.t + coarse_times, inputs.end))[0]
    poses = hanging_poses(marionette, q_K, x0, coarse_times)
    hanging_positions = point_positions(marionette, poses.q_D, poses.q_K, tied_points(marionette))
    return np.asarray(CubicSpline(coarse_times, hanging_positions)(t))


def _channels(score: Score, t: Times) -> list[_Channel]:
    """Channels of the coordinates that the score moves."""
    string_names = list(tied_points(score.marionette))
    channels = []
    offsets = np.array([score.offsets(instant)[0] for instant in t])
    fade = np.clip(np.minimum(t, t[-1] - t) / _MARGIN_TIME, 0.0, 1.0)
    for name, (_, v) in pieces.channel_names(score.marionette.coordinates).items():
        string, _, part = name.rpartition(".")
        if (
            string not in string_names
            or part not in AXIS_OF_COORDINATE
            or not score.gesture.named[v.start]
        ):
            continue
        is_moving = (np.abs(offsets[:, v.start]) > _MIN_OFFSET).astype(float)
        if not is_moving.any():
            continue
        smooth_mask: Array = gaussian_filter1d(
            is_moving, 0.5 * _MARGIN_TIME / _SAMPLE_INTERVAL, mode="nearest"
        )
        weight = np.clip(2.0 * smooth_mask, 0.0, 1.0) * fade * fade * (3.0 - 2.0 * fade)
        channels.append(
            _Channel(v.start, string_names.index(string), AXIS_OF_COORDINATE[part], weight)
        )
    return channels


def _fit(channel: _Channel, u: Array, positions: Array) -> bool:
    """Fits the motion of the hand by that of the string's end; False if the fit is poor."""
    x = positions[:, channel.point, channel.axis] - positions[0, channel.point, channel.axis]
    terms: Array = _with_rates(gaussian_filter1d(x, 0.03 / _SAMPLE_INTERVAL, mode="nearest"))
    if channel.axis == AXIS_OF_COORDINATE["length"]:
        terms[:, 1:] = 0.0  # the end follows a pull upwards at once
    is_learning = channel.weight > 0.0
    channel.fit = np.asarray(
        np.linalg.lstsq(terms[is_learning], u[is_learning], rcond=None)[0], dtype=float
    )
    residual = float(np.var(u[is_learning] - terms[is_learning] @ channel.fit))
    return residual <= (1.0 - _MIN_EXPLAINED_SHARE) * float(np.var(u[is_learning]))


def _with_rates(x: Array) -> Array:
    """(T, 3) values, first and second derivatives of samples."""
    rate = np.gradient(x, _SAMPLE_INTERVAL)
    return np.stack([x, rate, np.gradient(rate, _SAMPLE_INTERVAL)], axis=-1)


def _learnt_gesture(score: Score, t: Times, learnt: Array) -> Gesture:
    """Gesture of the score with the learnt offsets."""
    rate: Array = np.gradient(learnt, _SAMPLE_INTERVAL, axis=0)
    change: Array = np.gradient(rate, _SAMPLE_INTERVAL, axis=0)
    rate[[0, -1]] = change[[0, -1]] = 0.0
    end_values = [(x[:-1], x[1:]) for x in (learnt, rate, change)]
    coef = polynomial.hermite(
        np.diff(t)[:, None],
        (end_values[0][0], end_values[1][0], end_values[2][0]),
        (end_values[0][1], end_values[1][1], end_values[2][1]),
    )
    table, named = score.gesture.coordinates, np.any(learnt != 0.0, axis=0)
    return score.gesture + Gesture(table, t, coef, named, np.zeros(table.n_vK))


def _learnt_inputs(score: Score, x0: State, t: Times, learnt: Array) -> Input:
    """Input of the score with the learnt offsets."""
    gesture = _learnt_gesture(score, t, learnt)
    inputs = gesture.inputs(x0, speed=score.speed, acceleration=score.acceleration)
    return inputs.with_name(score.name)


def _simulate_learnt(score: Score, x0: State, t: Times, learnt: Array) -> tuple[Trajectory, Array]:
    """Event-driven run, and (T, n_points, 3) positions of the strings' ends."""
    marionette = score.marionette
    run = simulate(marionette, x0, _learnt_inputs(score, x0, t, learnt), x0.t + float(t[-1]))
    return run, point_paths(marionette, run, tied_points(marionette), x0.t + t)
