"""Event-driven contact of hulls: they equal boxes, and roll over their edges, to 1e-8."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import fantoccini as fan
from contact.bodies import G, thrown
from fantoccini import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

CLOSE = 1e-8
BOX, TABLE = (0.2, 0.12, 0.1), (1.0, 1.0, 0.1)


def sound(run: fan.Trajectory) -> None:
    """Assert that a run reached its end, without overlap, with balanced ledger and valid forces."""
    assert run.status is Status.DONE
    assert run.contact.gap.min(initial=0.0) > -1e-12
    assert np.max(np.abs(run.ledger["residual"])) < CLOSE
    assert np.max(run.contact_residual) < 1e-7


def write(folder: Path, name: str, mesh: trimesh.Trimesh) -> str:
    (folder / name).write_text(mesh.export(file_type="obj", digits=17))
    return name


def block(folder: Path, size: tuple[float, ...], mesh: bool) -> str:
    """A box as a shape, or as an equal mesh."""
    if not mesh:
        return f"type: box, size: {list(size)}"
    name = write(folder, "x".join(map(str, size)) + ".obj", trimesh.creation.box(size))
    return f"type: mesh, file: {name}"


def over_edge(
    folder: Path, body: str, friction: float, table_is_mesh: bool, more: str = ""
) -> fan.Marionette:
    """A body on a table with an edge along y."""
    (folder / "edge.yaml").write_text(f"""
puppet: edge
contact: {{friction: {friction}}}
obstacles:
- {{name: table, {block(folder, TABLE, table_is_mesh)}, at: [-0.5, 0, -0.05]}}
bodies:
- {{name: body, joint: {{type: free}}, shapes: [{{{body}, mass: 1}}]{more}}}
""")
    return fan.load(folder / "edge.yaml")


def moved_alike(run: fan.Trajectory, other: fan.Trajectory) -> None:
    """Assert that two runs, saved at the same times, have the same motion and contacts."""
    assert [event.kind for event in run.events] == [event.kind for event in other.events]
    for event, twin in zip(run.events, other.events, strict=True):
        assert abs(event.t - twin.t) < CLOSE
    assert np.max(np.abs(run.q_D[-1] - other.q_D[-1])) < CLOSE
    assert np.max(np.abs(run.v_D[-1] - other.v_D[-1])) < 10 * CLOSE


@pytest.mark.parametrize(
    ("yaw", "mu", "over", "speed"),
    [
        (0.4, 0.5, 0.02, 0.0),
        (0.4, 0.2, 0.0, 0.5),
        (0.0, 0.3, -0.1, 1.5),
        (0.4, 0.0, -0.1, 1.5),
        (0.7, 0.3, -0.05, 3.0),
        (0.3, 0.5, -0.1, 1.5),
    ],
)
def test_a_box_as_a_mesh_tips_over_an_edge_as_the_box_does(tmp_path, yaw, mu, over, speed):
    """Either box or table is the mesh; faces, two edges, then corners that leave them."""
    turn = (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))
    place = {"body.x": over, "body.z": 0.05, "body.rotation": turn}
    runs = []
    for body_is_mesh, table_is_mesh in ((False, False), (True, False), (False, True), (True, True)):
        puppet = over_edge(tmp_path, block(tmp_path, BOX, body_is_mesh), mu, table_is_mesh)
        runs.append(fan.simulate(puppet, thrown(puppet, place, {"body.x": speed}), t_end=0.4))
        sound(runs[-1])
        moved_alike(runs[-1], runs[0])
    assert runs[0].q_D[-1, 2] < -0.1


ROUND = {
    "ball": ("type: sphere, radius: 0.05", {"x": -0.1, "z": 0.05}, {"x": 0.5, "wy": 10.0}),
    "ball at a corner": (
        "type: sphere, radius: 0.05",
        {"x": -0.02, "y": 0.49, "z": 0.05},
        {"x": 0.2, "y": 0.1, "wy": 4.0, "wx": -2.0},
    ),
    "rod along": (
        "type: capsule, from: [-0.1, 0, 0], to: [0.1, 0, 0], radius: 0.03",
        {"x": -0.1, "z": 0.03},
        {"x": 1.0},
    ),
    "rod askew": (
        "type: capsule, from: [0.01, -0.1, 0], to: [-0.01, 0.1, 0], radius: 0.03",
        {"x": -0.1, "z": 0.03},
        {"x": 0.6, "wy": 20.0},
    ),
    "rod on its end": (
        "type: capsule, from: [-0.1, 0, 0.01], to: [0.1, 0, -0.01], radius: 0.03",
        {"x": -0.05, "z": 0.0412},
        {"x": 0.8},
    ),
    "egg": (
        "type: ellipsoid, radii: [0.06, 0.05, 0.04]",
        {"x": -0.1, "z": 0.04},
        {"x": 0.6, "wy": 8.0},
    ),
}


@pytest.mark.parametrize("name", ROUND)
def test_round_solids_pass_over_the_edge_of_a_mesh_as_over_that_of_a_box(tmp_path, name):
    """Faces, edges and corners; ends and middles of capsules."""
    shape, place, speed = ROUND[name]
    runs = []
    for is_mesh in (False, True):
        puppet = over_edge(tmp_path, shape, 0.5, is_mesh)
        x0 = thrown(
            puppet,
            {f"body.{k}": x for k, x in place.items()},
            {f"body.{k}": x for k, x in speed.items()},
        )
        runs.append(fan.simulate(puppet, x0, t_end=0.4))
        sound(runs[-1])
    moved_alike(*runs)


@pytest.mark.parametrize("floor", ["plane", "mesh"])
def test_a_prism_rolls_over_its_edges_as_a_pendulum_that_changes_its_pivot(tmp_path, floor):
    """theta'' = m g R sin(theta) / I about an edge; each next edge takes its share of the spin.

    The angular momentum about the landing edge is conserved: (I_c + m R^2 cos a) / I of the spin
    remains.
    """
    n, R, length, slope = 6, 0.1, 0.3, 0.2
    turns = 2 * np.pi * np.arange(n) / n  # two corners are lowest
    corners = [[R * np.cos(a), y, R * np.sin(a)] for a in turns for y in (-length / 2, length / 2)]
    prism = write(tmp_path, "prism.obj", trimesh.convex.convex_hull(np.array(corners)))
    slab = write(tmp_path, "slab.obj", trimesh.creation.box((4, 2, 0.2)))
    ground = {
        "plane": "floor: 0",
        "mesh": f"obstacles: [{{name: slab, type: mesh, file: {slab}, at: [0.5, 0, -0.1]}}]",
    }
    side, across = 0.5 * R**2 * (1 - (2 / 3) * np.sin(np.pi / n) ** 2), 0.01
    g = [float(G * np.sin(slope)), 0.0, float(-G * np.cos(slope))]
    (tmp_path / "prism.yaml").write_text(f"""
puppet: prism
gravity: {g}
contact: {{friction: 5}}
{ground[floor]}
bodies:
- name: body
  joint: {{type: free}}
  shapes: [{{type: mesh, file: {prism}}}]
  mass: 1
  com: [0, 0, 0]
  inertia: [{across}, {side}, {across}]
""")
    puppet = fan.load(tmp_path / "prism.yaml")
    # On the edge ahead, tipped by `start` from the face behind it.
    half, inertia, start = np.pi / n, side + R**2, 0.35
    lean = start - half  # of the line from the edge to the middle, from the slope's normal
    x0 = puppet.state(
        {
            "body.x": R * np.sin(lean),
            "body.z": R * np.cos(lean),
            "body.rotation": (np.cos(start / 2), 0.0, np.sin(start / 2), 0.0),
        }
    )
    speed = 1.0
    x0 = thrown(
        puppet,
        {name: float(x) for name, x in zip(puppet.coordinates.q_D[:3], x0.q_D[:3], strict=True)}
        | {"body.rotation": tuple(float(x) for x in x0.q_D[3:])},
        {"body.x": speed * R * np.cos(lean), "body.z": -speed * R * np.sin(lean), "body.wy": speed},
    )
    t_end = 1.2
    run = fan.simulate(puppet, x0, t_end=t_end)
    sound(run)

    def lands(t: float, y: np.ndarray) -> float:
        return float(y[0] - half)

    lands.terminal, lands.direction = True, 1.0  # type: ignore[attr-defined]
    t, y, times, spins, rolled = 0.0, [lean, speed], [], [], 0
    while t < t_end:
        piece = solve_ivp(
            lambda t, y: [y[1], G * R * np.sin(y[0] + slope) / inertia],
            (t, t_end),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
            events=lands,
        )
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status == 1:
            times.append(t)
            rolled += 1
            y = [-half, y[1] * (side + R**2 * np.cos(2 * half)) / inertia]
            spins.append(y[1])
    touches = [event for event in run.events if event.kind == "touch"]
    assert len(times) == len(touches) >= 4
    for k, event in enumerate(touches):
        assert abs(event.t - times[k]) < CLOSE
        after = run["v:body.wy"][np.searchsorted(run.t, event.t, side="right") - 1]
        assert abs(after - spins[k]) < 10 * CLOSE
    assert abs(run["v:body.wy"][-1] - y[1]) < 10 * CLOSE
    assert abs(run["body.x"][-1] - (2 * rolled * R * np.sin(half) + R * np.sin(y[0]))) < CLOSE


def test_an_octahedron_falls_over_its_edge_onto_a_facet(tmp_path):
    """theta'' = g l sin(theta) / (I_c / m + l^2) about the edge, until the next facet lands."""
    a = 0.2  # from the middle to a corner
    points = a * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    name = write(tmp_path, "octahedron.obj", trimesh.convex.convex_hull(points))
    (tmp_path / "octahedron.yaml").write_text(f"""
puppet: octahedron
floor: 0
contact: {{friction: 5}}
bodies:
- {{name: body, joint: {{type: free}}, shapes: [{{type: mesh, file: {name}}}], mass: 1,
   com: [0, 0, 0], inertia: [0.008, 0.008, 0.008]}}
""")
    puppet = fan.load(tmp_path / "octahedron.yaml")
    # The edge from (a, 0, 0) to (0, 0, -a), turned to lie along x with the middle above it.
    arm, start = a / np.sqrt(2), 0.02
    first = np.array([np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8), 0.0])  # by 45 degrees about y
    lean = np.array([np.cos(start / 2), np.sin(start / 2), 0.0, 0.0])
    w, (x, y, z) = (
        lean[0] * first[0] - lean[1:] @ first[1:],
        (lean[0] * first[1:] + first[0] * lean[1:] + np.cross(lean[1:], first[1:])),
    )
    x0 = puppet.state(
        {
            "body.y": -arm * np.sin(start),
            "body.z": arm * np.cos(start),
            "body.rotation": (w, x, y, z),
        }
    )
    run = fan.simulate(puppet, x0, t_end=1.5)
    sound(run)
    falls = 0.5 * np.pi - np.arcsin(a / np.sqrt(3) / arm)  # where the middle is over the facet

    def squared(angle: float) -> float:
        return float(2 * G * arm * (np.cos(start) - np.cos(angle)) / (0.008 + arm**2))

    # The start is a root of the speed: angle = start + s^2.
    exact, _ = quad(
        lambda s: 2 * s / np.sqrt(squared(start + s**2)),
        0,
        np.sqrt(falls - start),
        epsabs=1e-13,
        epsrel=1e-13,
    )
    touch = next(event for event in run.events if event.kind == "touch")
    assert abs(touch.t - exact) < CLOSE
    # The landing corner is the facet's height away from the edge.
    assert abs(touch.speed - np.sqrt(squared(falls)) * a * np.sqrt(1.5)) < 10 * CLOSE


@pytest.mark.parametrize("is_mesh", [False, True])
@pytest.mark.parametrize("mu", [0.2, 0.4, 0.6])
def test_a_falling_plank_slips_when_its_forces_leave_the_cone(tmp_path, mu, is_mesh):
    """It slips at its lower edge, l from the middle, where |F| = mu N, both from the energy."""
    size, start = (0.02, 0.2, 1.0), 0.03
    puppet = over_edge(
        tmp_path,
        block(tmp_path, size, True),
        mu,
        is_mesh,
        ", mass: 1, com: [0, 0, 0], inertia: [0.09, 0.08, 0.01]",
    )
    arm, own = 0.5 * np.hypot(size[0], size[2]), np.arctan(size[0] / size[2])
    turned = start + own
    x0 = puppet.state(
        {
            "body.x": -0.4 + arm * np.sin(start),
            "body.z": arm * np.cos(start),
            "body.rotation": (np.cos(turned / 2), 0.0, np.sin(turned / 2), 0.0),
        }
    )
    run = fan.simulate(puppet, x0, t_end=1.5)
    assert run.status is Status.DONE
    slide = next(event for event in run.events if event.kind == "slide")
    angle_of_slip = 2 * np.arcsin(run["body.qy"][np.searchsorted(run.t, slide.t)]) - own
    about = 0.08 + arm**2

    def excess(angle: float) -> float:
        """|F| - mu N during the rotation about the edge."""
        s, c = np.sin(angle), np.cos(angle)
        squared, acc = 2 * G * arm * (np.cos(start) - c) / about, G * arm * s / about
        return float(abs(arm * (c * acc - s * squared)) - mu * (G - arm * (s * acc + c * squared)))

    angles = np.linspace(start, np.pi / 2, 2001)
    first = int(np.argmax([excess(angle) > 0.0 for angle in angles]))
    assert abs(angle_of_slip - brentq(excess, angles[first - 1], angles[first], xtol=1e-14)) < CLOSE
