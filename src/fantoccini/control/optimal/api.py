"""Optimal motions: optimise, and its short form for paths, follow.

acc_K are the accelerations of the driven coordinates, the ends and lengths of strings, constant
between successive nodes. A slack string does not pull, and a winch slips if it lets out length at
its largest tension. In names, D stands for dynamic coordinates, which move by the equations of
motion.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.base import OnProgress, Progress, StateError, UnknownNameError, check_positive
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.finishing import confirm_event_driven, iterate, search_minimum
from fantoccini.control.optimal.hybrid import ExactRuns, HybridRuns
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.multi_start import MultiStartSearch
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.outlook import reach_notes
from fantoccini.control.optimal.result import Optimum
from fantoccini.control.optimal.shooting import EventRuns, StepRuns
from fantoccini.control.optimal.sqp import Search
from fantoccini.control.optimal.verdict import Verdict, measure
from fantoccini.control.tasks import (
    Answer,
    AnswerStatus,
    Bounds,
    ChosenParameters,
    Clip,
    GuessLike,
    Nodes,
    PlanConditions,
    Smooth,
    Target,
    Task,
    Track,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State


def optimise(
    task: Task,
    guess: GuessLike | None = None,
    *,
    tolerance: float = 1e-6,
    cost_tolerance: float = 0.0,
    iterations: int = 100,
    time_limit: float = 180.0,
    threads: int | None = None,
    seed: int = 0,
    exact: bool = False,
    progress: OnProgress | None = None,
) -> Optimum:
    """The motion of minimum cost J(x, acc_K), with piecewise constant accelerations, within bounds.

    The method is sequential quadratic programming. Every iterate is an event-driven run, so the
    answer holds without correction. Derivatives are those of time steps along it, with its taut
    strings; steps come from Riccati's recursion, within an interior point method if bounds are
    active. Strings with a lower bound of tension stay taut; others may go slack, and the
    derivatives then hold for the present order of events only. When iterations hardly decrease the
    cost, the search continues with exact derivatives of the run, except for puppets with contact
    or driven rotations. If the search ends at a motion that does not hold but its guess does, the
    answer is the guess. Ctrl-C ends the search with the best motion so far; before a first motion
    it raises.

    For tasks with explorations see :mod:`fantoccini.control.optimal.multi_start`.

    For puppets with contact, the first iterates are runs of time steps, whose derivatives hold for
    the points that stick, slide or are open there. The answer is simulated event-driven, and is
    improved further by such runs if one takes less than a twentieth of the remaining time.

    Args:
        task: the task.
        guess: initial motion of the inputs, or an answer of ``optimise`` or ``plan``; by default
            that of the task, or inputs that hold still.
        tolerance: tolerance of the KKT residual.
        cost_tolerance: relative decrease of the cost; the search ends after four successive steps
            with a smaller one. With 0, only ``tolerance`` ends it.
        iterations: largest number of iterations, for every motion from explorations.
        time_limit: time limit [s].
        threads: number of threads for derivatives and batches; all processors by default.
        seed: seed of the random numbers of explorations.
        exact: whether to use exact derivatives of the event-driven run, through its catches, from
            the first iteration on.
        progress: called after every iteration; ``best`` is the motion with its cost.

    Raises:
        StateError, UnknownNameError: ill-defined task, or a first motion that cannot be simulated.
        KeyboardInterrupt: Ctrl-C before a first motion.
    """
    check_positive(tolerance=tolerance, time_limit=time_limit)
    start_time = time.perf_counter()
    check_task(task)
    if task.obstacles:
        marionette, obstacles = task.world
        task = replace(task, marionette=marionette, obstacles=obstacles)
    original_task = task
    if not task.conditions.slack:
        # The answer keeps the bounds of the task, since plans support none of tension.
        task = replace(task, bounds=task.bounds.with_taut_strings(task.marionette, task.x0))
    marionette = task.marionette
    has_rotations = bool(marionette.coordinates.rotations)
    if exact and has_rotations:
        raise StateError("optimise: exact derivatives need driven coordinates that are scalars")
    free_parameters = ChosenParameters(marionette, task.x0, task.parameters)
    uses_tension = bool(task.bounds.tension or task.bounds.force)
    uses_tension = uses_tension or any(track.kind == "tension" for track in task.tracks)
    has_contact = marionette.contacts is not None
    if exact and has_contact:
        raise StateError("optimise: exact derivatives need a puppet without contact")
    longest = task.durations[1] / task.n_intervals
    time_steps = TimeSteps(marionette, task.dt, threads, free_parameters, uses_tension, longest)
    runs: EventRuns = (
        ExactRuns(time_steps, free_parameters) if exact else EventRuns(time_steps, free_parameters)
    )
    if has_contact:
        runs = StepRuns(time_steps, free_parameters)
    if task.explore:
        runs = HybridRuns(time_steps, free_parameters)
    guess = task.guess if guess is None else guess
    first = first_nodes(task, free_parameters, guess)
    objective = Objective(task)
    first_motion = iterate(runs, first, objective)
    if first_motion is None:
        raise StateError(
            "the first motion cannot be simulated; give a guess whose run arrives at its end"
        )
    motion = best = first_motion
    convergence = [(time.perf_counter() - start_time, motion.cost)]

    # Two searches for each exploration: the exploration itself and its refinement.
    max_iterations = float(iterations * max(1, 2 * task.explore))

    def record_progress(report: Progress) -> None:
        nonlocal best
        best = report.best
        convergence.append((time.perf_counter() - start_time, best.cost))
        if progress is not None:
            progress(replace(report, done=best.iterations, total=max_iterations))

    deadline = start_time + time_limit
    limits = Limits(tolerance, cost_tolerance, iterations, deadline)
    search: Search | MultiStartSearch = Search(motion, runs, objective, limits)
    if task.explore and isinstance(runs, HybridRuns):
        search = MultiStartSearch(motion, runs, objective, limits, seed)
    is_stopped = False
    try:
        if has_contact:
            motion = search.run(record_progress)
            runs, motion = confirm_event_driven(runs, motion, objective, limits, record_progress)
        elif task.explore:
            motion = search.run(record_progress)
        else:
            runs, motion = search_minimum(runs, motion, objective, limits, record_progress)
    except KeyboardInterrupt:
        motion, is_stopped = search.best if has_contact else best, True
    objective = search.objective
    if exact and isinstance(runs, ExactRuns) and runs.reasons:
        text = f"the last derivatives were those of time steps: {runs.reasons[-1]}"
        warnings.warn(text, stacklevel=2)
    verdict = Verdict.of(
        measure(runs, motion, objective),
        None if guess is None else first_motion,
        objective,
        limits,
        is_stopped,
    )
    measured = verdict.measured
    motion = measured.motion
    return Optimum(
        original_task,
        verdict.status,
        measured.run,
        motion.nodes.inputs(),
        motion.cost,
        motion.kkt,
        motion.stationarity,
        measured.bound.size,
        measured.end.size,
        measured.approaches,
        motion.iterations,
        time.perf_counter() - start_time,
        tuple(convergence),
        verdict.reason,
        motion,
        objective,
        measured.runs,
    )


def follow(
    marionette: Marionette,
    targets: Mapping[str | tuple[str, tuple[float, float, float]], Target],
    duration: float,
    x0: State | None = None,
    *,
    bounds: Bounds | None = None,
    smooth: Smooth | None = None,
    weight: float = 1e4,
    slack: bool = False,
    explore: int = 0,
    interval: float | None = None,
    **options: Any,
) -> Optimum:
    """The motion in which parts of a puppet follow paths: the short form of :func:`optimise`.

    It warns before the search if the puppet cannot hang at the paths of points; see :func:`reach`.

    Args:
        marionette: the puppet.
        targets: name -> path. A body's origin, or a point of it as ``(body, (x, y, z))``, follows
            places [m]; a coordinate follows values. A path is a value, a function of time, a pair
            of times and values, a :class:`Clip`, or an array (T, ...) that is spread evenly over
            the duration.
        duration: duration of the motion [s].
        x0: start; by default the puppet hangs at rest.
        bounds: see :class:`Bounds`.
        smooth: see :class:`Smooth`.
        weight: weight of every path [1/m^2 or 1/rad^2].
        slack: whether strings that are taut at the start may go slack.
        explore: number of random explorations for motions through slack strings and catches, which
            imply ``slack``; see :class:`Task`.
        interval: time between nodes [s]; by default a fiftieth of the duration, from 0.01 to 0.04.
        options: options of :func:`optimise`.

    Raises:
        UnknownNameError: name that is neither a body nor a coordinate.
    """
    x0 = marionette.rest() if x0 is None else x0
    tracks = tracks_of(marionette, targets, x0.t, duration, weight)
    bounds = Bounds() if bounds is None else bounds
    h = min(max(duration / 50.0, 0.01), 0.04) if interval is None else interval
    task = Task(
        marionette,
        x0,
        duration,
        tracks,
        smooth or Smooth(),
        bounds,
        interval=h,
        explore=explore,
        conditions=PlanConditions(slack=slack or bool(explore)),
    )
    check_task(task)
    for text in reach_notes(task):
        warnings.warn(text, stacklevel=2)
    return optimise(task, **options)


def tracks_of(
    marionette: Marionette,
    targets: Mapping[str | tuple[str, tuple[float, float, float]], Target],
    start: float,
    duration: float,
    weight: float,
) -> list[Track]:
    """Tracks of names and paths, the arguments of :func:`follow`.

    Args:
        marionette, targets, weight: see :func:`follow`.
        start, duration: time span over which arrays of values are spread [s].

    Raises:
        UnknownNameError: name that is neither a body nor a coordinate.
    """
    bodies = [link.name for link in marionette.tree.links]
    table = marionette.coordinates
    tracks = []
    for name, path in targets.items():
        body, point = name if isinstance(name, tuple) else (name, (0.0, 0.0, 0.0))
        path = _sampled(path, start, duration, 3 if body in bodies else 1)
        if body in bodies:
            tracks.append(Track.point(body, path, at=point, weight=weight))
        elif name in (*table.q_D, *table.q_K):
            tracks.append(Track.coordinate(str(name), path, weight=weight))
        else:
            known_names = [*bodies, *table.q_D, *table.q_K]
            raise UnknownNameError("body or coordinate", str(body), known_names)
    return tracks


def refuse_winches(marionette: Marionette, caller: str) -> None:
    """Raises StateError if a winch may slip."""
    max_forces = marionette.max_forces
    winches = [s.name for i, s in enumerate(marionette.tree.strings) if np.isfinite(max_forces[i])]
    if winches:
        raise StateError(
            f"{caller}: the winch of {', '.join(winches)} may slip, which is not differentiated; "
            "leave max_tension out of the puppet and give bounds of the tension"
        )


def check_task(task: Task) -> None:
    """Raises StateError if a task cannot be optimised, or starts beyond its bounds."""
    marionette = task.marionette
    refuse_winches(marionette, "optimise")
    if task.end is not None and task.required_end is None:
        raise StateError(
            "optimise: the task's end is an interval, a box, a contact or a function, which only "
            "plans support; needed: a state, values of coordinates, the place of a point, or "
            "instead of an end, tracks or touches"
        )
    if task.explore and task.all_touches:
        raise StateError(
            "optimise: explore excludes a place at the end: explore towards a pose first, then "
            "give the motion as a guess"
        )
    if task.is_free and any(
        callable(x.path) or isinstance(x.path, (tuple, Clip)) for x in task.tracks
    ):
        raise StateError(
            "optimise: where the duration is free, paths must be values: paths of "
            "time have no derivative by the duration"
        )
    if task.is_free and np.any(
        np.isfinite(jerk := task.bounds.magnitudes(marionette, "jerk")) & (jerk > 0.0)
    ):
        raise StateError("optimise: a bound of jerk needs a fixed duration")
    if not task.parameters:
        task.bounds.check_moves(marionette)
    task.bounds.check_state(marionette, task.x0, "at the start")
    if task.required_end is not None:
        task.bounds.check_end(marionette, task.x0, task.required_end)


def first_nodes(task: Task, free_parameters: ChosenParameters, guess: GuessLike | None) -> Nodes:
    """The nodes of the first motion, with the accelerations of a guess clipped to their bounds.

    If the duration is free, it is that of a plan; otherwise the longest.

    Raises:
        StateError: guess that is no motion, or a plan that does not arrive.
    """
    _check_guess(guess)
    N, (shortest, longest) = task.n_intervals, task.durations
    nodes = Nodes.constant(task.marionette, task.x0, longest, N)
    values = free_parameters.default_values
    if isinstance(guess, Optimum):
        values = np.array(
            [guess.parameters.get(n, v) for n, v in zip(free_parameters.names, values, strict=True)]
        )
    if isinstance(guess, Optimum):
        if len(guess.nodes) == N and guess.nodes.table is nodes.table:
            interval = min(max(guess.nodes.interval, shortest / N), longest / N)
            nodes = replace(nodes, interval=interval, acc_K=guess.nodes.acc_K)
        else:
            nodes = Nodes.from_input(task.marionette, task.x0, guess.inputs, longest, N)
    elif isinstance(guess, Input):
        nodes = Nodes.from_input(task.marionette, task.x0, guess, longest, N)
    elif guess is not None:
        duration = min(max(guess.duration, shortest), longest)
        nodes = Nodes.from_input(task.marionette, task.x0, guess.inputs, duration, N)
    max_acceleration = task.bounds.magnitudes(task.marionette, "acceleration")
    return replace(
        nodes,
        acc_K=np.clip(nodes.acc_K, -max_acceleration, max_acceleration),
        parameters=np.clip(values, free_parameters.low, free_parameters.high),
    )


def _check_guess(guess: GuessLike | None) -> None:
    """Raises StateError for a guess that is no motion, or a plan that does not arrive."""
    if guess is None or isinstance(guess, (Input, Optimum)):
        return
    if not isinstance(getattr(guess, "inputs", None), Input) or not hasattr(guess, "duration"):
        raise StateError(
            f"optimise: the guess is {guess!r}; needed: an input, a plan or an optimum"
        )
    if isinstance(guess, Answer) and not guess.holds:
        if guess.status is AnswerStatus.UNCONFIRMED:
            return
        raise StateError(
            f"optimise: the guess is a plan that does not arrive ({guess.message}); needed: one "
            "that does, or an input"
        )


def _sampled(path: Target, start: float, duration: float, width: int) -> Target:
    """A path whose array of many values becomes a pair of times and values."""
    if isinstance(path, Clip) or callable(path):
        return path
    if isinstance(path, tuple) and len(path) == 2 and np.ndim(path[0]) == 1:
        return path
    values = np.asarray(path, dtype=float)
    if values.size <= width or values.ndim == 0:
        return path
    return np.linspace(start, start + duration, len(values)), values
