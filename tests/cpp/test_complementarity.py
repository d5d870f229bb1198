"""The complementarity solvers against solvers that know nothing of them.

s = G x - b, 0 <= x <= upper, s >= 0 at x = 0, s <= 0 at x = upper, s = 0 between are the conditions
of the quadratic program min 1/2 x . G x - b . x over 0 <= x <= upper; with G = A^T A and
b = A^T c that is the bounded least-squares problem min |A x - c|.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.optimize import lsq_linear, nnls

from cpp.toolchain import SANITIZE, compile_program, run_program

pytestmark = pytest.mark.slow

SOLVED, INFEASIBLE = 0, 1


@dataclass(frozen=True)
class Problem:
    """min

    A x - c

     over 0 <= x <= upper, x of any sign where `free`.

    Attributes:
        A, c, free: data of the problem.
        upper: bounds; none when not given.
        event: solve exactly, as the event-driven run does, else as the time-stepper does.
        guess: start with all rows active, else with none.
        right: b, instead of A^T c.
    """

    A: np.ndarray
    c: np.ndarray
    free: np.ndarray
    event: bool = True
    guess: bool = True
    upper: np.ndarray | None = None
    right: np.ndarray | None = field(default=None, kw_only=True)

    @property
    def G(self) -> np.ndarray:
        return self.A.T @ self.A

    @property
    def b(self) -> np.ndarray:
        return self.A.T @ self.c if self.right is None else self.right

    @property
    def bounds(self) -> np.ndarray:
        return np.full(len(self.b), 1e300) if self.upper is None else self.upper

    def words(self) -> list[float]:
        length, n = self.A.shape
        numbers = [self.free.astype(float), self.bounds, self.b, self.A.T.ravel()]
        return [n, length, self.event, self.guess, *np.concatenate(numbers)]


@dataclass(frozen=True)
class Answer:
    status: int
    apart: float
    x: np.ndarray
    s: np.ndarray
    ray: np.ndarray


@pytest.fixture(scope="module")
def solve(tmp_path_factory):
    """A function from problems to answers."""
    folder = tmp_path_factory.mktemp("complementarity")
    flags = ("-O1", *SANITIZE)
    program = compile_program("complementarity.cpp", folder, *flags)

    def answers(problems: list[Problem]) -> list[Answer]:
        words = [len(problems), *(x for p in problems for x in p.words())]
        lines = run_program(program, "\n".join(repr(float(w)) for w in words)).splitlines()
        assert len(lines) == len(problems)
        parsed = []
        for line in lines:
            status, apart, *rest = map(float, line.split())
            parsed.append(Answer(int(status), apart, *np.split(np.array(rest), 3)))
        return parsed

    return answers


def random_problem(
    rng: np.random.Generator, n: int, *, redundant: int = 0, free: int = 0, **settings
) -> Problem:
    """Rows of a mechanism with 4 n or more degrees of freedom.

    Args:
        rng: random numbers.
        n: rows.
        redundant: number of rows that are combinations of others.
        free: number of two-sided rows.
        settings: other fields of the problem.
    """
    A = rng.normal(size=(2 * n + 6, n)) / np.sqrt(2 * n + 6)
    for k in range(redundant):
        n_independent = n - redundant
        A[:, n_independent + k] = (
            A[:, k % n_independent]
            if k % 2
            else A[:, :n_independent] @ rng.normal(size=n_independent)
        )
    order = rng.permutation(n)
    sides = np.zeros(n, dtype=bool)
    sides[rng.choice(n, free, replace=False)] = True
    return Problem(A[:, order], rng.normal(size=len(A)), sides, **settings)


def check_conditions(p: Problem, answer: Answer, tolerance: float = 1e-12) -> None:
    """s = G x - b, and the signs of x and s, to rounding of the terms of each."""
    assert answer.status == SOLVED
    x, s, G = answer.x, answer.s, p.G
    terms = np.abs(p.b) + np.abs(G) @ np.abs(x)
    top = max(np.max(np.abs(x)), 1e-300)
    assert np.max(np.abs(G @ x - p.b - s) / terms) <= tolerance
    assert np.min(x[~p.free], initial=0.0) >= -tolerance * top
    assert np.max((x - p.bounds)[~p.free], initial=0.0) <= tolerance * top
    low, high = ~p.free & (x < p.bounds), ~p.free & (x > 0)
    assert np.min((s / terms)[low], initial=0.0) >= -tolerance
    assert np.max(np.abs(s / terms)[p.free], initial=0.0) <= tolerance
    assert np.max((np.minimum(x, p.bounds) * s / (top * terms))[high], initial=0.0) <= tolerance


def least_squares(p: Problem) -> np.ndarray:
    """A x of the solution, by Lawson and Hanson, bounded by Stark and Parker; it is unique even
    if x is not.
    """
    if p.upper is not None:
        bounds = (np.where(p.free, -np.inf, 0.0), np.where(p.free, np.inf, p.upper))
        solution = lsq_linear(p.A, p.c, bounds, method="bvls", tol=1e-15, max_iter=10_000)
        return p.A @ solution.x
    x, _ = nnls(np.hstack([p.A, -p.A[:, p.free]]), p.c, maxiter=10_000)
    full = x[: p.A.shape[1]].copy()
    full[p.free] -= x[p.A.shape[1] :]
    return p.A @ full


def enumerated(p: Problem) -> np.ndarray:
    """x by trying every set of active rows; among the valid sets the one of least norm."""
    n, candidates = len(p.b), []
    for choice in itertools.product([False, True], repeat=n):
        on = np.array(choice)
        if np.any(p.free & ~on):
            continue
        x = np.zeros(n)
        x[on] = np.linalg.lstsq(p.G[np.ix_(on, on)], p.b[on], rcond=1e-10)[0]
        s = p.G @ x - p.b
        good = np.all(x[~p.free] > -1e-9) and np.all(s[~p.free] > -1e-9)
        if good and np.all(np.abs(s[on]) < 1e-9):
            candidates.append(x)
    return min(candidates, key=np.linalg.norm)


@pytest.mark.parametrize("event", [True, False], ids=["event", "timestepping"])
def test_well_conditioned_rows(solve, event):
    """Problems of one to sixty rows, compared with Lawson and Hanson; the guess does not matter."""
    rng = np.random.default_rng(1)
    problems = [
        random_problem(rng, n, event=event, guess=bool(k % 2))
        for n in (1, 2, 3, 5, 8, 13, 21, 34, 47, 60)
        for k in range(8)
    ]
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        assert np.linalg.norm(p.A @ answer.x - least_squares(p)) <= 1e-12 * np.linalg.norm(p.c)
        assert answer.apart <= 1e-12


def test_two_sided_rows(solve):
    rng = np.random.default_rng(2)
    problems = [
        random_problem(rng, n, free=free)
        for n, free in ((2, 1), (4, 2), (4, 4), (12, 5), (30, 10), (60, 20))
        for _ in range(8)
    ]
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        assert np.linalg.norm(p.A @ answer.x - least_squares(p)) <= 1e-12 * np.linalg.norm(p.c)
        assert answer.apart <= 1e-12


def test_redundant_rows_have_one_motion(solve):
    """x is not unique among redundant rows, A x is; nor does it depend on the guess."""
    rng = np.random.default_rng(3)
    problems = [
        random_problem(rng, n, redundant=redundant, free=free)
        for n, redundant, free in ((2, 1, 0), (4, 2, 0), (8, 3, 1), (20, 6, 0), (60, 15, 0))
        for _ in range(8)
    ]
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        assert np.linalg.norm(p.A @ answer.x - least_squares(p)) <= 1e-11 * np.linalg.norm(p.c)
        assert answer.apart <= 1e-12


@pytest.mark.parametrize("event", [True, False], ids=["event", "timestepping"])
def test_bounded_rows(solve, event):
    """Rows whose force has a largest value, as a slipping winch's; at it s may be negative."""
    rng = np.random.default_rng(7)
    problems = [
        random_problem(
            rng, n, free=free, event=event, guess=bool(k % 2), upper=rng.uniform(0.05, 0.8, n)
        )
        for n, free in ((1, 0), (3, 0), (6, 2), (12, 3), (30, 0), (60, 10))
        for k in range(8)
    ]
    n_at_bound = 0
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        assert np.linalg.norm(p.A @ answer.x - least_squares(p)) <= 1e-12 * np.linalg.norm(p.c)
        assert answer.apart <= 1e-12
        n_at_bound += np.sum(~p.free & (answer.x >= p.upper))
    assert n_at_bound >= 200


def test_bounded_rows_among_redundant_ones(solve):
    """The motion is unique, even if some of a redundant set pull with their largest force."""
    rng = np.random.default_rng(8)
    problems = [
        random_problem(
            rng, n, redundant=redundant, guess=bool(k % 2), upper=rng.uniform(0.05, 1.0, n)
        )
        for n, redundant in ((2, 1), (6, 2), (20, 6), (60, 15))
        for k in range(8)
    ]
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        assert np.linalg.norm(p.A @ answer.x - least_squares(p)) <= 1e-11 * np.linalg.norm(p.c)
        assert answer.apart <= 1e-12


def test_unsatisfiable_rows_have_a_proof(solve):
    """y >= 0 with A y = 0 and b . y > 0: then A^T z >= b has no solution z."""
    rng = np.random.default_rng(9)
    problems = []
    for n in (2, 5, 20, 58):
        for k in range(8):
            A = rng.normal(size=(2 * n + 6, n)) / np.sqrt(2 * n + 6)
            share = np.where(rng.random(n) < 0.3, 0.0, rng.uniform(0.2, 1.0, n))
            share[0] = 1.0
            A[:, -1] = -A[:, :-1] @ share[:-1]
            right = rng.normal(size=n)
            right[-1] = 0.3 - right[:-1] @ share[:-1]
            free = np.zeros(n, dtype=bool)
            problems.append(Problem(A, right, free, guess=bool(k % 2), right=right))
    for p, answer in zip(problems, solve(problems), strict=True):
        assert answer.status == INFEASIBLE
        y = answer.ray / np.max(answer.ray)
        assert np.min(y) >= -1e-13
        assert np.linalg.norm(p.A @ y) <= 1e-12 * np.sum(np.abs(y))
        assert p.b @ y >= 0.01


def test_every_set_of_rows_tried(solve):
    """Small problems, including redundant and two-sided rows, by enumeration."""
    rng = np.random.default_rng(4)
    problems = [
        random_problem(rng, n, redundant=redundant, free=free)
        for n, redundant, free in ((3, 0, 0), (5, 0, 1), (6, 1, 0), (6, 2, 1))
        for _ in range(10)
    ]
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        x = enumerated(p)
        assert np.linalg.norm(p.A @ (answer.x - x)) <= 1e-11 * np.linalg.norm(p.c)


def test_equal_strings_share_the_load(solve):
    """Among redundant rows that all pull the tensions of least norm are reported."""
    rng = np.random.default_rng(5)
    problems = []
    for k in (2, 3, 5):
        direction = rng.normal(size=(6, 1))
        A = np.repeat(direction, k, axis=1)
        problems.append(Problem(A, 3 * direction[:, 0], np.zeros(k, bool)))
    for p, answer in zip(problems, solve(problems), strict=True):
        check_conditions(p, answer)
        assert answer.x == pytest.approx(np.full(len(p.b), 3 / len(p.b)), rel=1e-14)


def test_rows_that_all_open_and_rows_that_all_close(solve):
    rng = np.random.default_rng(6)
    A = np.abs(rng.normal(size=(40, 12)))
    none, every = np.zeros(12, bool), np.ones(40)
    problems = [Problem(A, -every, none), Problem(np.eye(40)[:, :12], every, none)]
    open_, closed = solve(problems)
    check_conditions(problems[0], open_)
    check_conditions(problems[1], closed)
    assert np.all(open_.x == 0.0)
    assert closed.x == pytest.approx(np.ones(12), rel=1e-11)


@pytest.mark.parametrize("guess", [True, False])
def test_a_row_with_little_influence_gets_a_small_multiplier(solve, guess):
    """A string at dead centre pulls no harder than its neighbours, in the time-stepper."""
    settings = {"event": False, "guess": guess, "upper": np.full(2, 5e3)}
    cases = [(0.0, [1e-14, 1.0]), (1e-6, [1e-9, 1.0])]
    none, little = solve(
        [
            Problem(
                np.diag([a, 1.0]), np.zeros(2), np.zeros(2, bool), right=np.array(b), **settings
            )
            for a, b in cases
        ]
    )
    assert 0.0 <= none.x[0] < 1e-3 and none.x[1] == pytest.approx(1.0)
    assert 0.0 <= little.x[0] < 50.0 and little.x[1] == pytest.approx(1.0)


def test_rows_that_hardly_differ_settle(solve):
    """Three of six rows equal the others except for a tilt of 1e-5; pivoting is for one matrix."""
    rng, problems = np.random.default_rng(11), []
    for _ in range(600):
        A = rng.normal(size=(18, 6)) / np.sqrt(18)
        A[:, 3:] = A[:, :3] @ rng.normal(size=(3, 3)) + 1e-5 * rng.normal(size=(18, 3))
        # Rows at rest on the edge of pulling: neither x nor s differs from 0.
        right = A.T @ (A @ np.maximum(rng.normal(size=6), 0.0))
        free = np.zeros(6, dtype=bool)
        problems.append(Problem(A, np.zeros(18), free, event=False, right=right))
    unsettled = sum(answer.status != SOLVED for answer in solve(problems))
    assert unsettled <= 10


@pytest.mark.parametrize("event", [True, False])
def test_right_sides_that_are_subnormal_settle(solve, event):
    """17.E: a rate of 1e-320 m/s cannot be judged relative to itself."""
    rng, problems = np.random.default_rng(12), []
    for k in range(1_000):
        p = random_problem(rng, 6, free=k % 3, event=event)
        A = p.A * 10.0 ** rng.uniform(0.0, 2.5, 6)
        tiny = rng.integers(-10_000, 10_000, 6) * 5e-324
        right = np.where(rng.random(6) < 0.5, tiny, rng.choice([0.0, -1e-17, -4e-4], 6))
        problems.append(Problem(A, p.c, p.free, event=event, right=right))
    for p, answer in zip(problems, solve(problems), strict=True):
        assert answer.status == SOLVED
        x, terms = answer.x, np.abs(p.b) + np.abs(p.G) @ np.abs(answer.x)
        assert np.all(np.abs(p.G @ x - p.b - answer.s) <= 1e-12 * terms + 1e-280)
        assert np.all(x[~p.free] >= 0.0) and np.all(
            answer.s[~p.free] >= -1e-12 * terms[~p.free] - 1e-280
        )
