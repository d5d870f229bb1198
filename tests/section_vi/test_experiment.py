"""Comparison of the mixed and the full model: a bob on a winch that moves along x."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from benchmarks.section_vi.bandwidth import tracking_run
from benchmarks.section_vi.deviation import convergence_order
from benchmarks.section_vi.exact import compare, shared_catches
from benchmarks.section_vi.file_drives import follow_on_file_drives
from benchmarks.section_vi.heavy_string import heavy_strings
from benchmarks.section_vi.measure import measure
from benchmarks.section_vi.mechanism import Mechanism
from benchmarks.section_vi.reference import simulate_reference, smooth_reference, toss

import fantoccini as fan
from fantoccini.motion import EventKind
from lab.toys import HELD, WINCH

pytestmark = pytest.mark.slow

MASS = 0.5


@functools.cache
def winch_models():
    mechanism = Mechanism.of(fan.loads(WINCH))
    return mechanism, smooth_reference(mechanism, mechanism.mixed.rest()), mechanism.full()


def test_exact_tracking_gives_the_mixed_models_motion():
    mechanism, motion, full = winch_models()
    assert motion.smooth and np.ptp(motion.run.q_D[:, 0]) > 0.005
    comparisons, stopped = compare(mechanism, full, motion, ("event", "timestepping"))
    assert stopped == []
    event_driven = [c for c in comparisons if c.method == "event"]
    assert (
        event_driven[-1].deviation.max_puppet < 1e-10
        and event_driven[-1].deviation.max_mechanism < 1e-10
    )
    step_deviations = [
        (c.setting, c.deviation.max_puppet) for c in comparisons if c.method == "timestepping"
    ]
    assert convergence_order(*zip(*step_deviations, strict=True)) > 0.9


def test_a_catch_is_shared_with_the_drives():
    """Eq. 15 with the drives: Lambda (1/m + (1 + d_x^2) / J) = hdot, d the string's direction."""
    mechanism, motion, full = winch_models()
    tossed = toss(mechanism, motion.x0, motion.inputs)
    catch = next(e for e in tossed.run.events if e.kind is EventKind.CATCH)
    x = tossed.run.at(catch.t, side="left")
    d_x = (x.q_D[0] - x.q_K[0]) / x.q_K[1]
    assert catch.impulse == pytest.approx(MASS * catch.speed, rel=1e-9)
    catches = shared_catches(mechanism, full, tossed)
    for c in catches:
        shared_impulse = catch.speed / (1 / MASS + (1 + d_x**2) / (c.ratio * MASS))
        assert c.impulse == pytest.approx(shared_impulse, rel=1e-7)
        assert c.jump == pytest.approx(1 - shared_impulse / catch.impulse, rel=1e-4)
    order = convergence_order([c.ratio for c in catches], [c.after for c in catches])
    assert order == pytest.approx(-1, abs=0.01)


def test_the_puppet_nears_the_mixed_model_as_the_square_of_the_bandwidth():
    mechanism, motion, _ = winch_models()
    full = mechanism.full(bandwidth=1.0)
    runs = [tracking_run(mechanism, full, motion, w) for w in (200.0, 400.0, 800.0)]
    max_deviations = [t.deviation.max_puppet for t in runs]
    assert convergence_order([t.bandwidth for t in runs], max_deviations) == pytest.approx(
        -2, abs=0.02
    )
    # The winch lags by pull / (J w^2).
    max_tension = np.max(motion.run.tension["line"])
    assert runs[-1].deviation.max_mechanism == pytest.approx(
        max_tension / (MASS * 800.0**2), rel=0.02
    )


def test_a_string_with_mass_stays_away():
    mechanism, motion, _ = winch_models()
    light, heavy = heavy_strings(mechanism, motion, masses=(0.02, 0.1), bandwidths=(200.0, 800.0))
    for string in (light, heavy):
        slow, fast = (t.deviation.max_puppet for t in string.tracking)
        assert fast > 0.7 * slow
    light_deviation = light.tracking[-1].deviation.max_puppet
    assert heavy.tracking[-1].deviation.max_puppet > 3.0 * light_deviation
    assert heavy.coupling == pytest.approx(5.0 * light.coupling, rel=0.2)
    # M_DK = m/6 between a bob and a carriage that move alike, of masses m/3 + 0.5 each.
    assert light.coupling == pytest.approx(0.01 / 6 / (0.5 + 0.01 / 3), rel=1e-6)


def test_a_length_on_a_drive_may_begin_by_getting_shorter():
    _, _, full = winch_models()
    x = full.state({"v:line.length": -0.1})
    assert x.v_D[full.coordinates.v_D.index("line.length")] == -0.1


def test_a_puppet_that_cannot_move_keeps_the_rest_of_its_report():
    report = measure(fan.loads(HELD))
    assert report.comparisons == () and report.reduction.claims[3].holds is False
    assert "above" in report.missing[0]


def test_drives_of_the_file_are_replaced():
    drives = "drives:\n  - {on: line.length, mass: 2.0}\n"
    mechanism = Mechanism.of(fan.loads(WINCH + drives))
    assert mechanism.mixed.coordinates.v_K == ("line.x", "line.length")
    assert mechanism.full().coordinates.n_vD == 4


def test_drives_of_the_file_are_measured_as_they_are():
    """A winch of stiffness k sags by weight / k, and lags by its drum's inertia force / k."""
    drives = """
drives:
  - {on: line.x, mass: 2.0, control: {type: computed_torque, bandwidth: 400}}
  - {on: line.length, mass: 1.5, control: {type: pd, stiffness: 2.0e4, damping: 350}}
"""
    stand = fan.loads(WINCH + drives)
    lifting = fan.Input.waypoints(stand, {"line.length": [(0, 1.05), (0.5, 0.9)]})
    mechanism = Mechanism.of(stand)
    inputs = mechanism.translated(lifting, mechanism.mixed)
    x0 = mechanism.mixed.rest(inputs.first_values())
    motion = simulate_reference(mechanism, x0, inputs.bound(x0.q_K))
    followed = follow_on_file_drives(mechanism, stand, motion)
    assert followed.drives == ("line.x", "line.length") and not followed.deviation.status
    assert followed.lag[0] == pytest.approx([0.0, 0.5 * 9.81 / 2e4], abs=1e-9)
    command = motion.inputs.evaluate(followed.deviation.t)
    max_lag = (
        np.max(2.0 * np.abs(command[2][:, 1])) / 2e4
    )  # (m + J) acc / k, taken quasi-statically
    lag = np.max(np.abs(followed.lag[:, 1] - followed.lag[0, 1]))
    assert 0.5 * max_lag < lag < 1.5 * max_lag
    assert followed.deviation.max_puppet == pytest.approx(lag, rel=0.1)
    assert followed.force[1] == pytest.approx(0.5 * 9.81 + 2.0 * np.max(command[2][:, 1]), rel=0.1)
