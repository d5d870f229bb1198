"""Programs of stages, compared with the same programs as one dense system."""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram, StageSolver

N, N_Z, K = 4, 3, 2
STAGE_SIZE = K + N_Z


def random_program(rows: int = 0, seed: int = 1) -> StageProgram:
    """A random convex program without bounds."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(N, STAGE_SIZE, STAGE_SIZE))
    H = root @ root.swapaxes(1, 2) + np.eye(STAGE_SIZE)
    return StageProgram(
        H=H,
        g=random.normal(size=(N, STAGE_SIZE)),
        cross=0.1 * random.normal(size=(N, STAGE_SIZE, K)),
        A=0.5 * random.normal(size=(N, N_Z, N_Z)),
        B=random.normal(size=(N, N_Z, K)),
        e=0.3 * random.normal(size=(N, N_Z)),
        low=np.full((N, STAGE_SIZE), -UNBOUNDED),
        high=np.full((N, STAGE_SIZE), UNBOUNDED),
        C=random.normal(size=(N, rows, 2 * STAGE_SIZE)),
        row_low=np.full((N, rows), -0.3),
        row_high=np.full((N, rows), 0.2),
        elastic=np.full((N, rows), 0.2),
    )


def dense_program(stages: StageProgram) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """P, c, A, b of the program: min 1/2 x^T P x + c^T x, A x = b."""
    P, A = np.zeros((N * STAGE_SIZE, N * STAGE_SIZE)), np.zeros((N * N_Z, N * STAGE_SIZE))
    for i in range(N):
        stage = slice(STAGE_SIZE * i, STAGE_SIZE * (i + 1))
        previous_stage = slice(STAGE_SIZE * (i - 1), STAGE_SIZE * i)
        rows = slice(N_Z * i, N_Z * (i + 1))
        P[stage, stage] = stages.H[i]
        A[rows, stage] = np.concatenate([stages.B[i], -np.eye(N_Z)], axis=1)
        if i:
            u = slice(STAGE_SIZE * i, STAGE_SIZE * i + K)
            P[previous_stage, u] += stages.cross[i]
            P[u, previous_stage] += stages.cross[i].T
            A[rows, STAGE_SIZE * (i - 1) + K : STAGE_SIZE * i] = stages.A[i]
    return P, stages.g.ravel(), A, -stages.e.ravel()


def test_without_bounds_it_is_the_linear_system_of_the_conditions_of_optimality():
    stages = random_program()
    P, c, A, b = dense_program(stages)
    zero = np.zeros((len(b), len(b)))
    kkt = np.linalg.solve(np.block([[P, A.T], [A, zero]]), np.concatenate([-c, b]))
    solution = StageSolver(1e-10).solve(stages)
    assert solution.solved
    x = np.concatenate([solution.u, solution.z[1:]], axis=1).ravel()
    assert x == pytest.approx(kkt[: len(c)], abs=1e-6)
    assert solution.costate.ravel() == pytest.approx(kkt[len(c) :], abs=1e-5)


def test_bounds_and_elastic_rows_agree_with_another_solver():
    stages = random_program(rows=2)
    stages.low[:, :K], stages.high[:, :K] = -0.15, 0.15
    P, c, A, b = dense_program(stages)
    m = stages.C.shape[1]
    n = N * STAGE_SIZE
    rows = np.zeros((N * m, n))
    for i in range(N):
        stage_rows = slice(m * i, m * (i + 1))
        rows[stage_rows, STAGE_SIZE * i : STAGE_SIZE * (i + 1)] = stages.C[i, :, STAGE_SIZE:]
        if i:
            rows[stage_rows, STAGE_SIZE * (i - 1) : STAGE_SIZE * i] += stages.C[i, :, :STAGE_SIZE]
    price = stages.elastic.ravel()

    def cost(y: np.ndarray) -> float:
        x, s = y[:n], y[n:]
        return 0.5 * x @ P @ x + c @ x + price @ s + 0.5 * price @ s**2

    def slope(y: np.ndarray) -> np.ndarray:
        x, s = y[:n], y[n:]
        return np.concatenate([P @ x + c, price + price * s])

    identity, zeros = np.eye(N * m), np.zeros((len(b), N * m))
    low = np.concatenate([stages.low.ravel(), np.zeros(N * m)])
    high = np.concatenate([stages.high.ravel(), np.full(N * m, np.inf)])
    constraints = [
        LinearConstraint(np.concatenate([A, zeros], axis=1), b, b),
        LinearConstraint(
            np.concatenate([rows, -identity], axis=1), -np.inf, stages.row_high.ravel()
        ),
        LinearConstraint(np.concatenate([rows, identity], axis=1), stages.row_low.ravel(), np.inf),
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
    solution = StageSolver(1e-10).solve(stages)
    x = np.concatenate([solution.u, solution.z[1:]], axis=1).ravel()
    assert solution.solved
    assert x == pytest.approx(best.x[:n], abs=2e-5)
    assert solution.violation.ravel() == pytest.approx(best.x[n:], abs=2e-5)
    assert np.max(solution.violation) > 0.01 and np.max(np.abs(solution.u)) > 0.149


def test_a_solver_solves_program_after_program_of_one_shape():
    solver = StageSolver(1e-10)
    for seed in range(3):
        stages = random_program(seed=seed)
        repeated, alone = solver.solve(stages), StageSolver(1e-10).solve(stages)
        assert repeated.u == pytest.approx(alone.u, abs=1e-6)


def test_gains_are_the_change_of_the_optimum_with_the_start():
    stages = replace(random_program(), g=np.zeros((N, STAGE_SIZE)), e=np.zeros((N, N_Z)))
    # Costs between neighbouring inputs, or between an input and the next state, are left out.
    stages.cross[:, :K] = stages.H[:, :K, K:] = stages.H[:, K:, :K] = 0.0
    gains = stages.gains
    random = np.random.default_rng(5)
    z0 = random.normal(size=N_Z)
    # The first state is 0 in programs: its contributions are in e and g of the first stage.
    stages.e[0] = stages.A[0] @ z0
    stages.g[0, :K] = stages.cross[0, K:].T @ z0
    solution = StageSolver(1e-10).solve(stages)
    states = np.concatenate([z0[None], solution.z[1:]])
    for i in range(N):
        assert solution.u[i] == pytest.approx(gains[i] @ states[i], abs=1e-6)


@pytest.mark.parametrize("highest", [5.0, -0.3])
def test_constants_move_the_start_and_all_ends(highest: float):
    """Two states are constant from the start on, which they move as well."""
    random = np.random.default_rng(9)
    start = np.concatenate([random.normal(size=(N_Z - 2, 2)), np.eye(2)])
    stages = random_program(seed=3)
    stages.A[:, -2:], stages.B[:, -2:], stages.e[:, -2:] = np.eye(2, N_Z, N_Z - 2), 0.0, 0.0
    stages.low[:], stages.high[:], stages.C[:] = -UNBOUNDED, UNBOUNDED, 0.0
    L = random.normal(size=(N_Z, N_Z))
    Q, q = L @ L.T, random.normal(size=N_Z)
    low, high = np.full(2, -5.0), np.array([5.0, highest])
    solution = StageSolver(1e-11).solve(stages.with_constants(start, Q, q, low, high, 1e-6))
    assert solution.solved
    c = solution.u[0, K:]
    assert np.all(c <= high + 1e-6) and (highest > 1.0) == (c[1] < highest - 1e-3)
    assert solution.z[1:, -2:] == pytest.approx(np.repeat(c[None], N, axis=0), abs=1e-6)

    def cost(u: np.ndarray, c: np.ndarray) -> float:
        z = start @ c
        J = 0.5 * z @ Q @ z + q @ z + 5e-7 * c @ c
        for i in range(N):
            previous = np.concatenate([u[i - 1] if i else np.zeros(K), z])
            z = stages.A[i] @ z + stages.B[i] @ u[i] + stages.e[i]
            x = np.concatenate([u[i], z])
            J += 0.5 * x @ stages.H[i] @ x + stages.g[i] @ x + previous @ stages.cross[i] @ u[i]
        return float(J)

    least_cost = cost(solution.u[:, :K], c)
    for _ in range(100):
        du, dc = 1e-2 * random.normal(size=(N, K)), 1e-2 * random.normal(size=2)
        assert cost(solution.u[:, :K] + du, np.minimum(c + dc, high)) > least_cost


def sparse_program(stages: StageProgram) -> tuple[np.ndarray, ...]:
    """P, c, A, low, high of the program for a solver of sparse programs: x, then elastic parts."""
    P, c, dynamics, b = dense_program(stages)
    m, n = stages.C.shape[1], N * STAGE_SIZE
    rows = np.zeros((N * m, n))
    for i in range(N):
        stage_rows = slice(m * i, m * (i + 1))
        rows[stage_rows, STAGE_SIZE * i : STAGE_SIZE * (i + 1)] = stages.C[i, :, STAGE_SIZE:]
        if i:
            rows[stage_rows, STAGE_SIZE * (i - 1) : STAGE_SIZE * i] += stages.C[i, :, :STAGE_SIZE]
    price, identity = stages.elastic.ravel(), np.eye(N * m)
    zeros = np.zeros((len(b), N * m))
    P = np.block([[P, np.zeros((n, N * m))], [np.zeros((N * m, n)), np.diag(price)]])
    A = np.block([[dynamics, zeros], [rows, -identity], [rows, identity]])
    inf = np.full(N * m, np.inf)
    low = np.concatenate([b, -inf, stages.row_low.ravel()])
    high = np.concatenate([b, stages.row_high.ravel(), inf])
    return P, np.concatenate([c, price]), A, low, high


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("couples", [True, False])
def test_solutions_are_those_of_qpoases(seed: int, couples: bool):
    """Bounds of inputs and states, rows with a price; with and without costs between inputs."""
    stages = random_program(rows=2, seed=seed)
    if not couples:
        stages.cross[:, :K] = stages.H[:, :K, K:] = stages.H[:, K:, :K] = 0.0
        stages.C[:, :, :K] = 0.0
    stages.low[:, :K], stages.high[:, :K] = -0.15, 0.15
    drift = np.zeros((N + 1, N_Z))  # without inputs, so that there is a solution
    for i in range(N):
        drift[i + 1] = stages.A[i] @ drift[i] + stages.e[i]
    stages.high[:, K] = drift[1:, 0] + 0.02
    P, c, A, low, high = sparse_program(stages)
    m = stages.C.shape[1]
    lowest = np.concatenate([stages.low.ravel(), np.zeros(N * m)])
    highest = np.concatenate([stages.high.ravel(), np.full(N * m, UNBOUNDED)])
    sizes = {"h": casadi.DM(P).sparsity(), "a": casadi.DM(A).sparsity()}
    options = {"print_time": False, "printLevel": "none", "terminationTolerance": 1e-14}
    qpoases = casadi.conic("other", "qpoases", sizes, options)
    best = qpoases(h=P, g=c, a=A, lba=low, uba=high, lbx=lowest, ubx=highest)
    x = np.array(best["x"]).ravel()[: N * STAGE_SIZE].reshape(N, STAGE_SIZE)
    solution = StageSolver(1e-11).solve(stages)
    assert solution.solved
    assert np.max(np.abs(x[:, :K])) > 0.1499
    assert solution.u == pytest.approx(x[:, :K], abs=1e-8)
    assert solution.z[1:] == pytest.approx(x[:, K:], abs=1e-8)


def test_driven_double_integrators_are_stored_as_bands():
    """The same program with reordered states, which has no rows of few entries at the end."""
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
    stages = StageProgram(
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
    reversed_states = np.arange(size)[::-1]
    reversed_columns = np.concatenate([np.arange(k), k + reversed_states])
    reversed_program = replace(
        stages,
        H=stages.H[:, reversed_columns][:, :, reversed_columns],
        g=stages.g[:, reversed_columns],
        cross=stages.cross[:, reversed_columns],
        A=A[:, reversed_states][:, :, reversed_states],
        B=B[:, reversed_states],
        e=stages.e[:, reversed_states],
    )
    solution = StageSolver(1e-10).solve(stages)
    reversed_solution = StageSolver(1e-10).solve(reversed_program)
    assert solution.u == pytest.approx(reversed_solution.u, rel=1e-10, abs=1e-10)
    assert solution.z == pytest.approx(
        reversed_solution.z[:, reversed_states], rel=1e-10, abs=1e-10
    )


def test_the_first_gain_is_riccatis():
    stages = replace(random_program(), g=np.zeros((N, STAGE_SIZE)), e=np.zeros((N, N_Z)))
    stages.cross[:, :K] = stages.H[:, :K, K:] = stages.H[:, K:, :K] = 0.0
    assert StageSolver(1e-10).solve(stages).gain == pytest.approx(stages.gains[0], rel=1e-10)
