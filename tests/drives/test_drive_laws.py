"""Drives on random trees: Lagrange's equations, and the residual of the derivatives."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import fantoccini as fan
from fantoccini.kernel.equations.derivatives import Derivatives
from fantoccini.kernel.equations.energy import kinetic_energy
from harness import Model
from oracles.random_trees import description

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

CONTROLS = (
    {"type": "pd", "stiffness": 30.0, "damping": 2.0},
    {"type": "computed_torque", "bandwidth": 8.0},
    None,
)


def driven_coordinates(puppet: dict) -> list[tuple[str, bool]]:
    """(coordinate, whether it is a length) of every driven coordinate."""
    coordinates = []
    for body in puppet["bodies"]:
        joint = body["joint"]
        if joint.get("driven"):
            name = joint.get("name", body["name"])
            kinds = {
                "revolute": [("", False)],
                "prismatic": [("", True)],
                "ball": [(".rotation", False)],
                "translation": [(f".{a}", True) for a in joint.get("axes", ())],
                "free": [(".x", True), (".y", True), (".z", True), (".rotation", False)],
            }
            coordinates += [(name + s, length) for s, length in kinds[joint["type"]]]
    for string in puppet.get("strings", ()):
        ends = [a for point in string["path"] for a in point.get("driven", ())]
        coordinates += [(f"{string['name']}.{a}", True) for a in ends]
        if string["length"] == "driven":
            coordinates.append((f"{string['name']}.length", True))
    return coordinates


def motorised(seed: int) -> Model:
    """A random puppet with drives on two thirds of the driven coordinates."""
    puppet = description(seed, 12, driven=0.6, strings=3, limits=True, drag=True)
    rng, drives = np.random.default_rng(seed), []
    for name, length in driven_coordinates(puppet):
        if rng.random() < 0.67:
            drive = {"on": name, "inertia": 2e-3, "gear": 3.0, "friction": {"coulomb": 0.02}}
            drive |= {"drum": 0.1, "mass": 0.2} if length else {}
            control = CONTROLS[rng.integers(3)]
            drives.append(drive | ({} if control is None else {"control": control}))
    return Model(puppet | {"drives": drives})


@pytest.fixture(scope="module", params=range(4))
def model(request):
    motorised_model = motorised(request.param)
    assert motorised_model.tree.drives
    return motorised_model


def test_the_mass_matrix_is_the_kinetic_energys_hessian(model):
    s, x = model.equations.system.symbols, model.random(1)
    v = ca.vertcat(s.v_D, s.v_K)
    hessian, _ = ca.hessian(kinetic_energy(model.equations.system), v)
    T = ca.Function("T", [s.q_D, s.v_D, s.q_K, s.v_K, s.p], [hessian])
    matrices = model.call("mass_matrix", x)
    expected = np.array(T(x.q_D, x.v_D, x.q_K, x.v_K, model.p))
    n = model.table.n_vD
    np.testing.assert_allclose(matrices["M"], expected[:n, :n], atol=1e-12)
    np.testing.assert_allclose(matrices["M_DK"].reshape(n, -1), expected[:n, n:], atol=1e-12)
    a = np.random.default_rng(0).normal(size=n)
    times = np.ravel(model.call("mass_times", x, acc_D=a)["f"])
    np.testing.assert_allclose(times, matrices["M"] @ a, atol=1e-11)


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_the_residual_vanishes_at_the_accelerations(model, dt):
    """F^-1 (w0 - W tension), strings and drives included, solves the residual's equations."""
    x, rng = model.random(2), np.random.default_rng(3)
    pulls = rng.uniform(0, 2, len(model.tree.strings))
    tension = np.append(pulls, np.zeros(len(model.tree.limits)))
    name = "step_dynamics" if dt else "dynamics"
    acc_K = rng.normal(size=model.table.n_vK)
    result = model.call(name, x, dt=dt, acc_K=acc_K)
    W = result["W"].reshape(model.table.n_vD, -1)
    w = result["w0"] - W @ pulls
    (acc,) = (np.ravel(np.array(y)) for y in model.equations["solve_factor"].call([result["L"], w]))
    derivatives = Derivatives(model.tree)
    s, tau = derivatives.system.symbols, ca.SX.sym("tension", model.tree.n_rows)
    arguments = [s.q_D, s.v_D, s.acc_D, s.q_K, s.v_K, s.acc_K, s.dt, s.p, tau]
    residual = ca.Function("r", arguments, [derivatives.residual(tau)])
    left = residual(x.q_D, x.v_D, acc, x.q_K, x.v_K, acc_K, dt, model.p, tension)
    assert np.max(np.abs(np.array(left))) < 1e-9 * max(1.0, np.max(np.abs(acc)))


def test_hands_hold_commands():
    """A live performance moves commands: the string's end by its handle, its winch by length."""
    puppet = fan.loads(
        """
puppet: bob
bodies: [{name: bob, joint: {type: translation, axes: [x, z]}, mass: 0.4}]
strings:
  - {name: line, path: [{body: bob}, {driven: [x], at: [0, 0, 1]}], length: driven}
drives:
  - {on: line.x, mass: 0.3, control: {type: pd, stiffness: 200, damping: 12}}
  - {on: line.length, mass: 0.2, control: {type: computed_torque, bandwidth: 40}}
pose: {bob.z: 0.2, line.length: 0.8}
"""
    )
    show = fan.Performance(puppet)
    (handle,) = show.handles
    assert (handle.name, handle.coordinates) == ("line", ("line.command.x",))
    show.move("line", (0.2, 0.0, 1.0))
    show.wind("line", 0.7)
    show.advance(3.0)
    names = puppet.coordinates.q_D
    assert show.state.q_D[names.index("line.x")] == pytest.approx(0.2, abs=0.02)
    # It yields to the pull, unknown to its controller: pull / (inertia w^2).
    sag = 0.4 * 9.81 / (0.2 * 40**2)
    assert show.state.q_D[names.index("line.length")] == pytest.approx(0.7 + sag, abs=0.003)
