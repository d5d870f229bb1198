"""Geometry of a puppet and its motion, in metres: everything that is drawn.

A taut string pulls and a slack one sags; a wire also pushes and is drawn like a taut one. q_D and
q_K are the dynamic and driven coordinates; slip is the length that a winch has let out. A
marionette is a puppet with its compiled equations; `marionette.puppet` is the description in its
file. A link is a body on its joint. A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.base.documents import Number
from fantoccini.model.tree import WORLD, ChainRow, Point, SpringRow, Tree
from fantoccini.output.view import rope
from fantoccini.output.view.shapes import link_solids, obstacle_solids, stand_in_solids
from fantoccini.output.view.silhouettes import Solid
from fantoccini.output.view.still import Drawable
from fantoccini.output.view.theme import rgb

if TYPE_CHECKING:
    from fantoccini.motion import ContactPoints, State, Trajectory


@dataclass(frozen=True)
class StringCurve:
    """String at one time.

    Attributes:
        points: (n, 3) polyline to draw [m].
        taut: whether it pulls.
        tension: tension [N], or None if unknown.
        colour: (3,) its own colour, or None.
        wire: whether it is a wire.
    """

    points: np.ndarray
    taut: bool
    tension: float | None
    colour: np.ndarray | None
    wire: bool


Guides: TypeAlias = Callable[[Times], Sequence[Array]]
"""Function from times (T,) to lines (T, n, 3) that a motion is compared with [m]."""


@dataclass(frozen=True)
class Geometry:
    """Motion, ready to be drawn.

    Attributes:
        title: name of the puppet.
        t: (T,) times [s].
        solids: shapes on links, obstacles on the world.
        poses: (T, n_links, 3, 4) link poses.
        names: names of the strings.
        points: (T, n_points, 3) points of each string [m].
        lengths: (T, n_strings) lengths, including slip of the winches [m].
        taut: (T, n_strings) whether strings are taut.
        tension: (T, n_strings) tensions [N], or None if unknown.
        colours: each string's own colour, or None.
        wires: whether each string is a wire, which also pushes.
        springs: (T, 2, 3) ends of each spring [m].
        chains: (T, n_points, 3) positions of ends and masses of each chain [m].
        chain_forces: (T, n_chains) mean force of the springs of each chain [N].
        chain_colours: colours of chains, in the form of ``colours``.
        floor: height of the plane with the shadows [m].
        ground: whether this plane is the world's floor, on which slack strings lie.
        plane: mirror plane of the puppet, or None.
        size: largest side of the bounding box of puppet and strings at the first time [m].
        tree: links and strings, with values in place of parameters.
        arrows: (n, 2, 3) foot and head of the arrows of forces at each time [m]; empty for none.
        guides: (T, n, 3) polylines that the motion is compared with, drawn in front of it [m].
        max_tension: largest tension of the run, also at times not in ``t``; 0 if unknown [N].
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
    chain_forces: np.ndarray
    chain_colours: tuple[np.ndarray | None, ...]
    floor: float
    ground: bool
    plane: str | None
    size: float
    tree: Tree
    arrows: tuple[np.ndarray, ...] = ()
    guides: tuple[np.ndarray, ...] = ()
    max_tension: float = 0.0

    def with_guides(self, guides: Guides | None) -> Geometry:
        """The geometry with lines that the motion is compared with.

        Raises:
            ValueError: a line is not (T, n, 3) with n >= 2.
        """
        if guides is None:
            return self
        lines = tuple(np.asarray(line, dtype=float) for line in guides(self.t))
        for line in lines:
            fits_times = line.ndim == 3 and line.shape[::2] == (len(self.t), 3)
            if not fits_times or line.shape[1] < 2:
                raise ValueError(
                    f"a guide has the shape {line.shape}; it must be ({len(self.t)}, n, 3) with at "
                    "least 2 points"
                )
        return replace(self, guides=lines)

    def string_curves(self, k: int) -> list[StringCurve]:
        """Strings and chains at time ``t[k]``."""
        curves = []
        for s, points in enumerate(self.points):
            line, taut = points[k], bool(self.taut[k, s]) or self.wires[s]
            if not taut and np.isfinite(line).all():
                line = self.slack_curve(line, float(self.lengths[k, s]))
            tension = None if self.tension is None else float(self.tension[k, s])
            curves.append(StringCurve(line, taut, tension, self.colours[s], self.wires[s]))
        for s, points in enumerate(self.chains):
            pull = float(self.chain_forces[k, s])
            tension = None if self.tension is None else max(pull, 0.0)
            curves.append(StringCurve(points[k], pull > 0.0, tension, self.chain_colours[s], False))
        return curves

    def slack_curve(self, points: np.ndarray, length: float, n: int = 48) -> np.ndarray:
        """(m, 3) curve of a slack string through points (k, 3) [m], not below the world's floor."""
        line = rope.slack_curve(points, length, n)
        return np.maximum(line, [-np.inf, -np.inf, self.floor]) if self.ground else line

    def balls(
        self, strings: bool = True, max_times: int = 240, pan: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Centres (n, 3) and radii (n,) [m] of balls that cover the motion, to frame it.

        Args:
            strings: cover strings and springs as well as solids.
            max_times: largest number of times to cover.
            pan: (T, 3) displacement of a camera that follows the puppet [m]; centres are then
                relative to it, and obstacles are left out.
        """
        samples = spread_indices(len(self.t), max_times)
        centres, radii = [np.zeros((0, 3))], [np.zeros(0)]
        displacement = np.zeros((len(samples), 3)) if pan is None else pan[samples]
        for solid in self.solids:
            if pan is not None and solid.link == WORLD:
                continue
            poses = _link_pose(self.poses[samples], solid.link)
            for end in solid.axis:
                centres.append(poses[..., :3] @ end + poses[..., 3] - displacement)
                radii.append(np.full(len(samples), _radius(solid)))
        lines = (*self.points, *self.chains, *self.springs)
        covered_lines = lines if strings or not self.solids else ()
        for points in (*covered_lines, *self.guides):
            positions = (points[samples] - displacement[:, None]).reshape(-1, 3)
            centres.append(positions)
            radii.append(np.zeros(len(positions)))
        all_centres = np.concatenate(centres)
        finite = np.isfinite(all_centres).all(axis=1)
        if not finite.any():
            return np.zeros((1, 3)), np.ones(1)
        return all_centres[finite], np.concatenate(radii)[finite]

    def with_shadows(self, centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Balls (n, 3), (n,) [m] and the points below them on the floor, unless it is far below."""
        heights = centres[:, 2] - self.floor
        is_near = (heights > 0.0) & (heights < 0.25 * self.size)
        points = np.column_stack([centres[is_near, :2], np.full(is_near.sum(), self.floor)])
        return np.concatenate([centres, points]), np.concatenate([radii, np.zeros(len(points))])

    def ground_box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (2,) of the motion seen from above, without outliers [m]."""
        low, high = np.percentile(self.balls()[0][:, :2], [2.0, 98.0], axis=0)
        return low, high

    def tension_full_scale(self) -> float:
        """Upper end of the tension scale [N]: a round number above 98 % of the tensions."""
        if self.tension is None:
            return 1.0
        pulls = np.concatenate([self.tension.ravel(), self.chain_forces.ravel()])
        pulls = np.abs(pulls[np.isfinite(pulls)])
        pulls = pulls[pulls > 0.0]
        if not pulls.size:
            return 1.0
        reference_tension = float(np.percentile(pulls, 98.0))
        unit = 10.0 ** np.floor(np.log10(reference_tension))
        steps = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
        return float(unit * min(f for f in steps if f * unit >= reference_tension * (1.0 - 1e-9)))


def spread_indices(n: int, max_count: int) -> np.ndarray:
    """Evenly spaced indices from 0 to n - 1, at most ``max_count``."""
    return np.unique(np.linspace(0, n - 1, max_count).astype(int))


def round_down(length: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is at most ``length``."""
    unit = 10.0 ** np.floor(np.log10(length))
    return float(unit * max(f for f in (1.0, 2.0, 5.0) if f * unit <= length * (1.0 + 1e-9)))


def run_geometry(marionette: Drawable, run: Trajectory, forces: bool = False) -> Geometry:
    """Geometry of a run, with or without the forces of its contacts."""
    geometry = _make_geometry(
        marionette,
        np.asarray(run.t),
        run.q_D,
        run.q_K,
        run.taut.values,
        run.tension.values,
        0.0 if run.slip is None else run.slip.values,
    )
    return replace(geometry, arrows=_force_arrows(run, geometry.size)) if forces else geometry


def _force_arrows(run: Trajectory, size: float) -> tuple[np.ndarray, ...]:
    """(n, 2, 3) arrows of contact forces at each sample [m].

    Lengths are proportional to the forces: 9 of 10 are below 0.15 ``size``. Arrows of impacts are
    shortened to twice that.
    """
    contact = run.contact
    if contact is None:
        raise ValueError("this run has no contacts, so there are no forces to draw")
    force = np.linalg.norm(contact.force, axis=1)
    reference = float(np.percentile(force, 90.0)) if len(force) else 0.0
    ends = np.searchsorted(contact.sample, np.arange(1, len(run)))
    return tuple(np.split(force_arrows(contact, reference, size), ends))


def force_arrows(contact: ContactPoints, reference: float, size: float) -> np.ndarray:
    """(n, 2, 3) foot and head of the arrows of contact forces [m].

    Args:
        contact: the contact points.
        reference: force of an arrow of 0.15 ``size`` [N]; arrows are at most twice as long.
        size: size of the scene [m].
    """
    force = np.linalg.norm(contact.force, axis=1)
    scale = np.minimum(0.15 * size / max(reference, 1e-300), 0.3 * size / np.maximum(force, 1e-300))
    return np.stack([contact.point, contact.point + scale[:, None] * contact.force], axis=1)


def state_geometry(
    marionette: Drawable, state: State, tension: np.ndarray | None = None
) -> Geometry:
    """Geometry of one state.

    Args:
        marionette: the puppet.
        state: configuration and active set.
        tension: (n_strings,) tensions [N]; None draws strings without the tension scale.
    """
    n = len(marionette.tree.strings)
    return _make_geometry(
        marionette,
        np.array([state.t]),
        state.q_D[None],
        state.q_K[None],
        state.taut[None, :n],
        None if tension is None else np.asarray(tension, dtype=float)[None],
        state.slip[None] if len(state.slip) else 0.0,
    )


def _make_geometry(
    marionette: Drawable,
    t: Array,
    q_D: Array,
    q_K: Array,
    taut: np.ndarray,
    tension: Array | None,
    slip: Array | float,
) -> Geometry:
    tree, puppet = _with_values(marionette.tree, marionette.number), marionette.puppet
    poses = np.asarray(marionette.poses(q_D, q_K))
    points = tuple(np.asarray(p) for p in marionette.string_points(q_D, q_K).values())
    springs = spring_ends(tree, poses)
    chains, chain_forces = (
        chain_points(tree, poses),
        mean_chain_forces(marionette, tree, poses, q_D, q_K),
    )
    solids = link_solids(tree)
    size = _size(solids, poses, (*points, *chains))
    solids += stand_in_solids(tree, size)
    lowest = _lowest(solids, poses) if solids else 0.0
    floor = lowest - 0.04 * size if puppet.floor is None else float(puppet.floor)
    return Geometry(
        title=tree.name,
        t=t,
        solids=tuple(obstacle_solids(puppet) + solids),
        poses=poses,
        names=tuple(s.name for s in tree.strings),
        points=points,
        lengths=np.asarray(marionette.string_lengths(q_D, q_K)) + slip,
        taut=np.asarray(taut, dtype=bool),
        tension=None if tension is None else np.asarray(tension, dtype=float),
        colours=tuple(None if s.colour is None else rgb(s.colour) for s in tree.strings),
        wires=tuple(s.wire for s in tree.strings),
        springs=springs,
        chains=chains,
        chain_forces=chain_forces,
        chain_colours=tuple(None if c.colour is None else rgb(c.colour) for c in tree.chains),
        floor=floor,
        ground=puppet.floor is not None,
        plane=puppet.mirror.plane if puppet.mirror else None,
        size=size,
        tree=tree,
    )


def spring_ends(tree: Tree, poses: np.ndarray) -> tuple[np.ndarray, ...]:
    """(..., 2, 3) ends of each spring [m], from link poses (..., n_links, 3, 4)."""
    return _points_of(tree.springs, poses)


def chain_points(tree: Tree, poses: np.ndarray) -> tuple[np.ndarray, ...]:
    """(..., n_points, 3) positions of ends and masses of each chain [m], from link poses."""
    return _points_of(tree.chains, poses)


def _points_of(rows: Sequence[SpringRow | ChainRow], poses: np.ndarray) -> tuple[np.ndarray, ...]:
    return tuple(
        np.stack([_world_points(poses, end) for end in row.points], axis=-2) for row in rows
    )


def mean_chain_forces(
    marionette: Drawable, tree: Tree, poses: np.ndarray, q_D: np.ndarray, q_K: np.ndarray
) -> np.ndarray:
    """(..., n_chains) mean force EA (d / l - 1) of springs of lengths d, unstretched l [N]."""
    pulls = []
    for row, points in zip(tree.chains, chain_points(tree, poses), strict=True):
        path = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)
        length = row.unstretched_length(q_D, q_K, marionette.number)
        pulls.append(marionette.number(row.stiffness) * (path / length - 1.0))
    return np.stack(pulls, axis=-1) if pulls else np.zeros((*poses.shape[:-3], 0))


def _with_values(tree: Tree, number: Callable[[Number], float]) -> Tree:
    """The tree with current values in place of the parameters that pictures depend on."""

    def numbers(xs: tuple[Number, Number, Number]) -> tuple[float, float, float]:
        x, y, z = xs
        return number(x), number(y), number(z)

    def point(p: Point) -> Point:
        return replace(p, at=numbers(p.at))

    strings = (replace(s, points=tuple(map(point, s.points))) for s in tree.strings)
    springs = (replace(s, points=(point(s.points[0]), point(s.points[1]))) for s in tree.springs)
    chains = (replace(c, points=tuple(map(point, c.points))) for c in tree.chains)
    links = (
        replace(
            link,
            offset=numbers(link.offset),
            mass=None if link.mass is None else number(link.mass),
            com=None if link.com is None else numbers(link.com),
        )
        for link in tree.links
    )
    return replace(
        tree,
        links=tuple(links),
        strings=tuple(strings),
        springs=tuple(springs),
        chains=tuple(chains),
    )


def _link_pose(poses: np.ndarray, link: int) -> np.ndarray:
    if link == WORLD:
        return np.broadcast_to(np.eye(3, 4), (*poses.shape[:-3], 3, 4))
    return poses[..., link, :, :]


def _world_points(poses: np.ndarray, point: Point) -> np.ndarray:
    pose = _link_pose(poses, point.link)
    return pose[..., :3] @ np.array(point.at) + pose[..., 3]


def _radius(solid: Solid) -> float:
    """Radius of balls around the ends of the axis that cover the solid [m]."""
    if solid.kind == "capsule":
        return solid.radius
    if solid.kind == "ellipsoid":
        return float(np.sort(np.linalg.norm(solid.half_axes, axis=0))[1])
    gaps = np.linalg.norm(solid.points[:, None] - solid.axis[None], axis=-1)
    return float(gaps.min(axis=1).max())


def _lowest(solids: list[Solid], poses: np.ndarray) -> float:
    lowest = np.inf
    for solid in solids:
        pose = _link_pose(poses, solid.link)
        down = pose[:, 2, :3]
        heights = down @ solid.points.T + pose[:, 2, 3:]
        if solid.kind == "ellipsoid":
            heights = heights - np.linalg.norm(down @ solid.half_axes, axis=-1)[:, None]
        lowest = min(lowest, float(np.min(heights)) - solid.radius)
    return lowest if np.isfinite(lowest) else 0.0


def _size(solids: list[Solid], poses: np.ndarray, points: tuple[np.ndarray, ...]) -> float:
    position_sets = [poses[0, :, :, 3], *(p[0] for p in points)]
    for solid in solids:
        pose = _link_pose(poses[0], solid.link)
        position_sets.append(solid.points @ pose[:, :3].T + pose[:, 3])
    positions = np.concatenate(position_sets)
    positions = positions[np.isfinite(positions).all(axis=1)]
    size = float(np.ptp(positions, axis=0).max()) if len(positions) else 0.0
    return size if size > 1e-9 else 1.0
