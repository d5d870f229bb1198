"""Ways of puppets over a stage, past what stands there and past each other.

    |p(t) - o(t)| >= r + r_o,   distance(p(t), region) >= r,   p(t) within the hands' space

p is the middle of the puppet, r its radius, o those of others. A puppet turns on the spot, walks
straight, and so on; it begins later, or stands, to let others pass. Where it is to be at the end,
it stays: the place must be free from then on.
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

_RINGS, _DIRECTIONS = np.arange(1, 101) * 0.02, 24
"""Where a goal is moved to if it cannot be reached: distances [m], and how many directions."""
_TRIES, _APART = 3, 0.2
"""Other goals that are tried, and how far they are from each other [m]."""
_AT_ONCE = 64
"""Other goals that are looked at at once."""


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
    """The way that arrives first; of those the shortest, of those the one with fewest turns.

    That is among ways over the corners of obstacles, places beside others and places spread over
    the stage. Checked at samples 20 ms apart, until all others stand, two who pass are never
    closer than their radii, but for 0.01 mm.

    Args:
        start, goal: from where to where.
        begin: earliest time of the first step [s].
        step_time: of each step [s].
        longest_step: [m].
        radius: of the puppet, its sway included [m].
        blocked: convex parts of the stage to stay clear of.
        others: who else is on the stage, at all times.
        space: where the middle must stay; everywhere when not given.
        latest_begin: until when it waits before its first step; later it stands, in steps that do
            not move. When not given, ``begin`` [s].

    Returns:
        The way, or why there is none.

    Raises:
        ValueError: a time or a length is not greater than 0.
    """
    check_positive(step_time=step_time, longest_step=longest_step, radius=radius)
    stage = Stage(start, begin, step_time, longest_step, radius, blocked, others, space)
    trouble = _at_the_start(stage)
    if trouble is not None:
        return trouble
    trouble = _at_the_goal(stage, goal)
    if trouble is None:
        found = stage.way(goal, begin if latest_begin is None else latest_begin)
        if found is not None and stage.waits(found) <= HORIZON:
            return found
        trouble = _between(stage, goal, found)
        if found is not None:
            return trouble
    return replace(trouble, nearest=_nearest(stage, goal))


def _at_the_start(stage: Stage) -> NoWay | None:
    place = stage.start.place
    if not stage.space.holds(np.array(place)):
        text = "it is outside of the hands' space at the start"
        return NoWay(Hindrance.START_BLOCKED, text)
    name = stage.too_near(place, stage.begin)
    if name is None:
        return None
    return NoWay(Hindrance.START_BLOCKED, f"it is too near to {name} at the start", (name,))


def _at_the_goal(stage: Stage, goal: Footing) -> NoWay | None:
    outside = abs(stage.space.nearest(goal.place) - goal.place)
    if not stage.space.holds(np.array(goal.place)):
        text = f"the place is {outside:.2f} m outside of the hands' space"
        return NoWay(Hindrance.GOAL_OUTSIDE, text)
    name = stage.too_near(goal.place, np.inf)
    if name is None:
        return None
    if name in {region.name for region in stage.blocked}:
        return NoWay(Hindrance.GOAL_BLOCKED, f"{name} is there", (name,))
    return NoWay(Hindrance.GOAL_OCCUPIED, f"{name} stands there when it would arrive", (name,))


def _between(stage: Stage, goal: Footing, late: Way | None) -> NoWay:
    movers = tuple(mover.name for mover in stage.movers)
    roadmap = stage.roadmap(goal)
    if not np.any(np.isfinite(roadmap.rest[START])):
        names = _walls(stage, roadmap)
        return NoWay(Hindrance.NO_WAY_ROUND, f"no way leads round {_listed(names)}", names)
    if late is None:
        text = f"{_listed(movers)} {_verb(movers)} in the way, and no way leads past"
        return NoWay(Hindrance.OTHERS_IN_THE_WAY, text, movers)
    text = f"{_listed(movers)} {_verb(movers)} in the way; it could be there at {late.end:.1f} s"
    return NoWay(Hindrance.OTHERS_IN_THE_WAY, text, movers, earliest=late.end)


def _walls(stage: Stage, roadmap: Roadmap) -> tuple[str, ...]:
    """Whoever or whatever it is enough to take away; all things where none is enough."""
    names = []
    for k, one in enumerate(roadmap.standing):
        if roadmap.reached(roadmap.open[:k] + roadmap.open[k + 1 :])[GOAL]:
            names.append(one.name)
    # Others are more easily sent away than walls.
    fixed = {region.name for region in stage.blocked}
    movable = [name for name in names if name not in fixed]
    return tuple(dict.fromkeys(movable or names or [region.name for region in roadmap.standing]))


def _nearest(stage: Stage, goal: Footing) -> Footing | None:
    """About the nearest footing to a goal to which there is a way."""
    tried: list[complex] = []
    for place in _free_places(stage, goal):
        if any(abs(place - option) < _APART for option in tried):
            continue
        footing = Footing(place.real, place.imag, goal.heading)
        found = stage.way(footing, stage.begin)
        if found is not None and stage.waits(found) <= HORIZON:
            return footing
        tried.append(place)
        if len(tried) == _TRIES:
            break
    return None


def _free_places(stage: Stage, goal: Footing) -> Iterator[complex]:
    """Places where nothing stands at last, that are reached past all that stands."""
    roadmap = stage.roadmap(stage.start)
    # Past those who come as well, unless it would then be shut in: it can leave before.
    standing = stage.at_last if stage.is_free(roadmap.points[:1])[0] else stage.standing
    first, last = np.broadcast_arrays(roadmap.points[:, None], roadmap.points)
    known = roadmap.points[roadmap.reached([stage.are_open(standing, first, last)])]
    around = np.exp(2j * np.pi / _DIRECTIONS * np.arange(_DIRECTIONS))
    rings = goal.place + (_RINGS[:, None] * around).ravel()
    places = np.concatenate([[stage.space.nearest(goal.place)], rings, known])
    places = places[stage.is_free(places)]
    places = places[np.argsort(np.round(np.abs(places - goal.place), 9), kind="stable")]
    for k in range(0, len(places), _AT_ONCE):
        some: Complex = places[k : k + _AT_ONCE]
        first, last = np.broadcast_arrays(known[:, None], some)
        seen = np.any(stage.are_open(standing, first, last), axis=0)
        yield from (complex(place) for place in some[seen])


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _verb(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"
