"""reach: the hanging poses nearest to places, and the bounds that limit them.

In a hanging pose, a puppet is at rest for given driven coordinates q_K: ends and lengths of its
strings. A row is a string or a joint limit with its condition h <= 0; it is taut if h = 0, and
slack otherwise. In names, D stands for dynamic coordinates, which move by the equations of motion.
A winch changes the length of a string.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, check_positive
from fantoccini.control.optimal.reached import ReachedPoses, ReachProblem
from fantoccini.control.tasks import Bounds, Interval
from fantoccini.dynamics.compiled import moving_and_carrying, refuse_contact
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import MAX_TARGETS
from fantoccini.motion import State

TargetKey: TypeAlias = str | tuple[str, tuple[float, float, float]]
"""A body, a point (x, y, z) of it, or a scalar coordinate."""

_MAX_TENSION = 100.0
"""Largest tension, relative to the weight: without a bound it grows as a limb straightens."""
_MAX_REST_ACCELERATION = 1e-3
"""Largest acceleration of a start that counts as hanging at rest [m/s^2 or rad/s^2]."""
_MAX_DISPLACEMENT = 100.0
"""Largest displacement of a driven scalar [m or rad]; far ends only turn a string's direction."""
_MIN_LENGTH = 0.01
"""Smallest length of a driven string [m]."""


def reach(
    marionette: Marionette,
    targets: Mapping[TargetKey, Any],
    start: State | None = None,
    *,
    bounds: Bounds | None = None,
    parameters: Mapping[str, Interval] | None = None,
    slack: bool = False,
    tolerance: float = 1e-6,
    iterations: int = 200,
    weights: Mapping[TargetKey, float] | None = None,
    single_pass: bool = False,
) -> ReachedPoses:
    """The hanging poses nearest to targets, of least sum_i w_i |place_i(q_D, q_K) - target_i|^2.

    In a hanging pose forces balance, taut strings have their length, the others are slack, and
    joints are within their limits. The minimum is a local one: the nearest pose that the puppet
    reaches from ``start`` without falling. With many places, the search for a pose begins at the
    earlier pose whose place is nearest, on a path the last one; if it does not reach its place, the
    search is repeated from the start.

    Args:
        marionette: the puppet.
        targets: target -> place. A body's origin, or a point of it as ``(body, (x, y, z))``, is to
            be at a place (3,), or at n places (n, 3) one after another [m]; a scalar coordinate has
            a value or (n,) values [rad or m]. NaN leaves a direction free.
        start: a state that hangs at rest, from which the search begins; ``marionette.rest()`` by
            default.
        bounds: see :class:`Bounds`; speeds, accelerations and jerks other than 0 are ignored. By
            default, driven strings are at least 1 cm long, coordinates move by at most 100 m or
            rad, and tensions are at most 100 times the weight.
        parameters: name -> lowest and highest value of parameters that may be chosen, too.
        slack: whether strings that pull at the start may go slack. Slack strings may always become
            taut.
        tolerance: tolerance of the distance [m or rad].
        iterations: largest number of iterations for one pose.
        weights: weights w_i of targets; 1 by default. Small weights of driven coordinates speed up
            the search for many places that contradict one another.
        single_pass: whether to search each pose from the last one only, never again from the start:
            faster on paths.

    Raises:
        UnknownNameError: name that the puppet does not have, or weight without a target.
        StateError: places of another shape, start that does not hang at rest or is beyond its
            bounds, or puppet with contact or winches that slip.
    """
    check_positive(tolerance=tolerance)
    refuse_contact(marionette, "reach")
    winches = [
        s.name
        for i, s in enumerate(marionette.tree.strings)
        if np.isfinite(marionette.max_forces[i])
    ]
    if winches:
        raise StateError(
            f"reach: the winch of {', '.join(winches)} may slip; leave max_tension out of the "
            "puppet and give bounds of the tension"
        )
    start = marionette.rest() if start is None else start
    marionette.check_state(start)
    start_at_rest = start.replace(v_D=np.zeros_like(start.v_D), v_K=np.zeros_like(start.v_K))
    bounds = Bounds() if bounds is None else bounds
    held_velocities = tuple(bounds.held_velocities(marionette.coordinates).values())
    bounds = replace(bounds, speed=np.inf, acceleration=np.inf, jerk=np.inf, held=held_velocities)
    if not slack:
        bounds = bounds.with_taut_strings(marionette, start_at_rest)
    bounds.check_state(marionette, start_at_rest, "at the start")
    places, arrays = _target_arrays(marionette, targets)
    arrays["weights"] = _target_weights(targets, weights or {})
    variable_bounds = _variable_bounds(marionette, start_at_rest, bounds, parameters or {})
    problem = ReachProblem(
        marionette, start_at_rest, tuple(targets), places, arrays["moves"], **variable_bounds
    )
    rows = _row_arrays(marionette, start_at_rest, variable_bounds["tension_low"])
    result = marionette.libraries.reach.find(
        places,
        {
            **arrays,
            **rows,
            **variable_bounds,
            "q_D": start_at_rest.q_D,
            "q_K": start_at_rest.q_K,
            "p": marionette.p,
            "moved": problem.low < problem.high,
        },
        weight=marionette.weight or 1.0,
        tolerance=tolerance,
        max_iterations=iterations,
        single_pass=single_pass,
    )
    poses = ReachedPoses(problem, result)
    if poses.start_is_lost:
        raise StateError(
            "reach: the puppet does not hang stably at the start: a push would make it fall; "
            "give marionette.rest(...) as the start"
        )
    return poses


def _target_arrays(
    marionette: Marionette, targets: Mapping[TargetKey, Any]
) -> tuple[Array, dict[str, np.ndarray]]:
    """Places (n, n_targets, 3), and arrays that describe the targets."""
    table, tree = marionette.coordinates, marionette.tree
    if not 0 < len(targets) <= MAX_TARGETS:
        raise StateError(f"reach: {len(targets)} targets; needed: 1 to {MAX_TARGETS}")
    bodies = [link.name for link in tree.links]
    columns = {table.q_D[q]: v for q, v in table.scalars_D}
    columns |= {table.q_K[q]: table.n_vD + v for q, v in table.scalars_K}
    links, places, points = [], [], []
    column_of_target = []
    moving_mask = np.zeros((len(targets), table.n_vD + table.n_vK), dtype=bool)
    for i, (target, place) in enumerate(targets.items()):
        name, point = target if isinstance(target, tuple) else (target, (0.0, 0.0, 0.0))
        is_body = name in bodies
        if not is_body and (name not in columns or isinstance(target, tuple)):
            raise UnknownNameError("body or coordinate", str(name), [*bodies, *columns])
        if np.shape(point) != (3,) or not np.all(np.isfinite(point)):
            raise StateError(f"reach: the point of {name} is {point!r}; needed: three numbers")
        links.append(bodies.index(name) if is_body else -1)
        column_of_target.append(-1 if is_body else columns[name])
        points.append(point)
        moving_mask[i] = moving_and_carrying(tree)[0][links[-1]] if is_body else False
        if not is_body:
            moving_mask[i, columns[name]] = True
        places.append(_place_rows(name, place, is_body))
    sizes = {len(x) for x in places if len(x) != 1}
    if len(sizes) > 1:
        raise StateError(f"reach: targets have {sorted(sizes)} places; needed: one number of them")
    n = sizes.pop() if sizes else 1
    all_places = np.stack([np.broadcast_to(x, (n, 3)) for x in places], axis=1)
    arrays = {
        "links": np.array(links),
        "columns": np.array(column_of_target),
        "at": np.array(points, dtype=float),
        "moves": moving_mask,
    }
    return all_places, arrays


def _target_weights(targets: Mapping[TargetKey, Any], weights: Mapping[TargetKey, float]) -> Array:
    """(n_targets,) weights of squared distances."""
    for target, weight in weights.items():
        if target not in targets:
            raise UnknownNameError("target", str(target), [str(key) for key in targets])
        check_positive(weight=weight)
    return np.array([weights.get(target, 1.0) for target in targets], dtype=float)


def _place_rows(name: str, place: Any, is_body: bool) -> Array:
    """(n, 3) places; for a coordinate the value is the first number, and the others are free."""
    rows = np.asarray(place, dtype=float)
    if is_body and rows.ndim in (1, 2) and rows.shape[-1] == 3 and rows.size:
        rows = rows.reshape(-1, 3)
    elif not is_body and rows.ndim < 2 and rows.size:
        free_axes = np.full((rows.size, 2), np.nan)
        rows = np.concatenate([rows.reshape(-1, 1), free_axes], axis=1)
    else:
        allowed = "(3,) or (n, 3)" if is_body else "() or (n,)"
        raise StateError(
            f"reach: the target of {name} has the shape {rows.shape}; it takes {allowed}"
        )
    if np.any(np.isinf(rows)) or np.all(np.isnan(rows)):
        raise StateError(f"reach: the target of {name} has infinite numbers, or none at all")
    return rows


def _variable_bounds(
    marionette: Marionette, x0: State, bounds: Bounds, parameters: Mapping[str, Interval]
) -> dict[str, Array]:
    """Bounds of the variables (q_K, p), of tensions and of joints."""
    table, tree = marionette.coordinates, marionette.tree
    n, k = table.n_vD, table.n_vK
    low_z, high_z = bounds.intervals(marionette)
    low = np.concatenate([low_z[2 * n : 2 * n + k], marionette.p])
    high = np.concatenate([high_z[2 * n : 2 * n + k], marionette.p])
    start_values = {v: x0.q_K[q] for q, v in table.scalars_K}
    for v, value in start_values.items():
        low[v] = value - _MAX_DISPLACEMENT if np.isneginf(low[v]) else low[v]
        high[v] = value + _MAX_DISPLACEMENT if np.isposinf(high[v]) else high[v]
    for string in tree.strings:
        if string.driven_length and (v := string.driven_length[1]) in start_values:
            low[v] = min(max(low[v], _MIN_LENGTH), start_values[v])
    for v in bounds.held_velocities(table):
        low[v] = high[v] = start_values.get(v, 0.0)
    index = marionette.parameter_index
    for name, (lower, upper) in parameters.items():
        if name not in index:
            raise UnknownNameError("parameter", name, list(index))
        if not lower <= marionette.p[index[name]] <= upper or not np.isfinite(lower + upper):
            raise StateError(
                f"reach: the parameter {name} is {marionette.p[index[name]]:g} and is to lie from "
                f"{lower:g} to {upper:g}; needed: finite bounds on both sides of it"
            )
        for bound in (lower, upper):
            marionette.with_parameters({name: bound})
        low[k + index[name]], high[k + index[name]] = lower, upper
    rows, lowest, highest = bounds.tensions(marionette)
    tension_low = np.where(marionette.two_sided, -np.inf, 0.0)
    tension_high = np.full(len(tension_low), _MAX_TENSION * (marionette.weight or 1.0))
    tension_high[len(tree.strings) :] = np.inf
    tension_low[rows] = np.where(marionette.two_sided[rows], lowest, np.maximum(lowest, 0.0))
    tension_high[rows] = highest
    return {
        "low": low,
        "high": high,
        "tension_low": tension_low,
        "tension_high": tension_high,
        "joint_low": low_z[:n],
        "joint_high": high_z[:n],
    }


def _row_arrays(marionette: Marionette, x0: State, tension_low: Array) -> dict[str, np.ndarray]:
    """Tensions at the start, the taut rows, and the rows that may become taut or slack."""
    dynamics = marionette.forward_dynamics(x0)
    tension, length_index = dynamics.tension, np.full(len(dynamics.tension), -1)
    if np.max(np.abs(dynamics.acc_D), initial=0.0) > _MAX_REST_ACCELERATION:
        raise StateError(
            "reach: the start does not hang at rest; give marionette.rest(...) as the start"
        )
    for j, string in enumerate(marionette.tree.strings):
        if string.driven_length:
            length_index[j] = string.driven_length[1]
    is_taut = (tension > 1e-9 * (marionette.weight or 1.0)) | marionette.two_sided
    may_change = ~marionette.two_sided & ~(is_taut & (tension_low > 0.0))
    return {"tension": tension, "held": is_taut, "may_change": may_change, "lengths": length_index}
