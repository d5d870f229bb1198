"""Swing of hands below the upper ends of their strings, and the feed-forward that cancels it.

K. Yamane, J. K. Hodgins and H. B. Brown, "Controlling a marionette with human motion capture
data", ICRA 2003, sec. 6: a hand at y is a pendulum below the upper end at x, along each horizontal
axis on its own,

    d2y/dt2 = (g/L) (x - y) + d (dx/dt - dy/dt),   y = (b s + 1)/(a s^2 + b s + 1) x

with a = L/g and b = d L/g, or a and b fitted to steps at three heights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base.arrays import Array
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State
from fantoccini.theatre.retarget.figure import Figure
from fantoccini.theatre.retarget.mapping import SIDES
from fantoccini.theatre.retarget.retargeting import TiedString, part_positions, tied_strings

_STEP, _RISE, _LONG = 0.02, 0.1, 3.0
"""Size of a step [m], its duration and that of the observation [s]."""
_DT = 1e-3
"""Time step of identification [s]."""


@dataclass(frozen=True, eq=False)
class Swing:
    """Swing of hands, by driven coordinate of an upper end.

    Attributes:
        lengths: (n,) lengths of the hand's string, increasing [m].
        a: coordinate -> (n,) [s^2].
        b: coordinate -> (n,) [s].
        gain: coordinate -> (n,) static gain from its upper end to the hand. The feed-forward
            assumes 1, as in the paper.
    """

    lengths: Array
    a: Mapping[str, Array]
    b: Mapping[str, Array]
    gain: Mapping[str, Array]

    def lead(self, name: str, y: Array, length: Array, dt: float) -> Array:
        """(T,) path of the upper end for a hand that moves along y; see :func:`lead`.

        The sum of the filters' outputs for each length, with weights by the present length.

        Args:
            name: name of the coordinate.
            y: (T,) path of the hand along its axis [m].
            length: (T,) length of the string [m].
            dt: time step [s].
        """
        led = np.zeros_like(y)
        for i, weights in enumerate(np.eye(len(self.lengths))):
            share = np.interp(length, self.lengths, weights)
            led += share * lead(y, dt, self.a[name][i], self.b[name][i])
        return led


def lead(y: Array, dt: float, a: Array | float, b: float = 0.0) -> Array:
    """u = y + a w with b dw/dt + w = d2y/dt2: K(s) = (a s^2 + b s + 1)/(b s + 1).

    This is the inverse of the pendulum itself. It looks ahead by a time step; the paper's filter,
    for live use, has a lag of 1/(0.2 s + 1)^3 in addition.

    Args:
        y: (T,) path, at rest at both ends [m].
        dt: time step [s].
        a: [s^2], a number or (T,).
        b: [s].
    """
    before, after = np.concatenate([y[:1], y[:-1]]), np.concatenate([y[1:], y[-1:]])
    w = (before - 2.0 * y + after) / dt**2
    if b > 0.0:
        decay, last = np.exp(-dt / b), 0.0
        for i, value in enumerate(w):
            last = w[i] = decay * last + (1.0 - decay) * value
    return np.asarray(y + a * w)


def hand_strings(figure: Figure, start: State) -> list[TiedString]:
    """Strings from forearms to upper ends that move."""
    arms = [f"forearm_{side}" for side in SIDES]
    return [h for h in tied_strings(figure, start) if h.part in arms and h.ends and h.length]


def identify_swing(
    marionette: Marionette, figure: Figure, start: State, lengths: Sequence[float] = (0.7, 0.8, 0.9)
) -> Swing:
    """a and b of each hand along each axis, fitted to a step of its upper end in the simulator.

    Args:
        marionette: the puppet.
        figure: the puppet as a person.
        start: its hanging state.
        lengths: lengths of the hand's string, increasing [m].
    """
    fits: dict[str, list[Array]] = {}
    for string in hand_strings(figure, start):
        q = marionette.coordinates.q_K.index(string.length)
        for length in lengths:
            q_K = start.q_K.copy()
            q_K[q] = length
            x0 = marionette.rest(start.replace(q_K=q_K))
            for name, axis in string.ends.items():
                fits.setdefault(name, []).append(_fit(marionette, figure, x0, string, name, axis))
    rows = {name: np.stack(values, axis=1) for name, values in fits.items()}
    gain, a, b = ({name: row[i] for name, row in rows.items()} for i in range(3))
    return Swing(np.array(lengths), a, b, gain)


def _fit(
    marionette: Marionette, figure: Figure, x0: State, string: TiedString, name: str, axis: Array
) -> Array:
    """(3,) gain, a and b, from the mean of steps in both directions."""
    from scipy.optimize import least_squares  # slow to import
    from scipy.signal import lsim

    column = marionette.coordinates.q_K.index(name)
    q0, ways = float(x0.q_K[column]), []
    for size in (_STEP, -_STEP):
        move = Input.waypoints(marionette, {name: [(x0.t, q0), (x0.t + _RISE, q0 + size)]})
        run = simulate(
            marionette,
            x0,
            move,
            x0.t + _LONG,
            method=TimeStepping(dt=_DT),
            save_every=5,
            effort=False,
        )
        places = part_positions(figure, marionette.poses(run.q_D, run.q_K))
        ways.append(places[string.part.replace("forearm", "hand")] @ axis / size)
    y = 0.5 * (ways[0] + ways[1])  # an arm yields more inwards than outwards
    y, x = y - y[0], (q0 - run.q_K[:, column]) / _STEP
    t, g = run.t - run.t[0], marionette.weight / marionette.mass

    def response(values: Array) -> Array:
        gain, a, b = values[0], *np.exp(values[1:])
        return np.asarray(lsim(([gain * b, gain], [a, b, 1.0]), x, t)[1])

    begin = np.array([1.0, np.log(float(x0[string.length]) / g), np.log(0.05)])
    fit = least_squares(lambda values: response(values) - y, begin)
    return np.array([fit.x[0], *np.exp(fit.x[1:])])
