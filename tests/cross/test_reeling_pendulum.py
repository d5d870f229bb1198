"""A pendulum with a moving pivot and a reeled string, compared with its scalar equation."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from harness import polynomial_input, start
from oracles.reeling_pendulum import PUPPET, Reeling

pytestmark = pytest.mark.own_puppets

SECONDS, PIECES = 5.0, 250


@pytest.fixture(scope="module")
def pendulum():
    return fan.loads(PUPPET)


def prepared(pendulum):
    """The oracle, its polynomials, and state and inputs of the puppet with the same polynomials."""
    oracle = Reeling()
    drive = oracle.polynomials(SECONDS, PIECES)
    (first,), _ = oracle.solve(drive, np.array([0.0]))
    (X, L), (dX, dL), _ = drive.at(0, 0.0)
    x0 = start(
        pendulum,
        {"bob.x": first[0], "bob.z": first[1], "line.x": X, "line.length": L},
        {"bob.x": first[2], "bob.z": first[3], "line.x": dX, "line.length": dL},
    )
    coef = {"line.x": drive.coef[:, 0], "line.length": drive.coef[:, 1]}
    return oracle, drive, x0, polynomial_input(pendulum, drive.breaks, coef, x0.q_K)


def test_the_polynomials_are_the_sines():
    """Quintic pieces of 0.02 s miss the sines by less than 1e-12 m."""
    oracle = Reeling()
    drive = oracle.polynomials(SECONDS, PIECES)
    middles = (drive.breaks[:-1] + drive.breaks[1:]) / 2
    pieces = np.array([drive.at(i, t)[0] for i, t in enumerate(middles)])
    np.testing.assert_allclose(pieces.T, oracle.at(middles)[0], atol=1e-12)


@pytest.mark.parametrize("tolerance, error", [(1e-13, 1e-10), (1e-9, 1e-8)])
def test_motion_and_tension(pendulum, tolerance, error):
    """x, z, their rates and the tension over 5 s: errors below 1e-10, and 1e-8 by default."""
    oracle, drive, x0, inputs = prepared(pendulum)
    times = drive.breaks[::10]
    states, tensions = oracle.solve(drive, times)
    run = fan.simulate(
        pendulum,
        x0,
        inputs,
        t_end=SECONDS,
        method=fan.Event(rtol=tolerance, atol=tolerance),
        save_at=times,
    )
    assert not run.events and tensions.min() > 0.5
    rows = np.searchsorted(run.t, times)
    np.testing.assert_allclose(run.q_D[rows], states[:, :2], atol=error)
    np.testing.assert_allclose(run.v_D[rows], states[:, 2:], atol=error)
    np.testing.assert_allclose(run.tension["line"][rows], tensions, atol=error)
