"""Tensions and impulses over many closed rows satisfy all their conditions, exactly.

    s = W^T W x - b,   x >= 0,   s >= 0,   x . s = 0

On random states of the marionette and of a rig with twice as many strings as degrees of freedom:
any strings are taut and any limits closed, the velocities are random (then b is hdot and x are
impulses) or such that the closed rows rest (then b is hddot at zero tension and x are tensions).
Clipping the multipliers of the equality problem one by one, the rule for a single string, is wrong
in many of these states.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog, nnls

import fantoccini as fan
from fantoccini import Marionette, State
from fantoccini.base.rotation import exp
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.kernel.runtime import Complementarity
from oracles.rigs import many_strings

pytestmark = [pytest.mark.slow, pytest.mark.long]

STATES = {"marionette": 5000, "many_strings": 5400}
"""Random states of each puppet."""

TOLERANCE = 1e-12
"""Tolerance of every condition, relative to its terms."""

CAP = 1e5
"""Tensions and impulses, in weights, above which runs call an input impossible; rows that oppose
one another up to rounding need more.
"""


@dataclass(frozen=True, eq=False)
class Problem:
    """One complementarity problem.

    Attributes:
        W: (n_vD, n) columns of the closed rows.
        b: (n,) hdot or hddot at zero tension.
    """

    W: np.ndarray
    b: np.ndarray

    def terms(self, x: np.ndarray) -> np.ndarray:
        """(n,) sizes of the summands of each s."""
        return np.abs(self.b) + np.abs(self.W.T) @ (np.abs(self.W) @ np.abs(x))

    def worst(self, x: np.ndarray) -> float:
        """Largest violation of any condition, relative to its terms."""
        terms, top = self.terms(x), max(np.max(np.abs(x)), 1e-300)
        s = self.W.T @ (self.W @ x) - self.b
        return float(np.max([-x / top, -s / terms, np.abs(x * s) / (top * terms)]))

    def apart(self, x: np.ndarray, y: np.ndarray) -> float:
        """Difference of the motions of two solutions, relative to their terms."""
        terms = np.linalg.norm(np.abs(self.W) @ (np.abs(x) + np.abs(y)))
        return float(np.linalg.norm(self.W @ (x - y)) / max(terms, 1e-300))

    def clipped(self) -> np.ndarray:
        """(n,) multipliers of the equality problem, the negative ones set to 0."""
        wanted = np.linalg.lstsq(self.W.T, self.b, rcond=1e-10)[0]
        return np.maximum(np.linalg.lstsq(self.W, wanted, rcond=1e-10)[0], 0.0)


@cache
def puppet(name: str) -> Marionette:
    if name == "marionette":
        return fan.puppets.marionette()
    return fan.loads(json.dumps(many_strings()))


def closed_limits(marionette: Marionette, rng: np.random.Generator, q_D: np.ndarray) -> set[int]:
    """Moves about a third of the limited joints onto one of their limits; their links."""
    links = {limit.link for limit in marionette.tree.limits if rng.random() < 0.2}
    for link in sorted(links):
        limit = rng.choice(
            [candidate for candidate in marionette.tree.limits if candidate.link == link]
        )
        place = marionette.tree.links[link].q
        if limit.b is None:
            q_D[place] = limit.bound
        elif limit.side == "cone":
            across = np.cross(limit.a, rng.normal(size=3))
            q_D[place] = exp(limit.bound * across / np.linalg.norm(across))
        else:
            q_D[place] = exp(limit.bound * limit.b)
    return links


def random_state(marionette: Marionette, rng: np.random.Generator, still: bool) -> State:
    """A state in which a random part of the strings just reaches.

    Args:
        marionette: the puppet; its strings' lengths are driven.
        rng: random numbers.
        still: closed rows neither open nor close.
    """
    table, tree = marionette.coordinates, marionette.tree
    x = marionette.state()
    q_D, q_K, v_D, v_K = x.q_D.copy(), x.q_K.copy(), rng.normal(size=table.n_vD), x.v_K.copy()
    for q, v in table.scalars_D:
        q_D[q] += 0.2 * v_D[v] * rng.normal()
    for q, _ in table.quaternions_D:
        q_D[q : q + 4] = exp(rng.normal(scale=0.3, size=3))
    for link in closed_limits(marionette, rng, q_D):
        if still:
            v_D[tree.links[link].v] = 0.0
    v_K[:] = rng.normal(size=table.n_vK)
    lengths = np.array([string.length_index for string in tree.strings])
    q_K[lengths[:, 0]] = 0.0
    paths = marionette.library.evaluate("rows", q_D=q_D, q_K=q_K, p=marionette.p).h
    loose = rng.random(len(lengths)) > rng.choice([0.3, 0.6, 1.0])
    q_K[lengths[:, 0]] = paths[: len(lengths)] + loose * rng.uniform(0.01, 0.3, len(lengths))
    x = x.replace(q_D=q_D, q_K=q_K, v_D=v_D, v_K=v_K)
    if still:
        v_K[lengths[:, 1]] += Evaluation.at_state(marionette, x).hdot[: len(lengths)]
        x = x.replace(v_K=v_K)
    return x


def problems(name: str) -> Iterator[Problem]:
    """Problems over the closed rows of random states, of tensions and impulses by turns."""
    marionette, rng = puppet(name), np.random.default_rng(1)
    n_problems = 0
    while n_problems < STATES[name]:
        still = n_problems % 2 == 0
        x = random_state(marionette, rng, still)
        acc_K = rng.choice([0.0, 3.0]) * rng.normal(size=marionette.coordinates.n_vK)
        instant = Evaluation.at_state(marionette, x, acc_K)
        rows = np.flatnonzero(np.abs(instant.h) <= 1e-14)
        if len(rows) == 0:
            continue
        W = instant.W[:, rows]
        if still:
            assert np.max(np.abs(instant.hdot[rows])) < 1e-13
            yield Problem(W, instant.gamma[rows] + W.T @ instant.w0)
        else:
            yield Problem(W, instant.hdot[rows])
        n_problems += 1


@cache
def found(name: str) -> list[tuple[Problem, Complementarity]]:
    """All problems and the solver's results."""
    solve = puppet(name).library.complementarity
    return [(p, solve(p.W, p.b)) for p in problems(name)]


def answered(name: str) -> list[tuple[Problem, Complementarity]]:
    """Problems with a solution below the cap, and the solutions."""
    cap = CAP * puppet(name).weight
    return [(p, answer) for p, answer in found(name) if answer.solved and np.max(answer.x) <= cap]


def test_every_condition_holds():
    n = three = wrong = most_rows = 0
    worst = []
    for name in STATES:
        for p, answer in answered(name):
            n += 1
            three += np.count_nonzero(answer.x) >= 3
            most_rows = max(most_rows, len(p.b))
            worst.append(p.worst(answer.x))
            clipped = p.clipped()
            wrong += p.worst(clipped) > 1e-6 and p.apart(clipped, answer.x) > 1e-6
    counts = f"{n} states, {three} with three or more active rows, {wrong} where clipping is wrong"
    assert np.max(worst) <= TOLERANCE, f"{np.max(worst):.2e}; {counts}"
    assert n >= 10_000, counts
    assert three >= 3000, counts
    assert wrong >= 500, counts
    assert most_rows == 60


@pytest.mark.parametrize("name", STATES)
def test_the_guess_does_not_matter(name):
    solve = puppet(name).library.complementarity
    for p, answer in answered(name)[:1500]:
        right = answer.x > 0
        for guess in (right, ~right, np.zeros(len(p.b), bool)):
            again = solve(p.W, p.b, guess=guess)
            assert again.solved
            apart = p.apart(again.x, answer.x)
            assert apart <= 1e-13, f"motions {apart:.2e} apart"
            off = np.max(np.abs(again.x - answer.x)) / max(np.max(answer.x), 1e-300)
            assert off <= 1e-11, f"tensions {off:.2e} apart"


@pytest.mark.parametrize("name", STATES)
def test_the_motion_is_the_shortest_allowed_one(name):
    """z = W x is the shortest z with W^T z >= b, by Lawson and Hanson's least-distance method."""
    for p, answer in answered(name)[:1000]:
        left = np.vstack([p.W, p.b])
        right = np.append(np.zeros(len(p.W)), 1.0)
        residual = left @ nnls(left, right, maxiter=10_000)[0] - right
        z = -residual[:-1] / residual[-1]
        off = np.linalg.norm(z - p.W @ answer.x) / max(np.linalg.norm(z), 1e-300)
        assert off <= 1e-7, f"{off:.2e} apart"


def test_unsatisfiable_rows_have_a_proof():
    """y >= 0 with W y = 0 and b . y > 0: no z has W^T z >= b. Other rows almost oppose one
    another, with tensions beyond the cap.
    """
    rig = puppet("many_strings")
    refused = beyond = 0
    for p, answer in found("many_strings"):
        if answer.solved:
            assert answer.ray is None
            beyond += np.max(answer.x) > CAP * rig.weight
            continue
        refused += 1
        y = answer.ray / np.max(answer.ray)
        assert np.min(y) >= -1e-14
        assert np.linalg.norm(p.W @ y) <= 1e-13 * np.sum(np.linalg.norm(p.W, axis=0) * np.abs(y))
        assert p.b @ y >= 1e-6 * (np.abs(p.b) @ np.abs(y))
    assert refused >= 50, f"{refused} refused, {beyond} beyond the cap"
    assert beyond <= 20, f"{refused} refused, {beyond} beyond the cap"


def test_sixty_rows_that_all_pull():
    """b = W^T W y with y > 0: all sixty rows hold, and no shorter tensions do.

    The shortest x >= 0 with W x = W y is the positive part of W^T z for some z: z follows from the
    rows that pull, and then W^T z is not positive on the others. If y = W^T z, it is y itself; for
    half of the states there is a z with W^T z > 0 (Cover's theorem: sixty rows, thirty degrees of
    freedom).
    """
    rig, rng = puppet("many_strings"), np.random.default_rng(2)
    all_pull = some_rest = 0
    for _ in range(50):
        W = Evaluation.at_state(rig, random_state(rig, rng, still=True)).W
        random, shortest = rng.uniform(1.0, 1.5, W.shape[1]), all_positive(W)
        for y in (random, shortest):
            if y is None:
                continue
            p = Problem(W, W.T @ (W @ y))
            answer = rig.library.complementarity(p.W, p.b)
            assert answer.solved
            assert p.worst(answer.x) <= TOLERANCE
            assert p.apart(answer.x, y) <= 1e-14
            assert np.linalg.norm(answer.x) <= np.linalg.norm(y) * (1.0 + 1e-14)
            # The value of a row at rest is 0 or the last digit of a sum.
            pulls = answer.x > 1e-12 * np.max(answer.x)
            z = np.linalg.lstsq(W[:, pulls].T, answer.x[pulls], rcond=1e-10)[0]
            assert np.maximum(W.T @ z, 0.0) == pytest.approx(answer.x, abs=1e-9), "the shortest"
            motion = W @ nnls(W, W @ y, maxiter=10_000)[0]
            assert np.linalg.norm(W @ answer.x - motion) <= 1e-12 * np.linalg.norm(motion)
            some_rest += not np.all(pulls)
        if shortest is not None:
            assert answer.x == pytest.approx(shortest, rel=1e-9)
            all_pull += 1
    assert all_pull >= 15 and some_rest >= 20, f"{all_pull} and {some_rest} of 50"


def all_positive(W: np.ndarray) -> np.ndarray | None:
    """W^T z for the z in [-1, 1] with the greatest least entry; None if that is not positive."""
    m, n = W.shape
    solution = linprog(
        np.append(np.zeros(m), -1.0),
        A_ub=np.hstack([-W.T, np.ones((n, 1))]),
        b_ub=np.zeros(n),
        bounds=[(-1.0, 1.0)] * m + [(None, None)],
    )
    y = W.T @ solution.x[:m]
    # Far enough from 0 that rounding does not matter.
    return y if np.min(y) > 1e-3 * np.max(y) else None
