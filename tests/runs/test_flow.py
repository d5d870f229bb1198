"""A flow: the motion with a fixed active set, for other integrators."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate

import fantoccini as fan

pytestmark = pytest.mark.medium


def test_rate_is_the_motion(arm_reference):
    """ydot = (N v, acc_D, power, dissipation): Eqs. 10 and 11 at the start."""
    (marionette, x0, inputs, _), _ = arm_reference
    flow = marionette.flow(x0, inputs)
    acc_D, tension = marionette.forward_dynamics(x0, inputs.evaluate(0.0)[2])
    rate = flow.rate(flow.t0, flow.y0)
    assert rate[:2] == pytest.approx(x0.v_D, abs=1e-12)
    assert rate[2:4] == pytest.approx(acc_D, rel=1e-9)
    assert flow.rows == ("hand",) and flow.taut.tolist() == [True]
    assert flow.guards(0.0, flow.y0) == pytest.approx(-tension / marionette.weight, rel=1e-9)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_solve_ivp_on_a_flow(reference, method):
    """The first event is at the root of a guard."""
    for name in ("arm", "bar"):
        (marionette, x0, inputs, _), compiled_run = reference[name]
        flow = marionette.flow(x0, inputs)
        first = compiled_run.events[0]
        row = flow.rows.index(first.name)

        def guard(t, y, flow=flow, row=row):
            return flow.guards(t, y)[row]

        guard.terminal, guard.direction = True, 1  # type: ignore[attr-defined]
        assert flow.t_end > first.t
        solution = integrate.solve_ivp(
            flow.rate, (flow.t0, flow.t_end), flow.y0, method, events=guard, rtol=1e-10, atol=1e-10
        )
        assert solution.t[-1] == pytest.approx(first.t, abs=1e-7)
        x = flow.state(solution.t[-1], solution.y[:, -1])
        there = compiled_run.at(first.t)
        assert x.q_D == pytest.approx(there.q_D, abs=1e-6)
        assert x.q_K == pytest.approx(there.q_K, abs=1e-6)
        assert x.taut.tolist() == flow.taut.tolist()


def test_a_flow_ends_at_the_next_break_of_its_input(arm_reference):
    (marionette, x0, inputs, _), _ = arm_reference
    assert marionette.flow(x0, inputs).t_end == inputs.breaks[1]
    assert marionette.flow(x0).t_end == np.inf


def test_a_flow_starts_from_valid_states(arm_reference):
    (marionette, x0, _, _), _ = arm_reference
    with pytest.raises(fan.errors.StateError, match="hand is violated"):
        marionette.flow(x0.replace(q_D=x0.q_D + np.array([-0.2, 0.0])))
    elsewhere = fan.Input.waypoints(marionette, {"hand.length": [(0, 0.7), (1, 0.6)]})
    with pytest.raises(fan.errors.InputError, match=r"hand\.length"):
        marionette.flow(x0, elsewhere)
