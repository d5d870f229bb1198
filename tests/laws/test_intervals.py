"""Derivatives between intervals of event-driven runs, compared with differences of runs."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base import tangent
from fantoccini.dynamics.simulation.intervals import interval_derivatives
from oracles.differences import difference, worst

FINE = {"method": fan.Event(rtol=1e-13, atol=1e-13), "effort": False}
TIMES = np.linspace(0.0, 0.6, 7)


@pytest.fixture(scope="module")
def caught() -> tuple[fan.Marionette, fan.State, np.ndarray]:
    """The arm, caught and released within six intervals, and their accelerations."""
    arm = fan.puppets.arm2d()
    values = {"shoulder": -0.2, "elbow": 0.6, "hand.length": 0.95, "v:elbow": 0.5}
    x0 = arm.project(arm.state(values | {"v:shoulder": -0.3}))
    acc = np.zeros((6, arm.coordinates.n_vK))
    for name, a in {
        "hand.x": [1.0, -0.5, -0.5, 0.4, 0.0, 0.1],
        "hand.length": [-5.0, -5.0, 6.0, 6.0, 0.0, 0.0],
    }.items():
        acc[:, arm.coordinates.v_K.index(name)] = a
    return arm, x0, acc


def onto(puppet: fan.Marionette, x: fan.State, rows: np.ndarray) -> fan.State:
    """The nearest state with these rows taut, in the metric of M_DD, by Newton's method."""
    if not len(rows):
        return x
    for _ in range(6):
        h, A = puppet.constraint(x)[rows], puppet.A_D(x)[rows]
        pull = np.linalg.solve(puppet.mass_matrix(x), A.T)
        x = x.replace(q_D=x.q_D - pull @ np.linalg.solve(A @ pull, h))
    A = puppet.A_D(x)[rows]
    rate = A @ x.v_D + puppet.A_K(x)[rows] @ x.v_K
    pull = np.linalg.solve(puppet.mass_matrix(x), A.T)
    return x.replace(v_D=x.v_D - pull @ np.linalg.solve(A @ pull, rate))


def test_intervals_with_catches_agree_with_differences(caught):
    """The end of every interval by all of (q_D, v_D, q_K, v_K), acc_K and the parameters."""
    arm, x0, acc = caught
    t = arm.coordinates
    n, k, n_p = t.n_vD, t.n_vK, len(arm.p)
    inputs = fan.Input.segments(arm, TIMES, x0.q_K, x0.v_K, acc)
    run = fan.simulate(arm, x0, inputs, TIMES[-1], **FINE)
    derivatives = interval_derivatives(arm, run, inputs)
    assert sum(map(len, derivatives.passages)) >= 2 and derivatives.differentiable
    names = list(arm.tree.parameters)
    at = np.searchsorted(run.t, TIMES + 1e-9, side="right") - 1
    for i, T in enumerate(np.diff(TIMES)):
        here = run.state(at[i])

        def end(d: np.ndarray, here=here, i=i, T=T) -> np.ndarray:
            z, u, p = np.split(d, [2 * (n + k), 2 * n + 3 * k])
            q_D, v_D, q_K, v_K = np.split(z, [n, 2 * n, 2 * n + k])
            x = here.replace(
                t=0.0,
                v_D=here.v_D + v_D,
                v_K=here.v_K + v_K,
                q_D=tangent.moved(t.scalars_D, t.quaternions_D, here.q_D[None], q_D[None])[0],
                q_K=tangent.moved(t.scalars_K, t.quaternions_K, here.q_K[None], q_K[None])[0],
            )
            puppet = arm.with_parameters(
                {
                    name: arm.tree.parameters[name] + change
                    for name, change in zip(names, p, strict=True)
                }
            )
            x = onto(puppet, x, np.flatnonzero(here.taut))
            segment = fan.Input.segments(puppet, [0.0, T], x.q_K, x.v_K, (acc[i] + u)[None])
            run = fan.simulate(puppet, x, segment, T, **FINE)
            return np.concatenate([run.q_D[-1], run.v_D[-1], run.q_K[-1], run.v_K[-1]])

        wanted = difference(end, 2 * n + 3 * k + n_p, 1e-5)
        mine = np.concatenate([derivatives.A[i], derivatives.B[i], derivatives.C[i]], axis=1)
        assert worst(mine, wanted) < 1e-8, i


def test_intervals_make_up_the_run(caught):
    arm, x0, acc = caught
    inputs = fan.Input.segments(arm, TIMES, x0.q_K, x0.v_K, acc)
    whole = fan.dynamics.sensitivity(arm, x0, inputs, TIMES[-1])
    derivatives = interval_derivatives(arm, whole.run, inputs)
    n = arm.coordinates.n_vD
    z = np.eye(len(derivatives.A[0]))
    for A in derivatives.A:
        z = A @ z
    assert worst(z[: 2 * n, : 2 * n], whole.by_x0[-1]) < 1e-8
    by_p = np.zeros_like(derivatives.C[0])
    for A, C in zip(derivatives.A, derivatives.C, strict=True):
        by_p = A @ by_p + C
    assert worst(by_p[: 2 * n], whole.by_p[-1]) < 1e-8


def test_runs_without_intervals_are_refused(caught):
    arm, x0, acc = caught
    inputs = fan.Input.segments(arm, TIMES, x0.q_K, x0.v_K, acc)
    run = fan.simulate(arm, x0, inputs, TIMES[-2] - 0.01)
    with pytest.raises(fan.errors.InputError, match="no sample"):
        interval_derivatives(arm, run, inputs)
    smooth = fan.Input.waypoints(arm, {"hand.length": [(0, 0.95), (0.6, 0.9)]})
    run = fan.simulate(arm, x0, smooth, 0.6)
    with pytest.raises(fan.errors.InputError, match="acceleration that is not constant"):
        interval_derivatives(arm, run, smooth.bound(x0.q_K, 0.0))
