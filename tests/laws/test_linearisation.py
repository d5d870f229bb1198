"""Linearisations are derivatives of compiled functions: accelerations, tensions, steps."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.derivatives.linearisation import named_rows
from fantoccini.dynamics.steppers.stepper import Stepper
from fantoccini.kernel.codegen import generate
from fantoccini.kernel.codegen.straight import program
from oracles.differences import apart, difference, moved, worst

pytestmark = [pytest.mark.slow, pytest.mark.long]

RIG = """
puppet: rig
bodies:
  - {name: bar, joint: {type: free, driven: true}}
  - name: crank
    parent: bar
    joint: {type: revolute, axis: [0, 1, 0], at: [0.2, 0, 0], damping: 0.02, armature: 0.002}
    shapes: [{type: sphere, radius: 0.02, at: [0.1, 0, 0], mass: {parameter: bob, value: 0.1}}]
  - name: body
    joint: {type: free}
    shapes: [{type: box, size: [0.2, 0.1, 0.05], mass: 0.5}]
    drag: {linear: 0.1, quadratic: 0.3, angular: 0.01}
  - name: arm
    parent: body
    joint:
      name: shoulder
      type: ball
      at: [0.1, 0, 0]
      damping: {parameter: friction, value: 0.03}
      armature: {parameter: rotor, value: 0.1}
      spring: {stiffness: 0.05}
      cone: {max: 60 deg, axis: [0, 0, -1], of: [0, 0, -1]}
      twist: {lower: -70 deg, upper: 70 deg}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.2], radius: 0.02, mass: 0.2}]
strings:
  - name: lift
    path: [{body: body, at: [0, 0.05, 0.02]}, {body: bar, at: [0, 0.1, 0]}]
    length: driven
  - name: over
    path:
      - {body: arm, at: [0, 0, -0.2]}
      - {body: crank, at: [0.1, 0, 0]}
      - {driven: [x], at: [0, 0, 2]}
    length: driven
  - name: stay
    path: [{body: body, at: [-0.1, 0, 0]}, {world: [-0.5, 0, 1]}]
    length: {parameter: reach, value: 0.9}
    wire: true
springs:
  - name: rubber
    between: [{body: arm, at: [0, 0, -0.1]}, {body: bar, at: [0.1, 0, 0]}]
    stiffness: {parameter: pull, value: 2.0}
    rest: 0.4
    damping: 0.1
pose: {bar.z: 1.0, body.z: 0.5, lift.length: 0.5, over.length: 2.0}
"""


@pytest.fixture(scope="module")
def rig() -> fan.Marionette:
    return fan.loads(RIG)


def somewhere(puppet: fan.Marionette, seed: int) -> tuple[fan.State, np.ndarray, np.ndarray]:
    """A state in motion, accelerations of the inputs and forces."""
    rng, t = np.random.default_rng(seed), puppet.coordinates
    x = puppet.state()
    return (
        x.replace(
            q_D=moved(x.q_D, 0.3 * rng.normal(size=t.n_vD), t.scalars_D, t.quaternions_D),
            v_D=rng.normal(size=t.n_vD),
            q_K=moved(x.q_K, 0.05 * rng.normal(size=t.n_vK), t.scalars_K, t.quaternions_K),
            v_K=rng.normal(size=t.n_vK),
        ),
        rng.normal(size=t.n_vK),
        0.1 * rng.normal(size=t.n_vD),
    )


def accelerations(puppet: fan.Marionette, rows, x, acc_K, u_D) -> np.ndarray:
    """acc_D and the tensions with rows held as equalities, from the compiled model."""
    held = named_rows(puppet, rows)
    instant = Evaluation.at_state(puppet, x, acc_K, u_D)
    W = instant.W[:, held]
    tension = np.linalg.solve(W.T @ W, W.T @ instant.w0 + instant.gamma[held])
    return np.concatenate([instant.solve_factor(instant.w0 - W @ tension), tension])


def check_partials(puppet: fan.Marionette, rows, seed: int, bound: float) -> None:
    t = puppet.coordinates
    x, acc_K, u_D = somewhere(puppet, seed)
    lin = puppet.linearise(x, acc_K, u_D, rows)
    held = named_rows(puppet, rows)
    here = accelerations(puppet, rows, x, acc_K, u_D)
    assert worst(np.concatenate([lin.acc_D, lin.tension[held]]), here) < 1e-11

    def at(q_D=0.0, v_D=0.0, q_K=0.0, v_K=0.0, acc=0.0, u=0.0, p=None):
        changed = (
            puppet
            if p is None
            else puppet.with_parameters(
                {
                    name: value + d
                    for (name, value), d in zip(puppet.tree.parameters.items(), p, strict=True)
                }
            )
        )
        zero_D, zero_K = np.zeros(t.n_vD), np.zeros(t.n_vK)
        state = x.replace(
            q_D=moved(x.q_D, zero_D + q_D, t.scalars_D, t.quaternions_D),
            v_D=x.v_D + v_D,
            q_K=moved(x.q_K, zero_K + q_K, t.scalars_K, t.quaternions_K),
            v_K=x.v_K + v_K,
        )
        return accelerations(changed, rows, state, acc_K + acc, u_D + u)

    names = {"acc_K": "acc", "u_D": "u"}
    for name in ("q_D", "v_D", "q_K", "v_K", "acc_K", "u_D", "p"):
        partial = np.concatenate(
            [getattr(lin.acc, name), getattr(lin.tension_partials, name)[held]]
        )
        if not partial.shape[1]:
            continue
        key = names.get(name, name)
        wanted = difference(lambda d, key=key: at(**{key: d}), partial.shape[1], 1e-3)
        assert worst(partial, wanted) < bound, name
    free = np.setdiff1d(np.arange(len(lin.tension)), held)
    assert not np.any(lin.tension_partials.q_D[free])


def test_partials_are_those_of_the_compiled_accelerations(rig):
    check_partials(rig, ("lift", "over", "stay", "shoulder.cone"), seed=1, bound=1e-8)
    check_partials(rig, ("stay", "shoulder.twist.upper"), seed=2, bound=1e-8)
    check_partials(rig, (), seed=3, bound=1e-8)


def test_partials_of_the_arm(arm):
    check_partials(arm, ("hand",), seed=4, bound=1e-8)


def test_partials_of_the_marionette(marionette):
    """25 degrees of freedom, seven strings."""
    rows = [string.name for string in marionette.tree.strings]
    check_partials(marionette, rows, seed=5, bound=1e-8)


def test_the_mode_is_that_of_the_accelerations(arm):
    x = arm.rest({"hand.length": 0.8})
    lin = arm.linearise(x)
    acc_D, tension = arm.forward_dynamics(x)
    assert lin.rows == ("hand",)
    assert np.max(np.abs(lin.acc_D - acc_D)) < 1e-12
    assert np.max(np.abs(lin.tension - tension)) < 1e-12
    slack = arm.linearise(arm.state({"hand.length": 2.0}))
    assert slack.rows == () and not np.any(slack.tension_partials.q_D)


def test_derivatives_are_compiled_at_first_use():
    arm = fan.puppets.arm2d()
    fan.simulate(arm, arm.rest(), t_end=0.1)
    assert "derivatives" not in vars(arm.libraries)
    arm.linearise(arm.rest())
    assert "derivatives" in vars(arm.libraries)
    assert arm.with_parameters({"m2": 0.2}).libraries.derivatives is arm.libraries.derivatives


def test_derivatives_of_quadratic_drag_exist_at_rest(rig):
    lin = rig.linearise(rig.state())
    assert np.all(np.isfinite(lin.A)) and np.all(np.isfinite(lin.B_p))


def test_an_unknown_row_is_named(arm):
    with pytest.raises(fan.errors.UnknownNameError, match="did you mean 'hand'"):
        arm.linearise(arm.rest(), rows=["hnad"])


def test_the_linear_system_predicts_the_motion(rig):
    """z(h) = exp(A h) z(0) to first order in h, for a state with turning bodies."""
    t, rows = rig.coordinates, ("lift", "stay")
    x, acc_K, u_D = somewhere(rig, 6)
    lin = rig.linearise(x, acc_K, u_D, rows)

    def rates(z: np.ndarray) -> np.ndarray:
        """dz/dt of the deviation of a neighbour from the motion through x, at its start."""
        n, k = t.n_vD, t.n_vK
        parts = np.split(z, np.cumsum([n, n, k]))

        def after(h: float) -> np.ndarray:
            out = []
            for q, v, dq, dv, scalars, quaternions in (
                (x.q_D, x.v_D, parts[0], parts[1], t.scalars_D, t.quaternions_D),
                (x.q_K, x.v_K, parts[2], parts[3], t.scalars_K, t.quaternions_K),
            ):
                mine = moved(q, h * v, scalars, quaternions)
                theirs = moved(q, dq, scalars, quaternions)
                theirs = moved(theirs, h * (v + dv), scalars, quaternions)
                out += [apart(mine, theirs, len(v), scalars, quaternions)]
            return np.concatenate(out)

        dq = (after(1e-4) - after(-1e-4)) / 2e-4
        other = x.replace(
            q_D=moved(x.q_D, parts[0], t.scalars_D, t.quaternions_D),
            v_D=x.v_D + parts[1],
            q_K=moved(x.q_K, parts[2], t.scalars_K, t.quaternions_K),
            v_K=x.v_K + parts[3],
        )
        acc = accelerations(rig, rows, other, acc_K, u_D)[:n]
        return np.concatenate([dq[:n], acc, dq[n:], np.zeros(k)])

    size = len(lin.A)
    assert len(lin.names) == size and lin.B.shape == (size, t.n_vK)
    assert worst(lin.A, difference(rates, size, 1e-3)) < 1e-8


def derivatives_of_the_solved_form(puppet: fan.Marionette) -> ca.Function:
    """acc_D and the tensions of all strings, solved by Cholesky and then differentiated."""
    E = puppet.equations
    s, values_of = E.system.symbols, E["dynamics"]
    values = values_of(s.q_D, s.v_D, s.q_K, s.v_K, s.acc_K, s.u_D, s.p)
    out = dict(zip(values_of.name_out(), values, strict=True))
    R, b = ca.chol(out["G"]), ca.vertsplit(out["gamma"] + out["a0"])
    n, y, tension = len(b), [], []
    for i in range(n):
        y.append((b[i] - sum(R[j, i] * y[j] for j in range(i))) / R[i, i])
    for i in reversed(range(n)):
        known = sum(R[i, i + 1 + j] * x for j, x in enumerate(tension))
        tension.insert(0, (y[i] - known) / R[i, i])
    tension = ca.vertcat(*tension)
    acc = E["solve_factor"](out["L"], out["w0"] - out["W"] @ tension)
    arguments = [s.q_D, s.v_D, s.q_K, s.v_K, s.acc_K, s.u_D, s.p]
    by = ca.vertcat(*arguments)
    slopes = ca.jtimes(ca.cse(ca.vertcat(acc, tension)), by, ca.SX.eye(by.numel()))
    return ca.Function("solved", arguments, [ca.cse(ca.densify(slopes))])


def test_derivatives_of_the_solved_form_agree(arm):
    """This is tested on the arm, which has scalar coordinates."""
    solved = derivatives_of_the_solved_form(arm)
    x, acc_K, u_D = somewhere(arm, 7)
    lin = arm.linearise(x, acc_K, u_D, ("hand",))
    wanted = np.array(solved(x.q_D, x.v_D, x.q_K, x.v_K, acc_K, u_D, arm.p))
    for part, row in ((lin.acc, wanted[:2]), (lin.tension_partials, wanted[2:])):
        mine = np.concatenate([getattr(part, name) for name in vars(part)], axis=1)
        assert worst(mine, row) < 1e-12


def test_operations_of_the_marionettes_derivatives(marionette):
    """About 31,000; six times as many if the solved form of all strings is differentiated."""
    counts = generate(marionette.equations, "derivatives").operations
    counts = {name: n for name, n in counts.items() if "_by" in name}
    solved = program(derivatives_of_the_solved_form(marionette)).operations
    print(counts, "together", sum(counts.values()), "of the solved form", solved)
    assert sum(counts.values()) < 32_000
    assert solved > 5 * sum(counts.values())


# -- one step of the time-stepper ----------------------------------------------------------------


def check_step(puppet: fan.Marionette, x: fan.State, acc_K, u_D, dt: float, bound: float):
    t = puppet.coordinates
    n, k = t.n_vD, t.n_vK
    lin = puppet.linearise_step(x, acc_K, u_D, dt)

    def step(z=None, acc=0.0, u=0.0, p=None) -> np.ndarray:
        changed = (
            puppet
            if p is None
            else puppet.with_parameters(
                {
                    name: value + d
                    for (name, value), d in zip(puppet.tree.parameters.items(), p, strict=True)
                }
            )
        )
        parts = np.split(np.zeros(2 * n + 2 * k) if z is None else z, np.cumsum([n, n, k]))
        start = x.replace(
            q_D=moved(x.q_D, parts[0], t.scalars_D, t.quaternions_D),
            v_D=x.v_D + parts[1],
            q_K=moved(x.q_K, parts[2], t.scalars_K, t.quaternions_K),
            v_K=x.v_K + parts[3],
        )
        stepper = Stepper(changed, start, "timestepping", changed.run_options(dt=dt))
        y, to = stepper.advance(dt, acc_K + acc, u_D=u_D + u), lin.x_next
        return np.concatenate(
            [
                apart(to.q_D, y.q_D, n, t.scalars_D, t.quaternions_D),
                y.v_D - to.v_D,
                apart(to.q_K, y.q_K, k, t.scalars_K, t.quaternions_K),
                y.v_K - to.v_K,
                dt * dt * (stepper.tension - lin.tension),
            ]
        )

    pull = np.concatenate(
        [
            lin.tension_partials.q_D,
            lin.tension_partials.v_D,
            lin.tension_partials.q_K,
            lin.tension_partials.v_K,
        ],
        axis=1,
    )
    cases = (
        ("z", lin.A, pull, 3e-7),
        ("acc", lin.B, lin.tension_partials.acc_K, 3e-4),
        ("u", lin.B_u, lin.tension_partials.u_D, 1e-5),
        ("p", lin.B_p, lin.tension_partials.p, 1e-5),
    )
    for name, state, tension, size in cases:
        if not state.shape[1]:
            continue
        partial = np.concatenate([state, dt * dt * tension])
        wanted = difference(lambda d, name=name: step(**{name: d}), partial.shape[1], size)
        assert worst(partial, wanted) < bound, name


def test_a_step_of_the_time_stepper(arm, rig):
    x, _, _ = somewhere(arm, 8)
    x = arm.project(arm.rest({"hand.length": 0.8}).replace(v_D=0.2 * x.v_D))
    acc_K, u_D = np.array([0.4, -0.7]), np.array([0.01, -0.02])
    for _ in range(3):  # in motion, with the constraint violation of time-stepping
        check_step(arm, x, acc_K, u_D, 0.002, 1e-7)
        x = arm.linearise_step(x, acc_K, u_D).x_next
    at_rest = rig.rest()
    turning = at_rest.replace(v_K=np.linspace(-0.3, 0.4, rig.coordinates.n_vK))
    lin = rig.linearise_step(turning)
    assert "stay" in lin.rows
    acc_K = np.linspace(1.0, -1.0, rig.coordinates.n_vK)
    check_step(rig, lin.x_next, acc_K, np.full(rig.coordinates.n_vD, 0.01), 0.01, 1e-7)


def test_steps_follow_one_another(arm):
    """The product of ten steps' matrices is the derivative of ten steps."""
    t, dt = arm.coordinates, 0.002
    x0 = arm.rest({"hand.length": 0.8})
    acc_K, whole, x = np.array([0.5, 0.3]), np.eye(8), x0
    for _ in range(10):
        lin = arm.linearise_step(x, acc_K, dt=dt)
        whole, x = lin.A @ whole, lin.x_next

    def run(dz: np.ndarray) -> np.ndarray:
        q_D, v_D, q_K, v_K = np.split(dz, 4)
        start = x0.replace(q_D=x0.q_D + q_D, v_D=x0.v_D + v_D, q_K=x0.q_K + q_K, v_K=x0.v_K + v_K)
        y = arm.stepper(start, method=fan.TimeStepping(dt=dt, extrapolate=False)).advance(
            10 * dt, acc_K
        )
        return np.concatenate([y.q_D, y.v_D, y.q_K, y.v_K])

    assert t.n_vD == t.n_vK == 2
    assert worst(whole, difference(run, 8, 3e-7)) < 1e-6
