"""glTF 2.0 in one file (.glb): y up, metres; each body is a node under its parent's node."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Status, Times, rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.animation.bodies import Track, tracks_of
from fantoccini.output.animation.figures import floor_node, solid_node
from fantoccini.output.animation.gltf import Channels, Document, placed, xyzw
from fantoccini.output.animation.grid import Grid
from fantoccini.output.animation.pieces import named_solids
from fantoccini.output.animation.scene import AnimatedScene
from fantoccini.output.animation.spans import Spans, StringSamples
from fantoccini.output.animation.strands import Strands

_UP = np.sqrt(0.5) * np.array([1.0, -1.0, 0.0, 0.0])
"""Rotation from the world's z up to glTF's y up."""
_MIN_CHANGE = 1e-8
"""Change of a value below which it gets no keys [m or 1]."""


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes a scene."""
    run = scene.run
    document = Document({"asset": _asset(scene), "scene": 0})
    root = document.add("nodes", placed({"name": scene.tree.name}, np.zeros(3), _UP))
    channels = Channels(document)
    grid = Grid.of(run)
    nodes = _bodies(scene, grid, document, channels, root)
    _solids(scene, document, {WORLD: root, **nodes})
    strands = Strands(document, channels, scene, nodes, root)
    samples = StringSamples.among(scene, grid)
    meshes = [strands.add(line, Spans.of(scene, line, samples)) for line in scene.lines]
    # Skinned meshes are siblings of the root: only their joints move them.
    document.content["scenes"] = [{"nodes": [root, *meshes]}]
    channels.finish(scene.tree.name)
    document.save(path)


def _asset(scene: AnimatedScene) -> dict[str, object]:
    """Generator of the file and, if the run stopped early, the reason."""
    run = scene.run
    asset: dict[str, object] = {"version": "2.0", "generator": "fantoccini"}
    if run.status is not Status.DONE:
        asset["extras"] = {"status": run.status.name, "message": run.status.message}
    return asset


def _bodies(
    scene: AnimatedScene, grid: Grid, document: Document, channels: Channels, root: int
) -> dict[int, int]:
    """Adds a node for each link, with its keys; returns the nodes by link."""
    nodes = {WORLD: root}
    moves = _splines(scene, grid) if scene.fps is None else _lines(scene, scene.fps)
    for k, (r, q) in moves.items():
        node = placed({"name": scene.tree.links[k].name}, r.first, q.first)
        nodes[k] = document.add("nodes", node)
        _add_child(document, nodes[scene.parents[k]], nodes[k])
        for move, path in ((r, "translation"), (q, "rotation")):
            if len(move.t):
                values = xyzw(move.values) if path == "rotation" else move.values
                channels.add(nodes[k], path, move.t, values, move.interpolation)
    del nodes[WORLD]
    return nodes


class _Move(NamedTuple):
    """Keys of a translation or an orientation; none if it is constant."""

    first: Array
    t: Times
    values: Array
    interpolation: str


def _splines(scene: AnimatedScene, grid: Grid) -> dict[int, tuple[_Move, _Move]]:
    return {k: (_spline(body.r), _spline(body.q)) for k, body in tracks_of(scene, grid).items()}


def _spline(track: Track) -> _Move:
    """A track's keys in glTF's three rows: rate before the key, value, rate after it."""
    x, v, keys = track.curve.x, track.curve.v, track.keys
    if keys is None:
        return _Move(x[0], np.zeros(0), x[:0], "LINEAR")
    rows = np.stack([v[keys.before], x[keys.before], v[keys.after]], axis=1)
    t = track.curve.t[keys.before]
    return _Move(x[0], t, rows.reshape(-1, x.shape[1]), "CUBICSPLINE")


def _lines(scene: AnimatedScene, fps: float) -> dict[int, tuple[_Move, _Move]]:
    """Linear motions of all links, with a key for each frame."""
    t = scene.frames(fps)
    run = scene.run.resample(t)
    moves = {}
    for k in scene.links:
        motion = scene.motion(k, run)
        moves[k] = (_line(t, motion.r), _line(t, rotation.continuous(motion.q)))
    return moves


def _line(t: Times, x: Array) -> _Move:
    n = len(t) if np.abs(x - x[0]).max() > _MIN_CHANGE else 0
    return _Move(x[0], t[:n] - t[0], x[:n], "LINEAR")


def _solids(scene: AnimatedScene, document: Document, nodes: dict[int, int]) -> None:
    """Adds shapes to the nodes of their links, and obstacles and the floor to the root."""
    for name, solid in named_solids(scene):
        node = document.add("nodes", solid_node(document, solid, name))
        _add_child(document, nodes[solid.link], node)
    if scene.geometry.ground and scene.complete:
        _add_child(document, nodes[WORLD], document.add("nodes", floor_node(document, scene)))


def _add_child(document: Document, parent: int, child: int) -> None:
    document.content["nodes"][parent].setdefault("children", []).append(child)
