"""Steps of the bundled marionette: periodic, load-bearing and almost without slip."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from benchmarks.optimal import walk
from benchmarks.optimal.marionette_gait import MarionetteGait

import fantoccini as fan

pytestmark = pytest.mark.slow

STEPS = 24


@pytest.mark.parametrize("dt", [1e-3, 2.5e-4])
def test_it_walks_and_slips_by_less_than_a_millimetre_a_step(promenade, dt):
    gait, x0 = MarionetteGait(), promenade.rest()
    end, method = gait.duration * (STEPS + 1), fan.TimeStepping(dt=dt)
    inputs = gait.inputs(promenade, STEPS, x0)
    run = fan.simulate(promenade, x0, inputs, end, method=method, save_every=round(2e-3 / dt))
    steps = walk.measure_walk(promenade, run, gait, STEPS)
    assert steps.slip.max(axis=1).mean() < walk.SLIP
    assert steps.lift.min() > 4e-3
    assert steps.way == pytest.approx(2.0 * gait.stride, abs=1e-3)
    assert steps.cycle_changes.max() < 0.02
    assert steps.weight_share > 0.2
    assert steps.upright > 0.97


def test_it_ends_standing_as_it_began_except_for_the_displacement(promenade):
    gait, x0 = MarionetteGait(), promenade.rest()
    inputs = gait.inputs(promenade, 5, x0).bound(x0.q_K, x0.t)
    q_K = inputs.evaluate(inputs.end)[0]
    displacements = {name: q_K[i] - x0.q_K[i] for i, name in enumerate(promenade.coordinates.q_K)}
    distance = 4.0 * gait.stride  # the first step and the last are half as long
    for name, displacement in displacements.items():
        if name.endswith(".y"):
            expected = gait.apart if name == "knee_left.y" else 0.0
            expected = -gait.apart if name == "knee_right.y" else expected
        elif name.endswith(".x"):
            offsets = {"knee_left": gait.ahead, "knee_right": gait.ahead, "head": gait.lean}
            expected = distance + offsets.get(name.removesuffix(".x"), 0.0)
        else:
            expected = {"knee": gait.slack, "hand": 0.0, "shoulder": gait.lower}.get(
                name.split("_")[0], gait.lower + gait.nod
            )
        assert displacement == pytest.approx(expected, abs=1e-12), name


def test_steps_begin_at_their_given_places_and_times(promenade):
    x0 = promenade.rest().replace(t=3.0)
    points = MarionetteGait().waypoints(x0, 2)
    assert all(times[0] == (3.0, float(x0[name])) for name, times in points.items())
    assert all(np.all(np.diff([t for t, _ in times]) > 0.0) for times in points.values())


def test_puppets_that_cannot_walk_are_refused(promenade):
    with pytest.raises(ValueError, match="at least 2"):
        MarionetteGait().inputs(promenade, 1)
    with pytest.raises(fan.errors.UnknownNameError, match=r"head\.x"):
        MarionetteGait().inputs(fan.puppets.arm2d(), 4)
    with pytest.raises(ValueError, match="duration"):
        MarionetteGait(duration=0.0)
    names = {field.name for field in dataclasses.fields(MarionetteGait)}
    assert set(walk.SPREADS) | {"stride", "duration"} == names
