"""Programs of stages, beside the same programs written as one dense system."""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram, StageSolver

N, N_Z, K = 4, 3, 2
S = K + N_Z


def program(rows: int = 0, seed: int = 1) -> StageProgram:
    """Random, convex, without bounds."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(N, S, S))
    H = root @ root.swapaxes(1, 2) + np.eye(S)
    return StageProgram(
        H=H,
        g=random.normal(size=(N, S)),
        cross=0.1 * random.normal(size=(N, S, K)),
        A=0.5 * random.normal(size=(N, N_Z, N_Z)),
        B=random.normal(size=(N, N_Z, K)),
        e=0.3 * random.normal(size=(N, N_Z)),
        low=np.full((N, S), -UNBOUNDED),
        high=np.full((N, S), UNBOUNDED),
        C=random.normal(size=(N, rows, 2 * S)),
        row_low=np.full((N, rows), -0.3),
        row_high=np.full((N, rows), 0.2),
        elastic=np.full((N, rows), 0.2),
    )


def dense(given: StageProgram) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """P, c, A, b of the same: min 1/2 x^T P x + c^T x, A x = b."""
    P, A = np.zeros((N * S, N * S)), np.zeros((N * N_Z, N * S))
    for i in range(N):
        own, before = slice(S * i, S * (i + 1)), slice(S * (i - 1), S * i)
        rows = slice(N_Z * i, N_Z * (i + 1))
        P[own, own] = given.H[i]
        A[rows, own] = np.concatenate([given.B[i], -np.eye(N_Z)], axis=1)
        if i:
            u = slice(S * i, S * i + K)
            P[before, u] += given.cross[i]
            P[u, before] += given.cross[i].T
            A[rows, S * (i - 1) + K : S * i] = given.A[i]
    return P, given.g.ravel(), A, -given.e.ravel()


def test_without_bounds_it_is_the_linear_system_of_the_conditions_of_optimality():
    given = program()
    P, c, A, b = dense(given)
    zero = np.zeros((len(b), len(b)))
    kkt = np.linalg.solve(np.block([[P, A.T], [A, zero]]), np.concatenate([-c, b]))
    found = StageSolver(1e-10).solve(given)
    assert found.solved
    x = np.concatenate([found.u, found.z[1:]], axis=1).ravel()
    assert x == pytest.approx(kkt[: len(c)], abs=1e-6)
    assert found.costate.ravel() == pytest.approx(kkt[len(c) :], abs=1e-5)


def test_bounds_and_rows_that_are_passed_at_a_price_are_those_of_another_solver():
    given = program(rows=2)
    given.low[:, :K], given.high[:, :K] = -0.15, 0.15
    P, c, A, b = dense(given)
    m = given.C.shape[1]
    n = N * S
    rows = np.zeros((N * m, n))
    for i in range(N):
        at = slice(m * i, m * (i + 1))
        rows[at, S * i : S * (i + 1)] = given.C[i, :, S:]
        if i:
            rows[at, S * (i - 1) : S * i] += given.C[i, :, :S]
    price = given.elastic.ravel()

    def cost(y: np.ndarray) -> float:
        x, s = y[:n], y[n:]
        return 0.5 * x @ P @ x + c @ x + price @ s + 0.5 * price @ s**2

    def slope(y: np.ndarray) -> np.ndarray:
        x, s = y[:n], y[n:]
        return np.concatenate([P @ x + c, price + price * s])

    one, none = np.eye(N * m), np.zeros((len(b), N * m))
    low = np.concatenate([given.low.ravel(), np.zeros(N * m)])
    high = np.concatenate([given.high.ravel(), np.full(N * m, np.inf)])
    constraints = [
        LinearConstraint(np.concatenate([A, none], axis=1), b, b),
        LinearConstraint(np.concatenate([rows, -one], axis=1), -np.inf, given.row_high.ravel()),
        LinearConstraint(np.concatenate([rows, one], axis=1), given.row_low.ravel(), np.inf),
    ]
    best = minimize(
        cost,
        np.zeros(n + N * m),
        jac=slope,
        method="SLSQP",
        constraints=constraints,
        bounds=list(zip(low, high, strict=True)),
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert best.success
    found = StageSolver(1e-10).solve(given)
    x = np.concatenate([found.u, found.z[1:]], axis=1).ravel()
    assert found.solved
    assert x == pytest.approx(best.x[:n], abs=2e-5)
    assert found.passed.ravel() == pytest.approx(best.x[n:], abs=2e-5)
    assert np.max(found.passed) > 0.01 and np.max(np.abs(found.u)) > 0.149


def test_a_solver_solves_program_after_program_of_one_shape():
    solver = StageSolver(1e-10)
    for seed in range(3):
        given = program(seed=seed)
        again, alone = solver.solve(given), StageSolver(1e-10).solve(given)
        assert again.u == pytest.approx(alone.u, abs=1e-6)


def test_gains_are_what_the_best_inputs_do_where_the_start_is_another():
    given = replace(program(), g=np.zeros((N, S)), e=np.zeros((N, N_Z)))
    # What costs have between neighbouring inputs, or an input and the state after it, is left out.
    given.cross[:, :K] = given.H[:, :K, K:] = given.H[:, K:, :K] = 0.0
    gains = given.gains
    random = np.random.default_rng(5)
    z0 = random.normal(size=N_Z)
    # The first state is 0 in programs: what it would add stands in e and g of the first stage.
    given.e[0] = given.A[0] @ z0
    given.g[0, :K] = given.cross[0, K:].T @ z0
    found = StageSolver(1e-10).solve(given)
    states = np.concatenate([z0[None], found.z[1:]])
    for i in range(N):
        assert found.u[i] == pytest.approx(gains[i] @ states[i], abs=1e-6)


@pytest.mark.parametrize("highest", [5.0, -0.3])
def test_constants_move_the_start_and_all_ends(highest: float):
    """Two states stay what they are from the start on, which they move as well."""
    random = np.random.default_rng(9)
    start = np.concatenate([random.normal(size=(N_Z - 2, 2)), np.eye(2)])
    given = program(seed=3)
    given.A[:, -2:], given.B[:, -2:], given.e[:, -2:] = np.eye(2, N_Z, N_Z - 2), 0.0, 0.0
    given.low[:], given.high[:], given.C[:] = -UNBOUNDED, UNBOUNDED, 0.0
    L = random.normal(size=(N_Z, N_Z))
    Q, q = L @ L.T, random.normal(size=N_Z)
    low, high = np.full(2, -5.0), np.array([5.0, highest])
    found = StageSolver(1e-11).solve(given.with_constants(start, Q, q, low, high, 1e-6))
    assert found.solved
    c = found.u[0, K:]
    assert np.all(c <= high + 1e-6) and (highest > 1.0) == (c[1] < highest - 1e-3)
    assert found.z[1:, -2:] == pytest.approx(np.repeat(c[None], N, axis=0), abs=1e-6)

    def cost(u: np.ndarray, c: np.ndarray) -> float:
        z = start @ c
        J = 0.5 * z @ Q @ z + q @ z + 5e-7 * c @ c
        for i in range(N):
            before = np.concatenate([u[i - 1] if i else np.zeros(K), z])
            z = given.A[i] @ z + given.B[i] @ u[i] + given.e[i]
            x = np.concatenate([u[i], z])
            J += 0.5 * x @ given.H[i] @ x + given.g[i] @ x + before @ given.cross[i] @ u[i]
        return float(J)

    least = cost(found.u[:, :K], c)
    for _ in range(100):
        du, dc = 1e-2 * random.normal(size=(N, K)), 1e-2 * random.normal(size=2)
        assert cost(found.u[:, :K] + du, np.minimum(c + dc, high)) > least


def crossed(given: StageProgram) -> tuple[np.ndarray, ...]:
    """P, c, A, low, high of the same for a solver of sparse programs: x, then elastic parts."""
    P, c, dynamics, b = dense(given)
    m, n = given.C.shape[1], N * S
    rows = np.zeros((N * m, n))
    for i in range(N):
        at = slice(m * i, m * (i + 1))
        rows[at, S * i : S * (i + 1)] = given.C[i, :, S:]
        if i:
            rows[at, S * (i - 1) : S * i] += given.C[i, :, :S]
    price, one = given.elastic.ravel(), np.eye(N * m)
    none = np.zeros((len(b), N * m))
    P = np.block([[P, np.zeros((n, N * m))], [np.zeros((N * m, n)), np.diag(price)]])
    A = np.block([[dynamics, none], [rows, -one], [rows, one]])
    inf = np.full(N * m, np.inf)
    low = np.concatenate([b, -inf, given.row_low.ravel()])
    high = np.concatenate([b, given.row_high.ravel(), inf])
    return P, np.concatenate([c, price]), A, low, high


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("couples", [True, False])
def test_solutions_are_those_of_qpoases(seed: int, couples: bool):
    """Bounds of inputs and states, rows at a price; with and without costs between inputs."""
    given = program(rows=2, seed=seed)
    if not couples:
        given.cross[:, :K] = given.H[:, :K, K:] = given.H[:, K:, :K] = 0.0
        given.C[:, :, :K] = 0.0
    given.low[:, :K], given.high[:, :K] = -0.15, 0.15
    drift = np.zeros((N + 1, N_Z))  # without inputs, so that there is a solution
    for i in range(N):
        drift[i + 1] = given.A[i] @ drift[i] + given.e[i]
    given.high[:, K] = drift[1:, 0] + 0.02
    P, c, A, low, high = crossed(given)
    m = given.C.shape[1]
    lowest = np.concatenate([given.low.ravel(), np.zeros(N * m)])
    highest = np.concatenate([given.high.ravel(), np.full(N * m, UNBOUNDED)])
    sizes = {"h": casadi.DM(P).sparsity(), "a": casadi.DM(A).sparsity()}
    options = {"print_time": False, "printLevel": "none", "terminationTolerance": 1e-14}
    other = casadi.conic("other", "qpoases", sizes, options)
    best = other(h=P, g=c, a=A, lba=low, uba=high, lbx=lowest, ubx=highest)
    x = np.array(best["x"]).ravel()[: N * S].reshape(N, S)
    found = StageSolver(1e-11).solve(given)
    assert found.solved
    assert np.max(np.abs(x[:, :K])) > 0.1499
    assert found.u == pytest.approx(x[:, :K], abs=1e-8)
    assert found.z[1:] == pytest.approx(x[:, K:], abs=1e-8)


def test_driven_states_that_are_double_integrators_are_kept_as_bands():
    """The same program with its states in another order, which has no rows of few entries last."""
    random, n, k, dense_rows = np.random.default_rng(3), 8, 2, 4
    h = 0.1
    A, B = np.zeros((6, n + dense_rows, n + dense_rows)), np.zeros((6, n + dense_rows, k))
    size = n + dense_rows
    A[:, :n] = 0.3 * random.normal(size=(6, n, size))
    B[:, :n] = random.normal(size=(6, n, k))
    q, v = n + np.arange(k), n + k + np.arange(k)
    A[:, q, q] = A[:, v, v] = 1.0
    A[:, q, v], B[:, v, [0, 1]], B[:, q, [0, 1]] = h, h, 0.5 * h * h
    s = k + size
    root = random.normal(size=(6, s, s))
    given = StageProgram(
        H=root @ root.swapaxes(1, 2) + np.eye(s),
        g=random.normal(size=(6, s)),
        cross=0.1 * random.normal(size=(6, s, k)),
        A=A,
        B=B,
        e=random.normal(size=(6, size)),
        low=np.full((6, s), -UNBOUNDED),
        high=np.full((6, s), UNBOUNDED),
        C=np.zeros((6, 0, 2 * s)),
        row_low=np.zeros((6, 0)),
        row_high=np.zeros((6, 0)),
        elastic=np.zeros((6, 0)),
    )
    turned = np.arange(size)[::-1]
    both = np.concatenate([np.arange(k), k + turned])
    other = replace(
        given,
        H=given.H[:, both][:, :, both],
        g=given.g[:, both],
        cross=given.cross[:, both],
        A=A[:, turned][:, :, turned],
        B=B[:, turned],
        e=given.e[:, turned],
    )
    found, again = StageSolver(1e-10).solve(given), StageSolver(1e-10).solve(other)
    assert found.u == pytest.approx(again.u, rel=1e-10, abs=1e-10)
    assert found.z == pytest.approx(again.z[:, turned], rel=1e-10, abs=1e-10)


def test_the_first_gain_is_riccatis():
    given = replace(program(), g=np.zeros((N, S)), e=np.zeros((N, N_Z)))
    given.cross[:, :K] = given.H[:, :K, K:] = given.H[:, K:, :K] = 0.0
    assert StageSolver(1e-10).solve(given).gain == pytest.approx(given.gains[0], rel=1e-10)
