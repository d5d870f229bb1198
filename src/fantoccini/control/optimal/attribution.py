"""Attribution of the largest residual of a motion: bound, coordinate and time, in words.

A residual is the error by which a motion misses its end, violates a bound, or is not yet optimal. A
node is a time at which the inputs may change. In names, D stands for dynamic coordinates, which
move by the equations of motion, and K for driven ones: ends and lengths of strings, driven joints.
A row is a condition on a number of the motion, such as a tension.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.control.optimal.clear_rows import ClearanceRows
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import AnswerStatus, ClosestApproach, Nodes, entry_names
from fantoccini.motion import Trajectory

_MAX_ROUNDING_EFFECT = 1e-9
"""The effect of the inputs on a final coordinate is rounding if it is below this share of the
largest effect on any coordinate."""


@dataclass(frozen=True)
class Residual:
    """A residual of a motion.

    Attributes:
        size: magnitude [SI].
        text: the bound, coordinate and time.
    """

    size: float
    text: str

    @property
    def rank(self) -> float:
        """The size for comparisons; infinite for NaN."""
        return math.inf if math.isnan(self.size) else self.size


NO_RESIDUAL = Residual(0.0, "")


def largest_bound_violation(objective: Objective, nodes: Nodes, ends: Ends) -> Residual:
    """The largest violation of a bound at the nodes; :data:`NO_RESIDUAL` without one."""
    return max(
        _bound_residuals(objective, nodes, ends),
        key=lambda residual: residual.rank,
        default=NO_RESIDUAL,
    )


def end_residual(objective: Objective, nodes: Nodes) -> Residual:
    """The largest error of a coordinate or velocity at the end."""
    errors = np.abs(objective.end_gap(nodes))
    if not np.max(errors, initial=0.0) > 0.0:
        return NO_RESIDUAL
    index = int(np.argmax(errors))
    name = entry_names(nodes.table)[index]
    text = f"{name} ends {errors[index]:.3g} from the required state, at {nodes.t[-1]:.6g} s"
    return Residual(float(errors[index]), text)


def clearance_residual(clearances: ClearanceRows, run: Trajectory) -> Residual:
    """The largest violation of the required clearance in a run, with the body or string."""
    if not len(clearances):
        return NO_RESIDUAL
    closest = clearances.clearance.least(run)
    name = f"the clearance of {clearances.clearance.pair_at(closest.q_D, closest.q_K).first}"
    size = clearances.margin - closest.distance
    return _residual(size, name, closest.t, closest.distance, clearances.margin, np.inf)


def touch_residual(approaches: tuple[ClosestApproach, ...]) -> Residual:
    """The largest distance by which a touch misses its place."""
    residuals = (
        Residual(approach.distance, f"{approach}, instead of touching it")
        for approach in approaches
    )
    return max(residuals, key=lambda approach: approach.rank, default=NO_RESIDUAL)


def no_input_note(nodes: Nodes, linear: LinearEnds, gap: Array) -> str:
    """Note on the coordinate with the largest final error if, to first order, no input moves it."""
    index = int(np.argmax(np.abs(gap)))
    rows, effect = np.eye(nodes.n_z), np.zeros(nodes.n_z)
    for A, B in zip(linear.A[::-1], linear.B[::-1], strict=True):
        effect = np.maximum(effect, np.max(np.abs(rows @ B), axis=1, initial=0.0))
        rows = rows @ A
    if effect[index] > _MAX_ROUNDING_EFFECT * np.max(effect):
        return ""
    return "; no input moves it"


def largest_residual(objective: Objective, iterate: Iterate, tolerance: float) -> str:
    """Reason why an iterate is not optimal: error at the end, violated bound, or next step."""
    bound = largest_bound_violation(objective, iterate.nodes, iterate.ends)
    end = end_residual(objective, iterate.nodes)
    largest = max(bound, end, key=lambda residual: residual.rank)
    if largest.size > max(tolerance, iterate.stationarity) or not np.isfinite(iterate.stationarity):
        return largest.text or "the search ended before a step was found"
    if iterate.solution is None:
        return "no step was found"
    nodes, (_, u, _) = iterate.nodes, objective.expanded(iterate.solution)
    i, j = np.unravel_index(int(np.argmax(np.abs(u))), u.shape)
    low, high = objective.limits(nodes.interval).acceleration[j] * np.array([-1.0, 1.0])
    return (
        f"the next step would change the acceleration of {nodes.table.v_K[j]} at {nodes.t[i]:.6g} "
        f"s, which is {nodes.acc_K[i, j]:.6g} within {low:g} to {high:g}, by {u[i, j]:.3g}"
    )


def _bound_residuals(objective: Objective, nodes: Nodes, ends: Ends) -> Iterator[Residual]:
    """The largest violation for each kind of bound."""
    limits, names = objective.limits(nodes.interval), nodes.table.v_K
    value, low, high = objective.rows.values(nodes, ends)
    violation = np.maximum(low - value, value - high)
    if violation.size:
        i, j = np.unravel_index(int(np.argmax(violation)), violation.shape)
        name, node_offset = objective.rows.names[j]
        t = nodes.t[i + node_offset]
        yield _residual(float(violation[i, j]), name, t, value[i, j], low[j], high[j])
    max_acceleration = np.broadcast_to(limits.acceleration, nodes.acc_K.shape).copy()
    max_acceleration[-1] = np.minimum(
        max_acceleration[-1], limits.jump
    )  # the acceleration jumps to 0 at the end
    positions = nodes.scalars[1:, nodes.splits[1] : nodes.splits[2]]
    for prefix, values, lowest, highest, t in (
        ("the acceleration of ", nodes.acc_K, -max_acceleration, max_acceleration, nodes.t[:-1]),
        ("the speed of ", nodes.v_K[1:], -limits.speed, limits.speed, nodes.t[1:]),
        ("", positions, limits.low, limits.high, nodes.t[1:]),
    ):
        lowest, highest = (np.broadcast_to(a, values.shape) for a in (lowest, highest))
        violation = np.maximum(lowest - values, values - highest)
        if violation.size:
            i, j = np.unravel_index(int(np.argmax(violation)), violation.shape)
            yield _residual(
                float(violation[i, j]),
                prefix + names[j],
                t[i],
                values[i, j],
                lowest[i, j],
                highest[i, j],
            )


def _residual(size: float, name: str, t: float, value: float, low: float, high: float) -> Residual:
    if size <= 0.0:
        return NO_RESIDUAL
    return Residual(
        size, f"{name} is {value:.6g} at {t:.6g} s, beyond its bounds {low:g} to {high:g}"
    )


def search_status(iterate: Iterate, limits: Limits) -> AnswerStatus:
    """Status of a search whose motion keeps its bounds and reaches its end."""
    if iterate.kkt <= limits.tolerance:
        return AnswerStatus.SOLVED
    if iterate.settled:
        return AnswerStatus.SETTLED
    if iterate.stalled:
        return AnswerStatus.STALLED
    is_late = time.perf_counter() > limits.deadline
    return AnswerStatus.TIMEOUT if is_late else AnswerStatus.ITERATIONS


def early_end_note(iterate: Iterate, limits: Limits) -> str:
    """Note on the limit that ended a search before its motion held; may be empty."""
    if time.perf_counter() > limits.deadline:
        return "; the time limit ended the search: raise time_limit"
    if iterate.iterations >= limits.iterations:
        return f"; {limits.iterations} iterations ended the search: allow more"
    return ""
