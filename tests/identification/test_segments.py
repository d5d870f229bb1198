"""Segments that are simulated, judged and repaired individually."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.identify.cases import arm, record

from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.estimating import make_fit
from fantoccini.lab.identification.fit import continuous_point
from fantoccini.lab.identification.reattaching import reattach
from fantoccini.lab.identification.search_point import Weights
from fantoccini.lab.identification.searching import SavedJacobians
from fantoccini.lab.identification.windows import cheaper_windows, with_neighbours


@pytest.fixture(scope="module")
def setting():
    """A fit of a record without noise, begun at the truth, and its point."""
    case = arm()
    data = record(case, 4.0, 3, noise=0.0)
    fit = make_fit(data, 0.25, 0.005, 1)
    fit = replace(fit, theta_0=np.array([case.truth[name] for name in data.labels]))
    return fit, continuous_point(fit, data.start_state(fit.inputs, float(fit.starts[0])))


@pytest.mark.parametrize("extrapolated", [False, True])
def test_selected_segments_are_predicted_as_all_are(setting, extrapolated):
    """Results of two changed states' segments alone equal those of all."""
    fit, at = setting
    rng = np.random.default_rng(0)
    selected = np.zeros(len(at.q_D), dtype=bool)
    selected[[3, 4, 9]] = True
    by = np.where(
        selected[:, None], 0.01 * rng.standard_normal((len(selected), 2 * at.v_D.shape[1])), 0.0
    )
    to = fit.moved_point(at, by, np.zeros(len(at.theta)), selected)
    assert np.array_equal(to.q_D[~selected], at.q_D[~selected])
    before = fit.predict(at, extrapolated=extrapolated)
    whole = fit.predict(to, extrapolated=extrapolated)
    part = fit.predict(to, extrapolated=extrapolated, selected=selected, unselected=before)
    for name in ("y", "q_D", "v_D"):
        assert np.allclose(getattr(part, name), getattr(whole, name), rtol=0, atol=1e-12), name
    assert np.max(np.abs(part.y - before.y)) > 1e-3


def test_selected_jacobians_equal_those_of_all(setting):
    fit, at = setting
    selected = np.zeros(len(at.q_D), dtype=bool)
    selected[[2, 7]] = True
    by = np.where(selected[:, None], 0.01, np.zeros((len(selected), 8)))
    to = fit.moved_point(at, by, 0.0 * at.theta, selected)
    whole = fit.jacobians(to)
    part = fit.jacobians(to, selected=selected, unselected=fit.jacobians(at))
    for name in ("samples", "begin", "end"):
        a, b = getattr(part, name), getattr(whole, name)
        assert np.max(np.abs(a - b)) < 1e-9 * np.max(np.abs(b)), name


def test_derivatives_are_renewed_at_releases(setting):
    """Two segments release a string; all are renewed after a large change of a number."""
    fit, at = setting
    assert np.all(at.active_rows[3:5, 0])
    cost = Cost(fit, at, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    saved, positive = SavedJacobians.at(fit, at), np.arange(len(at.theta)) < 3
    held = at.active_rows.copy()
    held[3:5] = False
    free = replace(at, active_rows=held)
    other = cost.changed_segments(at, free)
    assert np.flatnonzero(other).tolist() == [3, 4]
    whole = fit.jacobians(free)
    assert np.max(np.abs(whole.begin[3] - saved.jacobians.begin[3])) > 0.1
    renewed = replace(saved, stale=other).renew(fit, free, positive)
    assert np.allclose(renewed.jacobians.begin, whole.begin, rtol=0, atol=1e-12)
    assert np.allclose(renewed.jacobians.samples, whole.samples, rtol=0, atol=1e-9)
    assert not np.any(renewed.stale)
    theta = at.theta.copy()
    theta[1] *= 1.2
    distant = fit.projected_point(at.q_D, at.v_D, theta, at.active_rows)
    assert np.array_equal(renewed.renew(fit, distant, positive).theta, theta)


def test_a_badly_predicted_move_is_stale_and_a_small_one_is_not(setting):
    fit, at = setting
    cost = Cost(fit, at, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    jacobians, predicted = fit.jacobians(at), fit.predict(at)
    n = at.v_D.shape[1]
    for size, expected in ((1e-4, []), (0.5, [6])):
        by = np.zeros((len(at.q_D), 2 * n))
        by[6, : n - 1] = size
        to = fit.moved_point(at, by, 0.0 * at.theta)
        stale = cost.badly_predicted(at, to, predicted, fit.predict(to), jacobians)
        assert np.flatnonzero(stale).tolist() == expected, size


def test_a_detached_segment_is_found_and_repaired(setting):
    """Three segments begin elsewhere, too far for small moves; their states are recovered."""
    fit, at = setting
    cost = Cost(fit, at, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    assert not np.any(cost.detached_segments(at, fit.predict(at, extrapolated=True)))
    q_D, v_D = at.q_D.copy(), at.v_D.copy()
    q_D[6:8, -1] += 0.3
    v_D[6:9] += 3.0
    bad = fit.projected_point(q_D, v_D, at.theta, at.active_rows)
    seen = fit.predict(bad, extrapolated=True)
    assert np.all(cost.detached_segments(bad, seen)[6:9])
    assert not np.any(cost.explained_segments(bad, seen)[6:8])
    mended = reattach(cost, bad)
    assert np.array_equal(mended.q_D[:3], bad.q_D[:3])  # distant segments are unchanged
    assert np.max(np.abs(mended.q_D - at.q_D)) < 2e-3
    assert np.max(np.abs(mended.v_D - at.v_D)) < 2e-2
    assert not np.any(cost.detached_segments(mended, fit.predict(mended, extrapolated=True)))


def test_a_detached_segment_costs_nothing(setting):
    """Neither its samples nor the jump after it cost."""
    fit, at = setting
    trusted = np.ones(len(at.q_D), dtype=bool)
    trusted[5] = False
    weights = Weights(np.full(9, 2e-3), (5e-4, 5e-3))
    q_D = at.q_D.copy()
    q_D[5, -1] += 0.1
    to = replace(at, q_D=q_D)
    seen = fit.predict(to)
    all_count, some_count = (
        Cost(fit, at, weights, x).segment_costs(to, seen) for x in (None, trusted)
    )
    assert all_count[5] > some_count[5] + 10.0  # the samples
    assert all_count[6] > some_count[6] + 10.0  # the jump after it; the one before it stays
    assert some_count[5] > 10.0


def test_windows_are_judged_with_the_jump_after_them():
    selected = with_neighbours(np.array([0, 0, 1, 0, 0, 0, 0, 1], dtype=bool), 1, 0)
    assert selected.tolist() == [False, True, True, False, False, False, True, True]
    before, after = np.ones(9), np.ones(9)
    after[1:4] = 0.0, 0.0, 3.5  # costs less, but not with the jump after it
    after[7] = 0.5
    assert cheaper_windows(selected, before, after).tolist() == [False] * 6 + [True, True]
