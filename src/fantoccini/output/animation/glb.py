"""glTF 2.0 in one file (.glb): y up, metres; each body is a node under its parent's node.

A key is a value at a time, between which a player interpolates; a link is a body on its joint.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Status, Times, rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.animation.bodies import Track, compute_tracks
from fantoccini.output.animation.figures import floor_node, solid_node
from fantoccini.output.animation.gltf import Channels, Document, with_transform, xyzw
from fantoccini.output.animation.grid import Grid
from fantoccini.output.animation.pieces import named_solids
from fantoccini.output.animation.scene import AnimatedScene
from fantoccini.output.animation.spans import Spans, StringSamples
from fantoccini.output.animation.strands import StringMeshWriter

_Z_UP_TO_Y_UP = np.sqrt(0.5) * np.array([1.0, -1.0, 0.0, 0.0])
"""Rotation from the world's z up to glTF's y up."""
_MIN_CHANGE = 1e-8
"""Change of a value below which it gets no keys [m or 1]."""


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes a scene."""
    run = scene.run
    document = Document({"asset": _asset(scene), "scene": 0})
    root = document.add(
        "nodes", with_transform({"name": scene.tree.name}, np.zeros(3), _Z_UP_TO_Y_UP)
    )
    channels = Channels(document)
    grid = Grid.from_run(run)
    nodes = _add_bodies(scene, grid, document, channels, root)
    _add_solids(scene, document, {WORLD: root, **nodes})
    writer = StringMeshWriter(document, channels, scene, nodes, root)
    samples = StringSamples.at_even_times(scene, grid)
    meshes = [writer.add(line, Spans.of_line(scene, line, samples)) for line in scene.lines]
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


def _add_bodies(
    scene: AnimatedScene, grid: Grid, document: Document, channels: Channels, root: int
) -> dict[int, int]:
    """Adds a node for each link, with its keys; returns the nodes by link."""
    nodes = {WORLD: root}
    motions = (
        _spline_motions(scene, grid) if scene.fps is None else _linear_motions(scene, scene.fps)
    )
    for k, (r, q) in motions.items():
        node = with_transform({"name": scene.tree.links[k].name}, r.first, q.first)
        nodes[k] = document.add("nodes", node)
        _add_child(document, nodes[scene.parents[k]], nodes[k])
        for motion, property_name in ((r, "translation"), (q, "rotation")):
            if len(motion.t):
                values = xyzw(motion.values) if property_name == "rotation" else motion.values
                channels.add(nodes[k], property_name, motion.t, values, motion.interpolation)
    del nodes[WORLD]
    return nodes


class _KeyedMotion(NamedTuple):
    """Keys of a translation or an orientation; none if it is constant."""

    first: Array
    t: Times
    values: Array
    interpolation: str


def _spline_motions(
    scene: AnimatedScene, grid: Grid
) -> dict[int, tuple[_KeyedMotion, _KeyedMotion]]:
    return {
        k: (_spline_motion(body.r), _spline_motion(body.q))
        for k, body in compute_tracks(scene, grid).items()
    }


def _spline_motion(track: Track) -> _KeyedMotion:
    """A track's keys in glTF's three rows: rate before the key, value, rate after it."""
    x, v, keys = track.curve.x, track.curve.v, track.keys
    if keys is None:
        return _KeyedMotion(x[0], np.zeros(0), x[:0], "LINEAR")
    rows = np.stack([v[keys.before], x[keys.before], v[keys.after]], axis=1)
    t = track.curve.t[keys.before]
    return _KeyedMotion(x[0], t, rows.reshape(-1, x.shape[1]), "CUBICSPLINE")


def _linear_motions(
    scene: AnimatedScene, fps: float
) -> dict[int, tuple[_KeyedMotion, _KeyedMotion]]:
    """Linear motions of all links, with a key for each frame."""
    t = scene.frames(fps)
    run = scene.run.resample(t)
    motions = {}
    for k in scene.links:
        local_motion = scene.motion(k, run)
        motions[k] = (
            _linear_motion(t, local_motion.r),
            _linear_motion(t, rotation.continuous(local_motion.q)),
        )
    return motions


def _linear_motion(t: Times, x: Array) -> _KeyedMotion:
    n_keys = len(t) if np.abs(x - x[0]).max() > _MIN_CHANGE else 0
    return _KeyedMotion(x[0], t[:n_keys] - t[0], x[:n_keys], "LINEAR")


def _add_solids(scene: AnimatedScene, document: Document, nodes: dict[int, int]) -> None:
    """Adds shapes to the nodes of their links, and obstacles and the floor to the root."""
    for name, solid in named_solids(scene):
        node = document.add("nodes", solid_node(document, solid, name))
        _add_child(document, nodes[solid.link], node)
    if scene.geometry.ground and scene.complete:
        _add_child(document, nodes[WORLD], document.add("nodes", floor_node(document, scene)))


def _add_child(document: Document, parent: int, child: int) -> None:
    document.content["nodes"][parent].setdefault("children", []).append(child)
