"""From a puppet and its motion to things that can be drawn.

A :class:`Scene` holds what the motion looks like: solids on links, poses of the links, points of
the strings with their lengths, tensions and modes. It knows nothing of pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.puppet import Number
from fantoccini.tree import WORLD, Point, Role, Tree
from fantoccini.view import rope
from fantoccini.view.shapes import solid_of
from fantoccini.view.silhouettes import Solid, capsule
from fantoccini.view.theme import STONE, WOOD, Theme, rgb
from fantoccini.world import World

if TYPE_CHECKING:
    from fantoccini.marionette import Marionette
    from fantoccini.motion import State, Trajectory

_ROUND = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_HELD = {Role.DRIVEN, Role.FIXED}


@dataclass(frozen=True)
class Thread:
    """A string at one time.

    Attributes:
        points: (n, 3) polyline as it is to be drawn [m].
        taut: True when it pulls.
        tension: [N], or None when unknown.
        colour: (3,) of its own, or None.
        wire: True for a two-sided one.
    """

    points: np.ndarray
    taut: bool
    tension: float | None
    colour: np.ndarray | None
    wire: bool


@dataclass(frozen=True)
class Scene:
    """A motion, ready to be drawn.

    Attributes:
        title: name of the puppet or world.
        t: (T,) times [s].
        solids: shapes on links, obstacles on the world.
        poses: (T, n_links, 3, 4) link poses.
        names: of the strings.
        points: for each string (T, n_points, 3) [m].
        lengths: (T, n_strings) with what winches have let out [m].
        taut: (T, n_strings) modes.
        tension: (T, n_strings) [N], or None when unknown.
        colours: of the strings that have one of their own, else None.
        wires: True for two-sided strings.
        springs: for each spring (T, 2, 3) ends [m].
        chains: for each chain (T, n_points, 3) its ends and masses [m].
        pulls: (T, n_chains) mean pull of the springs of each chain [N].
        chain_colours: as ``colours``.
        floor: height of the plane that shadows fall on [m].
        ground: True where that plane is a floor of the world, which strings cannot hang through.
        plane: mirror plane of the puppet, or None.
        size: largest side of the box about puppet and strings at the first time [m].
        tree: links and strings, their places in plain numbers.
    """

    title: str
    t: np.ndarray
    solids: tuple[Solid, ...]
    poses: np.ndarray
    names: tuple[str, ...]
    points: tuple[np.ndarray, ...]
    lengths: np.ndarray
    taut: np.ndarray
    tension: np.ndarray | None
    colours: tuple[np.ndarray | None, ...]
    wires: tuple[bool, ...]
    springs: tuple[np.ndarray, ...]
    chains: tuple[np.ndarray, ...]
    pulls: np.ndarray
    chain_colours: tuple[np.ndarray | None, ...]
    floor: float
    ground: bool
    plane: str | None
    size: float
    tree: Tree

    def threads(self, k: int) -> list[Thread]:
        """The strings at time ``t[k]``."""
        out = []
        for s, points in enumerate(self.points):
            line, taut = points[k], bool(self.taut[k, s]) or self.wires[s]
            if not taut and np.isfinite(line).all():
                line = rope.path(line, float(self.lengths[k, s]))
                if self.ground:
                    line = np.maximum(line, [-np.inf, -np.inf, self.floor])
            tension = None if self.tension is None else float(self.tension[k, s])
            out.append(Thread(line, taut, tension, self.colours[s], self.wires[s]))
        for s, points in enumerate(self.chains):
            pull = float(self.pulls[k, s])
            tension = None if self.tension is None else max(pull, 0.0)
            out.append(Thread(points[k], pull > 0.0, tension, self.chain_colours[s], False))
        return out

    def balls(
        self, strings: bool = True, most: int = 240, pan: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Centres (n, 3) and radii (n,) [m] that cover the motion, for framing it.

        Args:
            strings: cover strings and springs as well as solids.
            most: times to look at.
            pan: (T, 3) how far a camera has gone along; places are then those that it sees [m],
                without what stands in the world.
        """
        rows = np.unique(np.linspace(0, len(self.t) - 1, most).astype(int))
        centres, radii = [np.zeros((0, 3))], [np.zeros(0)]
        gone = np.zeros((len(rows), 3)) if pan is None else pan[rows]
        for solid in self.solids:
            if pan is not None and solid.link == WORLD:
                continue
            poses = _on(self.poses[rows], solid.link)
            for end in solid.axis:
                centres.append(poses[..., :3] @ end + poses[..., 3] - gone)
                radii.append(np.full(len(rows), _reach(solid)))
        lines = (*self.points, *self.chains, *self.springs)
        for points in lines if strings or not self.solids else ():
            flat = (points[rows] - gone[:, None]).reshape(-1, 3)
            centres.append(flat)
            radii.append(np.zeros(len(flat)))
        centres, radii = np.concatenate(centres), np.concatenate(radii)
        good = np.isfinite(centres).all(axis=1)
        if not good.any():
            return np.zeros((1, 3)), np.ones(1)
        return centres[good], radii[good]

    def tension_top(self) -> float:
        """Upper end of the tension scale [N]: a round number most of the motion stays under."""
        if self.tension is None:
            return 1.0
        pulls = np.concatenate([self.tension.ravel(), self.pulls.ravel()])
        pulls = np.abs(pulls[np.isfinite(pulls)])
        pulls = pulls[pulls > 0.0]
        if not pulls.size:
            return 1.0
        top = float(np.percentile(pulls, 98.0))
        unit = 10.0 ** np.floor(np.log10(top))
        return float(unit * min(f for f in _ROUND if f * unit >= top * (1.0 - 1e-9)))


def scene_of(marionette: Marionette, run: Trajectory) -> Scene:
    """The scene of a run.

    Args:
        marionette: the puppet's handle.
        run: its motion.
    """
    return _scene(
        marionette, np.asarray(run.t), run.q_D, run.q_K, run.taut.values, run.tension.values,
        0.0 if run.slip is None else run.slip.values,
    )  # fmt: skip


def scene_at(marionette: Marionette, state: State, tension: np.ndarray | None = None) -> Scene:
    """The scene of one state.

    Args:
        marionette: the puppet's handle.
        state: configuration and string modes.
        tension: (n_strings,) [N]; None draws strings without the colours of tension.
    """
    n = len(marionette.tree.strings)
    return _scene(
        marionette, np.array([state.t]), state.q_D[None], state.q_K[None], state.taut[None, :n],
        None if tension is None else np.asarray(tension, dtype=float)[None],
        state.slip[None] if len(state.slip) else 0.0,
    )  # fmt: skip


def _scene(marionette: Marionette, t, q_D, q_K, taut, tension, slip) -> Scene:
    tree, world = _settled(marionette.tree, marionette.model.number), marionette.world
    poses = np.asarray(marionette.poses(q_D, q_K))
    points = tuple(np.asarray(p) for p in marionette.string_points(q_D, q_K))
    springs = spring_ends(tree, poses)
    chains, pulls = chain_points(tree, poses), chain_pulls(marionette, tree, poses, q_D, q_K)
    solids = _shapes(tree)
    size = _size(solids, poses, (*points, *chains))
    solids += _stand_ins(tree, size)
    low = _lowest(solids, poses) if solids else 0.0
    floor = low - 0.04 * size if world.floor is None else float(world.floor)
    mirrors = [p.mirror.plane for p in world.puppets if p.mirror is not None]
    return Scene(
        title=tree.name,
        t=t,
        solids=tuple(_obstacles(world) + solids),
        poses=poses,
        names=tuple(s.name for s in tree.strings),
        points=points,
        lengths=np.asarray(marionette.model.string_lengths(q_D, q_K)) + slip,
        taut=np.asarray(taut, dtype=bool),
        tension=None if tension is None else np.asarray(tension, dtype=float),
        colours=tuple(None if s.colour is None else rgb(s.colour) for s in tree.strings),
        wires=tuple(s.wire for s in tree.strings),
        springs=springs,
        chains=chains,
        pulls=pulls,
        chain_colours=tuple(None if c.colour is None else rgb(c.colour) for c in tree.chains),
        floor=floor,
        ground=world.floor is not None,
        plane=mirrors[0] if mirrors else None,
        size=size,
        tree=tree,
    )


def handles(tree: Tree, theme: Theme, size: float) -> list[Solid]:
    """Beads on the points of strings that a hand or a winch holds, and hooks on the world.

    Args:
        tree: of the world.
        theme: the look.
        size: of the motion [m].
    """
    out, seen = [], set()
    for string in (*tree.strings, *tree.chains):
        for point in string.points:
            key = (point.link, point.at)
            if key in seen or not _held(tree, point.link):
                continue
            seen.add(key)
            if point.link != WORLD and tree.links[point.link].shapes:
                continue
            out.append(capsule(point.link, theme.handle, np.tile(key[1], (2, 1)), 0.009 * size))
    return out


def _shapes(tree: Tree) -> list[Solid]:
    solids, depth = [], {WORLD: -1}
    for k, link in enumerate(tree.links):
        depth[k] = depth[link.parent] + 1
        colour = rgb(WOOD[depth[k] % len(WOOD)])
        solids += [solid_of(shape, k, colour) for shape in link.shapes]
    return solids


def _obstacles(world: World) -> list[Solid]:
    return [solid_of(shape, WORLD, rgb(STONE)) for shape in world.obstacles]


def _stand_ins(tree: Tree, size: float) -> list[Solid]:
    """Balls and sticks for links that weigh something, or carry strings, but have no shape."""
    out = []
    children: dict[int, list[np.ndarray]] = {}
    for link in tree.links:
        children.setdefault(link.parent, []).append(np.array(link.offset))
    for row in (*tree.strings, *tree.chains):
        for point in row.points:
            children.setdefault(point.link, []).append(np.array(point.at))
    for k, link in enumerate(tree.links):
        if link.shapes:
            continue
        colour = rgb(WOOD[1 if link.role is Role.DRIVEN else 3])
        mass = 0.0 if link.mass is None else link.mass
        com = np.zeros(3) if link.com is None else np.array(link.com)
        if mass > 0.0:
            out.append(capsule(k, colour, np.tile(com, (2, 1)), 0.026 * size))
        reach = [com, *children.get(k, [])]
        out += [
            capsule(k, colour, np.array([np.zeros(3), tip]), 0.011 * size)
            for tip in np.unique(np.round(reach, 9), axis=0)
            if np.linalg.norm(tip) > 1e-6
        ]
    return out


def spring_ends(tree: Tree, poses: np.ndarray) -> tuple[np.ndarray, ...]:
    """For each spring (..., 2, 3) its ends [m].

    Args:
        tree: with the springs.
        poses: (..., n_links, 3, 4) link poses.
    """
    return tuple(
        np.stack([_carry(poses, end) for end in row.points], axis=-2) for row in tree.springs
    )


def chain_points(tree: Tree, poses: np.ndarray) -> tuple[np.ndarray, ...]:
    """For each chain (..., n_points, 3) its ends and masses [m]; arguments as for springs."""
    return tuple(
        np.stack([_carry(poses, end) for end in row.points], axis=-2) for row in tree.chains
    )


def chain_pulls(
    marionette: Marionette, tree: Tree, poses: np.ndarray, q_D: np.ndarray, q_K: np.ndarray
) -> np.ndarray:
    """(..., n_chains) mean pull EA (d / l - 1) of the springs of each chain [N]."""
    pulls = []
    for row, points in zip(tree.chains, chain_points(tree, poses), strict=True):
        path = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)
        length = row.own_length(q_D, q_K, marionette.model.number)
        pulls.append(marionette.model.number(row.stiffness) * (path / length - 1.0))
    return np.stack(pulls, axis=-1) if pulls else np.zeros((*poses.shape[:-3], 0))


def _held(tree: Tree, link: int) -> bool:
    return link == WORLD or all(tree.links[k].role in _HELD for k in tree.ancestors(link))


def _settled(tree: Tree, number: Callable[[Number], float]) -> Tree:
    """The tree with plain numbers, of parameters their present values, where pictures need them."""

    def numbers(xs):
        return tuple(number(x) for x in xs)

    def points(row):
        return replace(row, points=tuple(replace(p, at=numbers(p.at)) for p in row.points))

    links = (
        replace(
            link, offset=numbers(link.offset),
            mass=None if link.mass is None else number(link.mass),
            com=None if link.com is None else numbers(link.com),
        )
        for link in tree.links
    )  # fmt: skip
    return replace(
        tree, links=tuple(links), strings=tuple(map(points, tree.strings)),
        springs=tuple(map(points, tree.springs)), chains=tuple(map(points, tree.chains)),
    )  # fmt: skip


def _on(poses: np.ndarray, link: int) -> np.ndarray:
    if link == WORLD:
        return np.broadcast_to(np.eye(3, 4), (*poses.shape[:-3], 3, 4))
    return poses[..., link, :, :]


def _carry(poses: np.ndarray, point: Point) -> np.ndarray:
    pose = _on(poses, point.link)
    return pose[..., :3] @ np.array(point.at) + pose[..., 3]


def _reach(solid: Solid) -> float:
    """Radius about the axis' ends that covers the solid [m]."""
    if solid.kind == "capsule":
        return solid.radius
    if solid.kind == "ellipsoid":
        return float(np.sort(np.linalg.norm(solid.half, axis=0))[1])
    gaps = np.linalg.norm(solid.points[:, None] - solid.axis[None], axis=-1)
    return float(gaps.min(axis=1).max())


def _lowest(solids: list[Solid], poses: np.ndarray) -> float:
    low = np.inf
    for solid in solids:
        pose = _on(poses, solid.link)
        down = pose[:, 2, :3]
        heights = down @ solid.points.T + pose[:, 2, 3:]
        if solid.kind == "ellipsoid":
            heights = heights - np.linalg.norm(down @ solid.half, axis=-1)[:, None]
        low = min(low, float(np.min(heights)) - solid.radius)
    return low if np.isfinite(low) else 0.0


def _size(solids: list[Solid], poses: np.ndarray, points: tuple[np.ndarray, ...]) -> float:
    places = [poses[0, :, :, 3], *(p[0] for p in points)]
    for solid in solids:
        pose = _on(poses[0], solid.link)
        places.append(solid.points @ pose[:, :3].T + pose[:, 3])
    places = np.concatenate(places)
    places = places[np.isfinite(places).all(axis=1)]
    size = float(np.ptp(places, axis=0).max()) if len(places) else 0.0
    return size if size > 1e-9 else 1.0
