"""Optimal control problems that Crocoddyl and MuJoCo can also express.

    min  w/2 integral |acc_K|^2 dt  +  W/2 |q(T) - goal|^2  +  W_v/2 |v(T)|^2

over accelerations of the hand that are constant in every interval, from rest at q = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import fantoccini as fan

Vector = tuple[float, float, float]

SMOOTH = 1.0
"""Weight w of the hand's accelerations [s^4/m^2]."""
END = 1e2
"""Weights of final positions and velocities [1/m^2 and s^2/m^2, or per rad^2]."""


@dataclass(frozen=True)
class Link:
    """A body on a hinge.

    Attributes:
        name: name of the body and of its hinge.
        parent: its index among the links; -1 is the hand.
        axis, at: axis and position of the hinge, in the parent's frame [m].
        mass, com, inertia: [kg], [m] and, about the centre of mass, [kg m^2].
    """

    name: str
    parent: int
    axis: Vector
    at: Vector
    mass: float
    com: Vector
    inertia: Vector


@dataclass(frozen=True)
class Problem:
    """Links that hang from a hand, and the goal to which it takes them, from rest to rest.

    Attributes:
        name: name of the problem.
        axes: axes along which the hand moves.
        links: links, parents first.
        goal: (n_inputs,) final position of the hand; the hinges end at 0 [m].
        duration, intervals: duration [s] and number of intervals of the motion.
        acceleration: largest acceleration of the hand [m/s^2].
        rope: whether the first link is a rope, of massless frame, whose mass hangs at ``com``.
    """

    name: str
    axes: str
    links: Sequence[Link]
    goal: tuple[float, ...]
    duration: float
    intervals: int
    acceleration: float = np.inf
    rope: bool = False

    @property
    def interval(self) -> float:
        """Length of an interval [s]."""
        return self.duration / self.intervals

    def marionette(self) -> fan.Marionette:
        """The puppet; a rope is a string whose end turns about the hand and may rise."""
        lines = [
            f"puppet: {self.name}",
            "bodies:",
            f"- {{name: hand, joint: {{type: translation, axes: [{', '.join(self.axes)}], "
            "driven: true}}",
        ]
        names = ["hand", *(link.name for link in self.links)]
        for i, link in enumerate(self.links):
            parent, at, com, weighs = names[link.parent + 1], link.at, link.com, True
            if self.rope and i == 0:
                # A frame that turns, and in it the hook, which may approach the hand.
                com, weighs = (0.0, 0.0, 0.0), False
            elif self.rope and link.parent == 0:
                parent, at = "hook", (0.0, 0.0, 0.0)
            solid = f", mass: {link.mass}, com: {list(com)}, inertia: {list(link.inertia)}"
            lines.append(
                f"- {{name: {link.name}, parent: {parent}, joint: {{type: revolute, "
                f"axis: {list(link.axis)}, at: {list(at)}}}{solid if weighs else ''}}}"
            )
            if not weighs:
                lines.append(
                    f"- {{name: hook, parent: {link.name}, joint: {{type: prismatic, "
                    f"axis: [0, 0, 1], at: {list(link.com)}}}{solid}}}"
                )
        if self.rope:
            length = -self.links[0].com[2]
            lines += [
                "strings:",
                "- {name: rope, path: [{body: hook, at: [0, 0, 0]}, {body: hand, at: [0, 0, 0]}], "
                f"length: {length}}}",
            ]
        return fan.loads("\n".join(lines))

    def task(self, marionette: fan.Marionette, dt: float) -> fan.Task:
        """The problem as ours; derivatives by time steps of dt."""
        t = marionette.coordinates
        hand = dict(zip(t.q_K, self.goal, strict=True))
        hinges = dict.fromkeys((link.name for link in self.links), 0.0)
        tracks = [
            fan.control.Track.coordinate(name, value, weight=0.0, end_weight=END)
            for name, value in {**hand, **hinges}.items()
        ] + [
            fan.control.Track.velocity(name, 0.0, weight=0.0, end_weight=END)
            for name in (*hand, *hinges)
        ]
        bounds = fan.control.Bounds(acceleration=self.acceleration)
        if self.rope:
            weight = 9.81 * sum(link.mass for link in self.links)
            bounds = replace(bounds, tension={"rope": (0.01 * weight, np.inf)})
        x0 = marionette.state(dict.fromkeys((*t.q_D, *t.q_K), 0.0))
        return fan.Task(
            marionette,
            x0,
            self.duration,
            tracks,
            fan.control.Smooth(SMOOTH, 0.0),
            bounds,
            interval=self.interval,
            dt=dt,
            name=self.name,
        )

    def as_json(self) -> dict[str, object]:
        """The problem for the peers, as JSON data."""
        return {
            "axes": self.axes,
            "goal": self.goal,
            "interval": self.interval,
            "intervals": self.intervals,
            "smooth": SMOOTH,
            "end": END,
            "acceleration": self.acceleration if np.isfinite(self.acceleration) else None,
            "links": [vars(link) for link in self.links],
        }


def puppet(intervals: int = 100) -> Problem:
    """A trunk with two arms and two legs on 22 hinges, hung from a hand: 25 degrees of freedom."""
    links: list[Link] = []

    def limb(name: str, n: int, parent: int, first: Vector, long: float, mass: float) -> int:
        """Index of the last of n links below a parent, with hinges about y and x in turn."""
        for k in range(n):
            axis = (1.0, 0.0, 0.0) if k % 2 else (0.0, 1.0, 0.0)
            at = (0.0, 0.0, -long) if k else first
            thin = mass * long**2 / 12
            inertia = (thin, 0.9 * thin, 0.3 * thin)
            com = (0.0, 0.0, -long / 2)
            links.append(Link(f"{name}{k}", parent, axis, at, mass, com, inertia))
            parent = len(links) - 1
        return parent

    # Depth first: Pinocchio's derivatives need contiguous subtrees.
    down = -0.12
    chest = limb("chest", 2, -1, (0.0, 0.0, 0.0), 0.12, 0.3)
    for side, y in (("left", 0.1), ("right", -0.1)):
        limb(f"arm_{side}", 4, chest, (0.0, y, down), 0.15, 0.1)
    hips = limb("trunk", 4, chest, (0.0, 0.0, down), 0.12, 0.3)
    for side, y in (("left", 0.1), ("right", -0.1)):
        limb(f"leg_{side}", 4, hips, (0.0, y, down), 0.2, 0.2)
    return Problem("puppet", "xyz", links, (0.3, 0.15, 0.05), 2.0, intervals)


def crane(intervals: int = 60) -> Problem:
    """A bounded trolley, a hook on a rope, and a load that turns on the hook."""
    down, across = (0.0, 0.0, -2.5), (0.0, -1.0, 0.0)
    links = [
        Link("swing", -1, across, (0.0, 0.0, 0.0), 30.0, down, (2.0, 2.0, 2.0)),
        Link("load", 0, across, down, 250.0, (0.0, 0.0, -0.6), (30.0, 30.0, 20.0)),
    ]
    return Problem("crane", "x", links, (2.0,), 3.0, intervals, acceleration=1.5, rope=True)
