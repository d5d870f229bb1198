"""simulate: its arguments, its refusals, and results of incomplete runs."""

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.compiled import as_method
from harness import bulge

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def hanging(arm):
    return arm.rest({"hand.length": 0.8})


def jerk(arm):
    """A pull and a quick release: the string goes slack and is caught."""
    points = [(0, 0.8), (0.15, 0.5), (0.4, 0.5), (0.6, 0.8)]
    return fan.Input.waypoints(arm, {"hand.length": points})


def test_a_string_too_long_at_the_start_is_named(arm, hanging):
    q_D = hanging.q_D + np.array([-0.2, 0.0])
    with pytest.raises(fan.errors.StateError, match=r"hand is violated by .*project"):
        fan.simulate(arm, hanging.replace(q_D=q_D), t_end=1.0)


def test_projecting_repairs_it(arm, hanging):
    wrong = hanging.replace(q_D=hanging.q_D + np.array([-0.2, 0.0]))
    repaired = arm.project(wrong)
    assert abs(arm.constraint(repaired)[0]) < 1e-12
    assert fan.simulate(arm, repaired, t_end=0.1).status is fan.Status.DONE


def test_a_velocity_past_the_string_is_named(arm, hanging):
    moving = hanging.replace(v_D=np.array([-1.0, 0.0]))
    with pytest.raises(fan.errors.StateError, match="hand is at its bound and moves past it"):
        fan.simulate(arm, moving, t_end=1.0)


def test_inputs_that_start_elsewhere_are_refused(arm, hanging):
    inputs = fan.Input.waypoints(arm, {"hand.length": [(0, 0.7), (1, 0.6)]})
    with pytest.raises(fan.errors.InputError, match=r"hand\.length.*0\.7.*0\.8"):
        fan.simulate(arm, hanging, inputs)


@pytest.mark.parametrize("t_end", [0.0, -1.0, np.nan, np.inf])
def test_an_end_before_the_start_is_refused(arm, hanging, t_end):
    with pytest.raises(ValueError, match="t_end"):
        fan.simulate(arm, hanging, t_end=t_end)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (fan.Event, "rtol"),
        (fan.Event, "atol"),
        (fan.Event, "max_step"),
        (fan.TimeStepping, "dt"),
        (fan.Variational, "dt"),
    ],
)
def test_steps_and_tolerances_are_positive(kind, name, value):
    with pytest.raises(ValueError, match=f"{name} is {value}; it must be a finite number"):
        kind(**{name: value})


def test_methods_are_named_or_given_with_their_options(arm, hanging):
    """Plain names are short forms; an option of another method is refused."""
    assert as_method("timestepping") == fan.TimeStepping()
    assert as_method("variational", dt=0.01) == fan.Variational(dt=0.01)
    with pytest.raises(ValueError, match="method='timestepping' has no option rtol"):
        as_method("timestepping", rtol=1e-9)
    for wrong in ("euler", None, 3, fan.Event):
        with pytest.raises(ValueError, match="one of 'event', 'timestepping', 'variational'"):
            fan.simulate(arm, hanging, t_end=1.0, method=wrong)
    with pytest.raises(TypeError, match=r"fan\.simulate_batch"):
        fan.simulate(arm, [hanging, hanging], t_end=1.0)


def test_a_marionette_does_not_change(arm):
    """A changed one is another marionette, with the same compiled library."""
    heavy = arm.with_parameters({"m2": 0.2})
    assert heavy.libraries is arm.libraries
    for change in (lambda: setattr(arm, "model", heavy), lambda: setattr(arm, "p", heavy.p)):
        with pytest.raises(AttributeError):
            change()
    with pytest.raises(ValueError, match="read-only"):
        arm.p[0] = 1.0


def test_an_unknown_method_is_refused(arm, hanging):
    with pytest.raises(ValueError, match="euler"):
        fan.simulate(arm, hanging, t_end=1.0, method="euler")


def test_an_impact_is_two_rows_at_one_time(arm, hanging):
    run = fan.simulate(arm, hanging, jerk(arm), 1.0)
    catches = [e for e in run.events if e.kind == "catch"]
    assert catches
    for event in catches:
        rows = np.flatnonzero(run.t == event.t)
        assert len(rows) == 2
        jump = run.v_D[rows[1]] - run.v_D[rows[0]]
        assert np.array_equal(run.q_D[rows[0]], run.q_D[rows[1]])
        A = arm.A_D(run.state(rows[0]))[0]
        M = arm.mass_matrix(run.state(rows[0]))
        assert np.allclose(M @ jump, -A * event.impulse, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_a_length_driven_through_zero_stops_the_run(arm, method):
    x0 = arm.rest({"hand.length": 0.8})
    breaks = np.array([0.0, 4.0])
    coef = np.zeros((1, 2, 6))
    coef[0, 0, 0], coef[0, 1, 0] = x0.q_K[0], 0.8
    coef[0, 1, 2] = -0.1
    inputs = fan.Input(arm.coordinates, breaks, coef, np.array([x0.q_K]), np.ones(2, dtype=bool))
    with pytest.raises(fan.errors.SimulationError, match="hand") as caught:
        fan.simulate(arm, x0, inputs, method=method)
    # The arm cannot follow before the length is 0: only `event` detects this itself.
    assert caught.value.status in (fan.Status.TENSION_CAP, fan.Status.LENGTH_NOT_POSITIVE)


def test_an_impossible_pull_stops_with_a_partial_run(arm, hanging):
    """The tip reaches 0.6 m from the shoulder; the string's end moves on beyond that."""
    inputs = fan.Input.waypoints(arm, {"hand.x": [(0, hanging.q_K[0]), (2, 3.0)]})
    with pytest.raises(fan.errors.SimulationError) as caught:
        fan.simulate(arm, hanging, inputs)
    error = caught.value
    assert error.status in (
        fan.Status.IMPOSSIBLE_INPUT,
        fan.Status.TENSION_CAP,
        fan.Status.STEP_TOO_SMALL,
    )
    run = error.trajectory
    assert 0.1 < run.t[-1] < 2.0
    assert np.all(np.isfinite(run.q_D)) and np.all(np.isfinite(run.tension.values))
    silent = fan.simulate(arm, hanging, inputs, throw=False)
    assert silent.status is error.status


def test_time_stepping_continues_with_a_bounded_state(arm, hanging):
    inputs = fan.Input.waypoints(arm, {"hand.x": [(0, hanging.q_K[0]), (2, 3.0)]})
    run = fan.simulate(arm, hanging, inputs, 3.0, method="timestepping", throw=False)
    assert np.all(np.isfinite(run.q_D))
    assert np.all(np.isfinite(run.tension.values))


def test_saved_times_are_on_the_motion(arm, hanging):
    times = np.linspace(0.0, 1.0, 101)
    every = fan.simulate(arm, hanging, jerk(arm), 1.0, method=fan.Event(rtol=1e-11, atol=1e-11))
    saved = fan.simulate(
        arm, hanging, jerk(arm), 1.0, method=fan.Event(rtol=1e-11, atol=1e-11), save_at=times
    )
    assert np.all(np.isin(times[1:], saved.t))
    at = np.searchsorted(saved.t, times[1:], side="right") - 1
    run_at_steps = every.resample(times[1:])
    assert np.max(np.abs(saved.q_D[at] - run_at_steps.q_D)) < 1e-8
    assert [e.t for e in saved.events] == [e.t for e in every.events]


def test_the_same_run_gives_the_same_bits(arm, hanging):
    first, second = (fan.simulate(arm, hanging, jerk(arm), 2.0) for _ in range(2))
    assert np.array_equal(first.t, second.t) and np.array_equal(first.q_D, second.q_D)


def test_effort_is_the_force_on_the_hand(arm, hanging):
    """At rest a string pulls its end down with its tension, and resists shortening."""
    run = fan.simulate(arm, hanging, t_end=0.1)
    tension = run.tension["hand"][0]
    end, tip = arm.string_points(run.q_D, run.q_K)["hand"][0][::-1]
    along = (end - tip) / np.linalg.norm(end - tip)
    assert run.effort["hand.length"][0] == pytest.approx(-tension, rel=1e-12)
    assert run.effort["hand.x"][0] == pytest.approx(tension * along[0], rel=1e-10)


def test_user_forces_act(arm, hanging):
    """u_D of Eq. 8: with unchanged gravity, a torque moves the shoulder by M^-1 u."""
    inputs = fan.Input.hold(arm).with_forces({"shoulder": [(0.0, 0.5), (1.0, 0.5)]})
    run = fan.simulate(arm, hanging, inputs, t_end=0.5)
    x = run.state(0)
    acc, tension = arm.forward_dynamics(x, u_D=np.array([0.5, 0.0]))
    assert np.allclose(run.acc_D[0], acc, rtol=1e-10, atol=1e-12)
    M, c = arm.mass_matrix(x), arm.bias(x) + arm.damping(x)
    pull = arm.A_D(x).T @ -tension
    assert np.allclose(M @ acc + c, np.array([0.5, 0.0]) + pull, atol=1e-10)


def test_ctrl_c_keeps_the_finished_rows(arm, hanging):
    def stop(at):
        if at.done > 0.3:
            raise KeyboardInterrupt

    run = fan.simulate(
        arm, hanging, t_end=2.0, method=fan.TimeStepping(dt=1e-4), progress=stop, throw=False
    )
    assert run.status is fan.Status.STOPPED
    assert 0.3 < run.t[-1] < 0.5


def test_a_progress_function_changes_nothing(arm, hanging):
    for how in ("event", fan.TimeStepping(dt=0.003)):
        first = fan.simulate(arm, hanging, jerk(arm), 1.0, method=how)
        two = fan.simulate(arm, hanging, jerk(arm), 1.0, method=how, progress=lambda at: None)
        assert np.array_equal(first.t, two.t) and np.array_equal(first.q_D, two.q_D)


@pytest.mark.parametrize("times", [[0.2, 0.2], [0.3, 0.1], [np.nan], [2.0], [-1.0]])
def test_times_to_save_increase_inside_the_run(arm, hanging, times):
    with pytest.raises(ValueError, match="save_at"):
        fan.simulate(arm, hanging, t_end=1.0, save_at=times)


def test_inputs_of_another_puppet_are_refused(arm, hanging):
    other = fan.Input.hold(fan.puppets.crane())
    with pytest.raises(fan.errors.InputError, match="made for a puppet"):
        fan.simulate(arm, hanging, other, 1.0)


def test_inputs_with_a_jump_of_velocity_are_refused(arm, hanging):
    inputs = fan.Input.segments(arm, [0.0, 0.5], hanging.q_K, [0.0, 0.0], [[0.5, 0.0]])
    run = fan.simulate(arm, hanging, inputs)
    assert run.v_K[-1, 0] == pytest.approx(0.25)
    with pytest.raises(
        fan.errors.InputError, match=r"hand\.x.*end at t = 0\.5 s with the velocity 0\.25"
    ):
        fan.simulate(arm, hanging, inputs, 1.0)


def test_a_jump_of_the_inputs_acceleration_is_two_rows(arm, hanging):
    inputs = fan.Input.segments(
        arm, [0.0, 0.5, 1.0], hanging.q_K, [0.0, 0.0], [[0.2, 0.0], [-0.2, 0.0]]
    )
    run = fan.simulate(arm, hanging, inputs, method=fan.Event(rtol=1e-11, atol=1e-11))
    rows = np.flatnonzero(run.t == 0.5)
    assert run.acc_K[rows, 0].tolist() == [0.2, -0.2]
    times = np.linspace(0.05, 0.95, 77)
    assert np.max(np.abs(run.resample(times).q_K - inputs.evaluate(times)[0])) < 1e-12


def test_a_bulge_past_a_loosened_string_is_a_catch():
    """A string released at 1 s opens and closes within one long step."""
    bob, inputs = bulge()
    for max_step in (0.1, 0.005):
        run = fan.simulate(
            bob, bob.project(bob.state()), inputs, 1.0999, method=fan.Event(max_step=max_step)
        )
        kinds = [e.kind.value for e in run.events]
        assert kinds == ["breakpoint", "release", "catch", "release"]
        assert run.events[2].t == pytest.approx(1.03, abs=1e-9)
        assert np.max(run.violation["line"]) < 1e-12


def test_mirrored_strings_that_loosen_together_do_not_stall():
    bar = fan.puppets.marionette_bar()
    push = {"torso.x": [(2.0, 0.0), (2.0, 0.5), (2.2, 0.5), (2.2, 0.0)]}
    run = fan.simulate(bar, bar.rest(), fan.Input.hold(bar, 4.0).with_forces(push))
    assert run.status is fan.Status.DONE
    assert np.max(run.violation.values) < 1e-9


def test_catches_in_turn_accumulate():
    """A rod on two strings inside its radius of gyration: intervals shrink by a constant ratio.

    A catch of one string turns hdot of the other by -(1 - a^2/k^2) / (1 + a^2/k^2), with the
    strings at a from the middle and k the radius of gyration; flights last 2 hdot / hddot.
    """
    a, inertia = 0.15, 1.0 / 12.0
    rod = fan.loads(f"""
puppet: rod
bodies:
  - name: rod
    joint: {{type: free}}
    mass: 1.0
    com: [0, 0, 0]
    inertia: [0.0001, {inertia}, {inertia}]
strings:
  - {{name: left, path: [{{body: rod, at: [-{a}, 0, 0]}}, {{world: [-{a}, 0, 1]}}], length: 1.0}}
  - {{name: right, path: [{{body: rod, at: [{a}, 0, 0]}}, {{world: [{a}, 0, 1]}}], length: 1.0}}
""")
    x0 = rod.state({"rod.z": 0.1, "rod.rotation": [0, 0.05, 0]})
    run = fan.simulate(rod, x0, t_end=1.5)
    catches = [e for e in run.events if e.kind == "catch"]
    assert {e.name for e in catches[-4:]} == {"left", "right"}
    ratio = (1 - a**2 / inertia) / (1 + a**2 / inertia)
    intervals = np.diff([e.t for e in catches])[6:16]
    assert np.allclose(intervals[1:] / intervals[:-1], ratio, rtol=1e-3)
    assert [e.kind.value for e in run.events][-1] == "accumulation"
    assert run.taut.values[-1].all()
    assert abs(run.ledger["residual"][-1]) < 1e-8


def test_a_run_knows_the_values_of_its_parameters(tmp_path):
    """They are in the saved puppet, which is not compiled again."""
    arm = fan.puppets.arm2d().with_parameters({"m1": 0.5}).with_parameters({"m2": 0.25})
    run = fan.simulate(arm, arm.rest({"hand.length": 0.8}), t_end=0.01)
    run.save(tmp_path / "run.npz")
    progress = []
    loaded = fan.Marionette(fan.Trajectory.load(tmp_path / "run.npz").puppet, progress.append)
    assert np.array_equal(loaded.p, arm.p) and loaded.mass == pytest.approx(0.75)
    assert np.array_equal(loaded.mass_matrix(run.state(0)), arm.mass_matrix(run.state(0)))
    assert not progress
    file = fan.puppets.arm2d()
    assert file.current_puppet is file.puppet
