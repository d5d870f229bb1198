"""SciPy's integrators on the flows between events, an independent check of the compiled runs."""

from __future__ import annotations

import pytest
from scipy import integrate
from scipy.interpolate import CubicHermiteSpline

import fantoccini as fan
from harness import bulge
from oracles import flow_events
from runs.references import CASES

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets, pytest.mark.long]

METHODS = {
    # its tolerance; allowed difference of event times, of impulses, of the end state
    "DOP853": (1e-11, 1e-11, 1e-11, 1e-9),
    "Radau": (1e-9, 1e-11, 1e-11, 1e-9),
    "RK45": (1e-10, 1e-9, 1e-9, 1e-6),
    "LSODA": (1e-10, 2e-8, 1e-7, 5e-6),
    "RK23": (1e-7, 1e-5, 1e-4, 2e-3),
    "BDF": (1e-7, 1e-4, 1e-3, 1e-2),
}


class FixedStep(integrate.OdeSolver):
    """The classical Runge-Kutta method as a custom solver without tolerances."""

    h = 5e-4

    def __init__(self, fun, t0, y0, t_bound, vectorized=False, **tolerances):
        super().__init__(fun, t0, y0, t_bound, vectorized)

    def _step_impl(self):
        t, y, h = self.t, self.y, min(self.h, self.t_bound - self.t)
        k1 = self.fun(t, y)
        k2 = self.fun(t + h / 2, y + h / 2 * k1)
        k3 = self.fun(t + h / 2, y + h / 2 * k2)
        k4 = self.fun(t + h, y + h * k3)
        self.before = y, k1
        self.t, self.y = t + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return True, None

    def _dense_output_impl(self):
        y, rate = self.before
        rates = [rate, self.fun(self.t, self.y)]
        return CubicHermiteSpline([self.t_old, self.t], [y, self.y], rates)


def agree(run, ours, t, impulse, state):
    """The same events in the same order, with close times, impulses and end state."""
    assert not run.stopped and run.x.t == ours.t[-1]
    assert [(e.kind, e.name) for e in run.events] == [(e.kind, e.name) for e in ours.events]
    assert [e.t for e in run.events] == pytest.approx([e.t for e in ours.events], abs=t)
    for name in ("impulse", "speed"):
        theirs, mine = ([getattr(e, name) for e in r.events] for r in (run, ours))
        assert theirs == pytest.approx(mine, abs=impulse * (10 if name == "speed" else 1))
    for name in ("q_D", "v_D", "slip"):
        mine = getattr(ours, name)
        mine = getattr(mine, "values", mine)[-1]
        assert getattr(run.x, name) == pytest.approx(mine, abs=state)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", METHODS)
def test_scipys_methods_give_the_compiled_run(reference, name, case):
    arguments, compiled_run = reference[case]
    tolerance, t, impulse, state = METHODS[name]
    run = flow_events.simulate(*arguments, integrator=name, rtol=tolerance, atol=tolerance)
    agree(run, compiled_run, t, impulse, state)


def test_a_custom_solver(arm_reference):
    arguments, compiled_run = arm_reference
    run = flow_events.simulate(*arguments, integrator=FixedStep, rtol=1e-11, atol=1e-11)
    agree(run, compiled_run, 1e-9, 1e-9, 1e-5)


def test_an_implicit_method_takes_long_steps_for_a_stiff_puppet():
    """An elbow with high damping: its time constant is 5 us."""
    arm = fan.loads("""
puppet: stiff
bodies:
  - name: upper
    joint: {type: revolute, axis: [0, -1, 0], damping: 0.001}
    mass: 0.2
    com: [0.15, 0, 0]
    inertia: [0.0015, 0.0015, 0.0015]
  - name: lower
    parent: upper
    joint: {type: revolute, axis: [0, -1, 0], at: [0.3, 0, 0], damping: 50}
    mass: 0.01
    com: [0.1, 0, 0]
    inertia: [0.00003, 0.00003, 0.00003]
strings:
  - {name: hand, path: [{body: lower, at: [0.3, 0, 0]}, {world: [0.45, 0, 0.7]}], length: driven}
pose: {hand.length: 0.9}
""")
    arguments = arm, arm.project(arm.state()), None, 0.3
    compiled_run = fan.simulate(*arguments)
    for name in ("Radau", "BDF", "LSODA"):
        run = flow_events.simulate(*arguments, integrator=name, rtol=1e-7, atol=1e-7, max_step=0.1)
        agree(run, compiled_run, 1e-6, 1e-5, 1e-4)
        assert 20 * run.n_steps < len(compiled_run.t)


def test_a_bulge_within_one_step_is_found():
    """A string released at 1 s opens and closes within one long step."""
    bob, inputs = bulge()
    x0 = bob.project(bob.state())
    compiled_run = fan.simulate(bob, x0, inputs, 1.0999)
    assert [e.kind.value for e in compiled_run.events] == [
        "breakpoint",
        "release",
        "catch",
        "release",
    ]
    for name in ("RK45", "DOP853", "Radau"):
        run = flow_events.simulate(bob, x0, inputs, 1.0999, integrator=name)
        agree(run, compiled_run, 1e-8, 1e-7, 1e-7)


@pytest.mark.parametrize("name", METHODS)
def test_an_impossible_pull_ends_equally(arm_reference, name):
    (marionette, x0, _, _), _ = arm_reference
    inputs = fan.Input.waypoints(marionette, {"hand.x": [(0, x0.q_K[0]), (2, 3.0)]})
    compiled_run = fan.simulate(marionette, x0, inputs, throw=False)
    run = flow_events.simulate(marionette, x0, inputs, 2.0, integrator=name, rtol=1e-6, atol=1e-6)
    assert compiled_run.causes == ("hand",) and run.stopped
    assert run.x.t == pytest.approx(compiled_run.t[-1], abs=1e-3)
