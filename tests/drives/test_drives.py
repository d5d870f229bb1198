"""Drives compared with closed forms and with Lagrange's equations in polar coordinates."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fantoccini as fan

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

MACHINES = """
puppet: machines
bodies:
  - name: lift
    joint: {type: prismatic, axis: [0, 0, 1], driven: true}
    mass: 0.5
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  - name: crank
    joint: {type: revolute, axis: [0, -1, 0], driven: true, at: [2, 0, 0]}
    mass: 0.3
    com: [0, 0, -0.2]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  - name: wheel
    joint: {type: revolute, axis: [0, 0, 1], driven: true, at: [4, 0, 0]}
    mass: 0.1
    inertia: [1.0e-4, 1.0e-4, 2.0e-4]
  - name: head
    joint: {type: ball, driven: true, at: [6, 0, 0]}
    mass: 0.2
    inertia: [4.0e-4, 4.0e-4, 4.0e-4]
drives:
  - on: lift
    mass: 0.2
    inertia: 3.0e-5
    gear: 4
    drum: 0.03
    friction: {viscous: 1.0e-4, coulomb: 2.0e-3}
    control: {type: computed_torque, bandwidth: {parameter: w, value: 12}, damping_ratio: 0.3}
  - on: crank
    inertia: 2.0e-5
    gear: 20
    friction: {viscous: 2.0e-5, coulomb: 1.0e-3, speed: 2.0}
    motor: {type: dc, constant: 0.05, current: 1.5, resistance: 4.0, voltage: 12.0}
    control: {type: pd, stiffness: 40, damping: 1.0}
  - on: wheel
    inertia: 1.0e-5
    gear: 2
    friction: {viscous: 4.0e-4}
    motor: {type: stepper, torque: 0.2, steps: 200, microsteps: 8, corner_speed: 30}
  - on: head.rotation
    inertia: 1.0e-5
    gear: 10
    motor: {type: servo, torque: 0.02}
    control: {type: pd, stiffness: 0.3, damping: 5.0e-3}
"""

BOB = """
puppet: bob
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 0.4}
strings:
  - name: line
    path: [{body: bob}, {driven: [x], at: [0, 0, 1]}]
    length: driven
drives:
  - on: line.x
    mass: {parameter: trolley, value: 0.7}
    control: {type: pd, stiffness: 90, damping: 6}
  - on: line.length
    inertia: {parameter: rotor, value: 4.0e-5}
    gear: 3
    drum: 0.02
    friction: {viscous: 2.0e-5, coulomb: 1.0e-3, speed: 5.0}
    control: {type: pd, stiffness: {parameter: k, value: 800}, damping: {parameter: d, value: 9}}
pose: {bob.z: 0.2, line.length: 0.8}
"""

FREE = (
    BOB[: BOB.index("drives:")]
    + """
drives:
  - {on: line.length, mass: {parameter: rotor, value: 0.6}}
pose: {bob.z: 0.2, line.length: 0.9}
"""
)


@pytest.fixture(scope="module")
def machines():
    return fan.loads(MACHINES)


@pytest.fixture(scope="module")
def bob():
    return fan.loads(BOB)


def solved(rates, y0, times):
    solution = solve_ivp(
        rates, (times[0], times[-1]), y0, "DOP853", t_eval=times, rtol=1e-13, atol=1e-13
    )
    assert solution.success
    return solution.y


def column(run, name):
    return run.q_D[:, run.coordinates.q_D.index(name)]


def test_roles_flip(machines):
    table = machines.coordinates
    assert table.q_D[:3] == ("lift", "crank", "wheel")
    assert table.commands["head.rotation"] == "head.command.rotation"
    assert "lift.command" in table.q_K and "lift" not in table.q_K
    roles = {row.name: str(row.role) for row in table.rows}
    assert (roles["crank"], roles["crank.command"]) == ("dynamic", "driven")


def test_reflected_inertia(machines):
    """M = mass + m + J (g / r)^2, J g^2 for angles."""
    M = machines.mass_matrix(machines.state())
    expected = [0.5 + 0.2 + 3e-5 * (4 / 0.03) ** 2, 0.3 * 0.2**2 + 1e-3 + 2e-5 * 400, 2e-4 + 4e-5]
    np.testing.assert_allclose(np.diag(M)[:3], expected, rtol=1e-13)
    np.testing.assert_allclose(np.diag(M)[3:], 4e-4 + 1e-3, rtol=1e-13)


def test_computed_torque_makes_the_error_linear(machines):
    """e'' + 2 zeta w e' + w^2 e = 0, through gravity and friction, while the command moves."""
    x0 = machines.state({"lift": 0.1, "lift.command": 0.0})
    move = fan.Input.waypoints(machines, {"lift": [(0, 0.0), (0.4, 0.3), (0.8, 0.1)]})
    run = fan.simulate(machines, x0, move, t_end=0.8)
    w, zeta = 12.0, 0.3
    fast = w * np.sqrt(1 - zeta**2)
    decay = np.exp(-zeta * w * run.t)
    expected = -0.1 * decay * (np.cos(fast * run.t) + zeta * w / fast * np.sin(fast * run.t))
    command = run.q_K[:, run.coordinates.q_K.index("lift.command")]
    np.testing.assert_allclose(command - column(run, "lift"), expected, atol=1e-9)


def test_direct_current_motor(machines):
    """A distant command: first the current's bound acts, then the voltage's, and then neither."""
    n, k, current, R, U = 20, 0.05, 1.5, 4.0, 12.0
    heavy, weight = 0.3 * 0.2**2 + 1e-3 + 2e-5 * n**2, 0.3 * 9.81 * 0.2

    def rates(t, y):
        q, v = y
        rotor = n * v
        high, low = min(current, (U - k * rotor) / R), max(-current, (-U - k * rotor) / R)
        torque = np.clip(40 * (2.5 - q) - 1.0 * v, n * k * low, n * k * high)
        friction = n * (2e-5 * rotor + 1e-3 * rotor / np.hypot(rotor, 2.0))
        return [v, (torque - friction - weight * np.sin(q)) / heavy]

    x0 = machines.state({"crank": 0.0, "crank.command": 2.5})
    times = np.linspace(0, 0.6, 61)
    run = fan.simulate(
        machines, x0, t_end=0.6, method=fan.Event(rtol=1e-12, atol=1e-12), save_at=times
    )
    expected = solved(rates, [0.0, 0.0], times)
    angles = column(run, "crank")[np.searchsorted(run.t, times)]
    np.testing.assert_allclose(angles, expected[0], atol=1e-8)
    speeds = expected[1] * n * k
    assert np.any(U - speeds < R * current) and speeds[1] < U - R * current


def test_a_run_may_begin_with_a_speed(machines):
    """The speed is that of the coordinate: the command is at rest, or has its named speed."""
    table = machines.coordinates
    place = table.v_K.index("crank.command")
    x0 = machines.state({"v:crank": 1.0})
    assert x0.v_K[place] == 0.0
    assert fan.simulate(machines, x0, t_end=0.01).v_D[0, table.v_D.index("crank")] == 1.0
    assert machines.state({"v:crank": 1.0, "v:crank.command": 0.5}).v_K[place] == 0.5


def test_a_stepper_holds_a_load_up_to_its_torque(machines):
    """n T sin(50 (angle - n q)) = load; a load above n T pulls it out of step."""

    def held(load, t_end=3.0):
        inputs = fan.Input.hold(machines, t_end).with_forces(
            {"wheel": [(0, 0.0), (0.5, load), (t_end, load)]}
        )
        run = fan.simulate(machines, machines.state(), inputs, t_end=t_end, throw=False)
        return column(run, "wheel")[-1], run.status.name

    assert held(0.3) == (pytest.approx(np.arcsin(0.3 / 0.4) / 50 / 2, abs=1e-6), "DONE")
    off, status = held(0.41)
    assert off > 2 * np.pi / 50 / 2 and status == "RUNAWAY"  # more than a pole pair


def test_a_stepper_moves_in_microsteps(machines):
    micro = 2 * np.pi / 1600 / 2
    rest = [machines.rest({"wheel": r, "wheel.command": r}) for r in np.array([0.4, 0.6]) * micro]
    at = machines.coordinates.q_D.index("wheel")
    assert [x.q_D[at] for x in rest] == pytest.approx([0.0, micro], abs=1e-10)


def test_a_stepper_is_pulled_out_beyond_its_corner(machines):
    """At 5 times the corner speed a fifth of the torque remains: less than the friction."""

    def lag(speed):
        end = 20.0 / speed + 0.3
        move = {"wheel": [(0, 0.0), (end, 20.0)]}
        run = fan.simulate(
            machines,
            machines.state(),
            fan.Input.waypoints(machines, move),
            t_end=end + 1.0,
            method=fan.TimeStepping(dt=5e-4),
            throw=False,
        )
        return abs(column(run, "wheel")[-1] - 20.0), run.status.name

    for speed, ended in ((8.0, "DONE"), (80.0, "LOST_STEPS")):
        off, status = lag(speed)
        assert status == ended and (off < 0.01 if ended == "DONE" else off > 1.0)


def test_an_orientation_follows_its_command(machines):
    """Rotation about one axis: I phi'' = k sin(r - phi) - d phi', at most 10 times 0.02 N m."""
    heavy = 4e-4 + 1e-3

    def rates(t, y):
        torque = np.clip(0.3 * np.sin(1.2 - y[0]) - 5e-3 * y[1], -0.2, 0.2)
        return [y[1], torque / heavy]

    axis = np.array([2.0, -1.0, 2.0]) / 3
    x0 = machines.state({"head.command.rotation": 1.2 * axis})
    times = np.linspace(0, 0.5, 26)
    run = fan.simulate(
        machines, x0, t_end=0.5, method=fan.Event(rtol=1e-12, atol=1e-12), save_at=times
    )
    at = run.coordinates.q_D.index("head.qw")
    turned = run.q_D[np.searchsorted(run.t, times), at : at + 4]
    phi = solved(rates, [0.0, 0.0], times)[0]
    np.testing.assert_allclose(turned[:, 0], np.cos(phi / 2), atol=1e-8)
    np.testing.assert_allclose(turned[:, 1:], np.sin(phi / 2)[:, None] * axis, atol=1e-8)


def lagrange():
    """Accelerations of (X, L, theta) of a bob on a winch that a trolley carries, from T and V."""
    X, L, a, *rates = sp.symbols("X L a dX dL da")
    dX, dL, da = rates
    q, v = sp.Matrix([X, L, a]), sp.Matrix(rates)
    place = sp.Matrix([X + L * sp.sin(a), 1 - L * sp.cos(a)])
    speed = place.jacobian(q) * v
    n = 3 / 0.02
    T = 0.4 * speed.dot(speed) / 2 + 0.7 * dX**2 / 2 + 4e-5 * n**2 * dL**2 / 2
    V = 0.4 * 9.81 * place[1]
    M = sp.hessian(T, list(v))
    slope = sp.Matrix([T - V]).jacobian(q).T - sp.Matrix([T]).jacobian(v).jacobian(q) * v
    return sp.lambdify([X, L, a, dX, dL, da], [M, slope])


def test_a_bob_on_a_winch_and_a_trolley(bob):
    """The event-driven run agrees to 1e-9 with Lagrange's equations; other orders are 1 and 2."""
    equations, n = lagrange(), 3 / 0.02
    move = fan.Input.waypoints(
        bob, {"line.length": [(0, 0.8), (0.6, 0.6)], "line.x": [(0, 0.0), (0.5, 0.15)]}
    )

    def rates(t, y):
        M, force = equations(*y)
        r, dr, _ = move.evaluate(t)
        friction = n * (2e-5 * n * y[4] + 1e-3 * n * y[4] / np.hypot(n * y[4], 5.0))
        force[0] += 90 * (r[0] - y[0]) + 6 * (dr[0] - y[3])
        force[1] += 800 * (r[1] - y[1]) + 9 * (dr[1] - y[4]) - friction
        return [*y[3:], *np.linalg.solve(M, np.ravel(force))]

    x0 = bob.rest({"line.length": 0.8})
    table = bob.coordinates
    sag = x0.q_D[table.q_D.index("line.length")] - 0.8
    assert sag == pytest.approx(0.4 * 9.81 / 800, rel=1e-9)
    times = np.linspace(0, 1.0, 11)
    y = solved(rates, [0.0, 0.8 + sag, 0.0, 0.0, 0.0, 0.0], times)
    expected = np.array([y[0] + y[1] * np.sin(y[2]), 1 - y[1] * np.cos(y[2]), y[0], y[1]]).T

    def error(**how):
        run = fan.simulate(bob, x0, move, t_end=1.0, **how)
        if isinstance(how["method"], fan.Event):
            assert abs(run.ledger["residual"]).max() < 1e-11
            force = run.effort["line.command.length"][0]
            assert force == pytest.approx(-0.4 * 9.81, rel=1e-9)
        return np.abs(run.q_D[np.searchsorted(run.t, times - 1e-9)] - expected).max()

    assert table.q_D == ("bob.x", "bob.z", "line.x", "line.length")
    assert error(method=fan.Event(rtol=1e-12, atol=1e-12), save_at=times) < 1e-9
    slow = [error(method=fan.TimeStepping(dt=dt)) for dt in (4e-3, 2e-3)]
    fine = [error(method=fan.Variational(dt=dt)) for dt in (4e-3, 2e-3)]
    assert slow[0] / slow[1] == pytest.approx(2, rel=0.15) and slow[1] < 1e-3
    assert fine[0] / fine[1] == pytest.approx(4, rel=0.15) and fine[1] < 1e-4


@pytest.mark.parametrize("rotor", [0.6, 60.0])
def test_a_catch_shares_its_impulse_with_the_rotor(rotor):
    """The string pulls the bob and the drum together: v = m v- / (m + M), Lambda = M v."""
    puppet = fan.loads(FREE).with_parameters({"rotor": rotor})
    run = fan.simulate(puppet, puppet.state(), t_end=0.2)
    (catch,) = [e for e in run.events if e.kind == "catch"]
    speed = np.sqrt(2 * 9.81 * 0.1)
    after = 0.4 * speed / (0.4 + rotor)
    assert catch.speed == pytest.approx(speed, rel=1e-9)
    assert catch.impulse == pytest.approx(rotor * after, rel=1e-9)
    end = 0.2 - speed / 9.81
    drop = after * end + 0.4 * 9.81 / (0.4 + rotor) * end**2 / 2
    assert column(run, "line.length")[-1] == pytest.approx(0.9 + drop, abs=1e-9)
    assert run.ledger["residual"][-1] == pytest.approx(0, abs=1e-12)


def test_rest_names_the_drive_that_yields(bob):
    with pytest.raises(fan.errors.StateError, match=r"the drive of line\.length has no control"):
        fan.loads(FREE).rest()
    motor = "motor: {type: servo, torque: {parameter: T, value: 1.0}}\n    gear: 3"
    puppet = fan.loads(BOB.replace("gear: 3", motor))
    names, x = puppet.coordinates.q_D, puppet.rest({"line.length": 0.8})
    assert x.q_D[names.index("line.length")] == pytest.approx(0.8 + 0.4 * 9.81 / 800, rel=1e-9)
    with pytest.raises(fan.errors.StateError, match=r"the motor of line\.length may be too weak"):
        puppet.with_parameters({"T": 0.02}).rest({"line.length": 0.8})


@pytest.mark.filterwarnings("error")
def test_a_rotor_alone_rests_and_swings():
    """Only a rotor has inertia: J phi'' = k (r - phi) - d phi'."""
    crank = MACHINES[: MACHINES.index("  - name: lift")]
    crank += "  - {name: crank, joint: {type: revolute, axis: [1, 0, 0], driven: true}}\n"
    control = "control: {type: pd, stiffness: 10, damping: 0.1}"
    crank = fan.loads(crank + "drives:\n  - {on: crank, inertia: 1.0e-3, " + control + "}\n")
    assert crank.rest({"crank.command": 0.3}).q_D == pytest.approx([0.3], abs=1e-12)  # type: ignore[attr-defined]
    run = fan.simulate(crank, crank.state({"crank": 0.1, "crank.command": 0.0}), t_end=0.05)  # type: ignore[attr-defined]
    w = np.sqrt(10 / 1e-3 - 50**2)
    expected = 0.1 * np.exp(-50 * run.t) * (np.cos(w * run.t) + 50 / w * np.sin(w * run.t))
    np.testing.assert_allclose(run.q_D[:, 0], expected, atol=1e-10)


def test_stiff_drives_do_not_shake_the_time_stepper(bob):
    """A drive of 1,000 rad/s at steps of 4 ms agrees with the motion of plain inputs."""
    stiff = bob.with_parameters({"k": 9e5, "d": 1.8e3})
    move = fan.Input.waypoints(stiff, {"line.length": [(0, 0.8), (0.6, 0.6)]})
    x0 = stiff.rest({"line.length": 0.8})
    run = fan.simulate(stiff, x0, move, t_end=1.0, method=fan.TimeStepping(dt=4e-3))
    lag = column(run, "line.length") - run.q_K[:, 1]
    assert np.abs(lag).max() < 5e-4
    exact = fan.simulate(stiff, x0, move, t_end=1.0).effort["line.command.length"]
    force = run.effort["line.command.length"]
    assert [force.min(), force.max()] == pytest.approx([exact.min(), exact.max()], abs=0.05)
    assert np.abs(run.ledger["residual"]).max() < 0.01


ARM = """
puppet: arm
gravity: [0, 0, 0]
bodies:
  - {name: a, joint: {type: revolute, axis: [0, -1, 0], driven: true}, mass: 0.2,
     com: [0.15, 0, 0], inertia: [1.0e-5, 1.5e-3, 1.5e-3]}
  - {name: b, parent: a, joint: {type: revolute, axis: [0, -1, 0], driven: true, at: [0.3, 0, 0]},
     mass: 0.2, com: [0.15, 0, 0], inertia: [1.0e-5, 1.5e-3, 1.5e-3]}
  - {name: head, parent: b, joint: {type: ball, driven: true, at: [0.3, 0, 0]}, mass: 0.05,
     inertia: [1.0e-5, 1.9e-3, 1.9e-3]}
  - {name: wheel, joint: {type: revolute, axis: [0, 0, 1], driven: true}, mass: 0.1,
     inertia: [1.0e-6, 1.0e-6, 1.0e-6]}
drives:
  - on: [a, b, head.rotation]
    inertia: 1.0e-6
    control: {type: computed_torque, bandwidth: {parameter: w, value: 1000}}
  - on: wheel
    inertia: 1.0e-7
    gear: 10
    motor: {type: dc, constant: 0.02, current: 1000, resistance: 1, voltage: 6}
    control: {type: pd, stiffness: 10, damping: 0.01}
"""


def test_stiff_coupled_drives_and_windings_are_stable():
    """Computed torque over coupled joints, and a motor at its bound of voltage."""
    arm = fan.loads(ARM)
    start = {"a.command": 0.01, "head.command.rotation": [0.3, -0.4, 0.5], "wheel.command": 100.0}
    run = fan.simulate(arm, arm.state(start), t_end=0.6, method=fan.TimeStepping(dt=2e-3))
    names = run.coordinates.v_D
    speed = np.abs(np.delete(run.v_D, names.index("wheel"), axis=1))
    assert speed[: len(speed) // 3].max() < 300 and speed[-20:].max() < 0.05
    assert run.q_D[-1, :2] == pytest.approx([0.01, 0.0], abs=1e-3)
    # The voltage without load: U / (k n).
    assert run.v_D[-1, names.index("wheel")] == pytest.approx(30.0, abs=1e-6)


def test_derivatives_agree_with_differences(machines):
    """Derivatives of accelerations by velocities and places, motors at and within their bounds."""
    x = machines.state({"crank": 0.2, "crank.command": 0.5, "lift": 0.1, "v:lift": 0.3})
    linear, h = machines.linearise(x), 1e-6
    for k, name in enumerate(machines.coordinates.v_D):
        for what, slope in (("v:", linear.acc.v_D), ("", linear.acc.q_D)):
            if name.startswith("head") and not what:
                continue
            place = machines.coordinates.q_D.index(name) if not what else k
            q, v = np.zeros(len(x.q_D)), np.zeros(len(x.v_D))
            (v if what else q)[place] = h
            ends = [
                machines.forward_dynamics(x.replace(q_D=x.q_D + s * q, v_D=x.v_D + s * v))[0]
                for s in (1, -1)
            ]
            expected = (ends[0] - ends[1]) / (2 * h)
            np.testing.assert_allclose(slope[:, k], expected, rtol=1e-5, atol=1e-5)
    step = machines.linearise_step(x)
    assert np.all(np.isfinite(step.A))


def test_lanes_are_the_scalar_run(bob):
    x0 = bob.rest({"line.length": 0.8})
    inputs = fan.motion.Inputs.random(bob, n=9, seed=1).bound(x0.q_K)
    many = fan.simulate_batch(bob, x0, inputs, t_end=0.1, method="timestepping")
    single = fan.simulate(bob, x0, inputs[4], t_end=0.1, method="timestepping")
    np.testing.assert_allclose(many.q_D[4, -1], single.q_D[-1], rtol=1e-11, atol=1e-13)


def test_a_drive_winds_a_chain():
    """At rest the winch yields by pull / stiffness; the energies of a lift balance."""
    rope = "length: driven\n    chain: {pieces: 3, mass: 0.01, stiffness: 500, damping: 0.5}"
    puppet = fan.loads(BOB.replace("length: driven", rope))
    x0, names = puppet.rest({"line.length": 0.8}), puppet.coordinates.q_D
    lift = fan.Input.waypoints(puppet, {"line.length": [(0, 0.8), (0.3, 0.7)]})
    run = fan.simulate(puppet, x0, lift, t_end=0.5)
    assert np.abs(run.ledger["residual"]).max() < 1e-10
    assert np.abs(run.v_D[0]).max() < 1e-9 and np.abs(run.acc_D[0]).max() < 1e-6
    # By virtual work a drum feels T (1 + T / 2 EA), with the tension T of each third.
    T = 9.81 * (0.4 + np.array([0.0, 0.005, 0.01]))
    sag = np.mean(T * (1 + T / 1000)) / 800
    assert x0.q_D[names.index("line.length")] - 0.8 == pytest.approx(sag, rel=1e-8)
