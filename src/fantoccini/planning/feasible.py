"""Goals that no plan can reach, recognised before the search."""

from __future__ import annotations

import numpy as np

from fantoccini.planning.goals import Goal
from fantoccini.runtime import POINT, POSE
from fantoccini.tree import WORLD

_TRANSLATING = ("prismatic", "translation", "free")
"""Kinds of joints that change the distance of a body from its parent."""


def out_of_reach(goal: Goal, tolerance: float) -> str:
    """Why a goal is out of reach; empty where it may be within.

    Either a pose is beyond a joint's limits, or a point is farther from the root of its chain of
    bodies than the chain is long. Goals that only strings or obstacles prevent are not recognised.

    Args:
        goal: of the plan.
        tolerance: of its distance.
    """
    if goal.numbers.kind == POSE:
        return _beyond_limits(goal, tolerance)
    return _too_far(goal, tolerance) if goal.numbers.kind == POINT else ""


def _beyond_limits(goal: Goal, tolerance: float) -> str:
    numbers, tree = goal.numbers, goal.marionette.tree
    for limit in tree.limits:
        link = tree.links[limit.link]
        if limit.side not in ("lower", "upper") or link.kind not in ("revolute", "prismatic"):
            continue
        weight = numbers.weight[link.v.start]
        if not weight:
            continue
        low, high = numbers.low[link.q.start], numbers.high[link.q.start]
        over = low - limit.bound if limit.side == "upper" else limit.bound - high
        if weight * over > tolerance:
            wanted = f"{low:g}" if low == high else f"{low:g} to {high:g}"
            return (
                f"{link.joint} is to be at {wanted}, beyond its {limit.side} limit "
                f"{limit.bound:g} by more than the tolerance"
            )
    return ""


def _too_far(goal: Goal, tolerance: float) -> str:
    numbers, marionette = goal.numbers, goal.marionette
    links, at = marionette.tree.links, numbers.link
    reach = float(np.linalg.norm(numbers.at))
    while True:
        link = links[at]
        if link.kind in _TRANSLATING:
            return ""
        offset = np.array([marionette.model.number(x) for x in link.offset])
        if link.parent == WORLD:
            break
        reach += float(np.linalg.norm(offset))
        at = link.parent
    away = float(np.linalg.norm(offset - np.clip(offset, numbers.place, numbers.place_high)))
    if away <= reach + tolerance:
        return ""
    return (
        f"the place is {away:.3g} m from {link.joint}, and {links[numbers.link].name} reaches no "
        f"farther than {reach:.3g} m"
    )
