"""Laws of the equations of every puppet, on seeded random trees.

Derivatives along a motion are eighth-order central differences of quantities at neighbouring
states, so no derivative of the package is compared with itself.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from harness import Model, State
from oracles import mjcf, random_trees

pytestmark = [pytest.mark.medium, pytest.mark.long]

SEEDS = range(300, 307)
SCALAR = ("fixed", "revolute", "prismatic", "translation")


@functools.cache
def tree(seed: int, dof: int | None = None, **options) -> Model:
    """A random puppet of 3 to 14 DOF; every second dynamic joint has an armature."""
    dof = 3 + seed * 5 % 12 if dof is None else dof
    description = random_trees.description(seed, dof, **options)
    for body in description["bodies"][::2]:
        if body["joint"]["type"] != "fixed" and not body["joint"].get("driven"):
            body["joint"]["armature"] = 0.2
    return Model(description)


def close(actual, desired, tolerance: float) -> None:
    """Equality relative to the largest entry, and to 1."""
    actual, desired = np.asarray(actual), np.asarray(desired)
    size = max(1.0, np.abs(desired).max(initial=0.0))
    np.testing.assert_allclose(actual, desired, rtol=0.0, atol=tolerance * size)


def whole_mass(model: Model, state: State) -> np.ndarray:
    """M over (v_D, v_K)."""
    n, k = model.table.n_vD, model.table.n_vK
    function = model.equations["mass_matrix"]
    blocks = function(q_D=state.q_D, q_K=state.q_K, p=model.p)
    M, M_DK, M_KK = (np.array(blocks[name]) for name in ("M", "M_DK", "M_KK"))
    M_DK, M_KK = M_DK.reshape(n, k), M_KK.reshape(k, k)
    return np.block([[M, M_DK], [M_DK.T, M_KK]])


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_is_symmetric_positive_definite_and_gives_the_kinetic_energy(seed):
    model = tree(seed)
    state = model.random(seed)
    M = whole_mass(model, state)
    close(M, M.T, 1e-15)
    assert np.linalg.eigvalsh(M[: model.table.n_vD, : model.table.n_vD]).min() > 0
    v = np.concatenate([state.v_D, state.v_K])
    close(model.first_output("kinetic", state), v @ M @ v / 2, 1e-12)


@pytest.mark.parametrize("kinds", [tuple(random_trees.DOF), SCALAR])
@pytest.mark.parametrize("seed", SEEDS)
def test_rate_of_M_minus_twice_C_is_skew(seed, kinds):
    model = tree(seed, kinds=kinds)
    state = model.random(seed)
    C = model.first_output("coriolis", state)
    rate = model.rate(lambda x: whole_mass(model, x), state)
    N = rate - 2 * C
    close(N, -N.T, 1e-8)
    close(rate, C + C.T, 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_C_times_v_is_the_velocity_part_of_the_bias(seed):
    model = tree(seed)
    state, n = model.random(seed), model.table.n_vD
    v = np.concatenate([state.v_D, state.v_K])
    velocity = model.first_output("bias", state)[:, 0] - model.first_output("gravity", state)[:, 0]
    close((model.first_output("coriolis", state) @ v)[:n], velocity, 1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_christoffel_symbols_where_joints_are_scalar(seed):
    """C_ij = sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) v_k / 2."""
    model = tree(seed, dof=3 + seed % 4, kinds=SCALAR)
    state, t = model.random(seed), model.table
    v = np.concatenate([state.v_D, state.v_K])
    n = len(v)
    slope = np.zeros((n, n, n))  # dM_ij/dq_k
    for k in range(n):
        unit = np.eye(n)[k]
        along = State(state.q_D, unit[: t.n_vD], state.q_K, unit[t.n_vD :], np.zeros(t.n_vK))
        slope[:, :, k] = model.rate(lambda x: whole_mass(model, x), along)
    C = np.einsum("ijk,k->ij", slope + slope.transpose(0, 2, 1) - slope.transpose(2, 1, 0), v) / 2
    close(model.first_output("coriolis", state), C, 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_lagranges_equations_with_moving_inputs(seed):
    """d/dt dL/dv - dL/dq = 0 for scalar joints, from L alone, while the inputs move."""
    model = tree(seed, dof=3 + seed % 4, kinds=SCALAR, dissipative=False)
    state, t = model.random(seed), model.table
    acc_D = model.acceleration(state)

    def momentum(x: State) -> np.ndarray:
        p = np.zeros(t.n_vD)
        for i, unit in enumerate(np.eye(t.n_vD)):  # L is quadratic in v, so the difference is exact
            ahead, behind = (
                State(x.q_D, x.v_D + s * unit, x.q_K, x.v_K, x.acc_K) for s in (0.5, -0.5)
            )
            p[i] = (
                model.first_output("lagrangian", ahead) - model.first_output("lagrangian", behind)
            )[0, 0]
        return p

    force = np.zeros(t.n_vD)
    for i, unit in enumerate(np.eye(t.n_vD)):

        def at(x: State) -> float:
            here = State(x.q_D, state.v_D, x.q_K, state.v_K, state.acc_K)
            return model.first_output("lagrangian", here)[0, 0]

        along = State(state.q_D, unit, state.q_K, np.zeros(t.n_vK), np.zeros(t.n_vK))
        force[i] = model.rate(at, along)
    close(model.rate(momentum, state, acc_D), force, 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_gravity_is_the_slope_of_the_potential(seed):
    model = tree(seed)
    state, t = model.random(seed), model.table
    slope = np.zeros(t.n_vD)
    for i, unit in enumerate(np.eye(t.n_vD)):
        along = State(state.q_D, unit, state.q_K, np.zeros(t.n_vK), np.zeros(t.n_vK))
        slope[i] = model.rate(lambda x: model.first_output("potential", x)[0, 0], along)
    close(model.first_output("gravity", state)[:, 0], slope, 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_power_balance(seed):
    """d(T + V)/dt = v_K . effort + lambda . hdot + u_D . v_D - losses, strings pulling at will."""
    model = tree(seed, strings=3, drag=True)
    state, t = model.random(seed), model.table
    rng = np.random.default_rng(seed)
    lam, u_D = -rng.uniform(0.0, 5.0, 3), rng.normal(size=t.n_vD)
    result = model.call("dynamics", state, u_D=u_D)
    A_D, A_K = model.first_output("A_D", state), model.first_output("A_K", state)
    M = whole_mass(model, state)[: t.n_vD, : t.n_vD]
    free = np.array(model.equations["solve_factor"](result["L"], result["w0"])).ravel()
    acc_D = free + np.linalg.solve(M, A_D.T @ lam)
    effort = model.first_output("effort", state, acc_D=acc_D, lam=lam)[:, 0]
    hdot = A_D @ state.v_D + A_K @ state.v_K
    close(result["hdot"], hdot, 1e-12)

    def energy(x: State) -> float:
        return (model.first_output("kinetic", x) + model.first_output("potential", x))[0, 0]

    power = state.v_K @ effort + lam @ hdot + u_D @ state.v_D - float(result["loss"][0])
    close(model.rate(energy, state, acc_D), power, 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_damping_takes_power_and_nothing_else(seed):
    """The dissipation force is the difference between motions with and without dissipation."""
    model = tree(seed, drag=True)
    state, t = model.random(seed, moving_inputs=False), model.table
    result = model.call("dynamics", state)
    force = model.first_output("damping", state)[:, 0]
    M = whole_mass(model, state)[: t.n_vD, : t.n_vD]
    bias = model.first_output("bias", state)[:, 0]
    close(M @ model.acceleration(state), -bias - force, 1e-11)
    close(force @ state.v_D, float(result["loss"][0]), 1e-12)
    assert result["loss"][0] >= 0


def constrained(seed: int) -> Model:
    """A random puppet with strings and limits."""
    return tree(seed, dof=6 + seed % 8, strings=4, limits=True)


@pytest.mark.parametrize("seed", SEEDS)
def test_A_D_and_A_K_are_the_slopes_of_h(seed):
    model = constrained(seed)
    state, t = model.random(seed), model.table
    n, k = t.n_vD, t.n_vK
    A = np.hstack([model.first_output("A_D", state), model.first_output("A_K", state)])
    for i, unit in enumerate(np.eye(n + k)):
        along = State(state.q_D, unit[:n], state.q_K, unit[n:], np.zeros(k))
        slope = model.rate(lambda x: model.first_output("constraint", x)[:, 0], along)
        close(A[:, i], slope, 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_Adot_v_is_the_rate_of_hdot_at_constant_velocity(seed):
    """Eq. 11: hddot = A_D acc_D + A_K acc_K + Adot_v, with the full derivative of A_D."""
    model = constrained(seed)
    state, t = model.random(seed), model.table
    state = State(state.q_D, state.v_D, state.q_K, state.v_K, np.zeros(t.n_vK))
    A_D, A_K = (lambda x: model.first_output("A_D", x)), (lambda x: model.first_output("A_K", x))
    rate = model.rate(lambda x: A_D(x) @ x.v_D + A_K(x) @ x.v_K, state)
    close(model.first_output("Adot_v", state)[:, 0], rate, 1e-8)
    rates = model.equations["A_rate"](
        q_D=state.q_D, v_D=state.v_D, q_K=state.q_K, v_K=state.v_K, p=model.p
    )
    close(np.array(rates["Adot_D"]), model.rate(A_D, state), 1e-8)
    close(np.array(rates["Adot_K"]), model.rate(A_K, state), 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_compiled_rows_agree_with_the_papers_objects(seed):
    """W, G, gamma, a0 of the compiled model, compared with M, A_D, A_K, Adot_v."""
    model = constrained(seed)
    state, t = model.random(seed), model.table
    m = len(model.tree.strings)
    result = model.call("dynamics", state)
    M = whole_mass(model, state)[: t.n_vD, : t.n_vD]
    A_D, A_K = model.first_output("A_D", state)[:m], model.first_output("A_K", state)[:m]
    close(result["G"], A_D @ np.linalg.solve(M, A_D.T), 1e-11)
    close(result["a0"], A_D @ model.acceleration(state), 1e-11)
    gamma = model.first_output("Adot_v", state)[:m, 0] + A_K @ state.acc_K
    close(result["gamma"], gamma, 1e-11)
    close(result["hdot_K"], A_K @ state.v_K, 1e-12)
    close(result["h"], model.first_output("constraint", state)[:m, 0], 1e-14)
    force = np.random.default_rng(seed).normal(size=t.n_vD)
    half = model.equations["solve_factor_transposed"](result["L"], force)
    solved = np.array(model.equations["solve_factor"](result["L"], half)).ravel()
    close(solved, np.linalg.solve(M, force), 1e-11)
    close(result["M_DK_v_K"], whole_mass(model, state)[: t.n_vD, t.n_vD :] @ state.v_K, 1e-12)
    none = np.zeros(t.n_vD)
    effort = model.first_output("effort", state, acc_D=none, lam=np.zeros(m))[:, 0]
    close(result["power0"][0], state.v_K @ effort, 1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_body_velocity_is_the_rate_of_the_pose(seed):
    """Eq. 4: V^b = unhat(g^-1 dg/dt)."""
    model = tree(seed)
    state = model.random(seed)
    n = len(model.tree.links)

    def frames(x: State) -> np.ndarray:
        flat = model.first_output("poses", x).reshape(n, 12)
        g = np.tile(np.eye(4), (n, 1, 1))
        g[:, :3, :3] = flat[:, :9].reshape(n, 3, 3).transpose(0, 2, 1)
        g[:, :3, 3] = flat[:, 9:]
        return g

    twist = np.linalg.inv(frames(state)) @ model.rate(frames, state)
    V = model.first_output("body_velocity", state)
    close(V[:3].T, twist[:, :3, 3], 1e-8)
    close(V[3:].T, np.stack([twist[:, 2, 1], twist[:, 0, 2], twist[:, 1, 0]], axis=1), 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_weights_as_wrenches_are_gravity(seed):
    """u_D of the weights, as wrenches on the centres of mass, is -g."""
    model = tree(seed, springs=False)
    state, twin = model.random(seed), mjcf.mirror(model.description)
    wrench = np.zeros((6, len(model.tree.links)))
    for i, link in enumerate(model.tree.links):
        mass = twin.model.body(link.name).mass[0]
        wrench[:3, i] = mass * np.array(model.tree.gravity)
    u_D = model.first_output("wrench_forces", state, wrench=wrench)[:, 0]
    close(u_D, -model.first_output("gravity", state)[:, 0], 1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_frozen_inputs_give_plain_euler_lagrange(seed):
    """Driven joints at rest act as fixed joints at their poses."""
    model = tree(seed, driven=0.4, drag=True)
    state = model.random(seed, moving_inputs=False)
    poses = dict(zip(model.table.q_K, state.q_K, strict=True))
    welded = Model(_welded(model.description, poses))
    assert welded.table.v_D == model.table.v_D
    assert welded.table.n_vK == 0
    none = np.zeros(0)
    plain = State(state.q_D, state.v_D, none, none, none)
    close(model.acceleration(state), welded.acceleration(plain), 1e-10)


def _welded(description: dict, q_K: dict[str, float]) -> dict:
    """The same puppet with its driven joints fixed at their positions."""
    bodies = []
    for body in description["bodies"]:
        joint, name = body["joint"], body["name"]
        if not joint.get("driven"):
            bodies.append(body)
            continue
        at = np.array(joint.get("at", (0.0, 0.0, 0.0)))
        turn = mjcf.quaternion(joint.get("orientation"))
        shift, q = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        kind = joint["type"]
        if kind in ("revolute", "prismatic"):
            axis = np.array(joint["axis"]) / np.linalg.norm(joint["axis"])
            if kind == "prismatic":
                shift = axis * q_K[name]
            else:
                half = q_K[name] / 2.0
                q = np.concatenate([[np.cos(half)], np.sin(half) * axis])
        for i, axis in enumerate("xyz"):
            shift[i] += q_K.get(f"{name}.{axis}", 0.0)
        if f"{name}.qw" in q_K:
            q = np.array([q_K[name + s] for s in (".qw", ".qx", ".qy", ".qz")])
        moved = at + _rotate(turn, shift)
        pose = {
            "type": "fixed",
            "at": [float(x) for x in moved],
            "orientation": {"quaternion": [float(x) for x in _product(turn, q)]},
        }
        bodies.append({**body, "joint": pose})
    return {**description, "bodies": bodies}


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate([[w], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])


def _rotate(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    return x + 2 * np.cross(q[1:], np.cross(q[1:], x) + q[0] * x)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_dynamics_equal_a_step_of_zero_length(seed):
    """Their factors store entries at different places, but have the same products."""
    model = tree(seed, strings=3, limits=True, drag=True)
    state, rng = model.random(seed), np.random.default_rng(seed)
    u_D = rng.normal(size=model.table.n_vD)
    step, exact = (model.call(f, state, u_D=u_D) for f in ("step_dynamics", "dynamics"))
    for name in exact:
        if name in step and name != "L":
            close(exact[name], step[name], 1e-12)
    for product in ("solve_factor_transposed", "solve_factor"):
        of_step, of_exact = (model.equations[product](x["L"], u_D) for x in (step, exact))
        close(np.array(of_exact), np.array(of_step), 1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_factor_of_a_step_has_its_damping(seed):
    """solve_factor(solve_factor_transposed(x)) = (M + dt damping)^-1 x."""
    model, dt = tree(seed), 0.1
    state, t = model.random(seed), model.table
    x = np.random.default_rng(seed).normal(size=t.n_vD)
    M = whole_mass(model, state)[: t.n_vD, : t.n_vD]
    for link in model.tree.links:
        if link.role == "dynamic":
            M[link.v, link.v] += dt * link.damping * np.eye(link.v.stop - link.v.start)
    L = model.call("step_dynamics", state, dt=dt)["L"]
    half = model.equations["solve_factor_transposed"](L, x)
    solution = np.array(model.equations["solve_factor"](L, half)).ravel()
    close(solution, np.linalg.solve(M, x), 1e-11)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_column_of_a_limit_is_a_solve_with_its_jacobian(seed):
    model = constrained(seed)
    state, rng = model.random(seed), np.random.default_rng(seed)
    L = model.call("step_dynamics", state, dt=0.01)["L"]
    columns = model.equations.columns
    assert set(columns) == {limit.link for limit in model.tree.limits}
    for link, (entries, function) in columns.items():
        place, x, forces = model.tree.links[link].v, np.zeros(3), np.zeros(model.table.n_vD)
        forces[place] = x[: place.stop - place.start] = rng.normal(size=place.stop - place.start)
        right = np.array(model.equations["solve_factor_transposed"](L, forces)).ravel()
        column = np.zeros_like(right)
        column[entries] = np.array(function(L, x)).ravel()
        close(column, right, 1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_times_is_a_product_with_M(seed):
    model = tree(seed)
    state, n = model.random(seed), model.table.n_vD
    x = np.random.default_rng(seed).normal(size=n)
    product = whole_mass(model, state)[:n, :n] @ x
    close(model.first_output("mass_times", state, acc_D=x)[:, 0], product, 1e-13)
