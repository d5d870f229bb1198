"""Laws that event-driven runs obey."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.integrate import DOP853

import fantoccini as fan
from harness import Model, State, polynomial_input, start

pytestmark = pytest.mark.medium

TIGHT = {"method": fan.Event(rtol=1e-12, atol=1e-12)}

TUMBLER = {
    "puppet": "tumbler",
    "bodies": [
        {
            "name": "hub",
            "joint": {"type": "free"},
            "mass": 1.0,
            "com": [0.02, -0.01, 0.03],
            "inertia": [0.02, 0.03, 0.04, 0.002, -0.001, 0.003],
        },
        {
            "name": "fin",
            "parent": "hub",
            "joint": {"type": "ball", "at": [0.1, 0.2, 0.0], "damping": 0.002},
            "mass": 0.3,
            "com": [0.0, 0.1, 0.05],
            "inertia": [0.003, 0.002, 0.0025],
            "drag": {"linear": 0.1, "quadratic": 0.05, "angular": 0.001},
        },
        {
            "name": "wing",
            "parent": "hub",
            "joint": {
                "type": "revolute",
                "axis": [1.0, 1.0, 0.0],
                "at": [-0.1, 0.0, 0.1],
                "spring": {"stiffness": 0.5, "rest": 0.2},
            },
            "mass": 0.2,
            "com": [-0.1, 0.0, 0.0],
            "inertia": [0.001, 0.002, 0.002],
        },
    ],
}
"""A free body with a ball joint and a hinge: quaternions, drag, springs, no strings."""

CRADLE = {
    "puppet": "cradle",
    "bodies": [
        {
            "name": "rod",
            "joint": {"type": "free", "at": [0.0, 0.0, 0.0]},
            "mass": 0.5,
            "com": [0.0, 0.0, 0.0],
            "inertia": [0.001, 0.015, 0.015],
        }
    ],
    "strings": [
        {
            "name": side,
            "path": [
                {"body": "rod", "at": [x, 0.0, 0.0]},
                {"driven": ["x", "z"], "at": [1.3 * x, 0.0, 0.8]},
            ],
            "length": "driven",
        }
        for side, x in (("left", -0.3), ("right", 0.3))
    ],
    "pose": {"left.length": 0.9, "right.length": 0.9},
}
"""A rod on two strings."""


def load(description: dict, folder) -> fan.Marionette:
    path = folder / f"{description['puppet']}.yaml"
    path.write_text(json.dumps(description))
    return fan.load(path)


@pytest.fixture(scope="module")
def cradle(tmp_path_factory):
    return load(CRADLE, tmp_path_factory.mktemp("cradle"))


def jerk(marionette, x0, **moves) -> fan.Input:
    """Minimum-jerk moves: coordinate -> [(t, change since the start), ...]."""
    table, points = marionette.coordinates, {}
    for name, knots in moves.items():
        name = name.replace("__", ".")
        q = x0.q_K[table.q_K.index(name)]
        points[name] = [(0.0, q), *((t, q + change) for t, change in knots)]
    return fan.Input.waypoints(marionette, points)


@pytest.fixture(scope="module")
def performance(arm):
    """arm2d thrown up and caught, several times."""
    x0 = arm.rest({"hand.length": 0.8, "hand.x": 0.45})
    drive = jerk(
        arm,
        x0,
        hand__length=[(0.25, -0.25), (0.6, 0.0), (0.85, -0.2), (1.5, 0.05)],
        hand__x=[(0.7, 0.1), (1.5, -0.05)],
    )
    run = fan.simulate(arm, x0, drive, t_end=2.0, **TIGHT)
    assert sum(e.kind == "catch" for e in run.events) >= 2
    return run


def energy(run) -> np.ndarray:
    return run.ledger["kinetic"] + run.ledger["potential"]


def test_energy_is_conserved_with_strings_at_rest(arm):
    """T + V + the energy lost in impacts is constant."""
    hanging = arm.rest({"hand.length": 0.7})
    q = hanging.q_D + np.array([0.5, 0.3])  # the hand comes nearer to S: the string is slack
    run = fan.simulate(arm, hanging.replace(q_D=q), fan.Input.hold(arm), t_end=3.0, **TIGHT)
    assert any(e.kind == "catch" for e in run.events)
    total = energy(run) + np.abs(run.ledger["impact"])
    np.testing.assert_allclose(total, total[0], atol=1e-9)
    assert np.all(np.diff(np.abs(run.ledger["impact"])) >= 0)


def test_ledger_closes(performance):
    """Energy gained = work of the inputs - losses."""
    ledger = performance.ledger
    gained = energy(performance) - energy(performance)[0]
    out = np.abs(ledger["impact"]) + np.abs(ledger["damping"]) + np.abs(ledger["slip"])
    np.testing.assert_allclose(gained, ledger["work"] - out, atol=1e-8)
    np.testing.assert_allclose(ledger["residual"], 0.0, atol=1e-8)


def test_catch_is_eqs_13_to_15(arm, performance):
    """M dv = A_D^T Lambda with Lambda = -impulse, and hdot = 0 afterwards."""
    run, model, caught = performance, Model.of(arm.puppet), 0
    for event in run.events:
        if event.kind != "catch":
            continue
        before, after = np.flatnonzero(run.t == event.t)[[0, -1]]
        x = State(run.q_D[after], run.v_D[after], run.q_K[after], run.v_K[after], np.zeros(2))
        M, A_D, A_K = (model.first_output(name, x) for name in ("mass_matrix", "A_D", "A_K"))
        dv = run.v_D[after] - run.v_D[before]
        np.testing.assert_allclose(M @ dv, -A_D[0] * event.impulse, atol=1e-12)
        assert abs(A_D[0] @ x.v_D + A_K[0] @ x.v_K) < 1e-12
        assert A_D[0] @ run.v_D[before] + A_K[0] @ x.v_K == pytest.approx(event.speed, abs=1e-12)
        np.testing.assert_array_equal(run.v_K[before], run.v_K[after])
        caught += 1
    assert caught >= 2


def test_catching_is_idempotent(cradle):
    """A state just after a catch starts without another catch and moves equally."""
    x0 = cradle.project(start(cradle, {"rod.z": 0.1, "rod.x": 0.05}, {"rod.wy": 0.5, "rod.z": 0.3}))
    still = fan.Input.hold(cradle)
    run = fan.simulate(cradle, x0, still, t_end=1.0, **TIGHT)
    catch = next(e for e in run.events if e.kind == "catch")
    after = np.flatnonzero(run.t == catch.t)[-1]
    again = x0.replace(t=run.t[after], q_D=run.q_D[after], v_D=run.v_D[after])
    rest = fan.simulate(cradle, again, still, t_end=1.0, **TIGHT)
    assert not any(e.kind == "catch" and e.t == catch.t for e in rest.events)
    np.testing.assert_allclose(rest.v_D[0], run.v_D[after], atol=1e-13)
    np.testing.assert_allclose(rest.q_D[-1], run.q_D[-1], atol=1e-9)
    np.testing.assert_allclose(rest.v_D[-1], run.v_D[-1], atol=1e-8)


def test_strings_only_pull_and_never_stretch(arm, cradle, performance):
    x0 = cradle.rest({})
    drive = jerk(cradle, x0, left__length=[(0.2, -0.3), (0.8, 0.1)], right__x=[(0.5, 0.2)])
    other = fan.simulate(cradle, x0, drive, t_end=2.0, **TIGHT)
    for marionette, run in ((arm, performance), (cradle, other)):
        model = Model.of(marionette.puppet)
        assert run.tension.values.min() >= 0
        for i in range(len(run.t)):
            x = State(run.q_D[i], run.v_D[i], run.q_K[i], run.v_K[i], np.zeros(run.v_K.shape[1]))
            h = model.first_output("constraint", x)[:, 0]
            assert h.max() < 1e-10
            assert np.abs(h[run.taut.values[i]]).max(initial=0.0) < 1e-10
            assert np.all(run.tension.values[i][~run.taut.values[i]] == 0)


@pytest.mark.parametrize("name", ["arm2d", "cradle", "marionette"])
def test_at_rest_the_strings_carry_the_weight(name, cradle, request):
    """Vertical string forces sum to the weight, minus the load of a fixed joint; nothing moves."""
    marionette = cradle if name == "cradle" else getattr(fan.puppets, name)()
    x0 = marionette.rest({})
    run = fan.simulate(marionette, x0, fan.Input.hold(marionette), t_end=0.01)
    model = Model.of(marionette.puppet)
    x = State(x0.q_D, np.zeros_like(x0.v_D), x0.q_K, np.zeros_like(x0.v_K), np.zeros_like(x0.v_K))
    tau = np.zeros(model.tree.n_rows)
    tau[: len(model.tree.strings)] = run.tension.values[0]
    tau[len(model.tree.strings) :] = run.limit_force.values[0]
    balance = model.first_output("gravity", x)[:, 0] + model.first_output("A_D", x).T @ tau
    weight = np.abs(model.first_output("gravity", x)).max()
    np.testing.assert_allclose(balance, 0.0, atol=1e-9 * max(1.0, weight))
    assert np.abs(run.v_D).max() < 1e-8
    if name == "arm2d":
        return
    total = model.first_output("gravity", x)[
        model.table.v_D.index({"cradle": "rod.z", "marionette": "torso.z"}[name]), 0
    ]
    pull = 0.0
    points = marionette.string_points(x0.q_D, x0.q_K).values()
    for string, tension in zip(points, run.tension.values[0], strict=True):
        last, end = string[-2], string[-1]
        pull += tension * (end - last)[2] / np.linalg.norm(end - last)
    assert pull == pytest.approx(total, rel=1e-9)


def test_a_run_without_strings_equals_scipys(tmp_path):
    """Quaternions, ball and free joints, drag and springs, compared with DOP853."""
    tumbler = load(TUMBLER, tmp_path)
    model, table = Model.of(tumbler.puppet), tumbler.coordinates
    rng = np.random.default_rng(4)
    x0 = start(tumbler, {}, dict(zip(table.v_D, rng.normal(size=table.n_vD) * 3, strict=True)))
    run = fan.simulate(tumbler, x0, fan.Input.hold(tumbler), t_end=1.0, **TIGHT)
    none = np.zeros(0)

    def rhs(_, y):
        q, v = y[: table.n_qD], y[table.n_qD :]
        rate = np.zeros(table.n_qD)
        for at, k in table.scalars_D:
            rate[at] = v[k]
        for at, k in table.quaternions_D:
            w, u, omega = q[at], q[at + 1 : at + 4], v[k : k + 3]
            rate[at] = -u @ omega / 2
            rate[at + 1 : at + 4] = (w * omega + np.cross(u, omega)) / 2
        return np.concatenate([rate, model.acceleration(State(q, v, none, none, none))])

    solver = DOP853(rhs, 0.0, np.concatenate([x0.q_D, x0.v_D]), 1.0, rtol=1e-10, atol=1e-11)
    while solver.status == "running":
        solver.step()
    ours = np.concatenate([run.q_D[-1], run.v_D[-1]])
    np.testing.assert_allclose(ours, solver.y, atol=2e-8)
    for at, _ in table.quaternions_D:
        norms = np.linalg.norm(run.q_D[:, at : at + 4], axis=1)
        np.testing.assert_allclose(norms, 1.0, atol=1e-12)


def test_moving_inputs_that_stand_still_are_frozen_inputs(arm):
    """An input that names all coordinates without moving them equals no input."""
    x0 = arm.rest({"hand.length": 0.7})
    x0 = x0.replace(v_D=np.array([0.5, 0.0]))
    table = arm.coordinates
    coef = {name: np.array([[x0.q_K[i], 0, 0, 0, 0, 0]]) for i, name in enumerate(table.q_K)}
    named = polynomial_input(arm, np.array([0.0, 1.0]), coef, x0.q_K)
    x0 = arm.project(x0)
    with_input = fan.simulate(arm, x0, named, t_end=1.0, **TIGHT)
    other = fan.simulate(arm, x0, fan.Input.hold(arm, 1.0), t_end=1.0, **TIGHT)
    np.testing.assert_array_equal(with_input.q_D[-1], other.q_D[-1])


def test_the_same_run_gives_the_same_bits(arm, performance):
    x0 = arm.rest({"hand.length": 0.8, "hand.x": 0.45})
    drive = jerk(
        arm,
        x0,
        hand__length=[(0.25, -0.25), (0.6, 0.0), (0.85, -0.2), (1.5, 0.05)],
        hand__x=[(0.7, 0.1), (1.5, -0.05)],
    )
    again = fan.simulate(arm, x0, drive, t_end=2.0, **TIGHT)
    np.testing.assert_array_equal(again.q_D, performance.q_D)
    np.testing.assert_array_equal(again.tension.values, performance.tension.values)
