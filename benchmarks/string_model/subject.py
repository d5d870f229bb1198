"""The measured puppets, their motions, and the compared point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini import puppets
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import WORLD, point_position
from fantoccini.motion import State


@dataclass(frozen=True)
class Subject:
    """A puppet and its motion.

    Attributes:
        name: name of the bundled puppet.
        moves: driven coordinate -> its displacement [m] over the duration of the moves.
        taken: duration of the moves [s].
        t_end: end of the motion [s].
        string: string whose lower end is compared.
        pieces: compared numbers of pieces of each chain.
    """

    name: str
    moves: dict[str, float]
    taken: float
    t_end: float
    string: str
    pieces: tuple[int, ...]

    def massless(self) -> Marionette:
        """The puppet on massless strings, which are constraints."""
        return getattr(puppets, self.name)()

    def chained(self, **chain) -> Marionette:
        """The puppet on chains of point masses and springs."""
        return Marionette(self.massless().puppet.with_chains(**chain))

    def inputs(self, puppet: Marionette, x: State) -> fan.Input:
        """The motion of the hands, from a state at rest."""
        start = dict(zip(puppet.coordinates.q_K, x.q_K, strict=True))
        return fan.Input.waypoints(
            puppet,
            {
                n: [(0, start[n]), (self.taken, start[n] + displacement)]
                for n, displacement in self.moves.items()
            },
        )

    def hand(self, puppet: Marionette, run: fan.Trajectory) -> np.ndarray:
        """(T, 3) position of the string's lower end [m]."""
        rows = (*puppet.tree.strings, *puppet.tree.chains)
        point = next(r for r in rows if r.name == self.string).points[0]
        assert point.link != WORLD
        return point_position(puppet.poses(run.q_D, run.q_K), point, puppet.number)


ARM = Subject(
    "arm3d",
    {"hand.length": -0.15, "hand.x": 0.08, "hand.y": 0.05},
    0.6,
    1.5,
    "hand",
    (2, 4, 8, 16, 32),
)
PUPPET = Subject(
    "marionette",
    {"hand_left.length": -0.1, "shoulder_left.x": 0.02, "head.x": 0.01},
    0.5,
    1.0,
    "hand_left",
    (4, 8),
)
