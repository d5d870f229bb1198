"""Initial states with contact: overlaps that are removed, and very different masses."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

PRESS = """
puppet: press
floor: 0
contact: {friction: 0.5}
bodies:
- {name: light, joint: {type: free}, shapes: [{type: box, size: [0.1, 0.1, 0.1], mass: 0.001}]}
- {name: heavy, joint: {type: free}, shapes: [{type: box, size: [0.3, 0.3, 0.3], mass: 100}]}
pose: {light.z: 0.05, heavy.z: 0.25}
"""


@pytest.fixture(scope="module")
def press() -> fan.Marionette:
    return fan.loads(PRESS)


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_a_gram_carries_a_hundred_kilograms(press, method):
    """Nothing slides: the floor carries both weights, and nothing moves."""
    run = fan.simulate(press, press.state(), t_end=0.2, method=method)
    assert run.status is Status.DONE
    assert np.max(np.abs(run.q_D - run.q_D[0])) < 1e-6
    force = (
        run.contact.force_on("light", len(run))[-1] + run.contact.force_on("heavy", len(run))[-1]
    )
    assert force[2] == pytest.approx(9.81 * 100.001, rel=1e-6)


@pytest.mark.parametrize("method", ["event", "timestepping"])
@pytest.mark.parametrize("depth", [1e-5, 5e-4, 9e-4])
def test_overlaps_at_the_start_are_moved_apart_and_nothing_jumps(press, method, depth):
    """The overlap is removed along the shortest direction: the body is lifted by the depth, and
    stays at rest.
    """
    x0 = press.state({"light.z": 0.05 - depth, "heavy.z": 0.25 - depth})
    run = fan.simulate(press, x0, t_end=0.1, method=method)
    assert run.status is Status.DONE
    assert run.contact.gap.min() > -1e-9
    assert np.max(np.abs(run.v_D)) < 1e-5
    assert run["light.z"][-1] == pytest.approx(0.05, abs=1e-6)
    assert run["heavy.z"][-1] == pytest.approx(0.25, abs=1e-6)


@pytest.mark.parametrize("method", ["event", "timestepping"])
@pytest.mark.parametrize(
    ("masses", "side", "depth"),
    [((1, 1), 0.4, 8e-4), ((100, 1e-3), 0.1, 2e-4), ((100, 1e-3), 0.1, 8e-4), ((1, 50), 0.2, 5e-4)],
)
def test_boxes_of_any_size_are_moved_apart_without_being_tilted(masses, side, depth, method):
    """Regression: the solver ended far from the shortest way, and a box was thrown on a corner."""
    small, large = f"[{side}, {side}, {side}], mass: {masses[0]}", f"mass: {masses[1]}"
    text = PRESS.replace("[0.1, 0.1, 0.1], mass: 0.001", small).replace("mass: 100", large)
    stack = fan.loads(text)
    x0 = stack.state({"light.z": side / 2 - depth, "heavy.z": side + 0.15 - 2 * depth})
    run = fan.simulate(stack, x0, t_end=0.02, method=method)
    state = stack.state({"light.z": side / 2, "heavy.z": side + 0.15})
    assert np.max(np.abs(run.q_D - state.q_D)) < 1e-6
    assert np.max(np.abs(run.v_D)) < 1e-5


def test_batches_move_overlaps_apart_too(press):
    starts = [press.state({"light.z": 0.05 - d, "heavy.z": 0.25 - d}) for d in (0.0, 2e-4, 8e-4)]
    runs = fan.simulate_batch(press, starts, t_end=0.02, method="timestepping")
    assert runs.done.all()
    assert np.allclose(runs.q_D[:, -1], runs.q_D[0, -1], atol=1e-6)


def test_deep_overlaps_are_refused_by_name(press):
    x0 = press.state({"light.z": 0.0485, "heavy.z": 0.2485})
    for method in ("event", "timestepping"):
        with pytest.raises(fan.errors.StateError, match=r"light\|floor by 0.0015"):
            fan.simulate(press, x0, t_end=0.1, method=method)
