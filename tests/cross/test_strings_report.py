"""Key figures of docs/strings.md, such as those of a pendulum thrown and caught repeatedly."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from benchmarks.strings import mujoco_peer, rivals, scenarios
from benchmarks.strings.scenarios import GRAVITY, LENGTH, MASS, SECONDS

import fantoccini as fan
from oracles import point_mass_events

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def chain():
    return scenarios.chain()


def test_closed_form_equals_scipys_integration(chain):
    """Elliptic functions and parabolas agree with DOP853 at 1e-13: the end and all events."""
    start = np.concatenate([chain.x0.q_D, chain.x0.v_D])
    known = point_mass_events.simulate(start, SECONDS, LENGTH, GRAVITY)
    np.testing.assert_allclose(known.state, chain.reference, atol=1e-12)
    assert len(known.events) == len(chain.events) >= 8
    for (t, kind, lost), (time, name, impulse) in zip(known.events, chain.events, strict=True):
        assert kind == name
        assert t == pytest.approx(time, abs=1e-12)
        assert MASS * lost == pytest.approx(impulse, abs=1e-12)


def test_eight_events_at_tight_tolerance(chain):
    """Times to 1e-11 s, impulses to 1e-10, the end to 1e-11."""
    run = chain.run(tolerance=1e-13)
    assert [e.kind.value for e in run.events] == [kind for _, kind, _ in chain.events]
    for event, (t, _, impulse) in zip(run.events, chain.events, strict=True):
        assert event.t == pytest.approx(t, abs=1e-11)
        assert event.impulse == pytest.approx(impulse, rel=1e-10)
    assert max(chain.errors(run)) < 1e-11


@pytest.mark.parametrize(
    "make",
    [
        scenarios.chain,
        lambda: scenarios.launched_pendulum(2.05),
        lambda: scenarios.launched_pendulum(3.0),
        scenarios.drop,
        scenarios.drop_below,
        lambda: scenarios.reeling(25)[0],
    ],
    ids=["thrown", "k=2.05", "k=3", "dropped beside", "dropped below", "reeled"],
)
def test_default_tolerance_after_five_seconds(make):
    """1e-8 in all coordinates and velocities."""
    scenario = make()
    assert max(scenario.errors(scenario.run())) < 1e-8


def test_steps_of_the_event_method_converge_at_high_order(chain):
    """The error falls by more than 2^7 with half the step, through eight events."""
    errors = [
        max(chain.errors(chain.run(tolerance=1e3, max_step=step))) for step in (0.1, 0.05, 0.025)
    ]
    assert errors[0] > 2**7 * errors[1] > 2**14 * errors[2]


def test_time_stepping_converges_at_first_order(chain):
    """Half the step gives half the error, a quarter of the violation and half the residual."""
    runs = [chain.run(method="timestepping", dt=dt) for dt in (2e-3, 1e-3, 5e-4)]
    for coarse, fine in itertools.pairwise(runs):
        assert 1.7 < max(chain.errors(coarse)) / max(chain.errors(fine)) < 2.3
        assert np.max(coarse.violation["line"]) > 3 * np.max(fine.violation["line"])
        residuals = [abs(run.ledger["residual"][-1]) for run in (coarse, fine)]
        assert 1.7 < residuals[0] / residuals[1] < 2.3


def test_the_event_ledger_shrinks_with_the_tolerance(chain):
    """The residual falls by more than four decades from 1e-6 to 1e-12, and to 1e-7 J by default."""
    worst = [
        np.max(np.abs(chain.run(tolerance=tolerance).ledger["residual"]))
        for tolerance in (1e-6, 1e-9, 1e-12)
    ]
    assert worst[0] > 1e4 * worst[2]
    assert worst[1] < 1e-7


def test_a_length_stays_at_rounding_for_a_hundred_seconds():
    """Lengths agree to 1e-12 of the length, of either sign, after every accepted step."""
    a = np.deg2rad(60.0)
    x0 = scenarios.pendulum_start(float(np.sin(a)), -float(np.cos(a)))
    run = fan.simulate(scenarios.pendulum(), x0, t_end=100.0)
    assert np.max(np.abs(np.hypot(*run.q_D.T) - LENGTH)) < 1e-12 * LENGTH


def test_a_mass_at_rest_pulls_with_its_weight():
    """The tension is m g in both methods, to rounding."""
    x0 = scenarios.pendulum_start(0.0, -LENGTH)
    for method in ("event", "timestepping"):
        run = fan.simulate(scenarios.pendulum(), x0, t_end=1.0, method=method)
        np.testing.assert_allclose(run.tension["line"], MASS * GRAVITY, atol=1e-12)


def test_mujocos_error_does_not_shrink_with_its_step(chain):
    """MuJoCo's default strings are soft: smaller steps do not reduce the error of softness."""
    errors = []
    for dt in (1e-3, 1e-4):
        peer = mujoco_peer.pendulum(dt, "default").put(chain.x0.q_D, chain.x0.v_D)
        errors.append(max(chain.apart(*peer.advance(round(SECONDS / dt)))))
    assert errors[1] > 0.5 * errors[0] > 0.01


def test_rivals_follow_the_same_motion(chain):
    """Penalty and Baumgarte methods come within 2e-2 of the reference with steps of 0.5 ms."""
    method = np.array(rivals.METHODS)
    setting = np.where(method == rivals.PENALTY, 1e6, 300.0)
    lanes = rivals.Lanes(method, setting, LENGTH, MASS, GRAVITY)
    start = np.concatenate([chain.x0.q_D, chain.x0.v_D])
    ends = lanes.run(start, SECONDS, 5e-4)
    errors = np.max(np.abs(ends.state - chain.reference), axis=1)
    assert np.all(errors < 2e-2)
    assert ends.lowest[method == rivals.UNCLIPPED] < 0 <= ends.lowest[method == rivals.CLIPPED]
