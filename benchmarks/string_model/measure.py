"""Measurements of one model of the strings."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from benchmarks.string_model.subject import Subject

import fantoccini as fan
from fantoccini.base.errors import StateError
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.equilibrium.projection import retract
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.output.view.geometry import chain_points

TOLERANCE = 1e-8
"""rtol and atol of the event-driven runs."""
_LONGEST = 0.2
"""Longest tested step of the time-stepper [s]."""
_FINE = 1.05
"""Ratio of the bounds of the largest stable step."""
_ASTRAY = 0.005
"""Distance from the event-driven motion at which a run counts as wrong [m]."""
_BLOWN = 0.1
"""Energy error at which a run counts as wrong [J]."""
_MOVE = 1e-6


@dataclass(frozen=True)
class Measurements:
    """Figures of one model on one motion.

    Attributes:
        dof: degrees of freedom.
        fastest, slowest: absolute values of the linearised motion's eigenvalues, at rest [1/s].
        largest_step: largest step of the time-stepper [s].
        stepping: processor time per simulated second at half that step.
        steps: steps of the event-driven method per simulated second.
        event: its processor time per simulated second.
        stretch: largest extension of a string beyond its length [m].
        error: largest distance of the hand from that of the massless model [m].
    """

    dof: int
    fastest: float
    slowest: float
    largest_step: float
    stepping: float
    steps: float
    event: float
    stretch: float
    error: float


def measure(
    subject: Subject, puppet: Marionette, hand: np.ndarray | None
) -> tuple[Measurements, np.ndarray]:
    """The figures of a model, and the hand's path.

    Args:
        subject: the motion.
        puppet: puppet on constraints or chains.
        hand: (T, 3) path of the hand on massless strings [m]; None for those themselves.
    """
    puppet.compile()
    x = puppet.rest()
    inputs, t_end = subject.inputs(puppet, x), subject.t_end
    options = {"method": fan.Event(rtol=TOLERANCE, atol=TOLERANCE), "effort": False}
    seconds, run = _shortest_time(lambda: fan.simulate(puppet, x, inputs, t_end, **options))
    grid = np.linspace(0, t_end, 301)
    on_grid = fan.simulate(puppet, x, inputs, t_end, save_at=grid[1:-1], **options)
    here = subject.hand(puppet, on_grid)[np.searchsorted(on_grid.t, grid - 1e-9)]
    fast, slow = eigenvalues(puppet, x)
    step = largest_step(subject, puppet, x, inputs, (grid, here), min(0.3 / fast, 2e-4))
    stepping, _ = _shortest_time(lambda: run_with_steps(puppet, x, inputs, t_end, 0.5 * step))
    figures = Measurements(
        dof=puppet.coordinates.n_vD,
        fastest=fast,
        slowest=slow,
        largest_step=step,
        stepping=stepping / t_end,
        steps=(len(run.t) - 1) / t_end,
        event=seconds / t_end,
        stretch=stretch(puppet, on_grid),
        error=0.0 if hand is None else float(np.max(np.linalg.norm(here - hand, axis=1))),
    )
    return figures, here


def _shortest_time(work: Callable[[], fan.Trajectory]) -> tuple[float, fan.Trajectory]:
    """Processor time of the fastest of three or more tries [s], and the last result."""
    took: list[float] = []
    while sum(took) < 20.0 and (len(took) < 3 or sum(took) < 0.5):
        began = time.process_time()
        result = work()
        took.append(time.process_time() - began)
    return min(took), result


def run_with_steps(puppet, x: State, inputs, t_end: float, dt: float) -> fan.Trajectory:
    """A run of the time-stepper with few samples."""
    return fan.simulate(
        puppet,
        x,
        inputs,
        t_end,
        method=fan.TimeStepping(dt=dt),
        effort=False,
        throw=False,
        save_every=max(1, int(t_end / dt / 100)),
    )


def largest_step(
    subject: Subject,
    puppet: Marionette,
    x: State,
    inputs: fan.Input,
    hand: tuple[np.ndarray, np.ndarray],
    first: float,
) -> float:
    """The largest step with which the time-stepper follows the right motion [s].

    Args:
        subject: the motion.
        puppet, x, inputs: puppet, start and inputs.
        hand: times (T,) [s], and (T, 3) right positions of the hand [m].
        first: a sufficiently small step [s].
    """

    def stands(dt: float) -> bool:
        try:
            run = run_with_steps(puppet, x, inputs, subject.t_end, dt)
        except StateError:
            return False
        if run.t[-1] < subject.t_end - 1e-9 or not np.all(np.isfinite(run.q_D)):
            return False
        right = np.array([np.interp(run.t, hand[0], x) for x in hand[1].T]).T
        off = np.max(np.linalg.norm(subject.hand(puppet, run) - right, axis=1))
        return bool(off < _ASTRAY and np.max(np.abs(run.ledger["residual"])) < _BLOWN)

    low = first
    if not stands(low):
        raise ValueError(f"a step of {low:g} s is too long already")
    while stands(2 * low) and low < _LONGEST:
        low *= 2
    high = 2 * low
    while high / low > _FINE:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    return float(low)


def eigenvalues(puppet: Marionette, x: State) -> tuple[float, float]:
    """Largest and smallest absolute eigenvalues of the motion near rest [1/s].

    In coordinates in which M_DD is 1, and orthogonal to taut strings; 0 is left out.
    """
    evaluation = Evaluation.at_state(puppet, x)
    n = len(x.v_D)
    _, tension = puppet.forward_dynamics(x)
    rows = np.flatnonzero(tension > 0)
    W, tau = evaluation.W[:, rows], tension[rows]
    moves = evaluation.solve_factor(np.eye(n))
    stiff, damped = np.zeros((n, n)), np.zeros((n, n))
    for k, move in enumerate(moves):
        for sign in (1, -1):
            size = sign * _MOVE / max(1.0, float(np.max(np.abs(move))))
            q_D = retract(puppet, x.q_D, size * move)
            there = Evaluation.at_state(puppet, x.replace(q_D=q_D))
            stiff[:, k] += 0.5 * (there.w0 - there.W[:, rows] @ tau) / size
            moving = Evaluation.at_state(puppet, x.replace(v_D=size * move))
            damped[:, k] += 0.5 * moving.w0 / size
    free = np.linalg.svd(W.T)[2][len(rows) :].T if len(rows) else np.eye(n)
    m = free.shape[1]
    system = np.zeros((2 * m, 2 * m))
    system[:m, m:] = np.eye(m)
    system[m:, :m], system[m:, m:] = free.T @ stiff @ free, free.T @ damped @ free
    sizes = np.abs(np.linalg.eigvals(system))
    return float(sizes.max()), float(sizes[sizes > 0.1].min())


def stretch(puppet: Marionette, run: fan.Trajectory) -> float:
    """The largest extension of a string beyond its length [m]."""
    if not puppet.tree.chains:
        n = len(puppet.tree.strings)
        return float(np.max(run.violation.values[:, :n]))
    poses, longest = puppet.poses(run.q_D, run.q_K), 0.0
    for row, points in zip(puppet.tree.chains, chain_points(puppet.tree, poses), strict=True):
        path = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)
        length = run.q_K[:, row.length_index[0]]
        longest = max(longest, float(np.max(path - length)))
    return longest
