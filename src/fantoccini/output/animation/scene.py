"""Contents of an animation: bodies, strings, floor and obstacles, and the run that moves them.

A link is a body on its joint. A slack string sags, a chain consists of point masses and springs.
q_D and q_K are the dynamic and driven coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from fantoccini.base import Array, Times, UnknownNameError
from fantoccini.model.tree import WORLD, Point, Tree
from fantoccini.motion import Trajectory
from fantoccini.output.animation.joints import LocalMotion, local_motion
from fantoccini.output.view import Drawable, Geometry, UncompiledPuppet, rgb, run_geometry

Bodies: TypeAlias = Sequence[str] | Literal["all"]
"""Names of bodies, or ``all``."""

_N_GEOMETRY_SAMPLES = 200
"""Number of samples from which a run's extent and floor height are computed."""


@dataclass(frozen=True)
class Line:
    """String, chain or spring: straight between points of links, unless slack.

    Attributes:
        name: its name; for a spring, ``spring`` and its number.
        points: points that it runs through.
        string: index among the strings; None for a chain or spring, which is never slack.
        colour: (3,) its colour, or None for the default.
    """

    name: str
    points: tuple[Point, ...]
    string: int | None
    colour: Array | None


@dataclass(frozen=True, eq=False)
class AnimatedScene:
    """Run with the things that it moves.

    Attributes:
        still: the puppet, or the puppets of a scene, as a tree with parameter values.
        run: the motion.
        links: indices of the shown links, parents first.
        parents: nearest shown ancestor of each of them, or ``WORLD``.
        lines: shown strings, chains and springs.
        complete: everything is shown.
        bodies_given: `bodies` was given, as names or ``all``.
        fps: keys per second; None if the motion determines them.
    """

    still: UncompiledPuppet
    run: Trajectory
    links: tuple[int, ...]
    parents: dict[int, int]
    lines: tuple[Line, ...]
    complete: bool
    bodies_given: bool
    fps: float | None

    @classmethod
    def from_run(
        cls, drawable: Drawable, run: Trajectory, bodies: Bodies | None, fps: float | None
    ) -> AnimatedScene:
        """Scene of a run.

        Args:
            drawable: the puppet or scene that moves.
            run: its motion.
            bodies: names of the bodies to show; all of them for ``all`` and None.
            fps: keys per second.

        Raises:
            UnknownNameError: there is no such body.
            ValueError: the run belongs to another puppet.
        """
        still = UncompiledPuppet(drawable.puppet, drawable.tree, drawable.number)
        tree = still.tree
        puppet_names, run_names = (
            (coordinates.q_D, coordinates.q_K)
            for coordinates in (tree.coordinates, run.coordinates)
        )
        if puppet_names != run_names:
            raise ValueError(f"the run is of another puppet than {tree.name}")
        check_bodies(still, bodies)
        names = None if bodies == "all" else bodies
        named_links = _named_links(tree, names)
        all_lines = _lines(still)
        lines = tuple(line for line in all_lines if _ends_on(line, named_links, tree))
        ends = {point.link for line in lines for point in line.points} - {WORLD}
        links = tuple(sorted({*named_links, *ends}))
        return cls(
            still,
            run,
            links,
            _parents(tree, links),
            lines,
            complete=names is None,
            bodies_given=bodies is not None,
            fps=fps,
        )

    def without_lines(self) -> AnimatedScene:
        """The scene without strings and without the links that only hold one."""
        names = body_names(self.tree)
        links = tuple(k for k in self.links if self.tree.links[k].name in names)
        return replace(self, links=links, parents=_parents(self.tree, links), lines=())

    @property
    def tree(self) -> Tree:
        """Links and strings of the puppet."""
        return self.still.tree

    @cached_property
    def geometry(self) -> Geometry:
        """Solids, floor and size, with poses at some times of the run."""
        first, last = self.run.t[0], self.run.t[-1]
        return run_geometry(
            self.still, self.run.resample(np.linspace(first, last, _N_GEOMETRY_SAMPLES))
        )

    def motion(self, link: int, run: Trajectory) -> LocalMotion:
        """Motion of a shown link in its parent's frame, at the samples of a run."""
        path, parent = self.tree.ancestors(link), self.parents[link]
        path_links = path if parent == WORLD else path[: path.index(parent)]
        number = self.still.number
        return LocalMotion.composed(
            local_motion(self.tree.links[k], run, number) for k in reversed(path_links)
        )

    def world_positions(self, point: Point, poses: Array) -> Array:
        """(T, 3) world positions of a point of a line [m], from link poses (T, n_links, 3, 4)."""
        local_position = self.at(point)
        if point.link == WORLD:
            return np.tile(local_position, (len(poses), 1))
        positions: Array = poses[:, point.link, :, :3] @ local_position + poses[:, point.link, :, 3]
        return positions

    def at(self, point: Point) -> Array:
        """(3,) position of a point in its link's frame [m]."""
        return np.array([self.still.number(x) for x in point.at])

    def frames(self, fps: float) -> Times:
        """Times of frames [s], from the run's start to its end."""
        n = int(np.floor(self.run.duration * fps * (1.0 + 1e-12)))
        times: Times = self.run.t[0] + np.arange(n + 1) / fps
        return np.minimum(times, self.run.t[-1])


def check_bodies(drawable: Drawable, bodies: Bodies | None) -> None:
    """Raises UnknownNameError if one of the names is not that of a body."""
    if bodies == "all":
        return
    names = [link.name for link in drawable.tree.links]
    for name in bodies or ():
        if name not in names:
            raise UnknownNameError("body", name, body_names(drawable.tree))


def body_names(tree: Tree) -> list[str]:
    """Names of the links that are bodies, mirrored ones included; others only hold strings."""
    strings = {row.name for row in (*tree.strings, *tree.chains)}
    names = [link.name for link in tree.links]
    # An end is named after its string, for example `hand.end`.
    return [name for name in names if name.rpartition(".")[0] not in strings]


def _parents(tree: Tree, links: Sequence[int]) -> dict[int, int]:
    """Nearest ancestor of each of these links among them, or ``WORLD``."""
    return {
        k: next((ancestor for ancestor in tree.ancestors(k)[1:] if ancestor in links), WORLD)
        for k in links
    }


def _named_links(tree: Tree, bodies: Sequence[str] | None) -> tuple[int, ...]:
    """Indices of the links with these names, parents first; of all links for None."""
    names = [link.name for link in tree.links]
    return tuple(k for k, name in enumerate(names) if bodies is None or name in bodies)


def _ends_on(line: Line, links: Sequence[int], tree: Tree) -> bool:
    """Whether a line ends on one of the links, and otherwise only on the world and hands."""
    bodies = body_names(tree)
    attached_links = {point.link for point in line.points} - {WORLD}
    other_bodies = [k for k in attached_links.difference(links) if tree.links[k].name in bodies]
    return not other_bodies and (not attached_links or not attached_links.isdisjoint(links))


def _lines(still: UncompiledPuppet) -> list[Line]:
    tree = still.tree
    lines = [
        Line(s.name, s.points, k, None if s.colour is None else rgb(s.colour))
        for k, s in enumerate(tree.strings)
    ]
    lines += [
        Line(c.name, c.points, None, None if c.colour is None else rgb(c.colour))
        for c in tree.chains
    ]
    lines += [Line(f"spring{k + 1}", s.points, None, None) for k, s in enumerate(tree.springs)]
    return lines
