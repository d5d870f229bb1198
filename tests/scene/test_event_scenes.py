"""The bundled scenes, event-driven: the result of fixed steps, at the integrator's tolerance."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "performance", "duration"),
    [("promenade", "walk", 0.25), ("stroll", "stroll", 0.7), ("visit", "visit", 1.2)],
)
def test_a_bundled_scene_runs_event_driven(name, performance, duration):
    stage = getattr(fan.puppets, name)()
    inputs = fan.Input.load(stage, fan.puppets.performance(performance))
    run = fan.simulate(stage, stage.rest(), inputs, t_end=duration)
    assert run.status is fan.Status.DONE
    assert len(run.contact) > 0
    assert run.contact.gap.min() > -1e-9
    assert run.violation.values.max() < 1e-8
    assert np.abs(run.ledger["residual"]).max() < 1e-7
    steps = fan.simulate(stage, stage.rest(), inputs, t_end=duration, method="timestepping")
    # Both end where the winches lead: fixed steps are off by a part of their step.
    assert np.abs(run.q_D[-1, :3] - steps.q_D[-1, :3]).max() < 5e-3


@pytest.mark.parametrize("name", fan.puppets.scenes())
def test_methods_that_know_no_contact_refuse_them_by_name(name):
    stage = getattr(fan.puppets, name)()
    with pytest.raises(fan.errors.StateError, match="has contact, which method='variational'"):
        fan.simulate(stage, stage.rest(), t_end=0.1, method="variational")
