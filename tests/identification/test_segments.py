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
def fit_and_point():
    """A fit of a record without noise, begun at the truth, and its point."""
    case = arm()
    data = record(case, 4.0, 3, noise=0.0)
    fit = make_fit(data, 0.25, 0.005, 1)
    fit = replace(fit, theta_0=np.array([case.truth[name] for name in data.labels]))
    return fit, continuous_point(fit, data.start_state(fit.inputs, float(fit.starts[0])))


@pytest.mark.parametrize("extrapolated", [False, True])
def test_selected_segments_are_predicted_as_all_are(fit_and_point, extrapolated):
    """Results of two changed states' segments alone equal those of all."""
    fit, point = fit_and_point
    rng = np.random.default_rng(0)
    selected = np.zeros(len(point.q_D), dtype=bool)
    selected[[3, 4, 9]] = True
    changes = np.where(
        selected[:, None], 0.01 * rng.standard_normal((len(selected), 2 * point.v_D.shape[1])), 0.0
    )
    moved = fit.moved_point(point, changes, np.zeros(len(point.theta)), selected)
    assert np.array_equal(moved.q_D[~selected], point.q_D[~selected])
    prediction = fit.predict(point, extrapolated=extrapolated)
    all_segments = fit.predict(moved, extrapolated=extrapolated)
    selected_segments = fit.predict(
        moved, extrapolated=extrapolated, selected=selected, unselected=prediction
    )
    for name in ("y", "q_D", "v_D"):
        assert np.allclose(
            getattr(selected_segments, name), getattr(all_segments, name), rtol=0, atol=1e-12
        ), name
    assert np.max(np.abs(selected_segments.y - prediction.y)) > 1e-3


def test_selected_jacobians_equal_those_of_all(fit_and_point):
    fit, point = fit_and_point
    selected = np.zeros(len(point.q_D), dtype=bool)
    selected[[2, 7]] = True
    changes = np.where(selected[:, None], 0.01, np.zeros((len(selected), 8)))
    moved = fit.moved_point(point, changes, 0.0 * point.theta, selected)
    all_segments = fit.jacobians(moved)
    selected_segments = fit.jacobians(moved, selected=selected, unselected=fit.jacobians(point))
    for name in ("samples", "begin", "end"):
        a, b = getattr(selected_segments, name), getattr(all_segments, name)
        assert np.max(np.abs(a - b)) < 1e-9 * np.max(np.abs(b)), name


def test_derivatives_are_renewed_at_releases(fit_and_point):
    """Two segments release a string; all are renewed after a large change of a number."""
    fit, point = fit_and_point
    assert np.all(point.active_rows[3:5, 0])
    cost = Cost(fit, point, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    saved, positive = SavedJacobians.at(fit, point), np.arange(len(point.theta)) < 3
    active_rows = point.active_rows.copy()
    active_rows[3:5] = False
    released = replace(point, active_rows=active_rows)
    changed = cost.changed_segments(point, released)
    assert np.flatnonzero(changed).tolist() == [3, 4]
    all_jacobians = fit.jacobians(released)
    assert np.max(np.abs(all_jacobians.begin[3] - saved.jacobians.begin[3])) > 0.1
    renewed = replace(saved, stale=changed).renew(fit, released, positive)
    assert np.allclose(renewed.jacobians.begin, all_jacobians.begin, rtol=0, atol=1e-12)
    assert np.allclose(renewed.jacobians.samples, all_jacobians.samples, rtol=0, atol=1e-9)
    assert not np.any(renewed.stale)
    theta = point.theta.copy()
    theta[1] *= 1.2
    distant = fit.projected_point(point.q_D, point.v_D, theta, point.active_rows)
    assert np.array_equal(renewed.renew(fit, distant, positive).theta, theta)


def test_a_badly_predicted_move_is_stale_and_a_small_one_is_not(fit_and_point):
    fit, point = fit_and_point
    cost = Cost(fit, point, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    jacobians, predicted = fit.jacobians(point), fit.predict(point)
    n = point.v_D.shape[1]
    for size, expected in ((1e-4, []), (0.5, [6])):
        changes = np.zeros((len(point.q_D), 2 * n))
        changes[6, : n - 1] = size
        moved = fit.moved_point(point, changes, 0.0 * point.theta)
        stale = cost.badly_predicted(point, moved, predicted, fit.predict(moved), jacobians)
        assert np.flatnonzero(stale).tolist() == expected, size


def test_a_detached_segment_is_found_and_repaired(fit_and_point):
    """Three segments begin elsewhere, too far for small moves; their states are recovered."""
    fit, point = fit_and_point
    cost = Cost(fit, point, Weights(np.full(9, 2e-3), (5e-4, 5e-3)))
    assert not np.any(cost.detached_segments(point, fit.predict(point, extrapolated=True)))
    q_D, v_D = point.q_D.copy(), point.v_D.copy()
    q_D[6:8, -1] += 0.3
    v_D[6:9] += 3.0
    detached = fit.projected_point(q_D, v_D, point.theta, point.active_rows)
    prediction = fit.predict(detached, extrapolated=True)
    assert np.all(cost.detached_segments(detached, prediction)[6:9])
    assert not np.any(cost.explained_segments(detached, prediction)[6:8])
    repaired = reattach(cost, detached)
    assert np.array_equal(repaired.q_D[:3], detached.q_D[:3])  # distant segments are unchanged
    assert np.max(np.abs(repaired.q_D - point.q_D)) < 2e-3
    assert np.max(np.abs(repaired.v_D - point.v_D)) < 2e-2
    assert not np.any(cost.detached_segments(repaired, fit.predict(repaired, extrapolated=True)))


def test_a_detached_segment_costs_nothing(fit_and_point):
    """Neither its samples nor the jump after it cost."""
    fit, point = fit_and_point
    trusted = np.ones(len(point.q_D), dtype=bool)
    trusted[5] = False
    weights = Weights(np.full(9, 2e-3), (5e-4, 5e-3))
    q_D = point.q_D.copy()
    q_D[5, -1] += 0.1
    moved = replace(point, q_D=q_D)
    prediction = fit.predict(moved)
    costs, trusted_costs = (
        Cost(fit, point, weights, x).segment_costs(moved, prediction) for x in (None, trusted)
    )
    assert costs[5] > trusted_costs[5] + 10.0  # the samples
    assert costs[6] > trusted_costs[6] + 10.0  # the jump after it; the one before it stays
    assert trusted_costs[5] > 10.0


def test_windows_are_judged_with_the_jump_after_them():
    selected = with_neighbours(np.array([0, 0, 1, 0, 0, 0, 0, 1], dtype=bool), 1, 0)
    assert selected.tolist() == [False, True, True, False, False, False, True, True]
    costs, new_costs = np.ones(9), np.ones(9)
    new_costs[1:4] = 0.0, 0.0, 3.5  # costs less, but not with the jump after it
    new_costs[7] = 0.5
    assert cheaper_windows(selected, costs, new_costs).tolist() == [False] * 6 + [True, True]
