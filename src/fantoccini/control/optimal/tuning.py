"""tune: the numbers of a family of motions with the least cost of the run.

    min over theta of cost(run(family(theta))),   theta ~ N(mean, C)

This is for motions without derivatives, such as steps of a walk, whose landings change the order of
many events. Many runs are simulated at once, and mean and covariance C move towards the best of
them: CMA-ES (Hansen, The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772), from `pycma`.

A family is a function from a few numbers theta to a motion of the driven coordinates.
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

_RUNS_PER_THREAD = 8
"""Number of runs per thread that are simulated and kept in memory together: the lanes."""
_MIN_RUNS = 3
"""Smallest number of runs in a generation, as the method needs."""
_MAX_FAILED_GENERATIONS = 3
"""Number of generations without a finite cost after which the search ends."""
_DEFAULT_SAMPLES = 201
"""Default number of samples of event-driven runs."""
_TIME_TOLERANCE = 1e-9
"""Largest difference of end times that count as equal [s]."""

Family = Callable[[dict[str, float]], Input]
Cost = Callable[[Trajectory], float]


@dataclass(frozen=True, eq=False)
class TuningResult(Answer):
    """The best motion of a family, with a run that is ``DONE``. True if all spreads are narrow.

    Attributes:
        values: numbers of the motion.
        spread: final spread of the distribution, by number. After many generations, numbers with a
            wide spread hardly matter.
        cost: cost of its run.
        inputs: motion of the driven coordinates.
        run: the run that the cost was computed from. ``fan.simulate`` of the inputs gives events,
            effort and contacts as well.
        status: status at the end of the search.
        curve: (generations, 2) the least cost so far, and the median of the generation; inf if half
            of its runs had no finite cost.
        seconds: duration of the search [s].
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
        return f"<TuningResult {self.status.name}: cost {self.cost:.6g} at {numbers}>"


@dataclass(frozen=True)
class DrawOptions:
    """Options of the random draws.

    Attributes:
        runs: number of runs in a generation; at least 3.
        generations: largest number of generations.
        narrow: ratio of final to first spreads; the search ends once all are below it.
        time_limit: time limit, checked after every generation [s].
        seed: seed of the random numbers, at least 0; the same seed gives the same draws.

    Raises:
        ValueError: number out of range.
    """

    runs: int = 60
    generations: int = 40
    narrow: float = 0.05
    time_limit: float = 600.0
    seed: int = 0

    def __post_init__(self) -> None:
        check_positive(narrow=self.narrow, time_limit=self.time_limit)
        for name, min_count in (("runs", _MIN_RUNS), ("generations", 1)):
            count = getattr(self, name)
            if not (isinstance(count, (int, np.integer)) and count >= min_count):
                text = f"{name} is {count!r}; it must be a whole number of at least {min_count}"
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
    draws: DrawOptions | None = None,
    threads: int | None = None,
    progress: OnProgress | None = None,
) -> TuningResult:
    """The numbers of a family of motions with the least cost of the run, by random draws.

    Args:
        marionette: the puppet or scene, with contact or without.
        family: function from numbers to inputs. It must clip values outside of their range; draws
            for which it, or the simulation, raises a FantocciniError count as infinitely expensive.
        numbers: name -> (start, spread): first value, and first standard deviation, above 0.
        cost: function from a run that is ``DONE`` to its cost; inf for an unacceptable run. Events,
            effort and contacts are not recorded.
        x0: start of the runs; by default the puppet hangs at rest.
        t_end: end of the runs [s]; by default the common end of all inputs.
        method: see :func:`fantoccini.simulate`.
        save_at: (n,) times of the samples of event-driven runs; by default 201 from start to end
            [s].
        save_every: number of steps between samples, with other methods; 1 by default.
        draws: options of the random draws.
        threads: number of threads; all processors by default.
        progress: called after every generation; ``best`` is the least cost so far and its median.

    Raises:
        ValueError: no numbers, a spread that is not positive, a cost that is not a number, or
            inputs that end at different times.
        StateError: no run of the first three generations had a finite cost.
    """
    draws = draws or DrawOptions()
    start_time, names = time.perf_counter(), list(numbers)
    mean, spreads = _first_distribution(numbers)
    x0 = marionette.rest() if x0 is None else x0
    evaluator = _Evaluator(
        marionette, family, names, cost, x0, t_end, method, save_at, save_every, threads
    )
    from cma import CMAEvolutionStrategy  # slow to import

    rng = np.random.default_rng(draws.seed)
    optimiser = CMAEvolutionStrategy(
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
            samples = optimiser.ask()
            if not generation:
                samples[0] = np.zeros(len(names))  # the first values are tried as well
            J = evaluator.costs(mean + spreads * np.array(samples))
            optimiser.tell(samples, list(J))
            spread = spreads * np.asarray(optimiser.stds)
            curve.append((evaluator.least_cost, float(np.median(J))))
            if progress is not None:
                progress(Progress(done=generation + 1, total=draws.generations, best=curve[-1]))
            if evaluator.best is None and generation + 1 >= _MAX_FAILED_GENERATIONS:
                break
            if evaluator.best is not None and np.all(spread <= draws.narrow * spreads):
                status = AnswerStatus.NARROW
                break
            if time.perf_counter() - start_time > draws.time_limit:
                status = AnswerStatus.TIMEOUT
                break
    except KeyboardInterrupt:
        status = AnswerStatus.STOPPED
        if evaluator.best is None:
            raise
    if evaluator.best is None:
        raise StateError(
            f"tune: none of the first {len(curve) * draws.runs} runs had a finite cost; the last "
            f"ended with {evaluator.last_end}; begin with numbers whose run does, "
            "and with smaller spreads"
        )
    values, inputs, run = evaluator.best
    return TuningResult(
        values,
        dict(zip(names, map(float, spread), strict=True)),
        evaluator.least_cost,
        inputs,
        run,
        status,
        np.array(curve),
        time.perf_counter() - start_time,
    )


def _first_distribution(numbers: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
    """(n,) first values of the numbers, and their first spreads.

    Raises:
        ValueError: no numbers, no pair for a number, or a spread that is not above 0.
    """
    try:
        pairs = np.array(list(numbers.values()), dtype=float)
    except (TypeError, ValueError):
        pairs = np.zeros(0)
    is_valid = pairs.ndim == 2 and pairs.shape[1] == 2 and bool(np.all(np.isfinite(pairs)))
    if not (is_valid and len(pairs) and np.all(pairs[:, 1] > 0.0)):
        raise ValueError(
            f"numbers is {dict(numbers)!r}; it must give each name (start, spread), spread above 0"
        )
    return pairs[:, 0], pairs[:, 1]


@dataclass(eq=False)
class _Evaluator:
    """Runs for draws of numbers, with costs and the best; arguments as for :func:`tune`.

    Attributes:
        least_cost: least cost so far.
        best: values, inputs and run with that cost.
        last_end: description of the last run's end.
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
    least_cost: float = math.inf
    best: tuple[dict[str, float], Input, Trajectory] | None = None
    last_end: str = "no run"
    _inputs_end: float | None = None

    def costs(self, theta: Array) -> Array:
        """(n,) costs of the numbers (n, m); inf for a run that is not done."""
        costs = np.full(len(theta), np.inf)
        inputs_of_draws: list[tuple[int, dict[str, float], Input]] = []
        for i, sample in enumerate(theta):
            values = dict(zip(self.names, map(float, sample), strict=True))
            try:
                inputs_of_draws.append((i, values, self.family(values)))
            except FantocciniError as error:
                self.last_end = str(error)
        batch_size = _RUNS_PER_THREAD * (
            default_threads() if self.threads is None else self.threads
        )
        for k in range(0, len(inputs_of_draws), batch_size):
            batch = inputs_of_draws[k : k + batch_size]
            runs = self._runs([inputs for _, _, inputs in batch])
            for (i, values, inputs), run in zip(batch, runs, strict=True):
                if run is not None:
                    costs[i] = self._cost_of(run)
                if costs[i] < self.least_cost:
                    assert run is not None
                    self.least_cost, self.best = float(costs[i]), (values, inputs, run)
        return costs

    def _runs(self, inputs: list[Input]) -> list[Trajectory | None]:
        """The runs; None for one that cannot begin."""
        end = self._end(inputs)
        is_event, save_at = isinstance(as_method(self.method), Event), self.save_at
        if is_event and save_at is None:
            save_at = np.linspace(self.x0.t, end, _DEFAULT_SAMPLES)
        try:
            batch = simulate_batch(
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
                self.last_end = str(error)
                return [None]
            return [self._runs([single])[0] for single in inputs]
        if np.any(batch.status == Status.STOPPED):
            raise KeyboardInterrupt
        return list(batch)

    def _end(self, inputs: list[Input]) -> float:
        """The end of all runs [s].

        Raises:
            ValueError: end that is not given, with inputs that end at different times.
        """
        if self.t_end is not None:
            return self.t_end
        end = inputs[0].end if self._inputs_end is None else self._inputs_end
        for later in inputs:
            if abs(later.end - end) > _TIME_TOLERANCE:
                raise ValueError(
                    f"tune: the family's inputs end at {end:g} s and at {later.end:g} s; "
                    "give t_end, or let them end at one time"
                )
        self._inputs_end = end
        return end

    def _cost_of(self, run: Trajectory) -> float:
        """The cost of a run; inf if it is not done."""
        self.last_end = run.status.name
        if run.status is not Status.DONE:
            return math.inf
        value = float(self.cost(run))
        if math.isnan(value):
            raise ValueError("tune: the cost of a run is NaN; it must be a number, or inf")
        return value
