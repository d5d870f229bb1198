"""Nonconvex meshes in contact: convex pieces in runs, their accuracy, and refused meshes."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import numpy as np
import pytest
import trimesh

import fantoccini as fan
from contact.dented_meshes import bowl, hook, ring, written
from fantoccini.base.errors import PuppetError
from fantoccini.kernel.runtime import pieces
from fantoccini.kernel.runtime.hulls import mesh_hulls
from fantoccini.model.puppet import Mesh

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

SCENE = """
puppet: scene
contact: {friction: 0.5}
obstacles: [OBSTACLE]
bodies:
- name: thing
  joint: {type: free}
  drag: {linear: 0.1, angular: 0.002}
  shapes: [SHAPE]
"""
MESH = "{type: mesh, file: thing.obj, mass: 0.5}"
WALL = "{name: wall, type: box, size: [0.08, 0.4, 1], at: [0, 0, -0.5]}"
PEG = "{name: peg, type: capsule, from: [0, -0.1, 0], to: [0, 0.1, 0], radius: 0.02}"
BALL = "{type: sphere, radius: 0.02, mass: 0.1}"
METHODS = ("timestepping", "event")


def scene(
    folder: Path, mesh: trimesh.Trimesh, obstacle: str, shape: str = MESH, more: str = ""
) -> fan.Marionette:
    """A free body and an obstacle; one of them may be the mesh `thing.obj`."""
    written(folder, mesh)
    path = folder / "scene.yaml"
    path.write_text(SCENE.replace("OBSTACLE", obstacle).replace("SHAPE", shape) + more)
    return fan.load(path)


def check(run: fan.Trajectory) -> None:
    """No overlaps, valid forces, and a balanced ledger: fixed steps lose to order dt."""
    assert run.status is fan.Status.DONE
    event = run.method == "event"
    assert np.min(run.contact.gap) > (-1e-9 if event else -1e-6)
    # At the instant of an event, ending contacts violate the law by up to the tolerance of guards.
    at_events = np.isin(run.t, [e.t for e in run.events]) if event else np.zeros(len(run), bool)
    assert np.max(run.contact_residual[~at_events]) < 1e-9
    assert np.max(run.contact_residual) < 1e-7
    assert np.max(np.abs(run.ledger["residual"])) < (1e-7 if event else 1e-2)


@pytest.mark.parametrize("method", METHODS)
def test_a_bowl_catches_a_ball(tmp_path, method):
    """It comes to rest inside, at the lowest place above the pieces."""
    puppet = scene(tmp_path, bowl(), "{name: bowl, type: mesh, file: thing.obj}", BALL)
    x0 = puppet.state({"thing.x": 0.03, "thing.y": 0.01, "thing.z": 0.2})
    run = fan.simulate(puppet, x0, t_end=4.0, method=method)
    check(run)
    assert np.hypot(*run.q_D[-1, :2]) < 0.01
    # The bowl's inner pole is at 0.02; pieces may fill 3 % of the longest side, 0.2 m.
    assert -1e-6 < run.q_D[-1, 2] - 0.04 < 0.03 * 0.2
    assert np.max(np.abs(run.v_D[-1])) < 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_a_hook_hangs_over_the_edge_of_a_wall(tmp_path, method):
    puppet = scene(tmp_path, hook(), WALL)
    run = fan.simulate(puppet, puppet.state({"thing.z": 0.005}), t_end=1.0, method=method)
    check(run)
    assert np.allclose(run.q_D[-1, :3], 0.0, atol=1e-4)
    assert np.max(np.abs(run.v_D[-1])) < 1e-9
    force = run.contact.force_on("thing", len(run))[-1]
    assert np.allclose(force, [0, 0, 0.5 * 9.81], atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_ring_hangs_on_a_peg(tmp_path, method):
    puppet = scene(tmp_path, ring(), PEG)
    run = fan.simulate(puppet, puppet.state({"thing.z": -0.055}), t_end=2.0, method=method)
    check(run)
    # Its hole has the radius 0.08, the peg 0.02.
    assert -0.06 - 1e-6 < run.q_D[-1, 2] < -0.06 + 0.03 * 0.24
    assert np.linalg.norm(run.q_D[-1, :2]) < 5e-3
    assert {event.name for event in run.events} == {"thing|peg"}


def test_a_ball_rolls_to_rest_over_the_pieces_of_a_bowl_beside_a_ring_on_a_peg(tmp_path):
    """The example's scene, event-driven: over edges and seams, the ledger balanced to rounding."""
    (tmp_path / "bowl.obj").write_text(bowl().export(file_type="obj"))
    written(tmp_path, ring())
    (tmp_path / "dented.yaml").write_text("""
puppet: dented
floor: 0
contact: {friction: 0.4}
obstacles:
- {name: bowl, type: mesh, file: bowl.obj}
- {name: peg, type: capsule, from: [0.3, -0.08, 0.2], to: [0.3, 0.08, 0.2], radius: 0.02}
bodies:
- name: ball
  joint: {type: free}
  drag: {linear: 0.02, angular: 1.0e-4}
  shapes: [{type: sphere, radius: 0.02, mass: 0.1}]
- name: ring
  joint: {type: free}
  drag: {linear: 0.1, angular: 0.002}
  shapes: [{type: mesh, file: thing.obj, mass: 0.3}]
pose: {ball.x: 0.05, ball.y: 0.01, ball.z: 0.25, ring.x: 0.29, ring.z: 0.15}
""")
    scene = fan.load(tmp_path / "dented.yaml")
    run = fan.simulate(scene, scene.state(), t_end=2.5)
    check(run)
    assert np.max(np.abs(run.ledger["residual"])) < 1e-10
    assert np.hypot(*run.q_D[-1, :2]) < 0.02
    assert {event.name for event in run.events} == {"ball|bowl", "ring|peg"}


def test_a_dented_mesh_in_lanes_and_in_a_scene_of_two(tmp_path):
    """Batches move it as single runs do; a second body has its own pieces."""
    puppet = scene(
        tmp_path,
        hook(),
        WALL,
        more="- {name: other, joint: {type: free}, shapes: [" + MESH + "]}\n",
    )
    assert len(puppet.contacts.hulls) == 6
    method = fan.TimeStepping(dt=1e-3)
    starts = [
        puppet.state({"thing.z": 0.005 + 0.001 * i, "other.z": 0.33, "other.y": 0.05})
        for i in range(9)
    ]
    batch = fan.simulate_batch(puppet, starts, t_end=0.3, method=method)
    for i, x0 in enumerate(starts):
        run = fan.simulate(puppet, x0, t_end=0.3, method=method)
        assert np.allclose(batch.q_D[i][-1], run.q_D[-1], rtol=0, atol=1e-9)
    assert {"thing|wall", "other|thing"} <= {event.name for event in run.events}
    # Pieces of one body do not touch each other.
    assert all(len(set(pair)) == 2 for pair in puppet.contacts.names)


def hulls_of(folder: Path, mesh: trimesh.Trimesh):
    """The pieces of a mesh, from a file, and the mesh read back."""
    scene(folder, mesh, WALL)
    shape = fan.load(folder / "scene.yaml").tree.links[0].shapes[0]
    assert isinstance(shape, Mesh)
    return mesh_hulls(shape), mesh


@pytest.mark.parametrize("make", [bowl, ring, hook])
def test_pieces_are_the_mesh_to_3_percent(tmp_path, make):
    """Distances of random balls from the pieces, and from the mesh by coal."""
    hulls, mesh = hulls_of(tmp_path, make())
    size = float(np.max(mesh.extents))
    rng = np.random.default_rng(0)
    low, high = mesh.bounds
    points = rng.uniform(low - 0.1 * size, high + 0.1 * size, size=(400, 3))
    points = points[~pieces.inside(mesh, points)]
    exact = pieces.distances(mesh, points)
    distances = np.min([_distance(hull, points) for hull in hulls], axis=0)
    assert np.max(np.abs(distances - exact)) < 0.03 * size
    assert np.median(np.abs(distances - exact)) < 0.01 * size


def _distance(hull, points: np.ndarray) -> np.ndarray:
    """(n,) distances of points from a hull, by coal; 0 within."""
    faces = [
        [hull.corners[a], hull.corners[k], hull.corners[k + 1]]
        for a, b in zip(hull.begins, hull.begins[1:], strict=False)
        for k in range(a + 1, b - 1)
    ]
    solid = trimesh.Trimesh(hull.vertices + hull.centroid, faces, process=False)
    away = pieces.distances(solid, points)
    return np.where(pieces.inside(solid, points), 0.0, away)


def test_winding_numbers_and_distances_have_closed_forms():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    points = np.random.default_rng(0).uniform(-1, 1, size=(200, 3))
    r = np.linalg.norm(points, axis=1)
    clear = np.abs(r - 0.5) > 0.01
    assert np.array_equal(pieces.inside(ball, points)[clear], (r < 0.5)[clear])
    assert np.allclose(pieces.distances(ball, points), np.abs(r - 0.5), atol=2e-3)


def test_the_same_mesh_has_the_same_pieces_with_and_without_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path / "cache"))
    first, _ = hulls_of(tmp_path, hook())
    (cached,) = (tmp_path / "cache").glob("??/*.npz")
    for spoil in (None, b"", b"PK\x03\x04 no archive"):
        if spoil is not None:
            cached.write_bytes(spoil)
        repeated, _ = hulls_of(tmp_path, hook())
        for piece, other in zip(first, repeated, strict=True):
            assert np.array_equal(piece.vertices, other.vertices)
    cached.chmod(0o666)  # not to be trusted: computed again, with the permissions of the first
    hulls_of(tmp_path, hook())
    assert cached.stat().st_mode & 0o777 == 0o600


def test_mass_is_that_of_the_mesh(tmp_path):
    marionette = scene(tmp_path, hook(), WALL, MESH.replace("mass: 0.5", "density: 1000"))
    assert marionette.weight == pytest.approx(9.81 * 1000 * hook().volume)


def refused(thing: fan.Marionette, text: str) -> None:
    with pytest.raises(PuppetError) as error:
        _ = thing.contacts
    assert text in str(error.value)
    assert "scene.yaml:6: shapes of thing: thing.obj" in str(error.value)


def test_a_missing_library_has_a_remedy(tmp_path, monkeypatch):
    known = importlib.metadata.version

    def version(name: str) -> str:
        if name == "coacd":
            raise importlib.metadata.PackageNotFoundError(name)
        return known(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    puppet = scene(tmp_path, hook(), WALL)
    refused(puppet, "is not installed: python -m pip install coacd")


def test_too_many_pieces_and_pieces_that_do_not_fit_are_refused(tmp_path, monkeypatch):
    tolerances = pieces.PieceTolerances(max_pieces=2)
    monkeypatch.setattr(pieces, "TOLERANCES", tolerances)
    refused(scene(tmp_path, hook(), WALL), "needs 3 convex pieces in contact; allowed: 2")
    tight = pieces.PieceTolerances(deviation=1e-9)
    monkeypatch.setattr(pieces, "TOLERANCES", tight)
    refused(scene(tmp_path, hook(), WALL), "could not be cut into convex pieces")


def test_a_mesh_with_later_contact_is_refused(tmp_path):
    """Compiled code has a fixed number of solids, those with contact when it was compiled."""
    puppet = scene(tmp_path, hook(), WALL)
    path = tmp_path / "scene.yaml"
    path.write_text(path.read_text().replace(WALL, ""))
    alone = fan.load(path)
    assert len(alone.contacts.hulls) == 0
    among = alone.with_obstacles(puppet.puppet.obstacles)
    refused(among, "touched nothing when the puppet was compiled")
    # The reverse is possible.
    bare = puppet.with_obstacles(())
    assert len(bare.contacts.hulls) == 0
    fan.simulate(bare, bare.state(), t_end=0.01, method="timestepping")
