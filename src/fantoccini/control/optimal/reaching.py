"""reach: the hanging poses that come nearest to places, and what keeps them from there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, check_positive
from fantoccini.control.optimal.reached import ReachedPoses, ReachProblem
from fantoccini.control.tasks import Bounds, Interval
from fantoccini.dynamics.compiled import refuse_contact, relations
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import MAX_TARGETS
from fantoccini.motion import State

What: TypeAlias = str | tuple[str, tuple[float, float, float]]
"""A body, a point (x, y, z) of it, or a scalar coordinate."""

_MOST_TENSION = 100.0
"""Largest tension, relative to the weight: a limb that is pulled straight asks for ever more."""
_AT_REST = 1e-3
"""Largest acceleration of a start that hangs at rest [m/s^2 or rad/s^2]."""
_FARTHEST = 100.0
"""Farthest that a driven scalar moves [m or rad]: far ends only turn a string's direction."""
_SHORTEST = 0.01
"""Shortest length of a driven string [m]."""


def reach(
    marionette: Marionette,
    targets: Mapping[What, Any],
    start: State | None = None,
    *,
    bounds: Bounds | None = None,
    parameters: Mapping[str, Interval] | None = None,
    slack: bool = False,
    tolerance: float = 1e-6,
    iterations: int = 200,
    weights: Mapping[What, float] | None = None,
    once: bool = False,
) -> ReachedPoses:
    """min sum_i w_i |place_i(q_D, q_K) - target_i|^2 over the q_K with which the puppet hangs.

    The pose hangs: forces balance, strings that pull have their length, the others are slack, and
    joints are within their limits. The minimum is a local one: the nearest pose that the puppet
    passes into from ``start`` without falling. Of many places each pose begins at the one found
    before whose place is nearest, on a path the last; one that is not reached is looked for from
    the start as well.

    Args:
        marionette: the puppet.
        targets: what -> where. A body's origin, or a point of it as ``(body, (x, y, z))``, is to be
            at a place (3,), or at n places (n, 3) one after the other [m]; a scalar coordinate has
            a value or (n,) values [rad or m]. NaN leaves a direction free.
        start: a state that hangs at rest, from which the search begins; ``marionette.rest()`` when
            not given.
        bounds: see :class:`Bounds`; speeds, accelerations and jerks have no part. Driven strings
            are at least 1 cm long; coordinates move by 100 m or rad at most, and tensions are at
            most 100 times the weight, when not given.
        parameters: name -> lowest and highest value: numbers of the puppet that may be chosen too.
        slack: whether strings that pull at the start may go slack. Slack ones may always begin to
            pull.
        tolerance: of the distance [m or rad].
        iterations: at most, of one pose.
        weights: w_i of targets; 1 where not given. With light targets of driven coordinates many
            places that contradict one another are found quickly.
        once: whether each pose is looked for from the last one only, and not again where it is not
            reached: faster on paths.

    Raises:
        UnknownNameError: a name that the puppet does not have, or a weight of no target.
        StateError: places of another shape, a start that does not hang at rest or is beyond its
            bounds, or a puppet with contact or winches that slip.
    """
    check_positive(tolerance=tolerance)
    refuse_contact(marionette, "reach")
    winches = [
        s.name for i, s in enumerate(marionette.tree.strings) if np.isfinite(marionette.upper[i])
    ]
    if winches:
        raise StateError(
            f"reach: the winch of {', '.join(winches)} may slip; leave max_tension out of the "
            "puppet and give bounds of the tension"
        )
    start = marionette.rest() if start is None else start
    marionette.check_state(start)
    still = start.replace(v_D=np.zeros_like(start.v_D), v_K=np.zeros_like(start.v_K))
    bounds = Bounds() if bounds is None else bounds
    bounds = replace(bounds, speed=np.inf, acceleration=np.inf, jerk=np.inf)
    if not slack:
        bounds = bounds.staying_taut(marionette, still)
    bounds.check_state(marionette, still, "at the start")
    places, arrays = _targets(marionette, targets)
    arrays["weights"] = _weights(targets, weights or {})
    chosen = _chosen(marionette, still, bounds, parameters or {})
    problem = ReachProblem(marionette, still, tuple(targets), places, arrays["moves"], **chosen)
    rows = _rows(marionette, still, chosen["tension_low"])
    found = marionette.libraries.reach.find(
        places,
        {
            **arrays,
            **rows,
            **chosen,
            "q_D": still.q_D,
            "q_K": still.q_K,
            "p": marionette.p,
            "moved": problem.low < problem.high,
        },
        weight=marionette.weight or 1.0,
        tolerance=tolerance,
        max_iterations=iterations,
        once=once,
    )
    made = ReachedPoses(problem, found)
    if made.is_lost:
        raise StateError(
            "reach: the puppet does not hang stably at the start: a push would make it fall; "
            "give marionette.rest(...) as the start"
        )
    return made


def _targets(
    marionette: Marionette, targets: Mapping[What, Any]
) -> tuple[Array, dict[str, np.ndarray]]:
    """Places (n, n_targets, 3), and what is to be there."""
    table, tree = marionette.coordinates, marionette.tree
    if not 0 < len(targets) <= MAX_TARGETS:
        raise StateError(f"reach: {len(targets)} targets; needed: 1 to {MAX_TARGETS}")
    bodies = [link.name for link in tree.links]
    columns = {table.q_D[q]: v for q, v in table.scalars_D}
    columns |= {table.q_K[q]: table.n_vD + v for q, v in table.scalars_K}
    links, places, at = [], [], []
    of_coordinates, moves = [], np.zeros((len(targets), table.n_vD + table.n_vK), dtype=bool)
    for i, (what, place) in enumerate(targets.items()):
        name, point = what if isinstance(what, tuple) else (what, (0.0, 0.0, 0.0))
        is_body = name in bodies
        if not is_body and (name not in columns or isinstance(what, tuple)):
            raise UnknownNameError("body or coordinate", str(name), [*bodies, *columns])
        if np.shape(point) != (3,) or not np.all(np.isfinite(point)):
            raise StateError(f"reach: the point of {name} is {point!r}; needed: three numbers")
        links.append(bodies.index(name) if is_body else -1)
        of_coordinates.append(-1 if is_body else columns[name])
        at.append(point)
        moves[i] = relations(tree)[0][links[-1]] if is_body else False
        if not is_body:
            moves[i, columns[name]] = True
        places.append(_places(name, place, is_body))
    sizes = {len(x) for x in places if len(x) != 1}
    if len(sizes) > 1:
        raise StateError(f"reach: targets have {sorted(sizes)} places; needed: one number of them")
    n = sizes.pop() if sizes else 1
    whole = np.stack([np.broadcast_to(x, (n, 3)) for x in places], axis=1)
    numbers = {
        "links": np.array(links),
        "columns": np.array(of_coordinates),
        "at": np.array(at, dtype=float),
        "moves": moves,
    }
    return whole, numbers


def _weights(targets: Mapping[What, Any], weights: Mapping[What, float]) -> Array:
    """(n_targets,) weights of squared distances."""
    for what, weight in weights.items():
        if what not in targets:
            raise UnknownNameError("target", str(what), [str(one) for one in targets])
        check_positive(weight=weight)
    return np.array([weights.get(what, 1.0) for what in targets], dtype=float)


def _places(name: str, place: Any, is_body: bool) -> Array:
    """(n, 3) places; of a coordinate the value is the first, the others are free."""
    found = np.asarray(place, dtype=float)
    if is_body and found.ndim in (1, 2) and found.shape[-1] == 3 and found.size:
        found = found.reshape(-1, 3)
    elif not is_body and found.ndim < 2 and found.size:
        free = np.full((found.size, 2), np.nan)
        found = np.concatenate([found.reshape(-1, 1), free], axis=1)
    else:
        needed = "(3,) or (n, 3)" if is_body else "() or (n,)"
        raise StateError(
            f"reach: the target of {name} has the shape {found.shape}; it takes {needed}"
        )
    if np.any(np.isinf(found)) or np.all(np.isnan(found)):
        raise StateError(f"reach: the target of {name} has infinite numbers, or none at all")
    return found


def _chosen(
    marionette: Marionette, x0: State, bounds: Bounds, parameters: Mapping[str, Interval]
) -> dict[str, Array]:
    """Bounds of what is chosen: (q_K, p), of tensions and of joints."""
    table, tree = marionette.coordinates, marionette.tree
    n, k = table.n_vD, table.n_vK
    low_z, high_z = bounds.intervals(marionette)
    low = np.concatenate([low_z[2 * n : 2 * n + k], marionette.p])
    high = np.concatenate([high_z[2 * n : 2 * n + k], marionette.p])
    now = {v: x0.q_K[q] for q, v in table.scalars_K}
    for v, value in now.items():
        low[v] = value - _FARTHEST if np.isneginf(low[v]) else low[v]
        high[v] = value + _FARTHEST if np.isposinf(high[v]) else high[v]
    for string in tree.strings:
        if string.driven_length and (v := string.driven_length[1]) in now:
            low[v] = min(max(low[v], _SHORTEST), now[v])
    for name in bounds.held:
        v = table.v_K.index(name)
        low[v] = high[v] = now.get(v, 0.0)
    index = marionette.parameter_index
    for name, (a, b) in parameters.items():
        if name not in index:
            raise UnknownNameError("parameter", name, list(index))
        if not a <= marionette.p[index[name]] <= b or not np.isfinite(a + b):
            raise StateError(
                f"reach: the parameter {name} is {marionette.p[index[name]]:g} and is to lie from "
                f"{a:g} to {b:g}; needed: finite bounds that it lies between"
            )
        for end in (a, b):
            marionette.with_parameters({name: end})
        low[k + index[name]], high[k + index[name]] = a, b
    rows, least, most = bounds.tensions(marionette)
    tension_low = np.where(marionette.two_sided, -np.inf, 0.0)
    tension_high = np.full(len(tension_low), _MOST_TENSION * (marionette.weight or 1.0))
    tension_high[len(tree.strings) :] = np.inf
    tension_low[rows] = np.where(marionette.two_sided[rows], least, np.maximum(least, 0.0))
    tension_high[rows] = most
    return {
        "low": low,
        "high": high,
        "tension_low": tension_low,
        "tension_high": tension_high,
        "joint_low": low_z[:n],
        "joint_high": high_z[:n],
    }


def _rows(marionette: Marionette, x0: State, least: Array) -> dict[str, np.ndarray]:
    """Tensions at the start, which rows pull there, and which may begin or cease to."""
    found = marionette.forward_dynamics(x0)
    tension, lengths = found.tension, np.full(len(found.tension), -1)
    if np.max(np.abs(found.acc_D), initial=0.0) > _AT_REST:
        raise StateError(
            "reach: the start does not hang at rest; give marionette.rest(...) as the start"
        )
    for j, string in enumerate(marionette.tree.strings):
        if string.driven_length:
            lengths[j] = string.driven_length[1]
    held = (tension > 1e-9 * (marionette.weight or 1.0)) | marionette.two_sided
    may_change = ~marionette.two_sided & ~(held & (least > 0.0))
    return {"tension": tension, "held": held, "may_change": may_change, "lengths": lengths}
