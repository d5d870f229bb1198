"""Slow event-driven runs: limited computing time, and a warning that names the cause."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import Status
from fantoccini.dynamics.simulation import SlowRunWarning, pace
from fantoccini.motion import ContactPoints, EventKind, EventRecord

ARM = fan.puppets.arm2d()
SWINGING = ARM.project(ARM.rest().replace(v_D=[3.0, -3.0]))

SPINNING = """
puppet: spinning
floor: 0
contact: {friction: 0.5, restitution: 0.3}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: box, size: [0.1, 0.06, 0.04], density: 500}]}
- {name: b, joint: {type: free}, shapes: [{type: box, size: [0.1, 0.06, 0.04], density: 500}]}
- {name: c, joint: {type: free}, shapes: [{type: box, size: [0.1, 0.06, 0.04], density: 500}]}
"""


def test_a_time_limit_ends_a_run_with_a_partial_result():
    began = time.perf_counter()
    run = fan.simulate(ARM, SWINGING, t_end=1e5, save_at=[1e5], time_limit=0.5, throw=False)
    assert run.status is Status.OUT_OF_TIME
    assert time.perf_counter() - began < 5.0
    assert 0.0 < run.t[-1] < 1e5
    whole_run = fan.simulate(ARM, SWINGING, t_end=1.0, time_limit=1e3)
    assert whole_run.status is Status.DONE
    with pytest.raises(
        fan.errors.SimulationError, match="time limit on computing ended the run: at t ="
    ):
        fan.simulate(ARM, SWINGING, t_end=1e5, save_at=[1e5], time_limit=0.1)


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_a_time_limit_is_a_positive_number(limit):
    with pytest.raises(ValueError, match="time_limit"):
        fan.simulate(ARM, SWINGING, t_end=1.0, time_limit=limit)


def test_a_run_of_minutes_warns_early_with_a_remedy(monkeypatch):
    early = dataclasses.replace(pace.LIMITS, first_check=0.2)
    monkeypatch.setattr(pace, "LIMITS", early)
    with pytest.warns(SlowRunWarning) as warned:
        fan.simulate(ARM, SWINGING, t_end=1e6, time_limit=1.0, throw=False)
    (warning,) = warned
    text = str(warning.message)
    assert "of computing the run is at t =" in text and "samples take" in text
    assert "method='timestepping'" in text and "time_limit" in text
    with pytest.warns(SlowRunWarning):
        fan.simulate(ARM, SWINGING, t_end=1e6, save_at=[1e6], time_limit=1.0, throw=False)


def test_chattering_is_reported_with_events_and_touches():
    t = np.linspace(0.0, 0.1, 1000)
    names = (("a", "floor"), ("b", "a"))
    sample = np.arange(990, 1000)
    zeros = np.zeros((10, 3))
    contact = ContactPoints(
        sample, np.ones(10, int), np.zeros(10), zeros, zeros, zeros, zeros, names
    )
    events = [EventRecord(x, EventKind.CATCH, "left", 0.0, 0.0) for x in t[-20:]]
    events.append(EventRecord(0.0, EventKind.CATCH, "right", 0.0, 0.0))
    text = pace.short_steps_message(t, contact, events)
    assert text == (
        "its last 500 samples take 0.05 s of motion, with events of left (20), while b|a touches"
    )
    assert pace.short_steps_message(t[:1], None, []) == "its steps are short"


@pytest.mark.slow
def test_a_slow_run_of_spinning_bodies_names_their_contacts(monkeypatch):
    early = dataclasses.replace(pace.LIMITS, first_check=0.5)
    monkeypatch.setattr(pace, "LIMITS", early)
    heap = fan.loads(SPINNING)
    x0 = heap.state(
        {
            "a.z": 0.05,
            "b.x": 0.02,
            "b.z": 0.12,
            "c.x": -0.02,
            "c.z": 0.19,
            "v:a.wz": 60.0,
            "v:b.wz": -60.0,
            "v:c.wx": 60.0,
        }
    )
    with pytest.warns(SlowRunWarning, match=r"touch|events of"):
        run = fan.simulate(heap, x0, t_end=1e4, time_limit=8.0, throw=False)
    assert run.status in (Status.OUT_OF_TIME, Status.TOO_MANY_EVENTS)
