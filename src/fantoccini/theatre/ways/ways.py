"""Ways of puppets over a stage, past obstacles and past each other.

    |p(t) - o(t)| >= r + r_o,   distance(p(t), region) >= r,   p(t) within the hands' space

p is the middle of the puppet and r its radius, o and r_o are those of others. A puppet turns on the
spot and walks straight, in turn; to let others pass it begins later, or stands. It stays at its
goal, which must be free from then on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fantoccini.base import check_positive
from fantoccini.theatre.cast import Footing, Hindrance, NoWay, Way
from fantoccini.theatre.gestures import Complex
from fantoccini.theatre.ways.regions import Rectangle, Region
from fantoccini.theatre.ways.roadmap import GOAL, START, Roadmap
from fantoccini.theatre.ways.stage import HORIZON, Stage
from fantoccini.theatre.ways.traffic import Other

_RING_RADII, _N_DIRECTIONS = np.arange(1, 101) * 0.02, 24
"""Distances of alternative goals from one that cannot be reached [m], and number of directions."""
_MAX_TRIES, _MIN_SPACING = 3, 0.2
"""Number of alternative goals to try, and least distance between them [m]."""
_BATCH_SIZE = 64
"""Number of alternative goals that are checked together."""


def find_way(
    start: Footing,
    goal: Footing,
    *,
    begin: float,
    step_time: float,
    longest_step: float,
    radius: float,
    blocked: Sequence[Region] = (),
    others: Sequence[Other] = (),
    space: Rectangle | None = None,
    latest_begin: float | None = None,
) -> Way | NoWay:
    """Way with the earliest arrival; among those the shortest, then the one with the fewest turns.

    Ways lead over the corners of obstacles, places beside other players and places spread over
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

    Returns:
        The way, or the reason why there is none.

    Raises:
        ValueError: a time or a length is not greater than 0.
    """
    check_positive(step_time=step_time, longest_step=longest_step, radius=radius)
    stage = Stage(start, begin, step_time, longest_step, radius, blocked, others, space)
    failure = _check_start(stage)
    if failure is not None:
        return failure
    failure = _check_goal(stage, goal)
    if failure is None:
        way = stage.way(goal, begin if latest_begin is None else latest_begin)
        if way is not None and stage.waits(way) <= HORIZON:
            return way
        failure = _obstruction(stage, goal, way)
        if way is not None:
            return failure
    return replace(failure, nearest=_nearest(stage, goal))


def _check_start(stage: Stage) -> NoWay | None:
    """Reason why the puppet cannot leave its start; None if it can."""
    place = stage.start.place
    if not stage.space.holds(np.array(place)):
        text = "it is outside of the hands' space at the start"
        return NoWay(Hindrance.START_BLOCKED, text)
    near = stage.too_near(place, stage.begin)
    if near is None:
        return None
    text = (
        f"it is too near to {near.name} at the start: its middle is {near.distance:.3f} m from "
        f"it; needed: {near.needed:.3f} m"
    )
    return NoWay(Hindrance.START_BLOCKED, text, (near.name,))


def _check_goal(stage: Stage, goal: Footing) -> NoWay | None:
    """Reason why the puppet cannot stay at a goal; None if it can."""
    outside = abs(stage.space.nearest(goal.place) - goal.place)
    if not stage.space.holds(np.array(goal.place)):
        text = f"the place is {outside:.2f} m outside of the hands' space"
        return NoWay(Hindrance.GOAL_OUTSIDE, text)
    near = stage.too_near(goal.place, np.inf)
    if near is None:
        return None
    name = near.name
    if name in {region.name for region in stage.blocked}:
        return NoWay(Hindrance.GOAL_BLOCKED, f"{name} is there", (name,))
    return NoWay(Hindrance.GOAL_OCCUPIED, f"{name} stands there when it would arrive", (name,))


def _obstruction(stage: Stage, goal: Footing, late: Way | None) -> NoWay:
    """Reason why no way leads to a goal in time; ``late`` is a way that takes too long."""
    movers = tuple(mover.name for mover in stage.movers)
    roadmap = stage.roadmap(goal)
    if not np.any(np.isfinite(roadmap.cost_to_goal[START])):
        names = _walls(stage, roadmap)
        return NoWay(Hindrance.NO_WAY_ROUND, f"no way leads round {_listed(names)}", names)
    if late is None:
        text = f"{_listed(movers)} {_verb(movers)} in the way, and no way leads past"
        return NoWay(Hindrance.OTHERS_IN_THE_WAY, text, movers)
    text = f"{_listed(movers)} {_verb(movers)} in the way"
    return NoWay(Hindrance.OTHERS_IN_THE_WAY, text, movers, earliest=late.end)


def _walls(stage: Stage, roadmap: Roadmap) -> tuple[str, ...]:
    """Players or obstacles whose removal alone clears the way; all if there is none."""
    names = []
    for k, region in enumerate(roadmap.standing):
        if roadmap.reached(roadmap.open[:k] + roadmap.open[k + 1 :])[GOAL]:
            names.append(region.name)
    # Players can be moved, obstacles cannot.
    fixed = {region.name for region in stage.blocked}
    movable = [name for name in names if name not in fixed]
    return tuple(dict.fromkeys(movable or names or [region.name for region in roadmap.standing]))


def _nearest(stage: Stage, goal: Footing) -> Footing | None:
    """Reachable footing about as near to a goal as possible; None after ``_MAX_TRIES`` failures."""
    tried: list[complex] = []
    for place in _free_places(stage, goal):
        if any(abs(place - option) < _MIN_SPACING for option in tried):
            continue
        footing = Footing(place.real, place.imag, goal.heading)
        way = stage.way(footing, stage.begin)
        if way is not None and stage.waits(way) <= HORIZON:
            return footing
        tried.append(place)
        if len(tried) == _MAX_TRIES:
            break
    return None


def _free_places(stage: Stage, goal: Footing) -> Iterator[complex]:
    """Places that are free at the end, and reached past everything that stands."""
    roadmap = stage.roadmap(stage.start)
    # Players that arrive later count too, unless they shut the puppet in: it can leave before.
    standing = stage.final_regions if stage.is_free(roadmap.points[:1])[0] else stage.standing
    first, last = np.broadcast_arrays(roadmap.points[:, None], roadmap.points)
    reached = roadmap.points[roadmap.reached([stage.are_open(standing, first, last)])]
    directions = np.exp(2j * np.pi / _N_DIRECTIONS * np.arange(_N_DIRECTIONS))
    rings = goal.place + (_RING_RADII[:, None] * directions).ravel()
    places = np.concatenate([[stage.space.nearest(goal.place)], rings, reached])
    places = places[stage.is_free(places)]
    places = places[np.argsort(np.round(np.abs(places - goal.place), 9), kind="stable")]
    for k in range(0, len(places), _BATCH_SIZE):
        batch: Complex = places[k : k + _BATCH_SIZE]
        first, last = np.broadcast_arrays(reached[:, None], batch)
        is_open = np.any(stage.are_open(standing, first, last), axis=0)
        yield from (complex(place) for place in batch[is_open])


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _verb(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"
