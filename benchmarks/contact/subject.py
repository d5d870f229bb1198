"""Simulated scenes: one or two bundled marionettes on a floor, on loose strings."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.model.puppet import Puppet
from fantoccini.motion import State

DT = 0.002
"""Step of all timed runs [s]."""

FRICTION = 0.6

_AT_REST = {"lowered": 1.0, "still": 8.0}
"""Times at which the strings are let out, and at which the puppets are at rest [s]."""

_PUSH = 0.02
"""Magnitude of the velocities that distinguish trajectories [m/s or rad/s]."""


@dataclass(frozen=True)
class Subject:
    """A scene and the length by which its strings are let out.

    Attributes:
        name: name on the page.
        members: name of a puppet -> its position on the floor [m].
        down: distance by which every puppet is let down from its hanging pose [m].
    """

    name: str
    members: tuple[tuple[str, tuple[float, float]], ...]
    down: float

    @functools.cached_property
    def marionette(self) -> fan.Marionette:
        """The scene."""
        return fan.loads(self.text)

    @property
    def text(self) -> str:
        """The scene's file."""
        puppets = "".join(
            f"- {{name: {name}, puppet: marionette, at: [{x}, {y}, 0]}}\n"
            for name, (x, y) in self.members
        )
        return f"scene: stage\nfloor: 0\ncontact: {{friction: {FRICTION}}}\npuppets:\n{puppets}"

    @functools.cached_property
    def standing(self) -> State:
        """The state in which it stands after the strings are let out."""
        stage = self.marionette
        x = stage.project(stage.state())
        lengths = [f"{s.name}.length" for s in stage.tree.strings]
        lowered, still = _AT_REST["lowered"], _AT_REST["still"]
        inputs = fan.Input.waypoints(
            stage, {n: [(0.0, x[n]), (lowered, x[n] + self.down)] for n in lengths}
        )
        run = fan.simulate(
            stage, x, inputs, t_end=still, method=fan.TimeStepping(dt=DT), save_every=50
        )
        return run.state(len(run) - 1).replace(t=0.0)

    def pushed(self, seed: int) -> State:
        """The standing state with small random velocities."""
        x = self.standing
        return x.replace(v_D=_PUSH * np.random.default_rng(seed).normal(size=len(x.v_D)))

    @functools.cached_property
    def peers_puppet(self) -> Puppet:
        """The scene without features that peers lack or define otherwise: drag, the neck's spring,
        limits of twists.

        The peers get this one; our own timings are of the full scene.
        """
        puppet = self.marionette.puppet.expanded()
        spared = dict.fromkeys(("spring", "twist"))
        bodies = [
            body.model_copy(update={"drag": None, "joint": body.joint.model_copy(update=spared)})
            for body in puppet.bodies
        ]
        return puppet.model_copy(update={"bodies": type(puppet.bodies)(bodies)})


ONE = Subject("one marionette on its feet", (("pierrot", (0.0, 0.0)),), 0.02)
TWO = Subject(
    "two marionettes on their feet", (("pierrot", (0.0, 0.25)), ("columbine", (0.0, -0.25))), 0.02
)
HEAP = Subject(
    "two marionettes in a heap", (("pierrot", (0.0, 0.1)), ("columbine", (0.0, -0.1))), 0.30
)
