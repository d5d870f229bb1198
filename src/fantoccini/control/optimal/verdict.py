"""The verdict on the motion of a search: whether it keeps its bounds and reaches its end."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace

from fantoccini.base import SimulationError, StateError, Status
from fantoccini.control.optimal.attribution import (
    NO_RESIDUAL,
    Residual,
    clearance_residual,
    early_end_note,
    end_residual,
    largest_bound_violation,
    largest_residual,
    no_input_note,
    search_status,
    touch_residual,
)
from fantoccini.control.optimal.finishing import event_driven_runs, iterate
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.multi_start import MAX_RESIDUAL
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns, StepRuns
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import AnswerStatus, ClosestApproach, Nodes
from fantoccini.motion import Trajectory

_CLEARANCE_SAMPLES = 5
"""Samples in every interval at which the clearance of a motion is measured."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """A motion with its residuals; clearances are also measured between the nodes.

    Attributes:
        motion: the motion.
        run: its run.
        runs: the runs by which it is simulated.
        bound, end: the largest violation of a bound and of the end.
        approaches: the closest approaches to places.
    """

    motion: Iterate
    run: Trajectory
    runs: EventRuns
    bound: Residual
    end: Residual
    approaches: tuple[ClosestApproach, ...]

    @property
    def largest(self) -> Residual:
        """The largest residual."""
        residuals = (self.bound, self.end, touch_residual(self.approaches))
        return max(residuals, key=lambda residual: residual.rank)

    @property
    def is_event_driven(self) -> bool:
        """Whether the run is event-driven."""
        return not isinstance(self.runs, StepRuns)

    @property
    def holds(self) -> bool:
        """Whether an event-driven run keeps its bounds, and reaches its end and places."""
        return self.is_event_driven and self.largest.size <= MAX_RESIDUAL


@dataclass(frozen=True, eq=False)
class Verdict:
    """The motion that a search returns, whether it holds, and why the search ended there.

    Attributes:
        measured: the motion of the search, or the guess if the search's motion does not hold and
            the guess does.
        status: see :class:`AnswerStatus`.
        reason: the largest residual of the search's motion in words; may be empty.
    """

    measured: MeasuredMotion
    status: AnswerStatus
    reason: str

    @classmethod
    def of(
        cls,
        last: MeasuredMotion,
        guess: Iterate | None,
        objective: Objective,
        limits: Limits,
        is_stopped: bool,
    ) -> Verdict:
        """The verdict on a search.

        Args:
            last: the motion with which the search ended.
            guess: the motion with which it began, if it is a guess of the user.
            objective: cost and bounds.
            limits: limits of the search.
            is_stopped: whether Ctrl-C ended it.
        """
        motion = last.motion
        if last.holds:
            status = AnswerStatus.STOPPED if is_stopped else search_status(motion, limits)
            is_solved = status in (AnswerStatus.SOLVED, AnswerStatus.STOPPED)
            reason = "" if is_solved else largest_residual(objective, motion, limits.tolerance)
        elif last.is_event_driven:
            status = AnswerStatus.VIOLATED
            reason = last.largest.text + early_end_note(motion, limits)
        else:
            status, reason = AnswerStatus.NO_RUN, ""
        reason += _note_on_unmoved_end(last, objective, limits, reason)
        if last.holds or guess is None or (is_stopped and not last.is_event_driven):
            return cls(last, status, reason)
        measured_guess = _measured_guess(last, guess, objective)
        if measured_guess is None or not measured_guess.holds:
            return cls(last, status, reason)
        first = replace(measured_guess.motion, iterations=motion.iterations)
        reason = reason or status.message
        return cls(replace(measured_guess, motion=first), AnswerStatus.GUESS, reason)


def measure(runs: EventRuns, motion: Iterate, objective: Objective) -> MeasuredMotion:
    """A motion with its residuals.

    Raises:
        SimulationError: the motion cannot be simulated again.
    """
    run = motion.nodes.run
    if run is None:  # it was part of a batch, which keeps no run
        nodes_and_run = runs.run(motion.nodes)
        if nodes_and_run is None:
            text = "the motion found cannot be simulated again"
            raise SimulationError(Status.NOT_SETTLED, text)
        run = nodes_and_run[1]
    bound = max(
        largest_bound_violation(objective, motion.nodes, motion.ends),
        _clearance_violation(objective, runs, motion.nodes),
        key=lambda residual: residual.rank,
    )
    approaches = objective.touches.closest_approaches(run, motion.nodes.parameters)
    end = max(
        end_residual(objective, motion.nodes),
        touch_residual(approaches[len(objective.task.touches) :]),
        key=lambda residual: residual.rank,
    )
    return MeasuredMotion(motion, run, runs, bound, end, approaches)


def _measured_guess(
    last: MeasuredMotion, guess: Iterate, objective: Objective
) -> MeasuredMotion | None:
    """The guess with its residuals; None if it has no event-driven run, or is the last motion."""
    if guess.nodes.run is last.run:
        return None
    try:
        if objective.task.marionette.contacts is None:
            return measure(last.runs, guess, objective)
        # The guess was simulated by time steps.
        event_runs = event_driven_runs(last.runs)
        event_iterate = iterate(event_runs, guess.nodes, objective)
        if event_iterate is None:
            return None
        measured = measure(event_runs, event_iterate, objective)
    except (KeyboardInterrupt, SimulationError):
        return None
    return replace(measured, runs=replace(event_runs, deadline=math.inf))


def _note_on_unmoved_end(
    last: MeasuredMotion, objective: Objective, limits: Limits, reason: str
) -> str:
    """Note on a coordinate of the end that no input moves; empty if there is none."""
    nodes = last.motion.nodes
    end = end_residual(objective, nodes)
    if not end.size > limits.tolerance or end.text not in reason or len(nodes.parameters):
        return ""
    with contextlib.suppress(StateError, SimulationError):  # the note is optional
        linear = last.runs.steps.linearise(nodes)
        return no_input_note(nodes, linear, objective.end_gap(nodes))
    return ""


def _clearance_violation(objective: Objective, runs: EventRuns, nodes: Nodes) -> Residual:
    """The largest violation of the required clearance, also between the nodes."""
    clearances = objective.rows.clearances
    if clearances is None:
        return NO_RESIDUAL
    nodes_and_run = runs.run(nodes.refined(_CLEARANCE_SAMPLES))
    if nodes_and_run is None:
        return Residual(math.inf, "the run cannot be repeated to measure its clearances")
    return clearance_residual(clearances, nodes_and_run[1])
