"""Least distances over a run of a play, between players, obstacles, the floor and strings.

q_D are dynamic coordinates, q_K driven ones (ends and lengths of strings). A link is a body on its
joint.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

from fantoccini.dynamics.clearance import Clearance, Path, StringDistances
from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import Cast
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE

MAX_STRING_DISTANCE = 0.3
"""Largest distance at which strings are listed [m]."""


@dataclass(frozen=True)
class OwnerClearance:
    """Least distance between two owners: players, obstacles or the floor.

    Attributes:
        owners: owners of the two bodies or strings.
        first, second: names of the nearest two: bodies, ``string pierrot.head``, obstacles.
        distance: distance between them [m]; below 0 they overlap.
        t: time of the least distance [s].
    """

    owners: tuple[str, str]
    first: str
    second: str
    distance: float
    t: float

    @property
    def is_of_string(self) -> bool:
        """Whether one of the two is a string."""
        return self.first.startswith("string ") or self.second.startswith("string ")


def clearances(cast: Cast, run: Trajectory) -> tuple[OwnerClearance, ...]:
    """Least distance between every two owners over a run: bodies first, then strings.

    Bodies are listed at any distance, strings up to :data:`MAX_STRING_DISTANCE` from strings and
    bodies. For each string, the nearest obstacle is listed at any distance.

    Args:
        cast: cast of the play.
        run: run of the stage, measured at every fourth sample, and in between as needed.
    """
    path = Path.from_run(cast.marionette, run, SAMPLE_STRIDE)
    bodies = _nearest(_body_clearances(cast, path))
    strings = _nearest(_string_clearances(cast, path))
    return (*bodies, *strings)


def _nearest(entries: Iterable[OwnerClearance]) -> list[OwnerClearance]:
    """The smallest distance of every two owners, in order of distance."""
    nearest_of_owners: dict[frozenset[str], OwnerClearance] = {}
    for entry in sorted(entries, key=lambda entry: entry.distance):
        nearest_of_owners.setdefault(frozenset(entry.owners), entry)
    return list(nearest_of_owners.values())


def _body_clearances(cast: Cast, path: Path) -> Iterator[OwnerClearance]:
    """Least distance between the bodies of every two owners."""
    marionette = cast.marionette
    links = [link.name for link in marionette.tree.links]
    names = dict.fromkeys(
        [*links, *(obstacle.name for obstacle in Clearance(marionette).obstacles)]
    )
    owner = {name: cast.owner(name) for name in names}
    moving_owners = {owner[name] for name in links}
    pairs = [frozenset(pair) for pair in combinations(names, 2)]
    for first_owner, second_owner in combinations(dict.fromkeys(owner.values()), 2):
        if not moving_owners & {first_owner, second_owner}:
            continue
        not_measured = [
            pair for pair in pairs if {owner[name] for name in pair} != {first_owner, second_owner}
        ]
        clearance = Clearance(marionette, strings=False, free=not_measured)
        if clearance.measures_nothing:
            continue
        nearest = clearance.least(path)
        pair = clearance.pair_at(nearest.q_D, nearest.q_K)
        yield OwnerClearance(
            (first_owner, second_owner), pair.first, pair.second, nearest.distance, nearest.t
        )


def _string_clearances(cast: Cast, path: Path) -> Iterator[OwnerClearance]:
    """Distances of strings from strings and bodies of other players, and from obstacles."""
    approaches = (
        StringDistances(cast.marionette, own=False)
        .motion(path.q_D, path.q_K, path.t)
        .nearest(MAX_STRING_DISTANCE)
    )
    for pair in (*approaches.strings, *approaches.bodies):
        if {pair.first, pair.second} & {*cast.file.leashes}:
            continue
        owners = cast.owner(pair.first), cast.owner(pair.second)
        second = f"string {pair.second}" if pair in approaches.strings else pair.second
        yield OwnerClearance(owners, f"string {pair.first}", second, pair.distance, pair.t)
    for name, part in Clearance(cast.marionette).parts().items():
        string = name.removeprefix("string ")
        if string == name or string in cast.file.leashes:
            continue
        nearest = part.least(path)
        second = part.pair_at(nearest.q_D, nearest.q_K).second
        owners = cast.owner(string), second
        yield OwnerClearance(owners, name, second, nearest.distance, nearest.t)
