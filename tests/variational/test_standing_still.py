"""Puppets at rest: forces cancel, and no momentum gives a scale for a convergence tolerance."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from lab.toys import CART

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

BALANCED = """
puppet: still
bodies:
  - name: crank
    joint: {type: revolute, axis: [0, -1, 0], driven: true}
    mass: 0.3
    com: [0, 0, -0.2]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  - name: arm
    joint:
      {type: revolute, axis: [0, -1, 0], at: [1, 0, 0], spring: {stiffness: 0.8, rest: 0.2}}
    mass: 0.3
    com: [0.2, 0, 0]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
drives:
  - {on: crank, inertia: 1.0e-3, control: {type: pd, stiffness: 40, damping: 1}}
"""
"""Weights on motors and springs, without strings and limits."""


def test_it_stands_still():
    """A single run and a run in lanes agree."""
    puppet = fan.loads(BALANCED)
    x = puppet.rest({"crank": 0.3})
    run = fan.simulate(puppet, x, t_end=5.0, method="variational")
    many = fan.simulate_batch(puppet, [x] * 3, t_end=5.0, method="variational", save="all")
    assert [run.status, *many.status] == [fan.Status.DONE] * 4
    for q_D in (run.q_D, *many.q_D):
        np.testing.assert_allclose(q_D, np.tile(x.q_D, (len(run), 1)), atol=1e-12)


def test_it_sets_out_from_rest():
    """A trolley under a hanging rod, second order: at first, only M_DK v_K acts."""
    cart = fan.loads(CART)
    x = cart.rest()
    inputs = fan.Input.waypoints(cart, {"trolley": [(0.0, 0.0), (0.5, 0.03)]})
    exact = fan.simulate(cart, x, inputs, 1.0).q_D[-1]
    runs = [
        fan.simulate(cart, x, inputs, 1.0, method=fan.Variational(dt=dt)) for dt in (4e-3, 2e-3)
    ]
    coarse, fine = (np.abs(run.q_D[-1] - exact)[0] for run in runs)
    assert coarse / fine == pytest.approx(4.0, rel=0.02)
