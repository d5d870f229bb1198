"""Ways of puppets over a stage, past obstacles and past each other.

    |p(t) - o(t)| >= r + r_o,   distance(p(t), region) >= r,   p(t) within the hands' space

p is the middle of the puppet and r its radius, o and r_o are those of others. A puppet turns on the
spot and walks straight, in turn; to let others pass it begins later, or stands. It stays at its
goal, which must be free from then on.

A footing is a place on the stage with a heading, the angle of the forward direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fantoccini.base import check_positive
from fantoccini.theatre.cast import Footing, Hindrance, NoPath, Walk
from fantoccini.theatre.gestures import Complex
from fantoccini.theatre.pathfinding.regions import Rectangle, Region
from fantoccini.theatre.pathfinding.roadmap import GOAL, START, Roadmap
from fantoccini.theatre.pathfinding.stage import HORIZON, WalkProblem
from fantoccini.theatre.pathfinding.traffic import OtherPlayer

_RING_RADII, _N_DIRECTIONS = np.arange(1, 101) * 0.02, 24
"""Distances of alternative goals from one that cannot be reached [m], and number of directions."""
_MAX_ALTERNATIVES, _MIN_SPACING = 3, 0.2
"""Number of alternative goals to try, and least distance between them [m]."""
_BATCH_SIZE = 64
"""Number of alternative goals that are checked together."""


def plan_walk(
    start: Footing,
    goal: Footing,
    *,
    begin: float,
    step_time: float,
    longest_step: float,
    radius: float,
    blocked: Sequence[Region] = (),
    others: Sequence[OtherPlayer] = (),
    space: Rectangle | None = None,
    latest_begin: float | None = None,
    pauses: tuple[int, int] = (0, 0),
) -> Walk | NoPath:
    """Walk with the earliest arrival; among those the shortest, then the one with the fewest turns.

    Walks turn at corners of obstacles, at places next to other players and at places spread over
    the stage. At samples 20 ms apart, until all others stand, two players that pass each other are
    at most 0.01 mm closer than their radii.

    Args:
        start, goal: footings at its ends.
        begin: earliest time of the first step [s].
        step_time: duration of a step [s].
        longest_step: longest step [m].
        radius: radius of the puppet, including its sway [m].
        blocked: convex parts of the stage to keep clear of.
        others: other players on the stage, at all times.
        space: bounds of the puppet's middle; none by default.
        latest_begin: latest time of the first step; longer waits are steps that do not move;
            ``begin`` by default [s].
        pauses: see :class:`Walk`.

    Returns:
        The walk, or the reason why no walk exists.

    Raises:
        ValueError: a time or a length is not greater than 0.
    """
    check_positive(step_time=step_time, longest_step=longest_step, radius=radius)
    problem = WalkProblem(
        start, begin, step_time, longest_step, radius, blocked, others, space, pauses
    )
    failure = _start_obstruction(problem)
    if failure is not None:
        return failure
    failure = _goal_obstruction(problem, goal)
    if failure is None:
        walk = problem.find_walk(goal, begin if latest_begin is None else latest_begin)
        if walk is not None and problem.n_waiting_steps(walk) <= HORIZON:
            return walk
        failure = _obstruction(problem, goal, walk)
        if walk is not None:
            return failure
    return replace(failure, nearest=_nearest(problem, goal))


def _start_obstruction(problem: WalkProblem) -> NoPath | None:
    """Reason why the puppet cannot leave its start; None if it can."""
    place = problem.start.place
    if not problem.space.holds(np.array(place)):
        text = "it is outside of the hands' space at the start"
        return NoPath(Hindrance.START_BLOCKED, text)
    obstruction = problem.too_near(place, problem.begin)
    if obstruction is None:
        return None
    text = (
        f"it is too near to {obstruction.name} at the start: its middle is "
        f"{obstruction.distance:.3f} m from it; needed: {obstruction.needed:.3f} m"
    )
    return NoPath(Hindrance.START_BLOCKED, text, (obstruction.name,))


def _goal_obstruction(problem: WalkProblem, goal: Footing) -> NoPath | None:
    """Reason why the puppet cannot stay at a goal; None if it can."""
    distance = abs(problem.space.nearest(goal.place) - goal.place)
    if not problem.space.holds(np.array(goal.place)):
        text = f"the place is {distance:.2f} m outside of the hands' space"
        return NoPath(Hindrance.GOAL_OUTSIDE, text)
    obstruction = problem.too_near(goal.place, np.inf)
    if obstruction is None:
        return None
    name = obstruction.name
    if name in {region.name for region in problem.blocked}:
        return NoPath(Hindrance.GOAL_BLOCKED, f"{name} is there", (name,))
    return NoPath(Hindrance.GOAL_OCCUPIED, f"{name} stands there when it would arrive", (name,))


def _obstruction(problem: WalkProblem, goal: Footing, late_walk: Walk | None) -> NoPath:
    """Reason why no walk reaches a goal in time; ``late_walk`` is a walk that takes too long."""
    mover_names = tuple(mover.name for mover in problem.movers)
    roadmap = problem.roadmap(goal)
    if not np.any(np.isfinite(roadmap.cost_to_goal[START])):
        blocking_names = _blocking_names(problem, roadmap)
        return NoPath(
            Hindrance.NO_WAY_ROUND, f"no way leads round {_listed(blocking_names)}", blocking_names
        )
    if late_walk is None:
        text = f"{_listed(mover_names)} {_is_or_are(mover_names)} in the way, and no way leads past"
        return NoPath(Hindrance.OTHERS_IN_THE_WAY, text, mover_names)
    text = f"{_listed(mover_names)} {_is_or_are(mover_names)} in the way"
    return NoPath(Hindrance.OTHERS_IN_THE_WAY, text, mover_names, earliest=late_walk.end)


def _blocking_names(problem: WalkProblem, roadmap: Roadmap) -> tuple[str, ...]:
    """Players or obstacles that each block the goal alone; all of them if no one does."""
    names = []
    for k, region in enumerate(roadmap.obstacles):
        if roadmap.reached(roadmap.clear_legs[:k] + roadmap.clear_legs[k + 1 :])[GOAL]:
            names.append(region.name)
    # Players can be moved, obstacles cannot.
    fixed_names = {region.name for region in problem.blocked}
    movable_names = [name for name in names if name not in fixed_names]
    return tuple(
        dict.fromkeys(movable_names or names or [region.name for region in roadmap.obstacles])
    )


def _nearest(problem: WalkProblem, goal: Footing) -> Footing | None:
    """Reachable footing that is about the nearest to a goal; None if none of a few is reachable."""
    tried_places: list[complex] = []
    for place in _free_places(problem, goal):
        if any(abs(place - tried_place) < _MIN_SPACING for tried_place in tried_places):
            continue
        footing = Footing(place.real, place.imag, goal.heading)
        walk = problem.find_walk(footing, problem.begin)
        if walk is not None and problem.n_waiting_steps(walk) <= HORIZON:
            return footing
        tried_places.append(place)
        if len(tried_places) == _MAX_ALTERNATIVES:
            break
    return None


def _free_places(problem: WalkProblem, goal: Footing) -> Iterator[complex]:
    """Places that are free at the end, and reached past everything that stands."""
    roadmap = problem.roadmap(problem.start)
    # Players that arrive later count too, unless they shut the puppet in: it can leave before.
    standing = problem.final_regions if problem.is_free(roadmap.points[:1])[0] else problem.standing
    leg_starts, leg_ends = np.broadcast_arrays(roadmap.points[:, None], roadmap.points)
    reached_points = roadmap.points[
        roadmap.reached([problem.are_legs_clear(standing, leg_starts, leg_ends)])
    ]
    directions = np.exp(2j * np.pi / _N_DIRECTIONS * np.arange(_N_DIRECTIONS))
    rings = goal.place + (_RING_RADII[:, None] * directions).ravel()
    places = np.concatenate([[problem.space.nearest(goal.place)], rings, reached_points])
    places = places[problem.is_free(places)]
    places = places[np.argsort(np.round(np.abs(places - goal.place), 9), kind="stable")]
    for k in range(0, len(places), _BATCH_SIZE):
        batch: Complex = places[k : k + _BATCH_SIZE]
        leg_starts, leg_ends = np.broadcast_arrays(reached_points[:, None], batch)
        is_open = np.any(problem.are_legs_clear(standing, leg_starts, leg_ends), axis=0)
        yield from (complex(place) for place in batch[is_open])


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _is_or_are(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"
