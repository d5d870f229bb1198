"""tune: the numbers of a family of motions for which a cost of the run is least.

    min over theta of cost(run(family(theta))),   theta ~ N(mean, C)

For what has no derivatives: steps of a walk, whose landings change the order of many events. Runs
are simulated many at once, and mean and covariance C move towards the best of them: CMA-ES
(Hansen, The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772), as implemented in pycma.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import (
    Array,
    FantocciniError,
    OnProgress,
    Progress,
    StateError,
    Status,
    Times,
    check_positive,
)
from fantoccini.control.tasks import Answer, AnswerStatus
from fantoccini.dynamics.compiled import Event, Method, MethodName, as_method
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate_batch
from fantoccini.kernel.runtime import default_threads
from fantoccini.motion import Input, State, Trajectory

_AT_ONCE = 8
"""Runs of a thread that are simulated and kept in memory together: as many as there are lanes."""
_FEWEST = 3
"""Runs of a generation at least, as the method needs."""
_PATIENCE = 3
"""Generations without a finite cost after which there is none."""
_SAMPLES = 201
"""Of event-driven runs, where their times are not given."""
_SAME_TIME = 1e-9
"""Distance of ends that are one [s]."""

Family = Callable[[dict[str, float]], Input]
Cost = Callable[[Trajectory], float]


@dataclass(frozen=True, eq=False)
class Tuned(Answer):
    """The best motion of a family, of a run that is ``DONE``. True where all spreads are narrow.

    Attributes:
        values: its numbers.
        spread: of the distribution in the end, by number. After many generations, what is still
            wide hardly matters.
        cost: of its run.
        inputs: motion of the driven coordinates.
        run: what the cost was given. ``fan.simulate`` of the inputs gives events, effort and
            contacts as well.
        status: how the search ended.
        curve: (generations, 2) the least cost so far, and the median of the generation; inf where
            half of its runs had no finite cost.
        seconds: that it took [s].
    """

    values: dict[str, float]
    spread: dict[str, float]
    cost: float
    inputs: Input
    run: Trajectory
    status: AnswerStatus
    curve: Array
    seconds: float

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name} {value:.4g}" for name, value in self.values.items())
        return f"<Tuned {self.status.name}: cost {self.cost:.6g} at {numbers}>"


@dataclass(frozen=True)
class Draws:
    """How numbers are drawn.

    Attributes:
        runs: of a generation; at least 3.
        generations: at most.
        narrow: the search ends where all spreads are below this share of those at the start.
        time_limit: at most, looked at after every generation [s].
        seed: of the random numbers, at least 0; the same seed gives the same draws.

    Raises:
        ValueError: a number out of range.
    """

    runs: int = 60
    generations: int = 40
    narrow: float = 0.05
    time_limit: float = 600.0
    seed: int = 0

    def __post_init__(self) -> None:
        check_positive(narrow=self.narrow, time_limit=self.time_limit)
        for name, least in (("runs", _FEWEST), ("generations", 1)):
            count = getattr(self, name)
            if not (isinstance(count, (int, np.integer)) and count >= least):
                text = f"{name} is {count!r}; it must be a whole number of at least {least}"
                raise ValueError(text)


def tune(
    marionette: Marionette,
    family: Family,
    numbers: Mapping[str, tuple[float, float]],
    cost: Cost,
    x0: State | None = None,
    t_end: float | None = None,
    *,
    method: Method | MethodName = "event",
    save_at: Times | None = None,
    save_every: int | None = None,
    draws: Draws | None = None,
    threads: int | None = None,
    progress: OnProgress | None = None,
) -> Tuned:
    """The numbers of a family of motions for which a cost of the run is least, by random draws.

    Args:
        marionette: the puppet or scene, with contact or without.
        family: makes the inputs of some numbers. It must clip values outside of their range; draws
            for which it, or the simulation, raises a FantocciniError count as infinitely expensive.
        numbers: name -> where to begin, and how far from there to look at first (a standard
            deviation, above 0).
        cost: of a run that is ``DONE``; inf where it will not do. Events, effort and contacts are
            not recorded.
        x0: where runs start; hanging at rest when not given.
        t_end: end of the runs [s]; the end of the inputs when not given, which must then be one.
        method: see :func:`fantoccini.simulate`.
        save_at: (n,) times of the runs' samples, event-driven; 201 from start to end when not given
            [s].
        save_every: write every so many steps, not event-driven; every one when not given.
        draws: how the numbers are drawn.
        threads: that simulate; as many as there are processors when not given.
        progress: called after every generation; ``best`` is the least cost so far and its median.

    Raises:
        ValueError: no numbers, a spread that is not positive, a cost that is not a number, or
            inputs that end at different times.
        StateError: not one run of the first three generations had a finite cost.
    """
    draws = draws or Draws()
    began, names = time.perf_counter(), list(numbers)
    first, spreads = _begin(numbers)
    x0 = marionette.rest() if x0 is None else x0
    trial = _Trial(marionette, family, names, cost, x0, t_end, method, save_at, save_every, threads)
    from cma import CMAEvolutionStrategy  # slow to import

    rng = np.random.default_rng(draws.seed)
    search = CMAEvolutionStrategy(
        np.zeros(len(names)),
        1.0,
        {
            "popsize": draws.runs,
            "verbose": -9,
            "seed": np.nan,
            "randn": lambda *shape: rng.standard_normal(shape),
        },
    )
    curve, status, spread = list[tuple[float, float]](), AnswerStatus.GENERATIONS, spreads
    try:
        for generation in range(draws.generations):
            drawn = search.ask()
            if not generation:
                drawn[0] = np.zeros(len(names))  # where it begins counts as well
            J = trial.costs(first + spreads * np.array(drawn))
            search.tell(drawn, list(J))
            spread = spreads * np.asarray(search.stds)
            curve.append((trial.least, float(np.median(J))))
            if progress is not None:
                progress(Progress(done=generation + 1, total=draws.generations, best=curve[-1]))
            if trial.best is None and generation + 1 >= _PATIENCE:
                break
            if trial.best is not None and np.all(spread <= draws.narrow * spreads):
                status = AnswerStatus.NARROW
                break
            if time.perf_counter() - began > draws.time_limit:
                status = AnswerStatus.TIMEOUT
                break
    except KeyboardInterrupt:
        status = AnswerStatus.STOPPED
        if trial.best is None:
            raise
    if trial.best is None:
        raise StateError(
            f"tune: none of the first {len(curve) * draws.runs} runs had a finite cost; the last "
            f"ended with {trial.ended}; begin with numbers whose run does, and with smaller spreads"
        )
    values, inputs, run = trial.best
    return Tuned(
        values,
        dict(zip(names, map(float, spread), strict=True)),
        trial.least,
        inputs,
        run,
        status,
        np.array(curve),
        time.perf_counter() - began,
    )


def _begin(numbers: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
    """(n,) where the numbers begin, and their first spreads.

    Raises:
        ValueError: there are none, or not two numbers of each, or a spread is not above 0.
    """
    try:
        both = np.array(list(numbers.values()), dtype=float)
    except (TypeError, ValueError):
        both = np.zeros(0)
    is_right = both.ndim == 2 and both.shape[1] == 2 and bool(np.all(np.isfinite(both)))
    if not (is_right and len(both) and np.all(both[:, 1] > 0.0)):
        raise ValueError(
            f"numbers is {dict(numbers)!r}; it must give each name (start, spread), spread above 0"
        )
    return both[:, 0], both[:, 1]


@dataclass(eq=False)
class _Trial:
    """Runs of numbers, what they cost, and the best; the arguments are those of :func:`tune`.

    Attributes:
        least: cost so far.
        best: its values, inputs and run.
        ended: how the last run ended, in words.
    """

    marionette: Marionette
    family: Family
    names: list[str]
    cost: Cost
    x0: State
    t_end: float | None
    method: Method | MethodName
    save_at: Times | None
    save_every: int | None
    threads: int | None
    least: float = math.inf
    best: tuple[dict[str, float], Input, Trajectory] | None = None
    ended: str = "no run"
    _inputs_end: float | None = None

    def costs(self, theta: Array) -> Array:
        """(n,) costs of the numbers (n, m); inf where there is no run that is done."""
        out = np.full(len(theta), np.inf)
        made: list[tuple[int, dict[str, float], Input]] = []
        for i, row in enumerate(theta):
            values = dict(zip(self.names, map(float, row), strict=True))
            try:
                made.append((i, values, self.family(values)))
            except FantocciniError as error:
                self.ended = str(error)
        at_once = _AT_ONCE * (default_threads() if self.threads is None else self.threads)
        for k in range(0, len(made), at_once):
            some = made[k : k + at_once]
            runs = self._runs([inputs for _, _, inputs in some])
            for (i, values, inputs), run in zip(some, runs, strict=True):
                if run is not None:
                    out[i] = self._cost_of(run)
                if out[i] < self.least:
                    assert run is not None
                    self.least, self.best = float(out[i]), (values, inputs, run)
        return out

    def _runs(self, inputs: list[Input]) -> list[Trajectory | None]:
        """The runs; None where one cannot be begun."""
        end = self._end(inputs)
        is_event, save_at = isinstance(as_method(self.method), Event), self.save_at
        if is_event and save_at is None:
            save_at = np.linspace(self.x0.t, end, _SAMPLES)
        try:
            many = simulate_batch(
                self.marionette,
                self.x0,
                inputs,
                end,
                method=self.method,
                save_at=save_at,
                save_every=self.save_every,
                save="all",
                threads=self.threads,
            )
        except FantocciniError as error:
            if len(inputs) == 1:
                self.ended = str(error)
                return [None]
            return [self._runs([one])[0] for one in inputs]
        if np.any(many.status == Status.STOPPED):
            raise KeyboardInterrupt
        return list(many)

    def _end(self, inputs: list[Input]) -> float:
        """The end of all runs [s].

        Raises:
            ValueError: it is not given, and inputs end at different times.
        """
        if self.t_end is not None:
            return self.t_end
        end = inputs[0].end if self._inputs_end is None else self._inputs_end
        for one in inputs:
            if abs(one.end - end) > _SAME_TIME:
                raise ValueError(
                    f"tune: the family's inputs end at {end:g} s and at {one.end:g} s; give t_end, "
                    "or let them end at one time"
                )
        self._inputs_end = end
        return end

    def _cost_of(self, run: Trajectory) -> float:
        """What a run costs; inf where it is not done."""
        self.ended = run.status.name
        if run.status is not Status.DONE:
            return math.inf
        value = float(self.cost(run))
        if math.isnan(value):
            raise ValueError("tune: the cost of a run is NaN; it must be a number, or inf")
        return value
