"""The world: one or more puppets, the obstacles around them and the floor below."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from fantoccini.errors import Mistake, PuppetError
from fantoccini.puppet import Number, Obstacle, Puppet


@dataclass(frozen=True)
class World:
    """Puppets that share gravity, obstacles and a floor.

    Attributes:
        puppets: one or more, with different names.
        name: of the world.
        gravity: [m/s^2].
        obstacles: shapes that stand in the world.
        floor: height of the floor [m], or None.
    """

    puppets: tuple[Puppet, ...]
    name: str
    gravity: tuple[Number, Number, Number]
    obstacles: tuple[Obstacle, ...] = ()
    floor: float | None = None

    @classmethod
    def of(cls, *puppets: Puppet, name: str | None = None) -> World:
        """The world of these puppets.

        Args:
            puppets: one or more, with different names, the same gravity and the same floor.
            name: of the world; by default the puppets' names, joined by +.

        Raises:
            PuppetError: naming the puppets that do not go together.
        """
        if not puppets:
            raise PuppetError([Mistake("<python>", None, "", "a world needs a puppet")])
        problems = []
        for twice in [n for n, count in Counter(p.name for p in puppets).items() if count > 1]:
            problems.append((twice, "puppet", "the name is used twice; puppets differ in name"))
        floors = {p.floor for p in puppets if p.floor is not None}
        for puppet in puppets[1:]:
            if puppet.gravity != puppets[0].gravity:
                found, other = list(puppet.gravity), list(puppets[0].gravity)
                text = f"found {found} where {puppets[0].name} has {other}; a world has one gravity"
                problems.append((puppet.name, "gravity", text))
        if len(floors) > 1:
            text = f"found {sorted(floors)}; a world has one floor"
            problems.append((puppets[-1].name, "floor", text))
        if problems:
            raise PuppetError(Mistake(f"<{n}>", None, key, text) for n, key, text in problems)
        return cls(
            puppets=tuple(puppets),
            name=name or "+".join(p.name for p in puppets),
            gravity=puppets[0].gravity,
            obstacles=tuple(dict.fromkeys(o for p in puppets for o in p.obstacles)),
            floor=floors.pop() if floors else None,
        )
