"""Segments that are simulated, judged and mended for themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.identify.cases import arm, record

from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.estimating import fit_of
from fantoccini.lab.identification.fit import chained
from fantoccini.lab.identification.reattaching import reattached
from fantoccini.lab.identification.search_point import Weights
from fantoccini.lab.identification.searching import SavedJacobians
from fantoccini.lab.identification.windows import cheaper, spread


@pytest.fixture(scope="module")
def setting():
    """A fit of a record without noise, begun at the truth, and its point."""
    case = arm()
    one = record(case, 4.0, 3, noise=0.0)
    fit = fit_of(one, 0.25, 0.005, 1)
    fit = replace(fit, begin=np.array([case.truth[name] for name in one.labels]))
    return fit, chained(fit, one.start_state(fit.inputs, float(fit.starts[0])))


@pytest.mark.parametrize("extrapolated", [False, True])
def test_some_segments_are_predicted_as_all_are(setting, extrapolated):
    """Two other states: what is found of their segments alone is what is found of all."""
    fit, at = setting
    rng = np.random.default_rng(0)
    some = np.zeros(len(at.q_D), dtype=bool)
    some[[3, 4, 9]] = True
    by = np.where(some[:, None], 0.01 * rng.standard_normal((len(some), 2 * at.v_D.shape[1])), 0.0)
    to = fit.moved(at, by, np.zeros(len(at.theta)), some)
    assert np.array_equal(to.q_D[~some], at.q_D[~some])
    before = fit.predict(at, extrapolated=extrapolated)
    whole = fit.predict(to, extrapolated=extrapolated)
    part = fit.predict(to, extrapolated=extrapolated, only=some, others=before)
    for name in ("y", "q_D", "v_D"):
        assert np.allclose(getattr(part, name), getattr(whole, name), rtol=0, atol=1e-12), name
    assert np.max(np.abs(part.y - before.y)) > 1e-3


def test_some_jacobians_are_those_of_all(setting):
    fit, at = setting
    some = np.zeros(len(at.q_D), dtype=bool)
    some[[2, 7]] = True
    by = np.where(some[:, None], 0.01, np.zeros((len(some), 8)))
    to = fit.moved(at, by, 0.0 * at.theta, some)
    whole = fit.jacobians(to)
    part = fit.jacobians(to, only=some, others=fit.jacobians(at))
    for name in ("samples", "begin", "end"):
        a, b = getattr(part, name), getattr(whole, name)
        assert np.max(np.abs(a - b)) < 1e-9 * np.max(np.abs(b)), name


def test_derivatives_are_renewed_where_a_row_lets_go(setting):
    """Of two segments that a string no longer holds, and of all where a number went far."""
    fit, at = setting
    assert np.all(at.held[3:5, 0])
    cost = Cost(fit, at, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    kept, positive = SavedJacobians.at(fit, at), np.arange(len(at.theta)) < 3
    held = at.held.copy()
    held[3:5] = False
    free = replace(at, held=held)
    other = cost.regrouped(at, free)
    assert np.flatnonzero(other).tolist() == [3, 4]
    whole = fit.jacobians(free)
    assert np.max(np.abs(whole.begin[3] - kept.jacobians.begin[3])) > 0.1
    renewed = replace(kept, stale=other).renewed(fit, free, positive)
    assert np.allclose(renewed.jacobians.begin, whole.begin, rtol=0, atol=1e-12)
    assert np.allclose(renewed.jacobians.samples, whole.samples, rtol=0, atol=1e-9)
    assert not np.any(renewed.stale)
    theta = at.theta.copy()
    theta[1] *= 1.2
    far = fit.projected(at.q_D, at.v_D, theta, at.held)
    assert np.array_equal(renewed.renewed(fit, far, positive).theta, theta)


def test_a_badly_told_move_is_stale_and_a_small_one_is_not(setting):
    fit, at = setting
    cost = Cost(fit, at, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    jacobians, predicted = fit.jacobians(at), fit.predict(at)
    n = at.v_D.shape[1]
    for size, expected in ((1e-4, []), (0.5, [6])):
        by = np.zeros((len(at.q_D), 2 * n))
        by[6, : n - 1] = size
        to = fit.moved(at, by, 0.0 * at.theta)
        stale = cost.stale(at, to, predicted, fit.predict(to), jacobians)
        assert np.flatnonzero(stale).tolist() == expected, size


def test_a_tangled_segment_is_found_and_mended(setting):
    """Three segments begin elsewhere, too far for small moves; the states come back."""
    fit, at = setting
    cost = Cost(fit, at, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    assert not np.any(cost.detached(at, fit.predict(at, extrapolated=True)))
    q_D, v_D = at.q_D.copy(), at.v_D.copy()
    q_D[6:8, -1] += 0.3
    v_D[6:9] += 3.0
    bad = fit.projected(q_D, v_D, at.theta, at.held)
    seen = fit.predict(bad, extrapolated=True)
    assert np.all(cost.detached(bad, seen)[6:9])
    assert not np.any(cost.explained(bad, seen)[6:8])
    mended = reattached(cost, bad)
    assert np.array_equal(mended.q_D[:3], bad.q_D[:3])  # far from there nothing moved
    assert np.max(np.abs(mended.q_D - at.q_D)) < 2e-3
    assert np.max(np.abs(mended.v_D - at.v_D)) < 2e-2
    assert not np.any(cost.detached(mended, fit.predict(mended, extrapolated=True)))


def test_what_is_not_trusted_costs_nothing(setting):
    """Neither its samples nor the gap behind it."""
    fit, at = setting
    trusted = np.ones(len(at.q_D), dtype=bool)
    trusted[5] = False
    weights = Weights(np.full(9, 2e-3), (5e-4, 5e-3))
    q_D = at.q_D.copy()
    q_D[5, -1] += 0.1
    to = replace(at, q_D=q_D)
    seen = fit.predict(to)
    all_count, some_count = (Cost(fit, at, weights, x).parts(to, seen) for x in (None, trusted))
    assert all_count[5] > some_count[5] + 10.0  # the samples
    assert all_count[6] > some_count[6] + 10.0  # the gap behind; that before it stays
    assert some_count[5] > 10.0


def test_windows_are_judged_with_the_gap_behind_them():
    some = spread(np.array([0, 0, 1, 0, 0, 0, 0, 1], dtype=bool), 1, 0)
    assert some.tolist() == [False, True, True, False, False, False, True, True]
    before, after = np.ones(9), np.ones(9)
    after[1:4] = 0.0, 0.0, 3.5  # costs less, but not with the gap behind
    after[7] = 0.5
    assert cheaper(some, before, after).tolist() == [False] * 6 + [True, True]
