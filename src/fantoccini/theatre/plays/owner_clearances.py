"""Least distances over a run of a play, between players, obstacles, the floor and strings."""

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
        what, other: names of the nearest two: bodies, ``string pierrot.head``, obstacles.
        distance: distance between them [m]; below 0 they overlap.
        t: time of the least distance [s].
    """

    owners: tuple[str, str]
    what: str
    other: str
    distance: float
    t: float

    @property
    def of_strings(self) -> bool:
        """Whether one of the two is a string."""
        return self.what.startswith("string ") or self.other.startswith("string ")


def clearances(cast: Cast, run: Trajectory) -> tuple[OwnerClearance, ...]:
    """Least distance between every two owners over a run: bodies first, then strings.

    Bodies are listed at any distance, strings up to :data:`MAX_STRING_DISTANCE` from strings and
    bodies. For each string, the nearest obstacle is listed at any distance.

    Args:
        cast: cast of the play.
        run: run of the stage, measured at every fourth sample, and in between as needed.
    """
    path = Path.from_run(cast.whole, run, SAMPLE_STRIDE)
    bodies = _nearest(_body_clearances(cast, path))
    strings = _nearest(_string_clearances(cast, path))
    return (*bodies, *strings)


def _nearest(entries: Iterable[OwnerClearance]) -> list[OwnerClearance]:
    """The smallest distance of every two owners, in order of distance."""
    by_owners: dict[frozenset[str], OwnerClearance] = {}
    for entry in sorted(entries, key=lambda entry: entry.distance):
        by_owners.setdefault(frozenset(entry.owners), entry)
    return list(by_owners.values())


def _body_clearances(cast: Cast, path: Path) -> Iterator[OwnerClearance]:
    """Least distance between the bodies of every two owners."""
    whole = cast.whole
    links = [link.name for link in whole.tree.links]
    names = dict.fromkeys([*links, *(obstacle.name for obstacle in Clearance(whole).obstacles)])
    owner = {name: cast.owner(name) for name in names}
    moving = {owner[name] for name in links}
    pairs = [frozenset(pair) for pair in combinations(names, 2)]
    for a, b in combinations(dict.fromkeys(owner.values()), 2):
        if not moving & {a, b}:
            continue
        not_measured = [pair for pair in pairs if {owner[name] for name in pair} != {a, b}]
        clearance = Clearance(whole, strings=False, free=not_measured)
        if clearance.measures_nothing:
            continue
        nearest = clearance.least(path)
        pair = clearance.pair_at(nearest.q_D, nearest.q_K)
        yield OwnerClearance((a, b), pair.first, pair.second, nearest.distance, nearest.t)


def _string_clearances(cast: Cast, path: Path) -> Iterator[OwnerClearance]:
    """Distances of strings from strings and bodies of other players, and from obstacles."""
    near = (
        StringDistances(cast.whole, own=False)
        .motion(path.q_D, path.q_K, path.t)
        .nearest(MAX_STRING_DISTANCE)
    )
    for pair in (*near.strings, *near.bodies):
        if {pair.first, pair.second} & {*cast.file.leashes}:
            continue
        owners = cast.owner(pair.first), cast.owner(pair.second)
        other = f"string {pair.second}" if pair in near.strings else pair.second
        yield OwnerClearance(owners, f"string {pair.first}", other, pair.distance, pair.t)
    for name, part in Clearance(cast.whole).parts().items():
        string = name.removeprefix("string ")
        if string == name or string in cast.file.leashes:
            continue
        nearest = part.least(path)
        other = part.pair_at(nearest.q_D, nearest.q_K).second
        owners = cast.owner(string), other
        yield OwnerClearance(owners, name, other, nearest.distance, nearest.t)
