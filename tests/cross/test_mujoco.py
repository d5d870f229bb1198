"""Random trees satisfy MuJoCo's equations of motion."""

from importlib.resources import files

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import motion
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.model.puppet import load
from harness import Model, State
from oracles import mjcf, random_trees

pytestmark = [pytest.mark.slow, pytest.mark.long]

TREES = 200
SIZES = [40, 38, 36, 34, *([28] * 6), *([20] * 15), *([12] * 45), *([6] * 65), *([3] * 65)]


COMPILED = (4, 10, 30, 45, 75, 140)
"""Seeds of the trees that are compiled too: 28, 20, 12, 12, 6, 3 DOF. One of each size is enough:
tests of the generator compare compiled functions with the equations.
"""


def check(model: Model, seed: int, acceleration=None) -> float:
    """Largest residual, relative to its terms, at a random state with moving inputs."""
    twin = mjcf.mirror(model.description)
    state, t = model.random(seed), model.table
    acc_D = (acceleration or model.acceleration)(state)
    twin.set(
        dict(zip(t.q_D + t.q_K, [*state.q_D, *state.q_K], strict=True)),
        dict(zip(t.v_D + t.v_K, [*state.v_D, *state.v_K], strict=True)),
        dict(zip(t.v_D + t.v_K, [*acc_D, *state.acc_K], strict=True)),
    )
    residual, size = twin.residual(t.v_D)
    return float(np.abs(residual).max() / size)


@pytest.mark.parametrize("part", range(8))
def test_random_trees_satisfy_mujocos_equations(part):
    """M qacc + bias - passive = 0 on the dynamic rows, with MuJoCo's M, bias and passive forces."""
    assert len(SIZES) == TREES
    for seed in range(part, TREES, 8):
        model = Model(random_trees.description(seed, SIZES[seed]))
        assert check(model, seed) < 1e-10, f"seed {seed}, {SIZES[seed]} DOF"


@pytest.mark.parametrize("seed", COMPILED)
def test_compiled_trees_satisfy_mujocos_equations(seed):
    """Compiled functions satisfy the equations too, through C++ and the shared library."""
    model = Model(random_trees.description(seed, SIZES[seed]))
    marionette = fan.Marionette(model.puppet)

    def acceleration(s: State) -> np.ndarray:
        x = motion.State(0.0, s.q_D, s.v_D, s.q_K, s.v_K, np.zeros(0, dtype=bool))
        instant = Evaluation.at_state(marionette, x, acc_K=s.acc_K)
        return instant.solve_factor(instant.w0)

    assert check(model, seed, acceleration) < 1e-10


@pytest.mark.parametrize("seed", range(0, 200, 25))
def test_energies_and_poses_equal_mujocos(seed):
    """T, V with all springs, and the bodies' poses."""
    model = Model(random_trees.description(seed, SIZES[seed], dissipative=False))
    twin, state, t = mjcf.mirror(model.description), model.random(seed), model.table
    values = dict(zip(t.q_D + t.q_K, [*state.q_D, *state.q_K], strict=True))
    rates = dict(zip(t.v_D + t.v_K, [*state.v_D, *state.v_K], strict=True))
    twin.set(values, rates, rates)
    potential, kinetic = twin.energy()
    assert model.first_output("kinetic", state)[0, 0] == pytest.approx(kinetic, rel=1e-11)
    ours = model.first_output("potential", state)[0, 0]
    assert ours == pytest.approx(potential, rel=1e-11, abs=1e-9)
    poses = model.first_output("poses", state).reshape(-1, 12)
    for link, pose in zip(model.tree.links, poses, strict=True):
        theirs = twin.body_pose(link.name)
        np.testing.assert_allclose(pose[:9].reshape(3, 3).T, theirs[:, :3], atol=1e-12)
        np.testing.assert_allclose(pose[9:], theirs[:, 3], atol=1e-12)


@pytest.mark.parametrize("name", ["arm3d", "marionette", "marionette_bar"])
def test_bundled_puppets_satisfy_mujocos_equations(name):
    """The bundled puppets, with shapes and mirror, without strings and air."""
    whole = load(files("fantoccini") / "model" / "puppets" / f"{name}.yaml").expanded()
    still_air = []
    for body in whole.bodies:
        joint = body.joint.model_copy(update={"spring": None})  # MuJoCo's ball spring is another
        still_air.append(body.model_copy(update={"drag": None, "joint": joint}))
    puppet = whole.model_copy(update={"bodies": type(whole.bodies)(still_air)})
    model = Model.of(puppet)
    model.description = puppet.model_dump(by_alias=True, mode="json")
    for seed in range(5):
        assert check(model, seed) < 1e-10
