"""Meshes in contact: as their convex hulls, in runs; and refused files."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh

import fantoccini as fan
from contact.bodies import stepped, thrown
from fantoccini.base.errors import PuppetError

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

BODY = """
puppet: thing
floor: 0
gravity: GRAVITY
contact: {friction: FRICTION}
bodies:
- name: body
  joint: {type: free}
  shapes: [SHAPE]
"""
TETRAHEDRON = 0.2 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
WEDGE = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.2, 0], [0.4, 0.2, 0], [0, 0, 0.1], [0, 0.2, 0.1]])
MESH = "{type: mesh, file: thing.obj, mass: 1}"
TORUS = trimesh.creation.torus(0.2, 0.05, major_sections=16, minor_sections=8)


def hulled(points: np.ndarray) -> trimesh.Trimesh:
    return trimesh.convex.convex_hull(points)


def body(
    folder: Path,
    mesh: trimesh.Trimesh,
    *,
    shape: str = MESH,
    friction: float = 0.5,
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81),
    more: str = "",
) -> fan.Marionette:
    """A free body with a shape, which may be the mesh `thing.obj`."""
    (folder / "thing.obj").write_text(mesh.export(file_type="obj", digits=17))
    text = BODY.replace("SHAPE", shape).replace("FRICTION", str(friction))
    path = folder / "thing.yaml"
    path.write_text(text.replace("GRAVITY", str([float(g) for g in gravity])) + more)
    return fan.load(path)


def lowest(q_D: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Heights of a body's points (n, 3) over the floor in configurations, in increasing order."""
    heights = []
    for q in q_D:
        w, x, y, z = q[3:7]
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        heights.append(np.sort((points @ R.T + q[:3])[:, 2]))
    return np.array(heights)


BOX = trimesh.creation.box((0.2, 0.3, 0.1))


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_box_as_a_mesh_slides_and_rests_as_the_box(tmp_path, friction):
    """It moves on a slope of 17 degrees, from a height, and against a post."""
    slope = 0.3
    gravity = (9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope))
    post = "obstacles: [{name: post, type: box, size: [0.1, 1, 0.2], at: [0.4, 0, 0]}]\n"
    runs = []
    for shape in ("{type: box, size: [0.2, 0.3, 0.1], mass: 1}", MESH):
        puppet = body(tmp_path, BOX, shape=shape, friction=friction, gravity=gravity, more=post)
        x0 = thrown(puppet, {"body.z": 0.051}, {"body.x": 0.4})
        runs.append(stepped(puppet, x0, 0.6, 1e-3))
    box, mesh = runs
    assert np.max(np.abs(box.q_D - mesh.q_D)) < 1e-9
    assert np.max(np.abs(box.v_D - mesh.v_D)) < 1e-7
    # At the post, eight points are redundant, and their forces are one of many solutions.
    before = np.flatnonzero(box.q_D[:, 0] < 0.24)
    out_of_length = [run.ledger["friction"][before] for run in runs]
    assert np.max(np.abs(out_of_length[0] - out_of_length[1])) < 1e-9
    assert np.ptp(box.q_D[:, 0]) > 0.02


def test_a_tetrahedron_thrown_onto_the_floor_comes_to_rest_on_a_face(tmp_path):
    puppet = body(tmp_path, hulled(TETRAHEDRON))
    x0 = thrown(puppet, {"body.z": 0.5}, {"body.x": 1.0, "body.wx": 3.0, "body.wy": -5.0})
    run = stepped(puppet, x0, 4.0, 2e-3)
    heights = lowest(run.q_D, TETRAHEDRON)
    assert np.min(heights) > -2e-3
    assert np.max(np.abs(heights[-1, :3])) < 1e-6
    assert heights[-1, 3] == pytest.approx(0.2 * 4 / 3, abs=1e-6)
    assert np.max(np.abs(run.v_D[-1])) < 1e-6
    force = run.contact.force_on("body", len(run))[-1]
    assert np.allclose(force, [0, 0, 9.81], rtol=0, atol=1e-6)


def test_a_wedge_holds_a_block_that_its_friction_holds(tmp_path):
    """A block on a wedge of 14 degrees: at rest at friction 0.3, sliding at 0.2."""
    angle = np.arctan(0.25)
    (tmp_path / "wedge.obj").write_text(hulled(WEDGE).export(file_type="obj", digits=17))
    cube = trimesh.creation.box((0.06, 0.06, 0.06))
    for friction, slides in ((0.3, False), (0.2, True)):
        puppet = body(
            tmp_path,
            cube,
            friction=friction,
            more="obstacles: [{name: ramp, type: mesh, file: wedge.obj}]\n",
        )
        up = np.array([np.sin(angle), 0.0, np.cos(angle)])
        middle = np.array([0.2, 0.1, 0.05]) + 0.03 * up
        place = {"body.x": middle[0], "body.y": middle[1], "body.z": middle[2]}
        x0 = puppet.state(place)
        q = np.array(x0.q_D)
        q[3:7] = [np.cos(angle / 2), 0, np.sin(angle / 2), 0]
        run = stepped(puppet, x0.replace(q_D=q), 0.3, 1e-3)
        moved = float(np.linalg.norm(run.q_D[-1, :3] - middle))
        rate = 9.81 * (np.sin(angle) - friction * np.cos(angle))
        assert moved == pytest.approx(0.5 * rate * 0.3**2 if slides else 0.0, abs=2e-4)


def test_an_icosphere_rolls(tmp_path):
    """It keeps rolling on its facets, always in contact with whole facets or edges, and upright."""
    coarse = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
    puppet = body(tmp_path, coarse, friction=0.8)
    speed = 2.0
    x0 = thrown(puppet, {"body.z": 0.1001}, {"body.x": speed, "body.wy": speed / 0.1})
    run = stepped(puppet, x0, 0.5, 1e-3)
    assert run.q_D[-1, 0] > 0.5
    heights = lowest(run.q_D, np.array(coarse.vertices))
    assert np.min(heights) > -2e-3
    # It neither flies off nor sinks, and its rotation equals its displacement.
    spin = run.v_D[:, 4]
    assert np.median(run.v_D[100:, 0] / (0.1 * spin[100:])) == pytest.approx(1.0, abs=0.1)
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    assert np.max(np.diff(energy)) < 1e-6


def test_meshes_meet_one_another_and_other_shapes(tmp_path):
    """A heap: a mesh on a mesh on the floor, with a ball, a capsule and an ellipsoid on top."""
    (tmp_path / "slab.obj").write_text(
        trimesh.creation.box((0.6, 0.6, 0.1)).export(file_type="obj", digits=17)
    )
    (tmp_path / "cube.obj").write_text(
        trimesh.creation.box((0.1, 0.1, 0.1)).export(file_type="obj", digits=17)
    )
    things = {
        "slab": ("{type: mesh, file: slab.obj, mass: 2}", [0, 0, 0.05], 0.05),
        "cube": ("{type: mesh, file: cube.obj, mass: 0.5}", [0.2, 0.2, 0.16], 0.15),
        "crate": ("{type: box, size: [0.1, 0.1, 0.1], mass: 0.5}", [-0.2, 0.2, 0.16], 0.15),
        "rod": (
            "{type: capsule, from: [-0.05, 0, 0], to: [0.05, 0, 0], radius: 0.03, mass: 0.3}",
            [0.0, -0.2, 0.14],
            0.13,
        ),
        "egg": ("{type: ellipsoid, radii: [0.08, 0.06, 0.03], mass: 0.3}", [0, 0, 0.14], 0.13),
        "ball": ("{type: sphere, radius: 0.03, mass: 0.3}", [0.2, -0.2, 0.14], 0.13),
    }
    bodies, pose = "", []
    for name, (shape, at, _) in things.items():
        bodies += f"- {{name: {name}, joint: {{type: free}}, shapes: [{shape}]}}\n"
        pose += [f"{name}.{c}: {x}" for c, x in zip("xyz", at, strict=True)]
    path = tmp_path / "heap.yaml"
    path.write_text(
        f"puppet: heap\nfloor: 0\ncontact: true\nbodies:\n{bodies}pose: {{{', '.join(pose)}}}\n"
    )
    heap = fan.load(path)
    run = stepped(heap, heap.state(), 1.0, 2e-3)
    names = heap.coordinates.q_D
    for name, (_, at, rests) in things.items():
        x, y, z = (run.q_D[-1, names.index(f"{name}.{c}")] for c in "xyz")
        assert z == pytest.approx(rests, abs=1e-5), name
        assert np.hypot(x - at[0], y - at[1]) < 1e-3, name
    for name in ("cube", "crate", "rod", "egg", "ball"):
        assert {name, "slab"} in [set(pair) for pair in heap.contacts.names]
        assert {name, "slab"} in [set(event.name.split("|")) for event in run.events]


def test_hulls_are_pickled_with_the_contacts(tmp_path):
    """They are pickled for other processes, with pointers to their own arrays there."""
    contacts = body(tmp_path, BOX).contacts
    twin = pickle.loads(pickle.dumps(contacts))
    (hull,), (other,) = contacts.hulls, twin.hulls
    assert np.array_equal(hull.vertices, other.vertices)
    assert contacts.structure.solids != twin.structure.solids


def test_a_box_as_an_obstacle_supports_a_body(tmp_path):
    """Meshes of obstacles are turned, scaled and shifted by the file."""
    trimesh.creation.box((4, 6, 2)).apply_translation((1, 2, 3)).export(tmp_path / "table.stl")
    table = (
        "obstacles: [{name: table, type: mesh, file: table.stl, scale: 0.1, at: [-0.1, 0.2, 0], "
        "orientation: {axis: [1, 0, 0], angle: 90 deg}}]\n"
    )
    puppet = body(tmp_path, BOX, more=table)
    # The table's z axis points along -y, its y axis up: it reaches from z = -0.1 to 0.5.
    x0 = thrown(puppet, {"body.z": 0.56, "body.y": -0.1}, {})
    run = stepped(puppet, x0, 0.5, 1e-3)
    assert np.allclose(run.q_D[-1, :3], [0, -0.1, 0.55], rtol=0, atol=1e-6)


def refused(folder: Path, mesh: trimesh.Trimesh, text: str, *, more: str = "") -> None:
    """Check that a drawn mesh on a body with its own mass is refused."""
    puppet = body(
        folder,
        mesh,
        shape="{type: sphere, radius: 0.1, mass: 1}, {type: mesh, file: thing.obj}",
        more=more,
    )
    with pytest.raises(PuppetError) as error:
        _ = puppet.contacts
    assert text in str(error.value)
    assert "thing.yaml:7: shapes of body: thing.obj" in str(error.value)


def test_an_open_mesh_is_refused(tmp_path):
    holed = trimesh.Trimesh(BOX.vertices, BOX.faces[2:], process=False)
    refused(tmp_path, holed, "is not closed; meshes in contact must be closed: close its holes")


def test_a_flat_mesh_is_refused(tmp_path):
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]], process=False)
    refused(tmp_path, flat, "is flat; meshes in contact need a volume: use a thin box")


def test_the_most_protruding_of_many_vertices_count(tmp_path):
    """For a ball, the worst case, the others protrude by at most 2 % of the diameter."""
    many = np.random.default_rng(0).normal(size=(2000, 3))
    many *= 0.1 / np.linalg.norm(many, axis=1)[:, None]
    (hull,) = body(tmp_path, hulled(many)).contacts.hulls
    assert len(hull.vertices) == 128
    out = (many - hull.centroid) @ hull.planes[:, :3].T - hull.planes[:, 3]
    assert np.max(out) < 0.02 * 0.2


def test_a_mesh_that_touches_nothing_may_have_any_shape(tmp_path):
    text = "{type: sphere, radius: 0.1, mass: 1}, {type: mesh, file: thing.obj}"
    puppet = body(
        tmp_path, TORUS, shape=text, more="obstacles: [{name: post, type: sphere, radius: 1}]\n"
    )
    path = tmp_path / "thing.yaml"
    path.write_text(path.read_text().replace("friction: 0.5", "meets: [self]"))
    assert fan.load(path).contacts.hulls == ()
    assert len(puppet.contacts.hulls) > 8


def test_dents_of_a_tenth_of_the_volume_are_filled(tmp_path):
    """A cube without a pyramid at its top, 1/3 of the base times the depth; deeper ones: pieces."""
    for depth, fits in ((0.25, True), (0.35, False)):
        cube = trimesh.creation.box((1, 1, 1))
        top = [i for i, v in enumerate(cube.vertices) if v[2] > 0]
        faces = [f for f in cube.faces if not set(f) <= set(top)]
        ring = sorted(top, key=lambda i: np.arctan2(cube.vertices[i, 1], cube.vertices[i, 0]))
        faces += [[a, b, 8] for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
        dented = trimesh.Trimesh(
            np.vstack([cube.vertices, [0, 0, 0.5 - depth]]), faces, process=False
        )
        assert dented.is_watertight
        assert dented.volume == pytest.approx(1 - depth / 3)
        if fits:
            (hull,) = body(tmp_path, dented).contacts.hulls
            assert len(hull.vertices) == 8
        else:
            assert len(body(tmp_path, dented).contacts.hulls) > 1


def test_lanes_move_meshes_as_single_runs_do(tmp_path):
    puppet = body(tmp_path, hulled(TETRAHEDRON))
    starts = [
        thrown(puppet, {"body.z": 0.3 + 0.01 * i}, {"body.x": 0.2 * i, "body.wx": i})
        for i in range(9)
    ]
    method = fan.TimeStepping(dt=1e-3)
    batch = fan.simulate_batch(puppet, starts, t_end=0.3, method=method)
    for i, x0 in enumerate(starts):
        run = fan.simulate(puppet, x0, t_end=0.3, method=method)
        assert np.allclose(batch.q_D[i][-1], run.q_D[-1], rtol=0, atol=1e-9)
        assert np.any(run.contact.force != 0.0)


def test_rest_lies_on_a_facet(tmp_path):
    """`rest` releases a wedge that would overlap the floor."""
    puppet = body(tmp_path, hulled(WEDGE))
    x = puppet.rest({})
    height = lowest(x.q_D[None], WEDGE)[0]
    assert np.max(np.abs(height[:3])) < 1e-5
