"""Distances from meshes compared with closed forms, and with the same solids as boxes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from functools import cache

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.control.tasks import RolloutOptions
from fantoccini.dynamics.clearance import Clearance
from fantoccini.kernel.runtime import ClearanceLibrary

pytestmark = [pytest.mark.medium, pytest.mark.long]

THICKNESS = 0.1
"""Thickness of the legs of the L. They lie along x and z, and are 0.4 long and 0.2 wide along y."""


def prism_mesh(
    outline: list[tuple[float, float]], triangles: list[tuple[int, ...]]
) -> trimesh.Trimesh:
    """Prism from y = -0.1 to 0.1; its outline in x and z is counter-clockwise from y = -0.1."""
    n, corners_2d = len(outline), np.array(outline)
    front = np.column_stack([corners_2d[:, 0], np.full(n, -0.1), corners_2d[:, 1]])
    corners = np.vstack([front, front + np.array([0.0, 0.2, 0.0])])
    faces = [*triangles, *((c + n, b + n, a + n) for a, b, c in triangles)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(j, i, i + n), (j, i + n, j + n)]
    return trimesh.Trimesh(corners, faces)


def l_mesh() -> trimesh.Trimesh:
    """The L."""
    outline = [
        (0, 0),
        (0.4, 0),
        (0.4, THICKNESS),
        (THICKNESS, THICKNESS),
        (THICKNESS, 0.4),
        (0, 0.4),
    ]
    return prism_mesh(outline, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Meshes: an L, a tetrahedron, a sheet; boxes, also small, fine, in pieces, hollow or open."""
    path = tmp_path_factory.mktemp("meshes")
    ell, box = l_mesh().subdivide(), trimesh.creation.box((0.2, 0.3, 0.4))
    small = box.copy().apply_scale(0.1)
    assert ell.is_volume and ell.volume == pytest.approx(0.2 * (0.4 * 0.1 + 0.3 * 0.1))
    corner = trimesh.Trimesh(
        np.vstack([np.zeros(3), 0.3 * np.eye(3)]), [(0, 2, 1), (0, 3, 2), (0, 1, 3), (1, 2, 3)]
    )
    halves = [trimesh.creation.box((0.1, 0.3, 0.4)).apply_translation((x, 0, 0)) for x in (-1, 1)]
    for half, x in zip(halves, (0.95, -0.95), strict=True):
        half.apply_translation((x, 0, 0))
    hole = trimesh.creation.box((0.1, 0.2, 0.3))
    hole.invert()
    for name, mesh in {
        "ell": ell,
        "corner": corner,
        "box": box.subdivide(),
        "halves": sum(halves[1:], halves[0]),
        "hollow": box + hole,
        "open": trimesh.Trimesh(box.vertices, box.faces[:-2]),
        "sheet": trimesh.Trimesh(corner.vertices, corner.faces[3:]),
        "small": small,
        "pair": small + small.copy().apply_translation([1, 0, 0]),
        "fine": box.subdivide().subdivide().subdivide(),
    }.items():
        mesh.export(path / f"{name}.obj")
    return path


@pytest.fixture(autouse=True)
def in_mesh_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)


def bodies_with_shapes(*shapes: dict) -> fan.Marionette:
    """A free body for every shape; shapes are not compiled, so that one library suffices."""
    bodies = [
        body | {"shapes": [s]} for body, s in zip(unshaped_bodies(len(shapes)), shapes, strict=True)
    ]
    puppet = fan.loads(str({"puppet": "flying", "bodies": bodies}))
    puppet.__dict__["clearances"] = shared_clearances(len(shapes))
    return puppet


def unshaped_bodies(n: int) -> list[dict]:
    """Bodies without a support."""
    inertia = {"mass": 1.0, "inertia": [1, 1, 1, 0, 0, 0]}
    return [
        {"name": f"body{k}", "joint": {"name": f"j{k}", "type": "free"}, **inertia}
        for k in range(n)
    ]


@cache
def shared_clearances(n: int) -> ClearanceLibrary:
    return fan.loads(str({"puppet": "flying", "bodies": unshaped_bodies(n)})).libraries.clearances


def mesh_shape(file: str, **options) -> dict:
    return {"type": "mesh", "file": f"{file}.obj", **options}


def state_with_poses(puppet: fan.Marionette, *poses: tuple[np.ndarray, Rotation]) -> fan.State:
    """A state in which each body has a given position and orientation."""
    numbers = [[*translation, *np.roll(rotation.as_quat(), 1)] for translation, rotation in poses]
    return puppet.state().replace(q_D=np.ravel(numbers))


def distances(puppet: fan.Marionette, obstacle: dict, places: np.ndarray) -> np.ndarray:
    """Distances of an obstacle from a body that is at places (n, 3), without rotation."""
    q_D = np.column_stack([places, np.tile([1.0, 0, 0, 0], (len(places), 1))])
    return Clearance(puppet, [obstacle | {"name": "it"}]).at(q_D, np.zeros((len(places), 0)))


@pytest.fixture(scope="module")
def bead():
    return bodies_with_shapes({"type": "sphere", "radius": 1e-3})


@pytest.mark.parametrize("name", ["box", "fine", "halves"])
@pytest.mark.parametrize("kind", ["capsule", "box", "ellipsoid", "half_space", "mesh"])
def test_a_mesh_of_a_box_is_the_box(folder, name, kind):
    rng = np.random.default_rng(3)
    puppet = bodies_with_shapes(mesh_shape(name))
    box_puppet = bodies_with_shapes({"type": "box", "size": [0.2, 0.3, 0.4]})
    obstacle = {
        "capsule": {"from": [-0.1, 0.02, 0.0], "to": [0.1, 0.05, 0.07], "radius": 0.02},
        "box": {"size": [0.1, 0.2, 0.3], "orientation": {"rpy": [0.4, 0.2, -0.5]}},
        "ellipsoid": {"radii": [0.1, 0.02, 0.05], "orientation": {"rpy": [0.4, 0.2, -0.5]}},
        "half_space": {"at": [0.0, 0.0, -0.1], "normal": [0.3, -0.2, 0.9]},
        "mesh": {"file": "box.obj"},
    }[kind] | {"type": kind, "name": "it"}
    box_obstacle = (
        {"type": "box", "size": [0.2, 0.3, 0.4], "name": "it"} if kind == "mesh" else obstacle
    )
    mesh_clearance = Clearance(puppet, [obstacle])
    box_clearance = Clearance(box_puppet, [box_obstacle])
    n_apart = 0
    for _ in range(25):
        rotation, translation = Rotation.random(random_state=rng), rng.normal(0, 0.25, 3)
        distance = float(mesh_clearance.of(state_with_poses(puppet, (translation, rotation))))
        expected = float(box_clearance.of(state_with_poses(box_puppet, (translation, rotation))))
        if expected > 0.0 or kind == "half_space":
            assert distance == pytest.approx(expected, abs=1e-7)
        assert (distance > 0.0) == (expected > 0.0)
        n_apart += expected > 0.0
    assert 3 < n_apart < 24


@pytest.mark.parametrize(
    ("at", "gap"),
    [
        ((0.5, 0.5, 0.5), (1.5 - 0.3) / np.sqrt(3)),  # the slanted face
        ((0.1, 0.1, -0.2), 0.2),  # a face
        ((-0.3, -0.4, 0.1), 0.5),  # an edge
        ((-0.2, -0.3, -0.6), 0.7),  # a corner
        ((0.0, 0.0, 0.5), 0.2),  # another
    ],
)
def test_a_moving_tetrahedron_has_the_distance_of_geometry(at, gap):
    rng = np.random.default_rng(4)
    puppet = bodies_with_shapes(mesh_shape("corner", at=[0.1, -0.2, 0.3]))
    for _ in range(5):
        rotation, translation = Rotation.random(random_state=rng), rng.normal(size=3)
        centre = rotation.apply(np.add(at, [0.1, -0.2, 0.3])) + translation
        ball = {"type": "sphere", "name": "ball", "radius": 0.05, "at": centre.tolist()}
        clear = Clearance(puppet, [ball])
        nearest = clear.nearest(state_with_poses(puppet, (translation, rotation)))
        assert nearest.distance == pytest.approx(gap - 0.05, abs=1e-9)
        assert (nearest.first, nearest.second) == ("body0", "ball")


def test_a_notch_is_free():
    """The rod is inside the box around the L; its axis is 0.1 away from the legs."""
    rod = bodies_with_shapes(
        {"type": "capsule", "from": [0, -0.3, 0], "to": [0, 0.3, 0], "radius": 0.02}
    )
    x = state_with_poses(rod, (np.array([0.2, 0.0, 0.2]), Rotation.identity()))
    ell = mesh_shape("ell", name="ell")
    assert float(Clearance(rod, [ell]).of(x)) == pytest.approx(0.1 - 0.02, abs=1e-9)
    surrounding_box = {"type": "box", "size": [0.4, 0.2, 0.4], "at": [0.2, 0, 0.2], "name": "about"}
    assert float(Clearance(rod, [surrounding_box]).of(x)) < 0.0
    tilted = state_with_poses(
        rod, (np.array([0.2, 0.0, 0.2]), Rotation.from_euler("x", 50, degrees=True))
    )
    assert float(Clearance(rod, [ell]).of(tilted)) < 0.0
    half_size = mesh_shape("ell", name="ell", scale=0.5, at=[0.1, 0.0, 0.1])
    assert float(Clearance(rod, [half_size]).of(x)) == pytest.approx(0.05 - 0.02, abs=1e-9)


def test_points_inside_overlap_even_if_aligned_with_edges(bead):
    """A grid of beads, many of them vertically above and below corners and edges of the L."""
    grid = np.arange(-2, 11) * 0.05
    places = np.stack(np.meshgrid(grid, grid[:7] - 0.05, grid), -1).reshape(-1, 3)

    def distance_outside(p, low, high):
        return np.linalg.norm(np.maximum(np.maximum(low - p, p - high), 0.0), axis=1)

    legs = ([0, -0.1, 0], [0.4, 0.1, THICKNESS]), ([0, -0.1, 0], [THICKNESS, 0.1, 0.4])
    gap = np.min([distance_outside(places, *(np.array(c) for c in leg)) for leg in legs], axis=0)
    is_inside = gap < 1e-12
    distance = distances(bead, mesh_shape("ell"), places)
    assert np.all(distance[is_inside] < 0.0) and np.count_nonzero(is_inside) > 100
    np.testing.assert_allclose(distance[~is_inside], gap[~is_inside] - 1e-3, atol=1e-9)


def test_hollows_are_free_and_open_meshes_have_no_inside(bead):
    in_hollow, in_wall = np.array([[0.0, 0.0, 0.01]]), np.array([[0.07, 0.0, 0.0]])
    assert distances(bead, mesh_shape("hollow"), in_hollow)[0] == pytest.approx(
        0.05 - 1e-3, abs=1e-9
    )
    assert distances(bead, mesh_shape("hollow"), in_wall)[0] < 0.0
    assert distances(bead, mesh_shape("box"), in_hollow)[0] < 0.0
    assert distances(bead, mesh_shape("halves", at=[0.03, 0, 0]), in_hollow)[0] < 0.0
    assert distances(bead, mesh_shape("open"), in_hollow)[0] == pytest.approx(0.1 - 1e-3, abs=1e-9)
    distance = distances(bead, mesh_shape("sheet"), np.zeros((1, 3)))[0]
    assert distance == pytest.approx(0.3 / np.sqrt(3) - 1e-3, abs=1e-9)


def test_solids_within_one_another_overlap_either_way():
    large = {"type": "box", "size": [1, 1, 1]}
    for moving, obstacle in (
        (mesh_shape("small"), mesh_shape("halves", scale=2.0, at=[0.1, 0, 0])),
        (mesh_shape("halves", scale=2.0, at=[0.1, 0, 0]), mesh_shape("small")),
        (mesh_shape("ell", scale=0.1, at=[0.1, 0, 0]), mesh_shape("halves")),
        ({"type": "box", "size": [0.01, 0.01, 0.01], "at": [0.05, 0, 0.05]}, mesh_shape("ell")),
        (mesh_shape("pair", at=[0.05, 0, 0.05]), mesh_shape("ell")),
        (mesh_shape("pair", at=[-0.95, 0, 0.05]), mesh_shape("ell")),
        (mesh_shape("ell"), large),
        (large, mesh_shape("open")),
    ):
        puppet = bodies_with_shapes(moving)
        assert float(Clearance(puppet, [obstacle | {"name": "it"}]).of(puppet.state())) < 0.0


def test_meshes_of_one_puppet_keep_clear_of_one_another():
    """Two Ls; one is turned by half a turn, so that a leg of each is in the notch of the other."""
    puppet = bodies_with_shapes(mesh_shape("ell"), mesh_shape("ell"))
    self_clearance = Clearance(puppet, self_collision=True)
    at_origin = (np.zeros(3), Rotation.identity())
    half_turn = Rotation.from_euler("y", 180, degrees=True)
    nearest = self_clearance.nearest(
        state_with_poses(puppet, at_origin, (np.array([0.53, 0.0, 0.54]), half_turn))
    )
    assert nearest.distance == pytest.approx(np.hypot(0.03, 0.04), abs=1e-9)
    assert {nearest.first, nearest.second} == {"body0", "body1"}
    assert (
        float(
            self_clearance.of(
                state_with_poses(puppet, at_origin, (np.array([0.45, 0.0, 0.45]), half_turn))
            )
        )
        < 0.0
    )


def test_threads_and_neighbours_do_not_matter():
    puppet = bodies_with_shapes({"type": "box", "size": [0.1, 0.1, 0.1]})
    rng = np.random.default_rng(7)
    n = 8200
    q_D = np.zeros((n, 7))
    q_D[:, :3] = rng.normal([0.2, 0.0, 0.2], 0.3, (n, 3))
    q_D[:, 3:] = Rotation.random(n, random_state=rng).as_quat()[:, [3, 0, 1, 2]]
    clear, zeros = Clearance(puppet, [mesh_shape("ell", name="ell")]), np.zeros((n, 0))
    distance = clear.at(q_D, zeros)
    assert np.array_equal(distance, clear.at(q_D, zeros, threads=2))
    assert np.array_equal(distance[5:40:7], [clear.at(q_D[k], zeros[k]) for k in range(5, 40, 7)])


ARM = fan.puppets.arm3d()
HANGING = ARM.rest({"hand.x": 0.3, "hand.length": 1.32, "elbow": 0.1})
RAISED = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
SHELF = mesh_shape("ell", name="shelf", scale=[-1.25, 1.0, 1.25], at=[0.6, 0.0, -0.75])
"""An L beside the hand, with a leg upright in front of the arm; the string is in its notch."""
LEG_BOXES = [
    {"name": "low", "type": "box", "size": [0.5, 0.2, 0.125], "at": [0.35, 0.0, -0.6875]},
    {"name": "up", "type": "box", "size": [0.125, 0.2, 0.5], "at": [0.5375, 0.0, -0.5]},
]
"""The legs of the shelf as boxes."""


def test_slack_strings_keep_clear_of_meshes_as_of_boxes():
    rng = np.random.default_rng(9)
    lengths = 1.3 + rng.uniform(0.0, 0.9, 150)
    q_D, q_K = np.tile(HANGING.q_D, (150, 1)), np.column_stack([*[lengths] * 3])
    q_K[:, 0], q_K[:, 1] = rng.uniform(-0.2, 0.9, 150), rng.uniform(-0.2, 0.2, 150)
    distance = Clearance(ARM, [SHELF]).at(q_D, q_K)
    box_distance = Clearance(ARM, LEG_BOXES).at(q_D, q_K)
    is_clear = box_distance > 0.0
    assert 30 < np.count_nonzero(is_clear) < 120
    np.testing.assert_allclose(distance[is_clear], box_distance[is_clear], atol=1e-9)
    assert np.all(distance[~is_clear] < 0.0)
    nearest = Clearance(ARM, [SHELF]).nearest(HANGING.replace(q_K=[0.3, 0.0, 1.9]))
    assert (nearest.first, nearest.second) == ("string hand", "shelf")


def test_a_plan_goes_through_a_notch():
    surrounding_box = {
        "name": "about",
        "type": "box",
        "size": [0.5, 0.2, 0.5],
        "at": [0.35, 0.0, -0.5],
    }
    blocked = fan.control.Problem(ARM, HANGING, RAISED, [surrounding_box])
    assert "string hand meets about" in blocked.reason
    plan = fan.plan(
        ARM,
        HANGING,
        RAISED,
        [SHELF],
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005),
        rollouts=RolloutOptions(threads=1),
        iterations=40000,
        time_limit=120.0,
        seed=2,
    )
    assert plan, str(plan)
    clear = plan.problem.rollouts.clearance
    assert np.min(clear.of(plan.trajectory)) > 0.0
    assert np.min(fan.dynamics.Clearance(ARM, [surrounding_box]).of(plan.trajectory)) < -1e-3
    assert plan.replay()
    np.testing.assert_allclose(
        clear.of(plan.trajectory),
        fan.dynamics.Clearance(ARM, LEG_BOXES).of(plan.trajectory),
        atol=1e-9,
    )
    other_scale = fan.control.Problem(
        ARM, HANGING, RAISED, [SHELF | {"scale": [-1.25, 1.01, 1.25]}]
    )
    assert other_scale.fingerprint != fan.control.Problem(ARM, HANGING, RAISED, [SHELF]).fingerprint


@pytest.mark.parametrize("threads", [1, 2])
def test_errors_during_measurements_of_meshes_are_raised(monkeypatch, threads):
    problem = fan.control.Problem(
        ARM, HANGING, RAISED, [SHELF], rollouts=RolloutOptions(threads=threads)
    )
    for error in (RuntimeError("no distance"), KeyboardInterrupt()):

        def raise_error(*solids, error=error):
            raise error

        monkeypatch.setattr("coal.distance", raise_error)
        with pytest.raises(type(error)):
            problem.rollouts.clearance.of(HANGING)
        with pytest.raises(type(error)):
            problem.rollouts.simulate(problem.root, np.zeros(8), np.zeros((8, 1, 3)))


def test_an_interrupt_is_not_lost_while_meshes_are_measured():
    """Python delivers the interrupt when compiled code calls Python."""

    class Stopped(Exception):
        pass

    def stop(number, frame):
        raise Stopped

    clear, n_states = Clearance(ARM, [SHELF]), 40_000
    previous_handler = signal.signal(signal.SIGINT, stop)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    try:
        timer.start()
        start_time = time.perf_counter()
        with pytest.raises(Stopped):
            clear.at(np.tile(HANGING.q_D, (n_states, 1)), HANGING.q_K)
        assert time.perf_counter() - start_time < 2.0
        assert signal.getsignal(signal.SIGINT) is stop
    finally:
        timer.join()
        signal.signal(signal.SIGINT, previous_handler)


def test_coal_is_loaded_only_if_there_is_a_mesh():
    code = (
        "import sys, fantoccini as fan; arm = fan.puppets.arm3d(); x = arm.rest();"
        "fan.dynamics.Clearance(arm, [{'name': 'b', 'type': 'box', 'size': [1, 1, 1]}]).of(x);"
        "assert 'coal' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
