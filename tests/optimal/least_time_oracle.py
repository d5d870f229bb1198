"""Least times of chains of bobs below a trolley, by collocation with CasADi and IPOPT.

    min T + w/2 h sum a_i^2,  h = T / N,   a constant in every interval,  |a| and |v| bounded

All states are polynomials of degree 4 in every piece of an interval, which satisfy the equations of
motion at Gauss-Legendre points. The chain's equations follow from its Lagrangian by CasADi; none of
the package's code is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

GRAVITY, DEGREE = 9.81, 4


@dataclass(frozen=True)
class Problem:
    """Motion from rest to rest over a distance.

    Attributes:
        lengths, masses: lengths and masses of the chain, from the trolley on [m, kg].
        distance: displacement of the trolley [m].
        speed, acceleration: its bounds.
        duration: the shortest and the longest [s].
        N: intervals.
        weight: weight of the squared accelerations.
    """

    lengths: tuple[float, ...]
    masses: tuple[float, ...]
    distance: float
    speed: float
    acceleration: float
    duration: tuple[float, float]
    N: int
    weight: float = 1e-6


def least_time(problem: Problem, guess: float, pieces: int = 1) -> float:
    """The duration found by IPOPT [s].

    Args:
        problem: see `Problem`.
        guess: guess of the duration [s].
        pieces: polynomials in an interval.
    """
    n = len(problem.lengths)
    state_rate, n_states = _state_rate(problem), 2 + 2 * n
    points = [0.0, *ca.collocation_points(DEGREE, "legendre")]
    basis = [np.poly1d([1.0])] * (DEGREE + 1)
    for j in range(DEGREE + 1):
        for r in range(DEGREE + 1):
            if r != j:
                basis[j] = basis[j] * np.poly1d([1.0, -points[r]]) / (points[j] - points[r])
    derivative_weights = np.array([[np.polyder(b)(t) for t in points] for b in basis])
    end_weights = np.array([b(1.0) for b in basis])

    opti = ca.Opti()
    T, a = opti.variable(), opti.variable(problem.N)
    h = T / problem.N
    x = opti.variable(n_states, problem.N + 1)
    for i in range(problem.N):
        state = x[:, i]
        for _ in range(pieces):
            inner = opti.variable(n_states, DEGREE)
            opti.set_initial(inner, 0.0)
            samples = ca.horzcat(state, inner)
            for j in range(1, DEGREE + 1):
                rate_sample = samples @ derivative_weights[:, j]
                opti.subject_to(rate_sample == h / pieces * state_rate(samples[:, j], a[i]))
            state = samples @ end_weights
        opti.subject_to(x[:, i + 1] == state)
    opti.subject_to(x[:, 0] == 0.0)
    opti.subject_to(x[:, -1] == ca.vertcat(problem.distance, ca.DM.zeros(n_states - 1)))
    opti.subject_to(opti.bounded(-problem.acceleration, a, problem.acceleration))
    opti.subject_to(opti.bounded(-problem.speed, x[1 + n, 1:-1].T, problem.speed))
    opti.subject_to(opti.bounded(problem.duration[0], T, problem.duration[1]))
    opti.minimize(T + 0.5 * problem.weight * h * ca.sumsqr(a))
    opti.set_initial(T, guess)
    opti.set_initial(x[0, :], problem.distance * np.linspace(0.0, 1.0, problem.N + 1))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-9})
    return float(opti.solve().value(T))


def _state_rate(problem: Problem) -> ca.Function:
    """d/dt of (trolley, angles, their rates) by (state, acceleration of the trolley)."""
    n = len(problem.lengths)
    q, v, a = ca.SX.sym("q", 1 + n), ca.SX.sym("v", 1 + n), ca.SX.sym("a")
    x, z, kinetic, potential = q[0], ca.SX(0), ca.SX(0), ca.SX(0)
    for k, (length, mass) in enumerate(zip(problem.lengths, problem.masses, strict=True)):
        x, z = x + length * ca.sin(q[1 + k]), z - length * ca.cos(q[1 + k])
        velocity = ca.jacobian(ca.vertcat(x, z), q) @ v
        kinetic += 0.5 * mass * ca.sumsqr(velocity)
        potential += mass * GRAVITY * z
    momentum = ca.jacobian(kinetic, v).T
    generalised_force = ca.jacobian(kinetic - potential, q).T - ca.jacobian(momentum, q) @ v
    M = ca.jacobian(momentum, v)
    angular_acc = ca.solve(M[1:, 1:], generalised_force[1:] - M[1:, 0] * a)
    state = ca.vertcat(q, v)
    return ca.Function("rate", [state, a], [ca.vertcat(v, a, angular_acc)])
