"""Rehearsals: a score is played again and again, and the hands learn from where the limbs were.

    u_{k+1} = u_k + g S[a_0 e + a_1 de/dt + a_2 d^2e/dt^2],    e = x_hung - x_k

x_k is where the end of a string was under the hands' motion u_k, x_hung where it would hang under
the score's; S smooths. The a_i are those with which u = a_0 x + a_1 dx/dt + a_2 d^2x/dt^2 fits the
first run best: what a pendulum on a string does. (Iterative learning control: Arimoto, Kawamura
and Miyazaki, 1984.)
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
    AXES,
    Late,
    hanging,
    lateness,
    paths,
    places,
    ties,
)
from fantoccini.theatre.gestures.transitions import limits

_STEP = 0.02
"""Time between the times at which hands learn [s]."""
_SETTLES = 0.4
"""Time after the score's end in which they still do [s]."""
_SMOOTHS = 0.11
"""Standard deviation of the smoothing of errors [s]."""
_GAIN = 0.7
_MOVES = 1e-3
"""Offset from which on a coordinate counts as moved [m]."""
_AROUND = 0.3
"""Time before and after that in which its hand learns as well [s]."""
_FITS = 0.4
"""Share of the variance that a fit explains at least."""
_ENOUGH = 0.012
"""Lateness at which rehearsals end [s]."""
_NEARLY = 0.06
"""Lateness from which on it is the mark that is aimed at, and most by which aims lead [s]."""
_LEADS = 0.4
"""Share of a lateness by which an aim leads more after a round."""
_SHRINKS = 12
"""Largest number of times that a step that passes a bound is made smaller."""
_SHRINK = 0.5
"""Factor of a step that is made smaller."""
_ROUNDING = 2e-3
"""Share of a bound by which a peak may pass it."""


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """A score that has been rehearsed.

    Attributes:
        score: what is played.
        inputs: the motion of the hands.
        run: event-driven, under it.
        before: how late limbs are when it is played as written.
        late: how late they are now.
        rounds: how often it was played.
    """

    score: Score
    inputs: Input
    run: Trajectory
    before: tuple[Late, ...]
    late: tuple[Late, ...]
    rounds: int

    def __repr__(self) -> str:
        worst = [1e3 * worst_of(one) for one in (self.before, self.late)]
        return (
            f"<Rehearsal of {self.score.name!r}: at most {worst[1]:.0f} ms off the beat, "
            f"{worst[0]:.0f} before>"
        )


def worst_of(late: tuple[Late, ...]) -> float:
    """The largest lateness, early ones included [s]; 0 where there is none."""
    return max((abs(one.seconds) for one in late), default=0.0)


@dataclass
class _Hand:
    """A learning channel: a driven coordinate, and the string's end and direction that it moves.

    Attributes:
        v, point, axis: their places.
        where: (T,) from 0 to 1, when it learns.
        fit: (3,) a_0, a_1 and a_2.
        gain: g; halved after a round that was worse.
        learnt: (T,) what it added to its motion in its best round [m].
        moved: (T,) where its end was then [m].
    """

    v: int
    point: int
    axis: int
    where: Array
    fit: Array = field(default_factory=lambda: np.zeros(3))
    gain: float = _GAIN
    learnt: Array = field(default_factory=lambda: np.zeros(0))
    moved: Array = field(default_factory=lambda: np.zeros(0))

    def learn(self, learnt: Array, aim: Array, moved: Array) -> None:
        """Keeps a round's motion (T,) where its error is the least so far."""
        now = moved[:, self.point, self.axis]
        if not len(self.moved) or self._error(aim, now) < self._error(aim, self.moved):
            self.learnt, self.moved = learnt, now
        else:
            self.gain *= 0.5

    def correction(self, aim: Array) -> Array:
        """(T,) what it is to add to its motion [m]."""
        gap = aim[:, self.point, self.axis] - self.moved
        smooth = gaussian_filter1d(gap, _SMOOTHS / _STEP, mode="nearest")
        return np.asarray(self.where * (_with_rates(smooth) @ self.fit))

    def _error(self, aim: Array, moved: Array) -> float:
        return float(np.sum(np.square(self.where * (aim[:, self.point, self.axis] - moved))))


class _Aim:
    """Where the strings' ends are to be: where they would hang, at times that turn on the marks.

    Args:
        hung: (T, n_points, 3) where they would hang [m].
        t: (T,) times [s].
        strings: names of the points' strings.
    """

    def __init__(self, hung: Array, t: Times, strings: list[str]):
        self._hung, self._t, self._strings = hung, t, strings
        self._leads: dict[str, dict[float, float]] = {}
        self.places = hung

    def lead(self, late: tuple[Late, ...]) -> None:
        """Takes limbs that are nearly in time nearer to their marks."""
        for one in late:
            if abs(one.seconds) < _NEARLY:
                leads = self._leads.setdefault(one.string, {})
                at = one.cue.marks[one.mark]
                lead = leads.get(at, 0.0) + _LEADS * one.seconds
                leads[at] = float(np.clip(lead, -_NEARLY, _NEARLY))
        places = np.array(self._hung)
        for string, own in self._leads.items():
            i, marks = self._strings.index(string), sorted(own)
            knots = np.array([marks[0] - _AROUND, *marks, marks[-1] + _AROUND])
            values = np.array([0.0, *(own[mark] for mark in marks), 0.0])
            by: Array = np.interp(self._t, knots, values)
            by = gaussian_filter1d(by, 0.25 * _AROUND / _STEP, mode="nearest")
            places[:, i] = CubicSpline(self._t, self._hung[:, i])(
                np.clip(self._t + by, self._t[0], self._t[-1])
            )
        self.places = places


def rehearse(score: Score, x0: State | None = None, rounds: int = 20) -> Rehearsal:
    """Plays a score again and again until the limbs are on its beats in the simulation.

    Hands lead by as much as limbs lag, set them swinging and brake them, within the score's bounds.
    The round nearest to the beats is kept; after one within 12 ms it ends.

    Args:
        score: of a puppet without contact, whose strings are driven.
        x0: where it hangs; at rest when not given.
        rounds: at most.

    Raises:
        StateError: the puppet has contact, cannot hang where the score takes it, or no string
            that the score moves ends on a body.
        SimulationError: the score as written cannot be simulated.
    """
    marionette = score.marionette
    x0 = marionette.rest() if x0 is None else x0
    n = int(np.ceil((score.duration + _SETTLES) / _STEP))
    t = _STEP * np.arange(n + 1, dtype=float)
    hung = _hung(score, x0, t)
    hands = _hands(score, t)
    if not hands:
        raise StateError(f"the score {score.name} moves no string that ends on a body")
    learnt = np.zeros((len(t), marionette.coordinates.n_vK))
    run, moved = _played(score, x0, t, learnt)
    before = lateness(score, run)
    best = run, learnt, before
    d = np.array([score.offsets(one)[0] for one in t])
    strings = list(ties(marionette))
    late = {strings.index(one.string) for one in before if abs(one.seconds) > _ENOUGH}
    hands = [one for one in hands if one.point in late and _fitted(one, d[:, one.v], moved)]
    aim = _Aim(hung, t, strings)
    for hand in hands:
        hand.learn(learnt[:, hand.v], aim.places, moved)
    played = 1
    while hands and played < rounds and worst_of(best[2]) > _ENOUGH:
        trial = _step(hands, aim.places, score, t)
        try:
            run, moved = _played(score, x0, t, trial)
        except SimulationError:
            for hand in hands:
                hand.gain *= 0.5
            continue
        finally:
            played += 1
        for hand in hands:
            hand.learn(trial[:, hand.v], aim.places, moved)
        after = lateness(score, run)
        aim.lead(after)
        if _size(after) < _size(best[2]):
            best = run, trial, after
    run, learnt, after = best
    return Rehearsal(score, _inputs(score, x0, t, learnt), run, before, after, played)


def _size(late: tuple[Late, ...]) -> float:
    """Root of the sum of squares [s]."""
    return float(np.sqrt(np.sum([one.seconds**2 for one in late])))


def _step(hands: list[_Hand], aim: Array, score: Score, t: Times) -> Array:
    """(T, n_vK) what the hands have learnt after one more round, within bounds."""
    most = limits(score.gesture.coordinates, score.speed, score.acceleration)
    most = np.maximum(most, score.gesture.peaks) * (1.0 + _ROUNDING)
    trial: Array = np.zeros((len(t), most.shape[1]))
    for hand in hands:
        trial[:, hand.v] = hand.learnt
    steps = np.zeros_like(trial)
    for hand in hands:
        steps[:, hand.v] = hand.gain * hand.correction(aim)
    for _ in range(_SHRINKS):
        whole = _whole(score, t, trial + steps)
        beyond = np.any(whole.peaks_of_pieces > most, axis=1)
        if not beyond.any():
            return trial + steps
        middle = 0.5 * (whole.breaks[1:] + whole.breaks[:-1])
        for v in np.flatnonzero(beyond.any(axis=0)):
            away = np.min(np.abs(t[:, None] - middle[beyond[:, v]]), axis=1)
            steps[:, v] *= 1.0 - _SHRINK * np.exp(-0.5 * np.square(away / _SMOOTHS))
    steps[:, beyond.any(axis=0)] = 0.0
    return trial + steps


def _hung(score: Score, x0: State, t: Times) -> Array:
    """(T, n_points, 3) places of the strings' ends where the puppet hangs under the score [m]."""
    marionette, inputs = score.marionette, score.inputs(x0)
    coarse = np.append(t[:-1:2], t[-1])
    q_K = inputs.evaluate(np.minimum(x0.t + coarse, inputs.end))[0]
    found = hanging(marionette, q_K, x0, coarse)
    hung = places(marionette, found.q_D, found.q_K, ties(marionette))
    return np.asarray(CubicSpline(coarse, hung)(t))


def _hands(score: Score, t: Times) -> list[_Hand]:
    """The coordinates that the score moves, and when."""
    tied = list(ties(score.marionette))
    found = []
    d = np.array([score.offsets(one)[0] for one in t])
    ends = np.clip(np.minimum(t, t[-1] - t) / _AROUND, 0.0, 1.0)
    for name, (_, v) in pieces.channel_names(score.marionette.coordinates).items():
        string, _, part = name.rpartition(".")
        if string not in tied or part not in AXES or not score.gesture.named[v.start]:
            continue
        moves = (np.abs(d[:, v.start]) > _MOVES).astype(float)
        if not moves.any():
            continue
        spread: Array = gaussian_filter1d(moves, 0.5 * _AROUND / _STEP, mode="nearest")
        where = np.clip(2.0 * spread, 0.0, 1.0) * ends * ends * (3.0 - 2.0 * ends)
        found.append(_Hand(v.start, tied.index(string), AXES[part], where))
    return found


def _fitted(hand: _Hand, u: Array, moved: Array) -> bool:
    """Fits what the string's end does under its hand; False where that explains too little."""
    x = moved[:, hand.point, hand.axis] - moved[0, hand.point, hand.axis]
    terms: Array = _with_rates(gaussian_filter1d(x, 0.03 / _STEP, mode="nearest"))
    if hand.axis == AXES["length"]:
        terms[:, 1:] = 0.0  # it is pulled up at once
    now = hand.where > 0.0
    hand.fit = np.asarray(np.linalg.lstsq(terms[now], u[now], rcond=None)[0], dtype=float)
    left = float(np.var(u[now] - terms[now] @ hand.fit))
    return left <= (1.0 - _FITS) * float(np.var(u[now]))


def _with_rates(x: Array) -> Array:
    """(T, 3) values, first and second derivatives of samples."""
    rate = np.gradient(x, _STEP)
    return np.stack([x, rate, np.gradient(rate, _STEP)], axis=-1)


def _whole(score: Score, t: Times, learnt: Array) -> Gesture:
    """The score's motion with what the hands have learnt."""
    rate: Array = np.gradient(learnt, _STEP, axis=0)
    change: Array = np.gradient(rate, _STEP, axis=0)
    rate[[0, -1]] = change[[0, -1]] = 0.0
    parts = [(x[:-1], x[1:]) for x in (learnt, rate, change)]
    coef = polynomial.hermite(
        np.diff(t)[:, None],
        (parts[0][0], parts[1][0], parts[2][0]),
        (parts[0][1], parts[1][1], parts[2][1]),
    )
    table, named = score.gesture.coordinates, np.any(learnt != 0.0, axis=0)
    return score.gesture + Gesture(table, t, coef, named, np.zeros(table.n_vK))


def _inputs(score: Score, x0: State, t: Times, learnt: Array) -> Input:
    whole = _whole(score, t, learnt)
    made = whole.inputs(x0, speed=score.speed, acceleration=score.acceleration)
    return made.called(score.name)


def _played(score: Score, x0: State, t: Times, learnt: Array) -> tuple[Trajectory, Array]:
    """The event-driven run, and (T, n_points, 3) where the strings' ends are."""
    marionette = score.marionette
    run = simulate(marionette, x0, _inputs(score, x0, t, learnt), x0.t + float(t[-1]))
    return run, paths(marionette, run, ties(marionette), x0.t + t)
