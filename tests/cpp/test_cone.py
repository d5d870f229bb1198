"""The solver of strings and contacts, compared with the law itself and with closed forms.

s = G x - b. Single rows: lower <= x <= upper, s >= 0 at lower, s <= 0 at upper, s = 0 between.
Contacts (normal n, tangents T): the same for n, with lower bound 0; |x_T| at most mu x_n;
s_T = 0 inside that disc, x_T = -mu x_n s_T / |s_T| on its edge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from cpp.toolchain import SANITIZE, compile_program, run_program

pytestmark = pytest.mark.medium

Array = NDArray[np.float64]
TOLERANCE = 1e-10
UNBOUNDED = 1e250


@dataclass(frozen=True)
class Problem:
    """A problem: single rows first, then three rows for each contact.

    Attributes:
        W, c: G = W^T W and b = W^T c.
        mu: (n_contacts,) coefficients of friction.
        lower, upper: bounds of x for all rows; 0 and unbounded by default.
        guess: start value of x; 0 by default.
        along: (n_contacts, 2) directions in which contacts slide, unit vectors; nan where they may
            stick. By default all may.
    """

    W: Array
    c: Array
    mu: Array
    lower: Array | None = field(default=None, kw_only=True)
    upper: Array | None = field(default=None, kw_only=True)
    guess: Array | None = field(default=None, kw_only=True)
    along: Array | None = field(default=None, kw_only=True)

    @property
    def G(self) -> Array:
        return self.W.T @ self.W

    @property
    def b(self) -> Array:
        return self.W.T @ self.c

    @property
    def n_single(self) -> int:
        return int(self.W.shape[1]) - 3 * len(self.mu)

    @property
    def bounds(self) -> tuple[Array, Array]:
        n = self.W.shape[1]
        low = np.zeros(n) if self.lower is None else self.lower
        return low, np.full(n, UNBOUNDED) if self.upper is None else self.upper

    def numbers(self) -> Array:
        """Input of the program for this problem."""
        guess = np.zeros(len(self.b)) if self.guess is None else self.guess
        counts = np.array([self.n_single, len(self.mu)], dtype=float)
        along = np.full((len(self.mu), 2), np.nan) if self.along is None else self.along
        slides = np.isfinite(along[:, :1])
        directions = np.concatenate([slides, np.where(slides, along, 0.0)], axis=1).ravel()
        parts = [counts, self.mu, directions, *self.bounds, self.b, guess, self.G.ravel()]
        return np.concatenate(parts)


@dataclass(frozen=True)
class Answer:
    solved: bool
    residual: float
    iterations: int
    rounds: int
    x: Array
    s: Array


Solve = Callable[[Sequence[Problem]], list[Answer]]


@pytest.fixture(scope="module")
def solve(tmp_path_factory: pytest.TempPathFactory) -> Solve:
    """A function that solves problems with the compiled program."""
    program = compile_program("cone.cpp", tmp_path_factory.mktemp("cone"), "-O2", *SANITIZE)

    def answers(problems: Sequence[Problem]) -> list[Answer]:
        program_input = np.concatenate([[len(problems)], *(p.numbers() for p in problems)])
        lines = run_program(program, "\n".join(map(repr, program_input.tolist()))).splitlines()
        assert len(lines) == len(problems)
        parsed = []
        for line in lines:
            solved, residual, iterations, rounds, *rest = map(float, line.split())
            x, s = np.split(np.array(rest), 2)
            parsed.append(Answer(solved == 1.0, residual, int(iterations), int(rounds), x, s))
        return parsed

    return answers


def violation(p: Problem, x: Array) -> float:
    """Violation of the law by x: a speed, relative to the largest entry of b.

    Inadmissible impulses count as the speed that they cause in their own row.
    """
    G, b, k = p.G, p.b, p.n_single
    s, diagonal, (low, high) = G @ x - b, np.diag(G), p.bounds
    violations = []
    for i in range(len(b)):
        if i < k or (i - k) % 3 == 0:
            beyond = max(low[i] * (i < k) - x[i], x[i] - high[i], 0.0)
            up, down = max(s[i], 0.0), max(-s[i], 0.0)
            above, below = x[i] - low[i] * (i < k), high[i] - x[i]
            weight = diagonal[i] if i < k else np.mean(diagonal[i : i + 3])
            violations += [weight * beyond, min(up, weight * above), min(down, weight * below)]
    for c, mu in enumerate(p.mu):
        i = k + 3 * c
        weight = np.mean(diagonal[i : i + 3])
        pull, slip = x[i + 1 : i + 3], s[i + 1 : i + 3]
        size, speed, radius = np.linalg.norm(pull), np.linalg.norm(slip), mu * max(x[i], 0.0)
        violations.append(weight * (size - radius))
        if size < radius * (1.0 - 1e-9):
            violations.append(min(speed, weight * (radius - size)))
        elif min(size, speed) > 0.0:
            apart = np.linalg.norm(pull / size + slip / speed)
            violations.append(min(speed, weight * radius) * apart)
    scale = np.max(np.abs(b))
    return float(max(violations) / scale) if scale > 0.0 else 0.0


def check(p: Problem, answer: Answer) -> None:
    """Assert the law, s = G x - b, and that rows at bounds are there exactly."""
    assert answer.solved
    assert answer.residual <= TOLERANCE
    assert violation(p, answer.x) <= 3.0 * TOLERANCE
    terms = np.abs(p.b) + np.abs(p.G) @ np.abs(answer.x)
    assert np.all(np.abs(p.G @ answer.x - p.b - answer.s) <= 1e-13 * np.max(terms, initial=0.0))
    low, high = p.bounds
    size = max(np.max(np.abs(p.b)), np.max(np.diag(p.G) * np.abs(answer.x)))
    away = np.abs(answer.s) > 10.0 * TOLERANCE * size
    for i in range(len(p.b)):
        if i < p.n_single and away[i]:
            assert answer.x[i] == (low[i] if answer.s[i] > 0.0 else high[i])
        elif i >= p.n_single and (i - p.n_single) % 3 == 0 and away[i] and answer.s[i] > 0.0:
            assert np.all(answer.x[i : i + 3] == 0.0)


def stack(
    rng: np.random.Generator, n_boxes: int, mu: float | None, n_strings: int, mass: float = 1.0
) -> Problem:
    """Boxes that fall onto one another, four contacts each with the body below, and strings.

    Args:
        rng: random numbers.
        n_boxes: number of boxes.
        mu: coefficient of friction of all contacts; random, one for each, if None.
        n_strings: number of strings between boxes, or from the world to a box.
        mass: scale of the boxes' masses [kg].
    """
    size, masses = rng.uniform(0.05, 0.3, (n_boxes, 3)), mass * rng.uniform(0.1, 3, n_boxes)
    inertia = masses[:, None] / 12 * (np.sum(size**2, axis=1)[:, None] - size**2)
    M = np.hstack([np.repeat(masses[:, None], 3, axis=1), inertia]).ravel()
    v = rng.normal(size=(n_boxes, 6)) * [2, 2, 1, 3, 3, 3]
    v[:, 2] = -np.abs(v[:, 2]) - 0.02
    rows = []
    for _ in range(n_strings):
        row = np.zeros((n_boxes, 6))
        first, second = rng.integers(n_boxes, size=2)
        row[first] = rng.normal(size=6) * [1, 1, 1, 0.1, 0.1, 0.1]
        if second != first:
            row[second] = np.r_[-row[first, :3], 0.1 * rng.normal(size=3)]
        rows.append(row.ravel())
    for k in range(n_boxes):
        for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            p = 0.5 * size[k] * [x, y, -1]
            for d in np.eye(3)[[2, 0, 1]]:
                row = np.zeros((n_boxes, 6))
                row[k] = np.r_[d, np.cross(p, d)]
                if k > 0:
                    q = p + np.array([0, 0, 0.5 * (size[k, 2] + size[k - 1, 2])])
                    row[k - 1] = -np.r_[d, np.cross(q, d)]
                rows.append(row.ravel())
    friction = rng.uniform(0, 1.5, 4 * n_boxes) if mu is None else np.full(4 * n_boxes, mu)
    low, high = np.zeros(len(rows)), np.full(len(rows), UNBOUNDED)
    for i in range(n_strings):
        low[i] = -1e30 if rng.random() < 0.2 else 0.0
        high[i] = rng.uniform(0.05, 1.0) * mass if rng.random() < 0.2 else UNBOUNDED
    W = np.array(rows).T / np.sqrt(M)[:, None]
    return Problem(W, -np.sqrt(M) * v.ravel(), friction, lower=low, upper=high)


FRICTION = (0.05, 0.3, 0.6, 1.0, 1.5, None)


def stacks(seed: int, count: int, mass: float = 1.0) -> list[Problem]:
    """Stacks of up to four boxes; every second one has up to seven strings."""
    rng = np.random.default_rng(seed)
    problems = []
    for k in range(count):
        n_strings = int(rng.integers(1, 8)) if k % 2 else 0
        problems.append(stack(rng, int(rng.integers(1, 5)), FRICTION[k % 6], n_strings, mass))
    return problems


@pytest.mark.parametrize("mu", [0.0, 0.05, 0.5, 2.0])
def test_one_contact(solve: Solve, mu: float) -> None:
    """A point mass m: it sticks with x = -m v, slides with x_T along -v_T, or lifts with x = 0."""
    m, problems, expected = 0.7, [], []
    for angle in np.linspace(0.0, 2 * np.pi, 9):
        for normal, slip in ((1.0, 0.9 * mu), (1.0, mu + 0.3), (1.0, 0.0), (-0.5, 0.4)):
            tangent = slip * np.array([np.cos(angle), np.sin(angle)])
            v = np.r_[-normal, tangent]
            problems.append(Problem(np.eye(3) / np.sqrt(m), -np.sqrt(m) * v, np.array([mu])))
            if normal < 0.0:
                expected.append(np.zeros(3))
            else:
                expected.append(m * np.r_[normal, -tangent * min(1.0, mu / max(slip, 1e-300))])
    for p, answer, x in zip(problems, solve(problems), expected, strict=True):
        check(p, answer)
        assert answer.x == pytest.approx(x, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, 4.0])
def test_a_foot_that_slides_has_one_normal_impulse(solve: Solve, angle: float) -> None:
    """n and one tangent are coupled, x_T = -mu x_n: 0 = (G_nn - mu G_nT) x_n - b_n."""
    coupling, mu = 0.4, 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    G = np.array([[1.0, coupling, 0.0], [coupling, 1.5, 0.0], [0.0, 0.0, 1.5]])
    R = np.eye(3)
    R[1:, 1:] = turn
    W = np.linalg.cholesky(G).T @ R.T
    b = R @ np.array([1.0, -5.0, 0.0])
    p = Problem(W, np.linalg.solve(W.T, b), np.array([mu]))
    (answer,) = solve([p])
    check(p, answer)
    normal = 1.0 / (1.0 - mu * coupling)
    assert answer.x == pytest.approx(R @ [normal, -mu * normal, 0.0], abs=1e-10)


def test_single_rows_are_bounded_least_squares(solve: Solve) -> None:
    """min |W x - c| between the bounds; W x is unique even where x is not."""
    rng, problems = np.random.default_rng(1), []
    for n, redundant in ((1, 0), (3, 0), (8, 0), (12, 3), (30, 8), (60, 0), (60, 15)):
        for _ in range(12):
            W = rng.normal(size=(2 * n, n)) / np.sqrt(2 * n)
            n_independent = n - redundant
            W[:, n_independent:] = W[:, :n_independent] @ rng.normal(
                size=(n_independent, redundant)
            )
            low = np.where(rng.random(n) < 0.2, -1e20, 0.0)
            high = np.where(rng.random(n) < 0.3, rng.uniform(0.05, 1.0, n), UNBOUNDED)
            c = rng.normal(size=2 * n)
            problems.append(Problem(W, c, np.zeros(0), lower=low, upper=high))
    for p, answer in zip(problems, solve(problems), strict=True):
        check(p, answer)
        low, high = p.bounds
        bounds = (np.where(low < 0, -np.inf, low), np.where(high < UNBOUNDED, high, np.inf))
        best = lsq_linear(p.W, p.c, bounds, method="bvls", tol=1e-15, max_iter=10_000).x
        assert np.linalg.norm(p.W @ (answer.x - best)) <= 1e-8 * np.linalg.norm(p.c)


def test_stacks_from_zero(solve: Solve) -> None:
    """400 stacks with and without strings are solved, most in a few iterations."""
    problems = stacks(2, 400)
    answers = solve(problems)
    for p, answer in zip(problems, answers, strict=True):
        check(p, answer)
    iterations = [answer.iterations for answer in answers]
    assert np.median(iterations) <= 12
    assert np.mean([answer.rounds == 0 for answer in answers]) >= 0.6


def test_random_rows_and_contacts(solve: Solve) -> None:
    """Rows of any rank, with some upper bounds, two-sided rows and contacts without friction."""
    rng, problems = np.random.default_rng(8), []
    for _ in range(300):
        n_single, n_contacts = int(rng.integers(8)), int(rng.integers(1, 9))
        n = n_single + 3 * n_contacts
        W = rng.normal(size=(int(rng.integers(1, n + 3)), n))
        low, high = np.zeros(n), np.where(rng.random(n) < 0.5, rng.uniform(0, 3, n), UNBOUNDED)
        low[:n_single] = np.where(rng.random(n_single) < 0.2, -rng.uniform(0, 3, n_single), 0.0)
        mu = rng.choice([0.0, 0.1, 0.7, 2.0], n_contacts)
        problems.append(Problem(W, 3.0 * rng.normal(size=len(W)), mu, lower=low, upper=high))
    for p, answer in zip(problems, solve(problems), strict=True):
        check(p, answer)


def test_a_guess_from_the_previous_step(solve: Solve) -> None:
    """If b and G change by a thousandth, few iterations are needed."""
    rng, before = np.random.default_rng(3), stacks(3, 150)
    problems = []
    for p, answer in zip(before, solve(before), strict=True):
        W = p.W * (1.0 + 1e-3 * rng.normal(size=(len(p.W), 1)))
        c = p.c * (1.0 + 1e-3 * rng.normal(size=len(p.c)))
        problems.append(replace(p, W=W, c=c, guess=answer.x))
    answers = solve(problems)
    for p, answer in zip(problems, answers, strict=True):
        check(p, answer)
    iterations = [answer.iterations for answer in answers]
    assert np.median(iterations) <= 3
    assert np.percentile(iterations, 90) <= 12


def test_a_solution_as_guess_needs_no_iteration(solve: Solve) -> None:
    before = stacks(4, 30)
    again = [replace(p, guess=a.x) for p, a in zip(before, solve(before), strict=True)]
    for p, answer in zip(again, solve(again), strict=True):
        check(p, answer)
        assert answer.iterations == 0
        assert p.guess is not None and np.array_equal(answer.x, p.guess)


@pytest.mark.parametrize("mass", [1e-6, 1e6])
def test_light_and_heavy_boxes(solve: Solve, mass: float) -> None:
    problems = stacks(5, 100, mass)
    for p, answer in zip(problems, solve(problems), strict=True):
        check(p, answer)


def test_nearly_redundant_rows(solve: Solve) -> None:
    """Contacts with planes tilted by 1e-6 against one another: G is nearly singular."""
    rng = np.random.default_rng(6)
    problems = [
        replace(p, W=p.W + 1e-6 * rng.normal(size=p.W.shape) * np.max(np.abs(p.W)))
        for p in stacks(6, 100)
    ]
    for p, answer in zip(problems, solve(problems), strict=True):
        check(p, answer)


def test_equal_strings_and_equal_contacts_share_the_load(solve: Solve) -> None:
    """The solution from zero has least norm: each of k bears 1/k of the load."""
    problems = []
    for k in (2, 3, 5):
        problems.append(Problem(np.ones((1, k)), np.array([3.0]), np.zeros(0)))
        W = np.tile(np.eye(3), (1, k))
        problems.append(Problem(W, np.array([3.0, 0.6, -0.3]), np.full(k, 0.5)))
    for p, answer in zip(problems, solve(problems), strict=True):
        check(p, answer)
        least_norm = np.linalg.pinv(p.W) @ p.c
        assert answer.x == pytest.approx(least_norm, abs=1e-6)


def test_a_normal_impulse_has_an_upper_bound(solve: Solve) -> None:
    """At the bound the contact yields, s_n <= 0, and the disc has the bound's radius."""
    high = np.array([0.8, UNBOUNDED, UNBOUNDED])
    stick = Problem(np.eye(3), np.array([1.0, 0.2, 0.0]), np.array([0.5]), upper=high)
    slide = Problem(np.eye(3), np.array([1.0, 0.6, 0.8]), np.array([0.5]), upper=high)
    answers = solve([stick, slide])
    for p, answer in zip((stick, slide), answers, strict=True):
        check(p, answer)
        assert answer.x[0] == 0.8
        assert answer.s[0] == pytest.approx(-0.2)
    assert answers[0].x[1:] == pytest.approx([0.2, 0.0], abs=1e-10)
    assert answers[1].x[1:] == pytest.approx([0.24, 0.32], abs=1e-10)


def test_rows_without_influence(solve: Solve) -> None:
    """Rows of G that are 0: x = 0 if the row opens, and x at its bound if it cannot."""
    nothing = Problem(np.zeros((2, 4)), np.ones(2), np.array([0.4]))
    W = np.zeros((4, 5))
    W[1:, 2:] = np.eye(3)
    partial = Problem(W, np.array([0.0, 1.0, 0.2, 0.0]), np.array([0.4]))
    for p, answer in zip((nothing, partial), solve([nothing, partial]), strict=True):
        check(p, answer)
        assert np.all(answer.x[: p.n_single] == 0.0)


def test_an_unsolvable_problem_is_reported(solve: Solve) -> None:
    """Two strings that pull against each other cannot both shorten."""
    against = Problem(np.array([[1.0, -1.0], [1e-9, 1e-9]]), np.array([0.0, 1e9]), np.zeros(0))
    (answer,) = solve([against])
    assert not answer.solved
    assert answer.residual > TOLERANCE
    assert np.all(np.isfinite(answer.x))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_infinite_numbers_and_nan(solve: Solve, bad: float) -> None:
    """Nothing is solved if G, b or mu has such numbers, but x is finite."""
    (p,) = stacks(7, 1)
    W, c, mu = p.W.copy(), p.c.copy(), p.mu.copy()
    W[0, 0], c[0], mu[0] = bad, bad, bad
    with np.errstate(all="ignore"):
        broken = [replace(p, W=W), replace(p, c=c), replace(p, mu=mu)]
        answers = solve(broken)
    for answer in answers:
        assert not answer.solved
        assert np.all(np.isfinite(answer.x))
    guess = np.full(len(p.b), bad)
    (answer,) = solve([replace(p, guess=guess)])
    check(p, answer)


def test_a_right_hand_side_of_zero_or_below_rounding(solve: Solve) -> None:
    """Without a load x = 0, for any guess."""
    for scale in (0.0, 1e-320):
        p = stacks(9, 1)[0]
        (answer,) = solve([replace(p, c=scale * p.c, guess=np.ones(len(p.b)))])
        assert answer.solved and answer.residual <= TOLERANCE
        assert np.max(np.abs(p.G @ answer.x)) <= 1e-10


def test_no_rows(solve: Solve) -> None:
    (answer,) = solve([Problem(np.zeros((1, 0)), np.zeros(1), np.zeros(0))])
    assert answer.solved and answer.iterations == 0


def test_contacts_that_slide_in_given_directions(solve: Solve) -> None:
    """Many problems with friction along d have no solution. Those that count as solved satisfy
    the law.
    """
    rng = np.random.default_rng(11)
    problems = []
    for p in stacks(12, 400):
        angles = rng.uniform(0.0, 2.0 * np.pi, len(p.mu))
        along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        along[rng.random(len(p.mu)) < 0.3] = np.nan
        problems.append(replace(p, along=along, mu=rng.uniform(0.2, 3.0, len(p.mu))))
    answers, solved = solve(problems), 0
    for p, answer in zip(problems, answers, strict=True):
        assert np.all(np.isfinite(answer.x))
        assert np.all(np.abs(answer.x) < 1e100)
        solved += answer.solved
        if not answer.solved:
            continue
        assert p.along is not None
        s, scale, size = p.G @ answer.x - p.b, np.max(np.abs(p.b)), np.diag(p.G)
        for c, d in enumerate(p.along):
            i = p.n_single + 3 * c
            normal = min(max(s[i], 0.0), size[i] * answer.x[i])
            assert max(normal, -s[i], -answer.x[i]) <= 1e-9 * scale
            if np.all(np.isfinite(d)):
                assert answer.x[i + 1 : i + 3] == pytest.approx(p.mu[c] * answer.x[i] * d)
    assert 20 < solved < len(problems)
