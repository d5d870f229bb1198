"""The check of a stand for a run, compared with closed forms, the ledger and simulated motors."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.optimize
from tests.stand.hoist import HOIST, LIFT, MASS, RADIUS, ROTOR, STAND, stand

import fantoccini as fan
from fantoccini.stand import axes_of, check_stand, remedies
from fantoccini.stand.catches import impulses_of, max_impulse
from fantoccini.stand.step_loss import lost_steps

pytestmark = pytest.mark.medium

G = 9.81


def test_the_torque_of_a_winch_that_lifts_a_mass(hoist, lifted):
    """Closed form: torque = -m (g - lddot) r + J lddot / r, the length l growing."""
    check = check_stand(stand(), lifted, hoist)
    length, _, acc = check.motion.series_of_axis("winch")
    torque = -MASS * (G - acc) * RADIUS + ROTOR * acc / RADIUS
    # Between samples, at kinks of the accelerations, forces are interpolated.
    assert np.allclose(check.torque[:, 0], torque, atol=1e-3 * MASS * G * RADIUS)
    assert np.mean(np.abs(check.torque[:, 0] - torque)) < 1e-6 * MASS * G * RADIUS
    assert np.max(np.abs(acc)) > 5.0 and np.ptp(length) == pytest.approx(0.4, abs=1e-6)
    limits = check.limits_of_axis("winch")
    assert limits["speed"].value == pytest.approx(1.875 * 0.4 / 0.5, rel=1e-5)  # minimum jerk
    peak = 10 / np.sqrt(3) * 0.4 / 0.5**2
    assert limits["acceleration"].value == pytest.approx(peak, rel=1e-4)
    assert limits["speed"].margin == pytest.approx(-50.0, abs=0.01) and not check.ok
    assert limits["travel"].margin == pytest.approx(100 / 7, abs=1e-3)
    # 15 s^2 - 60 s^3 ... : the first time at which 30 s^2 (1 - s)^2 0.4 / 0.5 = 1.
    s = (1 - np.sqrt(1 - 4 * np.sqrt(1 / 24))) / 2
    assert check.first.quantity == "speed" and check.first.axis == "winch"
    assert check.first.broken == pytest.approx(0.1 + 0.5 * s, abs=2e-3)
    assert "cannot do it: at t = 0.2" in check.summary()
    # The first broken limit is not the worst.
    worst = replace(limits["speed"], axis="other", margin=-90.0, broken=0.5, value=7.5)
    assert "other" in replace(check, limits=(*check.limits, worst)).summary().split("at worst")[1]


@pytest.mark.parametrize("gear, efficiency", [(1.0, 1.0), (4.0, 0.8)])
def test_a_hanging_mass(hoist, gear, efficiency):
    """m g r / gear at rest, and more when it is lifted through an efficiency."""
    x0 = hoist.rest({"line.length": 0.8})
    still = fan.simulate(hoist, x0, t_end=0.5)
    text = STAND.replace("    moves", f"    gear: {gear}\n    efficiency: {efficiency}\n    moves")
    check = check_stand(stand(text=text), still, hoist)
    assert np.allclose(check.torque, -MASS * G * RADIUS / gear, rtol=1e-6)
    up = fan.Input.segments(hoist, np.array([0.0, 0.4]), x0.q_K, np.array([-0.5]), np.zeros((1, 1)))
    moving = hoist.project(hoist.state({"line.length": 0.8}))
    moving = replace(moving, v_D=np.array([0.5]), v_K=np.array([-0.5]))
    steady = fan.simulate(hoist, moving, up, t_end=0.4)
    check = check_stand(stand(text=text), steady, hoist)
    mid = len(check.torque) // 2
    assert check.torque[mid, 0] == pytest.approx(-MASS * G * RADIUS / gear / efficiency, rel=1e-6)


def test_power_goes_into_the_puppet_the_rotors_and_friction(stand6, conduct):
    """sum of torque w = d/dt (kinetic energy of rotors) + work of the ledger + friction."""
    puppet, run = stand6, conduct
    check = check_stand("six_winches", run, puppet)
    t, v = check.motion.t, check.motion.velocity
    n = np.array([axis.ratio for axis in check.axes])
    J = np.array([axis.inertia for axis in check.axes])
    spun = 0.5 * (v * n) ** 2 @ J
    w = v * n
    viscous, coulomb, slow = (
        getattr(check.axes[0].file.friction, k) for k in ("viscous", "coulomb", "speed")
    )
    rubbed = np.sum(viscous * w**2 + coulomb * w**2 / np.sqrt(w**2 + slow**2), axis=1)
    # The gears of six_winches have losses: the output is F pdot.
    arrives = np.sum(check.force * v, axis=1)
    sent = np.sum(check.power(), axis=1)
    lost = sent - arrives - rubbed - np.gradient(spun, t)
    smooth = np.abs(np.gradient(spun, t)) < 1e-3
    assert np.max(lost) > 0.0 and np.min(np.where(smooth, lost, 0.0)) > -1e-3
    # Catches work as impulses do; between them forces do.
    times, impulses = impulses_of(run, puppet)
    at = np.searchsorted(run.t, times)
    caught = float(np.sum(run.v_K[at] * impulses))
    work = scipy.integrate.trapezoid(arrives, t) + caught
    exchanged = scipy.integrate.trapezoid(np.abs(arrives), t)
    assert work == pytest.approx(run.ledger["work"][-1], abs=2e-3 * exchanged)
    assert abs(caught) > 1e-4 * exchanged


def test_impulses_on_winches_are_those_of_their_strings(stand6, conduct):
    """A length takes the impulse of its own string."""
    puppet, run = stand6, conduct
    times, impulses = impulses_of(run, puppet)
    place = run.coordinates.v_K.index("head.length")
    for i, t in enumerate(times):
        own = [e.impulse for e in run.events if e.t == t and e.name == "head"]
        assert -impulses[i, place] == pytest.approx(sum(own), abs=1e-12 + 1e-9 * sum(own))


@pytest.mark.parametrize("load", [0.0, 0.3, 0.8])
def test_the_largest_impulse_on_a_stepper(load):
    """The equation of a rotor after an impulse: J angle'' = T sin(-50 angle) - M."""
    (axis,) = axes_of(stand("0.4"))
    T, M, caught = 0.4, 0.4 * load, 2e-5
    J = axis.inertia + caught
    limit = float(max_impulse(axis, *(np.array(x) for x in (M, 0.0, caught))))
    rest = -np.arcsin(load) / 50

    def escapes(impulse: float) -> bool:
        solution = scipy.integrate.solve_ivp(
            lambda t, y: [y[1], (-T * np.sin(50 * y[0]) - M) / J],
            (0.0, 0.5),
            [rest, -impulse / J],
            rtol=1e-9,
            atol=1e-12,
        )
        return bool(np.min(solution.y[0]) < rest - 2 * np.pi / 50)

    assert not escapes(0.995 * limit) and escapes(1.005 * limit)


@pytest.mark.parametrize("height", [0.005, 0.01])
def test_a_simulated_stepper_agrees_with_the_check_on_catches(hoist, height):
    """A bob falls into its string, whose winch is a rotor on a simulated stepper motor."""
    slack = replace(hoist.rest({"line.length": 0.8}), taut=np.array([False]))
    run = fan.simulate(hoist, replace(slack, q_D=slack.q_D + height), t_end=0.4)

    def margin(torque: float) -> float:
        return check_stand(stand(f"{torque}"), run, hoist).limits_of_axis("winch")["catch"].margin

    torque = scipy.optimize.brentq(margin, 0.05, 5.0, xtol=1e-4)
    real = fan.loads(
        HOIST + f"drives: [{{on: line.length, inertia: {ROTOR}, drum: {RADIUS}, "
        "motor: {type: stepper, torque: {parameter: torque, value: 0.1}, microsteps: 1600}}]"
    )
    state = {"bob.z": 0.2 + height, "line.length": 0.8, "line.command.length": 0.8}

    def keeps(torque: float) -> bool:
        weaker = real.with_parameters({"torque": torque})
        run = fan.simulate(
            weaker, weaker.state(state), t_end=0.2, method=fan.TimeStepping(dt=2e-5), throw=False
        )
        return run.status is fan.Status.DONE

    assert keeps(1.05 * torque) and not keeps(0.95 * torque)


def test_steps_lost_under_a_constant_load():
    """lag = excess / inertia t^2 / 2, in whole periods of four steps."""
    t = np.linspace(0.0, 0.1, 1001)
    lost = lost_steps(200, t, np.full(1001, 0.03), np.full(1001, 0.02), 4e-5)
    lag = 0.5 * 0.01 / 4e-5 * 0.1**2 / (2 * np.pi / 200)
    assert lost.since == 0.0 and lost.lag == pytest.approx(lag, rel=1e-9)
    assert lost.steps == 4 * round(lag / 4)
    brief = np.where(np.abs(t - 0.05) < 1e-3, 0.021, 0.01)
    assert lost_steps(200, t, brief, np.full(1001, 0.02), 4e-5).steps == 0
    assert lost_steps(200, t, np.full(1001, 0.019), np.full(1001, 0.02), 4e-5) is None


@pytest.mark.parametrize("share", [0.9, 1.15])
def test_a_simulated_stepper_agrees(hoist, lifted, share):
    """The same winch as a drive: it loses no step if the check says so, and otherwise more."""
    check = check_stand(stand(), lifted, hoist)
    torque = share * check.limits_of_axis("winch")["torque"].value
    check = check_stand(stand(f"{torque}"), lifted, hoist)
    real = fan.loads(
        HOIST + f"drives: [{{on: line.length, inertia: {ROTOR}, drum: {RADIUS}, "
        "friction: {viscous: 5.0e-5}, "
        "motor: {type: stepper, torque: {parameter: torque, value: 0.1}}}]"
    ).with_parameters({"torque": torque})
    inputs = fan.Input.waypoints(real, LIFT)
    run = fan.simulate(
        real,
        real.rest({"line.length": 0.8}),
        inputs,
        t_end=1.5,
        method=fan.TimeStepping(dt=1e-4),
        throw=False,
    )
    limit = check.limits_of_axis("winch")["torque"]
    if share > 1.0:
        assert limit.broken is None and not check.lost and run.status is fan.Status.DONE
    else:
        assert limit.broken is not None and run.status is not fan.Status.DONE
        (overload,) = run.overloads.values()
        lost = check.lost["winch"]
        assert lost.steps <= 4 * overload.lost_steps
        assert lost.since <= overload.since + 1e-3


def test_an_advised_motor_or_drum_passes(hoist, lifted):
    """The factors are those of a check that passes."""
    sure = {"speed": "speed: 2 #", "acceleration": "acceleration: 60 #"}
    weak = check_stand(stand("0.055", **sure), lifted)
    (line,) = remedies(weak)
    assert "a motor with" in line and "a smaller drum, radius" in line
    needed = float(re.search(r"a motor with ([\d.]+) N m", line)[1])
    radius = float(re.search(r"a smaller drum, radius [\d.]+ to ([\d.]+) m", line)[1])
    better = check_stand(stand(f"{needed}", **sure), lifted, hoist)
    assert better.ok and better.limits_of_axis("winch")["torque"].margin == pytest.approx(
        10.0, abs=0.5
    )
    smaller = check_stand(stand("0.055", **sure, **{"0.01}": f"{radius}}}"}), lifted, hoist)
    assert smaller.limits_of_axis("winch")["torque"].broken is None
    assert smaller.limits_of_axis("winch")["torque"].margin >= 9.0


def test_step_rates_are_those_of_the_controller(hoist, lifted):
    bound = {"axes:": "controller: {type: grbl, step_rate: 60000}\naxes:"}
    check = check_stand(stand(**bound), lifted, hoist)
    limit = check.limits_of_axis("winch")["step rate"]
    assert limit.value == pytest.approx(1.5 * 3200 / (2 * np.pi * 0.01), rel=1e-4)
    assert limit.broken is not None
    assert any("8 microsteps instead of 16" in line for line in remedies(check))
    assert "step rate" not in check_stand(stand(), lifted, hoist).limits_of_axis("winch")


def test_torques_that_the_motion_does_not_determine_are_not_judged(hoist, lifted):
    """Such times count neither for nor against the stand; other limits can still be broken."""
    sure = {"speed: 1": "speed: 2", "acceleration: 20": "acceleration: 60"}
    weak = check_stand(stand("0.055", **sure), lifted, hoist)
    first = weak.limits_of_axis("winch")["torque"].broken
    flags = np.zeros(lifted.undetermined.values.shape, dtype=bool)
    flags[lifted.t >= first - 0.01, lifted.undetermined.names.index("line.length")] = True
    unsure = replace(lifted, undetermined=lifted.undetermined.like(flags))
    check = check_stand(stand("0.055", **sure), unsure, hoist)
    assert not check.broken and not check.ok and not check.lost and not remedies(check)
    assert check.undetermined["winch"] == pytest.approx(first - 0.01, abs=4e-3)
    assert "is not determined" in check.summary() and "one_winch perhaps can" in repr(check)
    assert check.margin_text("winch", "torque").endswith("?")
    slow = check_stand(stand("0.055", **sure, **{"travel: [0.2": "travel: [0.5"}), unsure, hoist)
    assert {limit.quantity for limit in slow.broken} == {"travel"}


def test_effort_is_computed_where_a_run_has_none(hoist, lifted):
    x0 = hoist.rest({"line.length": 0.8})
    inputs = fan.Input.waypoints(hoist, {"line.length": [(0.1, 0.8), (0.6, 0.4)]})
    bare = fan.simulate(hoist, x0, inputs, t_end=0.8, effort=False)
    full = fan.simulate(hoist, x0, inputs, t_end=0.8)
    without_effort, with_effort = (check_stand(stand(), run, hoist) for run in (bare, full))
    assert np.array_equal(without_effort.torque, with_effort.torque)


def test_bundled_stands_do_bundled_performances(stand6, conduct):
    """The margins are those of the docs."""
    puppet, run = stand6, conduct
    check = check_stand("six_winches", run, puppet)
    assert check.ok and not check.lost and check.margin > 15.0
    assert repr(check) == f"<StandCheck: six_winches can, smallest margin {check.margin:.0f} %>"
