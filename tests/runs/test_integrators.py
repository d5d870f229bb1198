"""SciPy's integrators on the frozen-mode flow, an independent check of the compiled one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate
from scipy.interpolate import CubicHermiteSpline

import fantoccini as fan
from fantoccini.simulation.scipy_run import ScipyRun
from harness import bulge
from runs.references import CASES

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets, pytest.mark.long]

METHODS = {
    # tolerance given to it; allowed difference of event times, of impulses, of the end state
    "DOP853": (1e-11, 1e-11, 1e-11, 1e-9),
    "Radau": (1e-9, 1e-11, 1e-11, 1e-9),
    "RK45": (1e-10, 1e-9, 1e-9, 1e-6),
    "LSODA": (1e-10, 2e-8, 1e-7, 5e-6),
    "RK23": (1e-6, 1e-5, 1e-4, 2e-3),
    "BDF": (1e-7, 1e-4, 1e-3, 1e-2),
}

BLIND_AT = 0.05


class FixedStep(integrate.OdeSolver):
    """The classical Runge-Kutta method: a solver of one's own, which takes no tolerances."""

    h = 5e-4

    def __init__(self, fun, t0, y0, t_bound, vectorized=False, **extraneous):
        assert not extraneous
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


class GivesUp(integrate.RK45):
    """Fails after a while."""

    def _step_impl(self):
        return (False, "no") if self.t > 0.05 else super()._step_impl()


class Blind(integrate.RK45):
    """Its dense output knows nothing of one time."""

    def _dense_output_impl(self):
        found = super()._dense_output_impl()
        return lambda t: found(t) * np.where(t == BLIND_AT, np.nan, 1.0)


class Forwards(integrate.DOP853):
    """Passes its options on without naming them."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)


def agree(run, ours, t, impulse, state):
    """The same events in the same order, with times, impulses and the end state close."""
    assert run.status is ours.status
    assert [(e.kind, e.name) for e in run.events] == [(e.kind, e.name) for e in ours.events]
    assert [e.t for e in run.events] == pytest.approx([e.t for e in ours.events], abs=t)
    for name in ("impulse", "speed"):
        theirs, mine = ([getattr(e, name) for e in r.events] for r in (run, ours))
        assert theirs == pytest.approx(mine, abs=impulse * (10 if name == "speed" else 1))
    for name in ("q_D", "v_D", "slip"):
        theirs, mine = (getattr(r, name) for r in (run, ours))
        theirs, mine = (getattr(a, "values", a)[-1] for a in (theirs, mine))
        assert theirs == pytest.approx(mine, abs=state)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", METHODS)
def test_scipys_methods_give_the_compiled_ones_run(reference, name, case):
    given, ours = reference[case]
    tolerance, t, impulse, state = METHODS[name]
    run = fan.simulate(*given, method=fan.Event(integrator=name, rtol=tolerance, atol=tolerance))
    agree(run, ours, t, impulse, state)


@pytest.mark.parametrize(
    ("solver", "t", "state"), [(FixedStep, 1e-9, 1e-5), (Forwards, 1e-11, 1e-9)]
)
def test_a_solver_of_ones_own(arm_reference, solver, t, state):
    given, ours = arm_reference
    run = fan.simulate(*given, method=fan.Event(integrator=solver, rtol=1e-11, atol=1e-11))
    agree(run, ours, t, t, state)


def test_strings_are_kept_to_rounding_and_the_books_close(arm_reference):
    given, _ = arm_reference
    for name, residual in (("RK45", 1e-6), ("DOP853", 1e-7), ("Radau", 1e-7)):
        run = fan.simulate(*given, method=fan.Event(integrator=name, rtol=1e-7, atol=1e-7))
        assert np.max(run.violation.values) < 1e-14
        assert np.max(np.abs(run.ledger["residual"])) < residual


def test_an_implicit_method_takes_long_steps_where_the_puppet_is_stiff():
    """An elbow as in honey: its time constant is 5 us."""
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
    given = arm, arm.project(arm.state()), None, 0.3
    ours = fan.simulate(*given)
    for name in ("Radau", "BDF", "LSODA"):
        run = fan.simulate(*given, method=fan.Event(integrator=name, rtol=1e-7, atol=1e-7))
        agree(run, ours, 1e-6, 1e-5, 1e-4)
        assert 20 * len(run.t) < len(ours.t)


@pytest.mark.parametrize("integrator", ["dop853", "euler", "", 5, float])
def test_an_unknown_integrator_is_refused(arm_reference, integrator):
    given, _ = arm_reference
    with pytest.raises(ValueError, match=r"must be 'RK23', .*'LSODA', a subclass of") as caught:
        fan.simulate(*given, method=fan.Event(integrator=integrator))
    assert repr(integrator) in str(caught.value)


@pytest.mark.parametrize("n", [7, 2001])
def test_saved_times_are_on_the_motion(arm_reference, n):
    given, ours = arm_reference
    times = np.linspace(0.0, given[-1], n)
    options = {"save_at": times}
    run = fan.simulate(*given, method=fan.Event(integrator="DOP853"), **options)
    compiled = fan.simulate(*given, **options)
    assert run.t == pytest.approx(compiled.t, abs=1e-12)
    assert np.all(np.isin(times, run.t))
    for name in ("q_D", "v_D", "acc_D"):
        assert getattr(run, name) == pytest.approx(getattr(compiled, name), abs=1e-7)
    assert np.max(run.violation.values) < 1e-12
    assert [e.t for e in run.events] == pytest.approx([e.t for e in ours.events], abs=1e-11)


def test_a_jump_of_the_inputs_acceleration_is_two_rows(arm_reference):
    (marionette, x0, _, _), _ = arm_reference
    inputs = fan.Input.segments(
        marionette, [0.0, 0.5, 1.0], x0.q_K, [0.0, 0.0], [[0.2, 0.0], [-0.2, 0.0]]
    )
    run = fan.simulate(marionette, x0, inputs, method=fan.Event(integrator="DOP853"))
    assert run.acc_K[run.t == 0.5, 0].tolist() == [0.2, -0.2]
    assert [e.kind.value for e in run.events] == ["breakpoint"]
    assert run.t[-1] == 1.0


def test_a_bulge_within_one_step_is_found():
    """Released at 1 s, the string closes and opens again within one long step."""
    bob, inputs = bulge()
    x0 = bob.project(bob.state())
    ours = fan.simulate(bob, x0, inputs, 1.0999)
    assert [e.kind.value for e in ours.events] == ["breakpoint", "release", "catch", "release"]
    for name in ("RK45", "DOP853", "Radau"):
        run = fan.simulate(bob, x0, inputs, 1.0999, method=fan.Event(integrator=name))
        agree(run, ours, 1e-8, 1e-7, 1e-7)


@pytest.mark.parametrize("name", METHODS)
def test_a_pull_that_nothing_can_follow_ends_alike(arm_reference, name):
    (marionette, x0, _, _), _ = arm_reference
    inputs = fan.Input.waypoints(marionette, {"hand.x": [(0, x0.q_K[0]), (2, 3.0)]})
    ours = fan.simulate(marionette, x0, inputs, throw=False)
    with pytest.raises(fan.SimulationError, match="because of hand") as caught:
        fan.simulate(
            marionette, x0, inputs, method=fan.Event(integrator=name, rtol=1e-6, atol=1e-6)
        )
    run = caught.value.trajectory
    assert run.status is caught.value.status is ours.status
    assert run.blamed == ours.blamed
    assert run.t[-1] == pytest.approx(ours.t[-1], abs=1e-3)
    assert np.all(np.isfinite(run.tension.values))


def test_a_solver_that_fails_ends_the_run_with_what_was_reached(arm_reference):
    given, _ = arm_reference
    run = fan.simulate(*given, method=fan.Event(integrator=GivesUp), throw=False)
    assert run.status is fan.Status.STEP_TOO_SMALL
    assert 0.05 < run.t[-1] < 0.1


@pytest.mark.parametrize("taut", [True, False])
def test_a_sample_that_fails_ends_the_run(arm_reference, taut):
    """It was left out, and the run was done."""
    marionette, x0, inputs, t_end = arm_reference[0]
    if not taut:
        x0, inputs = marionette.state({"hand.length": 3.0}), None
    run = fan.simulate(
        marionette, x0, inputs, t_end, method=fan.Event(integrator=Blind),
        save_at=[0.0, 0.02, BLIND_AT, 0.2], throw=False,
    )  # fmt: skip
    assert run.status is (fan.Status.PROJECTION_FAILED if taut else fan.Status.NOT_FINITE)
    assert run.t.tolist() == [0.0, 0.02] and np.all(np.isfinite(run.q_D))


@pytest.mark.parametrize(
    ("bound", "status"),
    [("max_steps", fan.Status.TOO_MANY_STEPS), ("max_events", fan.Status.TOO_MANY_EVENTS)],
)
def test_bounds_hold(arm_reference, bound, status):
    (marionette, x0, inputs, t_end), _ = arm_reference
    run = ScipyRun(
        "RK45", marionette.model.library, marionette.model.run_options(**{bound: 1}), x0,
        marionette.p, marionette.winches, inputs.bound(x0.q_K, x0.t),
    )  # fmt: skip
    for _ in run.advance(t_end):
        pass
    assert run.status is status


def test_ctrl_c_keeps_what_was_reached(arm_reference):
    (marionette, x0, inputs, t_end), _ = arm_reference

    def stop(t):
        if t > 0.1:
            raise KeyboardInterrupt

    run = fan.simulate(
        marionette,
        x0,
        inputs,
        t_end,
        method=fan.Event(integrator="RK23", rtol=1e-7),
        progress=stop,
        throw=False,
    )
    assert run.status is fan.Status.STOPPED
    assert 0.1 < run.t[-1] < t_end
    acc_D, _ = marionette.forward_dynamics(run.state(-1), run.acc_K[-1])
    assert run.acc_D[-1] == pytest.approx(acc_D, rel=1e-9, abs=1e-9)


def test_the_same_run_gives_the_same_bits(arm_reference):
    given, _ = arm_reference
    one, two = (
        fan.simulate(*given, method=fan.Event(integrator="RK45"), progress=progress)
        for progress in (None, lambda t: None)
    )
    assert np.array_equal(one.t, two.t) and np.array_equal(one.q_D, two.q_D)


# -- the flow by itself ------------------------------------------------------------------------


TWINS = """
puppet: twins
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 0.25}
strings:
  - {name: one, path: [{body: bob}, {world: [0, 0, 0.6]}], length: 0.6}
  - {name: other, path: [{body: bob}, {world: [0, 0, 0.6]}], length: 0.6}
"""
"""A bob on two strings between the same two points."""


@pytest.mark.parametrize("integrator", ["LSODA", "BDF", "Radau"])
def test_a_redundant_string_stops_no_integrator(integrator):
    """It follows from the other: on the dense output it is off by no more than that is."""
    rows = []
    for text in (TWINS, TWINS.replace("  - {name: other, path", "  # - {name: other, path")):
        puppet = fan.loads(text)
        x0 = puppet.project(puppet.state({"bob.x": 0.3, "bob.z": 0.1}))
        run = fan.simulate(
            puppet, x0, None, 1.0, method=fan.Event(integrator=integrator, rtol=1e-7, atol=1e-7)
        )
        rows.append(len(run))
    assert rows[0] <= 1.2 * rows[1] + 10, rows


SPRINGY = """
puppet: springy
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 0.25}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 0.6]}], length: 0.6, restitution: 0.5}
"""
"""A bob on a string that springs back with half the speed."""


@pytest.mark.parametrize("integrator", METHODS)
def test_a_string_that_springs_back_comes_to_rest(integrator):
    """Bounces that an integrator cannot tell from its errors are none: it does not hop for ever."""
    puppet = fan.loads(SPRINGY)
    x0 = puppet.project(puppet.state({"bob.x": 0.3, "bob.z": 0.4}))
    right = fan.simulate(puppet, x0, None, 1.0, method=fan.Event(rtol=1e-6, atol=1e-6))
    run = fan.simulate(
        puppet, x0, None, 1.0, method=fan.Event(integrator=integrator, rtol=1e-6, atol=1e-6)
    )
    assert 10 <= len(run.events) <= len(right.events) + 2
    assert run.events[-1].kind == "accumulation"
    assert np.max(np.abs(run.q_D[-1] - right.q_D[-1])) < 1e-4
