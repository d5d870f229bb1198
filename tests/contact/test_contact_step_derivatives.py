"""linearise_step with contact: finite differences in every mode, and missing derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

import fantoccini as fan
from contact.bodies import thrown
from contact.files import ACROBAT, BALL, BALLS, BOX, CAPSULE, EGG, LOGS, STACK
from oracles.differences import apart, difference, moved, worst

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

DT = 0.002


@dataclass(frozen=True)
class DifferenceSizes:
    """Sizes of finite differences in configurations, velocities, and accelerations and forces."""

    q: float = 1e-7
    v: float = 1e-6
    a: float = 1e-4


def step(
    puppet: fan.Marionette, x: fan.State, acc_K: np.ndarray, u_D: np.ndarray, dt: float
) -> tuple[fan.State, np.ndarray]:
    """A first time step, and the forces of its contacts (n, 3)."""
    stepper = puppet.stepper(x, fan.TimeStepping(dt=dt))
    end = stepper.advance(dt, acc_K, u_D=u_D)
    last = stepper.contacts[stepper.contacts[:, 0] == len(stepper.samples) - 1]
    return end, last[:, 9:12]


def check_step(
    puppet: fan.Marionette,
    x: fan.State,
    modes: list[str],
    bound: float = 1e-7,
    steps: DifferenceSizes = DifferenceSizes(),
    seed: int | None = None,
    dt: float = DT,
):
    """A, B, B_u, B_p and derivatives of contact forces agree with finite differences."""
    t = puppet.coordinates
    n, k, n_p = t.n_vD, t.n_vK, len(puppet.p)
    acc_K, u_D = np.zeros(k), np.zeros(n)
    if seed is not None:
        rng = np.random.default_rng(seed)
        acc_K, u_D = rng.normal(size=k), 0.1 * rng.normal(size=n)
    lin = puppet.linearise_step(x, acc_K, u_D, dt)
    assert [point.mode for point in lin.contacts] == modes
    assert lin.differentiable
    check_compiled(puppet, lin, acc_K, u_D)
    end = lin.x_next
    widths = {"q_D": n, "v_D": n, "q_K": k, "v_K": k, "acc_K": k, "u_D": n, "p": n_p}
    places = np.cumsum([0, *widths.values()])

    def end_for(d: np.ndarray) -> np.ndarray:
        q_D, v_D, q_K, v_K, acc, u, p = np.split(d, places[1:-1])
        changed = puppet
        if np.any(p):
            values = zip(puppet.tree.parameters.items(), p, strict=True)
            changed = puppet.with_parameters({name: value + dp for (name, value), dp in values})
        x_changed = x.replace(
            q_D=moved(x.q_D, q_D, t.scalars_D, t.quaternions_D),
            v_D=x.v_D + v_D,
            q_K=moved(x.q_K, q_K, t.scalars_K, t.quaternions_K),
            v_K=x.v_K + v_K,
        )
        y, force = step(changed, x_changed, acc_K + acc, u_D + u, dt)
        return np.concatenate(
            [
                apart(end.q_D, y.q_D, n, t.scalars_D, t.quaternions_D),
                y.v_D,
                apart(end.q_K, y.q_K, k, t.scalars_K, t.quaternions_K),
                y.v_K,
                force.ravel(),
            ]
        )

    sizes = {"q_D": steps.q, "v_D": steps.v, "q_K": steps.q, "v_K": steps.v, "p": steps.q}
    state_derivatives = np.concatenate([lin.A, lin.B, lin.B_u, lin.B_p], axis=1)
    for (name, width), first in zip(widths.items(), places, strict=False):
        if not width:
            continue
        size = sizes.get(name, steps.a)
        columns = np.zeros((places[-1], width))
        columns[first : first + width] = size * np.eye(width)
        expected = difference(lambda d, c=columns: end_for(c @ d), width, 1.0) / size
        derivative = state_derivatives[:, first : first + width]
        assert worst(derivative, expected[: len(derivative)]) < bound, name
        if len(set(modes)) == len(modes):
            # Redundant points may share their forces differently for neighbouring states.
            assert (
                worst(getattr(lin.force_partials, name), expected[len(derivative) :]) < 10 * bound
            ), name
    return lin


def check_compiled(
    puppet: fan.Marionette, lin: fan.dynamics.StepLinearisation, acc_K: np.ndarray, u_D: np.ndarray
):
    """The compiled linearise_steps gives the derivatives of linearise_step; all steps settle."""
    x, t = lin.x, puppet.coordinates
    steps = puppet.linearise_steps(
        x.q_D, x.v_D, x.q_K, x.v_K, acc_K, u_D, dt=lin.dt, forces=True, tension_partials=True
    )
    assert steps.settled.all()
    assert steps.n_contacts.tolist() == [len(lin.contacts)]
    assert steps.differentiable.tolist() == [lin.differentiable]
    assert np.allclose(steps.q_D[0], lin.x_next.q_D, rtol=0, atol=1e-12)
    assert np.allclose(steps.v_D[0], lin.x_next.v_D, rtol=0, atol=1e-12)
    n, k = t.n_vD, t.n_vK
    derivatives = np.concatenate([steps.A[0], steps.B[0]], axis=1)
    expected = np.concatenate([lin.A, lin.B], axis=1)
    assert worst(derivatives, expected) < 1e-9
    more = np.concatenate([lin.B_u, lin.B_p], axis=1)[: 2 * n]
    assert worst(steps.motion[0][:, 2 * n + 3 * k :], more) < 1e-9
    pull = np.concatenate(list(vars(lin.tension_partials).values()), axis=1)
    assert worst(steps.tension_partials[0], pull) < 1e-9


@pytest.fixture(scope="module")
def ball() -> fan.Marionette:
    return fan.loads(BALL)


@pytest.fixture(scope="module")
def box() -> fan.Marionette:
    return fan.loads(BOX)


@pytest.fixture(scope="module")
def balls() -> fan.Marionette:
    return fan.loads(BALLS)


def test_a_ball_rests_slides_and_lands(ball):
    """The centre of the ball is not the origin of its frame."""
    on_floor = {"body.z": 0.07}
    check_step(ball, ball.state(on_floor), ["stick"])
    slides = {"body.x": 1.0, "body.y": 0.2, "body.wx": 0.3, "body.wy": 0.2, "body.wz": 0.1}
    check_step(ball, thrown(ball, on_floor, slides), ["slide"])
    check_step(ball, thrown(ball, on_floor, {"body.x": 0.5, "body.z": -1, "body.wy": 4}), ["stick"])


def test_a_sliding_ball_slows_by_the_friction_of_the_closed_form():
    """dv+/dv = 1 along the motion and 1 - mu g dt/(norm(u+) + 7/2 mu g dt) across it: friction
    turns with the slip u of the contact point.
    """
    puppet = fan.loads(BALL.replace("at: [0.02, 0.01, 0.03], ", ""))
    lin = puppet.linearise_step(thrown(puppet, {"body.z": 0.1}, {"body.x": 2.0}), dt=DT)
    A = lin.A[6:, 6:]
    slowed = 2.0 - 3.5 * 0.3 * 9.81 * DT
    turning = 0.3 * 9.81 * DT / (slowed + 3.5 * 0.3 * 9.81 * DT)
    assert A[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert A[1, 1] == pytest.approx(1.0 - turning, abs=1e-12)


def test_a_box_on_a_floor_has_derivatives_though_its_forces_are_not_unique(box):
    lin = check_step(
        box, box.state({"body.z": 0.05}), ["stick"] * 4, steps=DifferenceSizes(q=1e-8, v=1e-4)
    )
    assert np.max(np.abs(lin.A[6:, 6:])) < 1e-9  # it stays where it is


def test_a_box_slides_along_its_edge(box):
    x = thrown(box, {"body.z": 0.05}, {"body.x": 1.0})
    check_step(box, x, ["slide"] * 4, steps=DifferenceSizes(v=1e-3))


def test_a_box_on_one_edge(box):
    angle = 0.3
    tilted = {
        "body.z": 0.1 * np.sin(angle) + 0.05 * np.cos(angle),
        "body.qw": np.cos(angle / 2),
        "body.qy": np.sin(angle / 2),
    }
    slides = {"body.x": 0.5, "body.y": 0.1, "body.wy": 1.0}
    check_step(box, thrown(box, tilted, slides), ["slide"] * 2)


def test_a_box_that_slides_aside_has_no_derivative(box):
    """Its rotation would depend on how its four corners share its weight."""
    x = thrown(box, {"body.z": 0.05}, {"body.x": 1.0, "body.y": 0.5})
    with pytest.raises(
        fan.errors.StateError, match=r"body\|floor slide on more points than the law"
    ):
        box.linearise_step(x)
    steps = box.linearise_steps(x.q_D, x.v_D, x.q_K, x.v_K)
    assert not steps.settled.any() and not steps.differentiable.any()
    assert steps.edges_of(0) == ("solids slide on so many points that their forces are not unique",)


def test_a_capsule_lies_and_slides():
    puppet = fan.loads(CAPSULE)
    on_floor = {"body.z": 0.03}
    check_step(puppet, puppet.state(on_floor), ["stick"] * 2, steps=DifferenceSizes(q=1e-8))
    speed = {"body.x": 0.3, "body.y": 0.4, "body.wz": 0.3}
    check_step(puppet, thrown(puppet, on_floor, speed), ["slide"] * 2)


def test_boxes_stacked_and_logs_that_lie_on_one_another():
    """The points of flat faces move smoothly only for small tilts, so differences are small."""
    flat = DifferenceSizes(q=1e-8, v=1e-5, a=1e-3)
    stack = fan.loads(STACK)
    check_step(stack, stack.state({"a.z": 0.05, "b.z": 0.15}), ["stick"] * 8, steps=flat)
    logs = fan.loads(LOGS)
    x = thrown(logs, {"a.z": 0.03, "b.z": 0.1, "b.x": 0.05}, {"b.x": 0.1, "b.wx": 0.2, "b.wz": 0.1})
    modes = ["stick", "stick", "slide", "slide"]
    check_step(logs, x, modes, steps=flat)


def test_a_mesh_on_its_facet(tmp_path):
    """A wedge lies on four points, one of them redundant."""
    ground = [[0, 0, 0], [0.4, 0, 0], [0, 0.2, 0], [0.4, 0.2, 0]]
    points = np.array([*ground, [0, 0, 0.1], [0, 0.2, 0.1]])
    mesh = trimesh.convex.convex_hull(points)
    (tmp_path / "wedge.obj").write_text(mesh.export(file_type="obj", digits=17))
    text = BOX.replace(
        "{type: box, size: [0.2, 0.3, 0.1], mass: 1}", "{type: mesh, file: wedge.obj, mass: 1}"
    )
    (tmp_path / "wedge.yaml").write_text(text)
    wedge = fan.load(tmp_path / "wedge.yaml")
    x = wedge.state({"body.z": 0.0})
    check_step(wedge, x, ["stick"] * 4, steps=DifferenceSizes(q=1e-8, v=1e-4))


def test_an_egg_rolls_on_a_floor_and_slides_on_a_dome():
    puppet = fan.loads(EGG)
    check_step(puppet, puppet.state({"egg.z": -0.95}), ["stick"])
    speed = {"egg.x": 0.3, "egg.y": -0.2, "egg.z": -0.1, "egg.wx": 2, "egg.wy": 1, "egg.wz": 3}
    check_step(puppet, thrown(puppet, {"egg.z": 0.35, "egg.x": 1.0}, speed), ["slide"])


def test_balls_that_strike_one_another(balls):
    """Balls bounce shortly after the step begins, in the air and on the floor.

    Balls that touch at its very start have no derivative: neighbours touch earlier or later.
    """
    above = {"b.x": 0.17 * 0.6 + 1e-4}
    speed = {"b.x": 0.5, "b.y": 0.3, "b.z": -1.0}
    on_floor = thrown(balls, above | {"a.z": 0.1, "b.z": 0.1 + 0.17 * 0.8}, speed)
    check_step(balls, on_floor, ["stick", "stick"])
    in_air = thrown(balls, above | {"a.z": 1.1, "b.z": 1.1 + 0.17 * 0.8}, speed)
    lin = check_step(balls, in_air, ["stick"])
    assert lin.contacts[0].restitution == 0.5


def test_separating_overlaps(balls):
    """They separate at depth/dt, at most at the recovery speed, which does not depend on depth."""
    for dt, speed in ((DT, 0.25), (0.2 * DT, 1.0)):
        x = thrown(balls, {"a.z": 0.0995, "b.z": 5.0}, {"a.x": 0.3})
        lin = check_step(balls, x, ["stick"], dt=dt)
        assert lin.x_next.v_D[2] == pytest.approx(speed)


def test_a_puppet_on_a_tray_and_a_string():
    """The tray is driven and turns; parameters move joints."""
    puppet = fan.loads(ACROBAT)
    z = 0.02 + 0.2 * np.cos(0.2) - 0.06
    x = puppet.state({"body.z": z, "leg": 0.2, "rope.length": 1.2 - z})
    for seed, mode in ((1, "slide"), (7, "slide"), (27, "stick"), (28, "stick")):
        rng = np.random.default_rng(seed)
        v_K, v_D = 0.1 * rng.normal(size=7), 0.3 * rng.normal(size=10)
        v_D[2] -= 0.3
        lin = check_step(
            puppet, x.replace(v_K=v_K, v_D=v_D), [mode], steps=DifferenceSizes(q=1e-7, a=1e-2)
        )
        assert lin.rows == ("rope",)


def test_the_bundled_marionette_stands_on_one_foot():
    """It stands on all corners of a sole, held by strings; the other knee is raised."""
    puppet = fan.puppets.promenade()
    x = puppet.rest()
    x = puppet.rest({"knee_right.length": x["knee_right.length"] - 0.03})
    lin = check_step(
        puppet, x, ["stick"] * 4, bound=2e-7, steps=DifferenceSizes(q=3e-8, v=2e-7, a=1e-3)
    )
    assert {point.name for point in lin.contacts} == {"shin_left|floor"}
    assert "head" in lin.rows


def test_edges_are_named(ball, box, balls):
    """A touch without force, sticking at the edge of the cone, and the onset of a rebound."""
    lift = np.zeros(6)
    lift[2] = 9.81
    lin = ball.linearise_step(ball.state({"body.z": 0.07}), u_D=lift)
    assert not lin.differentiable
    assert lin.edges == ("body|floor: touches without force",)
    pull = np.zeros(6)
    pull[0], pull[4] = 0.3 * 9.81, -0.3 * 9.81 * 0.07
    lin = ball.linearise_step(ball.state({"body.z": 0.07}), u_D=pull)
    assert not lin.differentiable
    x = ball.state({"body.z": 0.07})
    steps = ball.linearise_steps(x.q_D, x.v_D, x.q_K, x.v_K, u_D=np.array([lift, pull, 0 * pull]))
    assert steps.differentiable.tolist() == [False, False, True] and steps.settled.all()
    assert steps.edges_of(0) == ("a point touches without force",)
    assert steps.edges_of(1) == ("a point sticks at the edge of its cone",)
    assert steps.edges_of(2) == ()
    above_right = {"a.z": 0.1, "b.z": 0.1 + 0.17 * 0.8, "b.x": 0.17 * 0.6}
    assert balls.linearise_step(balls.state(above_right)).edges == (
        "b|a: would rebound if faster, or is not the only one that touches first",
    )
    x = balls.state(above_right)
    steps = balls.linearise_steps(x.q_D, x.v_D, x.q_K, x.v_K)
    assert steps.edges_of(0) == (
        "a point would rebound if faster, or is not the only one that touches first",
    )
    assert box.linearise_step(box.state({"body.z": 0.05})).differentiable


def test_a_decelerated_landing_closes_its_gap():
    """It closes exactly within the step: without restitution, u_n+ = -gap/dt."""
    ball = fan.loads(BALL + "gravity: [0, 0, 9.81]\n")
    x = thrown(ball, {"body.z": 0.0705}, {"body.x": 0.5, "body.z": -1.0, "body.wy": 2.0})
    lin = check_step(ball, x, ["stick"])
    assert lin.contacts[0].touch.gap == pytest.approx(0.0005)
    assert (
        lin.contacts[0].closing_rate == pytest.approx(1.0 / DT)
        and lin.contacts[0].restitution == 0.0
    )


def test_a_gap_that_closes_within_the_step(ball):
    """It starts 5 mm above the floor, at 5 m/s."""
    x = thrown(ball, {"body.z": 0.075}, {"body.x": 0.5, "body.z": -5.0, "body.wy": 2.0})
    lin = check_step(ball, x, ["stick"])
    assert lin.contacts[0].touch.gap == pytest.approx(0.005)


def test_more_points_than_are_expected_and_nodes_without_any():
    """Five boxes stand on twenty points, or fly; on one thread or two."""
    names = "abcde"
    bodies = ",".join(
        f"{{name: {name}, joint: {{type: free}}, shapes: [{{type: box, size: [0.2, 0.2, 0.1],"
        " mass: 1}]}"
        for name in names
    )
    pose = ",".join(f"{name}.x: {i}, {name}.z: 0.05" for i, name in enumerate(names))
    boxes = fan.loads(
        f"{{puppet: boxes, floor: 0, contact: true, bodies: [{bodies}], pose: {{{pose}}}}}"
    )
    x = boxes.state()
    up = x.q_D.copy()
    up[boxes.tree.coordinates.q_D.index("a.z")] = 1.0
    q_D = np.array([x.q_D, up] * 4)
    single_thread, two = (
        boxes.linearise_steps(q_D, x.v_D, x.q_K, x.v_K, threads=threads) for threads in (1, 2)
    )
    assert single_thread.n_contacts.tolist() == [20, 16] * 4
    assert single_thread.settled.all()
    assert np.array_equal(single_thread.motion, two.motion)
    lin = boxes.linearise_step(x)
    assert len(lin.contacts) == 20
    assert worst(single_thread.A[0], lin.A) < 1e-9
