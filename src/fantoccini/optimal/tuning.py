"""tune: the numbers of a family of motions for which a cost of the run is least.

    min over theta of cost(run(family(theta))),   theta ~ N(mean, C)

For what has no derivatives: steps of a walk, whose landings change the order of many events. Runs
are simulated many at once, and mean and covariance C move towards the best of them: CMA-ES
(Hansen, The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772), as the library pycma has it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, check_positive
from fantoccini.errors import FantocciniError, StateError, Status
from fantoccini.marionette import Marionette, Method, MethodName
from fantoccini.motion import Input, State, Trajectory
from fantoccini.optimal.result import OptimalStatus
from fantoccini.simulation import simulate, simulate_batch

_AT_ONCE = 16
"""Runs that are simulated and kept in memory together."""

Family = Callable[[dict[str, float]], Input]
Cost = Callable[[Trajectory], float]


@dataclass(frozen=True, eq=False)
class Tuned:
    """The best motion of a family.

    Attributes:
        values: its numbers.
        spread: of the distribution in the end, by number: what is still wide hardly matters, or
            was not given the generations to narrow.
        cost: of its run.
        inputs: motion of the driven coordinates.
        run: by the method that was asked for.
        status: how the search ended: ``SETTLED`` when all spreads were narrow.
        curve: (generations, 2) the least cost so far, and the median of the generation; inf where
            half of its runs did not arrive.
        seconds: that it took [s].
    """

    values: dict[str, float]
    spread: dict[str, float]
    cost: float
    inputs: Input
    run: Trajectory
    status: OptimalStatus
    curve: Array
    seconds: float

    def __bool__(self) -> bool:
        """Whether the search came to its end by itself."""
        return self.status is OptimalStatus.SETTLED

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name} {value:.4g}" for name, value in self.values.items())
        return f"<Tuned {self.status.name}: cost {self.cost:.6g} at {numbers}>"


def tune(
    marionette: Marionette,
    family: Family,
    numbers: Mapping[str, tuple[float, float]],
    cost: Cost,
    x0: State | None = None,
    t_end: float | None = None,
    *,
    method: Method | MethodName = "event",
    save_every: int | None = None,
    runs: int = 60,
    generations: int = 40,
    narrow: float = 0.05,
    time_limit: float = 600.0,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Tuned:
    """The numbers of a family of motions for which a cost of the run is least, by random draws.

    Args:
        marionette: the puppet or scene, with contact or without.
        family: makes the inputs of some numbers, all of one duration. Numbers out of a range that
            makes sense are for it to clip; where it raises a FantocciniError, they are passed by.
        numbers: name -> where to begin, and how far from there to look at first (a standard
            deviation, above 0).
        cost: of a run that reached its end; inf where it will not do. Events are not recorded.
        x0: where runs start; hanging at rest when not given.
        t_end: end of the runs [s]; the end of the inputs when not given.
        method: see :func:`fantoccini.simulate`.
        save_every: write every so many steps (not event-driven); every one when not given.
        runs: of a generation; at least 3.
        generations: at most.
        narrow: it ends where all spreads are below this share of those at the start.
        time_limit: at most, looked at after every generation [s].
        seed: of the random numbers; the same seed gives the same draws.
        threads: that simulate; as many as there are processors when not given.
        progress: called after every generation with the least cost so far and its median.

    Raises:
        ValueError: no numbers, a spread that is not positive, or a cost that is not a number.
        StateError: not one run of the first generations arrived.
    """
    check_positive(runs=runs, generations=generations, narrow=narrow, time_limit=time_limit)
    began, names = time.perf_counter(), list(numbers)
    first = np.array([numbers[name] for name in names], dtype=float)
    is_right = first.shape == (len(names), 2) and np.all(np.isfinite(first))
    if not (is_right and len(names) and np.all(first[:, 1] > 0.0)):
        raise ValueError(
            f"numbers is {dict(numbers)!r}; it must give each name (start, spread), spread above 0"
        )
    x0 = marionette.rest() if x0 is None else x0
    from cma import CMAEvolutionStrategy  # slow to import

    law = CMAEvolutionStrategy(
        np.zeros(len(names)), 1.0,
        {"popsize": runs, "seed": 1 + seed, "verbose": -9, "CMA_elitist": False},
    )
    trial = _Trial(marionette, family, names, cost, x0, t_end, method, save_every, threads)
    best, least, spread = first[:, 0], math.inf, first[:, 1]
    curve, status = list[tuple[float, float]](), OptimalStatus.ITERATIONS
    try:
        for generation in range(generations):
            drawn = law.ask()
            if not generation:
                drawn[0] = np.zeros(len(names))  # where it begins counts as well
            theta = first[:, 0] + first[:, 1] * np.array(drawn)
            J = trial.costs(theta)
            law.tell(drawn, list(J))
            if np.min(J) < least:
                best, least = theta[np.argmin(J)], float(np.min(J))
            spread = first[:, 1] * np.asarray(law.stds)
            curve.append((least, float(np.median(J))))
            if progress is not None:
                progress(*curve[-1])
            if np.all(spread <= narrow * first[:, 1]):
                status = OptimalStatus.SETTLED if least < math.inf else status
                break
            if time.perf_counter() - began > time_limit:
                status = OptimalStatus.TIMEOUT
                break
    except KeyboardInterrupt:
        status = OptimalStatus.STOPPED
        if least == math.inf:
            raise
    if least == math.inf:
        raise StateError(
            f"tune: none of the {len(curve) * runs} runs had a finite cost; the last ended with "
            f"{trial.ended}; begin with numbers whose run arrives, and with smaller spreads"
        )
    values = dict(zip(names, map(float, best), strict=True))
    inputs = family(values)
    run = simulate(
        marionette, x0, inputs, t_end, method=method, save_every=save_every, throw=False
    )
    return Tuned(
        values, dict(zip(names, map(float, spread), strict=True)), trial.cost_of(run), inputs,
        run, status, np.array(curve), time.perf_counter() - began,
    )  # fmt: skip


@dataclass(eq=False)
class _Trial:
    """Runs of numbers, and what they cost; the arguments are those of :func:`tune`."""

    marionette: Marionette
    family: Family
    names: list[str]
    cost: Cost
    x0: State
    t_end: float | None
    method: Method | MethodName
    save_every: int | None
    threads: int | None
    ended: str = "no run"

    def costs(self, theta: Array) -> Array:
        """(n,) costs of the numbers (n, m); inf where there is no run that arrives."""
        out = np.full(len(theta), np.inf)
        made: list[tuple[int, Input]] = []
        for i, row in enumerate(theta):
            try:
                made.append((i, self.family(dict(zip(self.names, map(float, row), strict=True)))))
            except FantocciniError as error:
                self.ended = str(error)
        for k in range(0, len(made), _AT_ONCE):
            some = made[k : k + _AT_ONCE]
            many = simulate_batch(
                self.marionette, self.x0, [inputs for _, inputs in some], self.t_end,
                method=self.method, save_every=self.save_every, save="all", threads=self.threads,
            )  # fmt: skip
            if np.any(many.status == Status.STOPPED):
                raise KeyboardInterrupt
            for (i, _), run in zip(some, many, strict=True):
                out[i] = self.cost_of(run)
        return out

    def cost_of(self, run: Trajectory) -> float:
        """What a run costs; inf where it did not end well."""
        self.ended = run.status.name
        if run.status is not Status.DONE:
            return math.inf
        value = float(self.cost(run))
        if math.isnan(value):
            raise ValueError("tune: the cost of a run is NaN; it must be a number, or inf")
        return value
