"""Gradients of rollouts with contact: closed forms, products of steps, differences, refusals."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import G, thrown
from contact.files import ACROBAT, BALL, BALLS, BOX, CAPSULE, STACK
from oracles.differences import moved
from oracles.step_products import swept

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

DT = 0.002


@dataclass(frozen=True)
class Case:
    """A start with inputs of n steps."""

    puppet: fan.Marionette
    x: fan.State
    acc: np.ndarray
    force: np.ndarray

    @classmethod
    def of(
        cls, puppet: fan.Marionette, x: fan.State, n: int, seed: int | None = None, acc: float = 1.0
    ) -> Case:
        """Case with random inputs, or none."""
        t, rng = puppet.coordinates, np.random.default_rng(seed)
        size = 0.0 if seed is None else 1.0
        inputs = rng.normal(size=(n, t.n_vK)), rng.normal(size=(n, t.n_vD))
        return cls(puppet, x, size * acc * inputs[0], 0.1 * size * inputs[1])

    def rollout(self, extrapolate: bool = True) -> fan.dynamics.Rollout:
        run = self.puppet.rollout(self.x, self.acc, self.force, dt=DT, extrapolate=extrapolate)
        assert run.status is fan.Status.DONE
        assert run.differentiable.all()
        return run


def weights(run: fan.dynamics.Rollout) -> tuple[list[np.ndarray], np.ndarray]:
    """Weights of a linear cost: of the states (q_D, v_D, q_K, v_K) and of the tensions."""
    t, rng = run.coordinates, np.random.default_rng(2)
    widths = (t.n_vD, t.n_vD, t.n_vK, t.n_vK)
    tension = 0.01 * rng.normal(size=run.tension.shape)
    return [rng.normal(size=(len(run.q_D), w)) for w in widths], tension


def check_products(case: Case) -> fan.dynamics.Rollout:
    """A sweep is the product of the derivatives of all steps."""
    run = case.rollout(extrapolate=False)
    own, by_tension = weights(run)
    gradient = run.gradient(*own, by_tension)
    for name, expected in swept(case.puppet, run, case.acc, case.force, own, by_tension).items():
        size = np.max(np.abs(expected), initial=1e-6)
        assert np.allclose(getattr(gradient, name), expected, rtol=0, atol=1e-9 * size), name
    return run


@dataclass(frozen=True)
class Steps:
    """Steps of differences by each quantity."""

    q_D: float = 1e-6
    v_D: float = 1e-6
    q_K: float = 1e-6
    v_K: float = 1e-6
    acc_K: float = 1e-5
    u_D: float = 1e-5
    p: float = 1e-6


def check_differences(case: Case, steps: Steps = Steps()) -> fan.dynamics.Rollout:
    """Agreement along random directions to 1e-7, with the time-stepper's extrapolation.

    In each step the active rows and the numbers of sticking and sliding points are the same in all
    rollouts.
    """
    puppet, t, run = case.puppet, case.puppet.coordinates, case.rollout()
    own, by_tension = weights(run)
    gradient = run.gradient(*own, by_tension)
    rng = np.random.default_rng(3)

    def cost(at: fan.dynamics.Rollout) -> float:
        dq_D = puppet.difference(run.q_D, at.q_D)
        dq_K = puppet.difference(run.q_K, at.q_K, driven=True)
        parts = zip(own, (dq_D, at.v_D - run.v_D, dq_K, at.v_K - run.v_K), strict=True)
        pulls = np.sum(by_tension * (at.tension - run.tension))
        return float(sum(np.sum(w * d) for w, d in parts) + pulls)

    def changed(name: str, d: np.ndarray) -> float:
        by = {
            f.name: np.zeros_like(getattr(gradient, f.name)) for f in dataclasses.fields(gradient)
        }
        by[name] = d
        x = case.x
        moved_state = x.replace(
            q_D=moved(x.q_D, by["q_D"], t.scalars_D, t.quaternions_D),
            v_D=x.v_D + by["v_D"],
            q_K=moved(x.q_K, by["q_K"], t.scalars_K, t.quaternions_K),
            v_K=x.v_K + by["v_K"],
        )
        at = puppet.rollout(
            moved_state, case.acc + by["acc_K"], case.force + by["u_D"], p=puppet.p + by["p"], dt=DT
        )
        for modes in ("held", "n_contacts", "n_sliding"):
            assert (getattr(at, modes) == getattr(run, modes)).all(), (name, modes)
        return cost(at)

    for name, h in dataclasses.asdict(steps).items():
        values = getattr(gradient, name)
        if not values.size:
            continue
        d = rng.normal(size=values.shape)
        fine, coarse = (
            (changed(name, k * h * d) - changed(name, -k * h * d)) / (2 * k * h) for k in (1, 2)
        )
        terms = values * d
        error = abs(np.sum(terms) - (4 * fine - coarse) / 3) / np.sum(np.abs(terms))
        assert error < 1e-7, (name, error)
    return run


def acrobat(seed: int, n: int = 30, slack: float = 0.0) -> Case:
    """One leg stands on a driven, turning tray; the rope is slack at first [m]."""
    puppet = fan.loads(ACROBAT)
    z = 0.02 + 0.2 * np.cos(0.2) - 0.06
    x = puppet.state({"body.z": z, "leg": 0.2, "rope.length": 1.2 - z + slack})
    rng = np.random.default_rng(seed)
    v_K, v_D = 0.1 * rng.normal(size=7), 0.3 * rng.normal(size=10)
    v_D[2] -= 0.3
    return Case.of(puppet, x.replace(v_K=v_K, v_D=v_D), n, seed)


def test_a_sliding_box_stops_at_the_distance_of_its_speed():
    """Until it sticks, x+ = x + dt v+ and v+ = v + (u/m - mu g) dt; then it stays."""
    box = fan.loads(BOX)
    n = 30
    case = Case.of(box, thrown(box, {"body.z": 0.05}, {"body.x": 0.1}), n)
    run = case.rollout()
    slid = int(np.sum(run.n_sliding == 4))
    assert slid == int(0.1 / (0.4 * G * DT))
    assert (run.n_contacts == 4).all()
    last = np.zeros((n + 1, 6))
    last[-1, 0] = 1.0
    gradient = run.gradient(q_D=last)
    assert gradient.q_D[0] == pytest.approx(1.0, abs=1e-12)
    assert gradient.v_D[0] == pytest.approx(slid * DT, abs=1e-12)
    by_u = np.maximum(slid - np.arange(n), 0) * DT**2
    assert np.allclose(gradient.u_D[:, 0], by_u, rtol=0, atol=1e-12)


def test_a_bounce_reverses_the_derivative_of_the_speed():
    """dv/dv0 = dz/dz0 = -e after the impact, and dz/dv0 = -e t, for a later touch or none."""
    balls = fan.loads(BALLS)
    n = 40
    x = thrown(balls, {"a.z": 0.115, "b.z": 5.0}, {"a.z": -1.0})
    run = Case.of(balls, x, n).rollout()
    (k,) = np.flatnonzero(run.n_contacts)
    assert 0 < k < n - 1
    v, z = np.zeros((2, n + 1, 12))
    v[-1, 2] = z[-1, 2] = 1.0
    by_v, by_z = run.gradient(v_D=v), run.gradient(q_D=z)
    assert by_v.v_D[2] == pytest.approx(-0.5, abs=1e-12)
    assert by_v.q_D[2] == pytest.approx(0.0, abs=1e-9)
    assert by_z.v_D[2] == pytest.approx(-0.5 * n * DT, abs=1e-12)
    assert by_z.q_D[2] == pytest.approx(-0.5, abs=1e-9)


def test_a_landing_does_not_depend_on_its_height():
    """Without restitution a ball comes to rest on the floor, from any height and speed."""
    ball = fan.loads(BALL.replace("at: [0.02, 0.01, 0.03], ", ""))
    run = Case.of(ball, thrown(ball, {"body.z": 0.103}, {"body.z": -0.5}), 20).rollout()
    assert 0 < np.sum(run.n_contacts == 0) < 5
    last = np.zeros((21, 6))
    last[-1, 2] = 1.0
    gradient = run.gradient(q_D=last, v_D=last)
    assert np.allclose([gradient.q_D[2], gradient.v_D[2]], 0.0, rtol=0, atol=1e-9)
    assert np.allclose(gradient.u_D, 0.0, rtol=0, atol=1e-9)


def test_a_sweep_is_the_product_of_all_steps():
    """Steps depend on their state alone: sticking, sliding, redundant, on a driven tray."""
    box, ball, stack = fan.loads(BOX), fan.loads(BALL), fan.loads(STACK)
    run = check_products(Case.of(box, thrown(box, {"body.z": 0.05}, {"body.x": 0.1}), 30))
    assert set(run.n_sliding) == {0, 4}
    x = thrown(ball, {"body.z": 0.075}, {"body.x": 0.5, "body.z": -1, "body.wy": 4})
    run = check_products(Case.of(ball, x, 30))
    assert set(run.n_contacts) == {0, 1}
    check_products(Case.of(stack, stack.state({"a.z": 0.05, "b.z": 0.15}), 10))
    run = check_products(acrobat(7))
    assert set(run.n_contacts) == {0, 1} and run.active.any()


def test_gradients_agree_with_differences_of_rollouts():
    """A landing and rolling, a landing and sliding, a bounce off a ball, a capsule that slides."""
    ball, balls, capsule = fan.loads(BALL), fan.loads(BALLS), fan.loads(CAPSULE)
    above = {"body.z": 0.075}
    rolls = thrown(ball, above, {"body.x": 0.5, "body.z": -1, "body.wy": 4})
    run = check_differences(Case.of(ball, rolls, 40))
    assert run.n_contacts.tolist() == [0] * 2 + [1] * 38 and not run.n_sliding.any()
    slides = thrown(ball, above, {"body.x": 2, "body.y": 0.3, "body.z": -1, "body.wy": -4})
    run = check_differences(Case.of(ball, slides, 40))
    assert run.n_sliding.tolist() == [0] * 2 + [1] * 38
    place = {"a.z": 0.1, "b.x": 0.17 * 0.6, "b.z": 0.105 + 0.17 * 0.8}
    bounces = thrown(balls, place, {"b.x": 0.5, "b.y": 0.3, "b.z": -1})
    run = check_differences(Case.of(balls, bounces, 60))
    assert set(run.n_contacts) == {1, 2}
    speed = {"body.x": 0.3, "body.y": 0.4, "body.wz": 0.3}
    lies = thrown(capsule, {"body.z": 0.03}, speed)
    check_differences(Case.of(capsule, lies, 40), Steps(q_D=1e-8))


@pytest.mark.parametrize(("seed", "slack", "slides"), [(1, 0.0, 5), (27, 0.001, 0), (2, 0.002, 1)])
def test_differences_on_a_tray_and_a_rope_that_catches(seed, slack, slides):
    """The rope lifts the leg off the turning tray; parameters move joints and set a mass."""
    steps = Steps(q_D=1e-7, v_D=1e-5, q_K=1e-7, v_K=1e-5, acc_K=1e-3, u_D=1e-4, p=1e-7)
    run = check_differences(acrobat(seed, 20, slack), steps)
    assert run.n_sliding.sum() == slides
    assert run.n_contacts[0] == 1 and run.n_contacts[-1] == 0
    assert slack == 0.0 or (not run.active[0, 0] and run.active[-1, 0])


def test_the_bundled_marionette_on_its_feet():
    """Under random inputs its soles tip, slip and strike; thighs touch."""
    puppet = fan.puppets.promenade()
    x = puppet.rest()
    x = puppet.rest({"knee_right.length": x["knee_right.length"] - 0.03})
    steps = Steps(q_D=1e-7, v_D=3e-5, q_K=3e-8, v_K=2e-5, acc_K=1e-3, u_D=1e-5, p=1e-5)
    run = check_differences(Case.of(puppet, x, 40, 4), steps)
    assert len(set(run.n_contacts)) > 2 and run.n_sliding.any()
    assert len({tuple(row) for row in run.active}) > 1


def test_the_rollout_is_that_of_the_stepper():
    """The recorded contacts do not change later steps."""
    case = acrobat(27, 20)
    run = case.rollout()
    stepper = case.puppet.stepper(case.x, fan.TimeStepping(dt=DT))
    for i, (a, u) in enumerate(zip(case.acc, case.force, strict=True)):
        y = stepper.advance(DT, a, u_D=u)
        assert np.allclose(run.q_D[i + 1], y.q_D, rtol=0, atol=1e-12)
        assert np.allclose(run.v_D[i + 1], y.v_D, rtol=0, atol=1e-10)


def test_a_rollout_without_a_gradient_says_at_which_step_and_pair():
    """The refusals are those of linearise_step."""
    box = fan.loads(BOX)
    x = thrown(box, {"body.z": 0.05}, {"body.x": 1.0, "body.y": 0.5}).replace(t=2.0)
    run = box.rollout(x, np.zeros((3, 0)))
    reason = r"step 2, at 2.004 s, .* body\|floor: solids slide on so many points"
    for _ in range(2):
        with pytest.raises(fan.errors.StateError, match=reason):
            run.gradient()
    assert run.edges_of(2) == ("solids slide on so many points that their forces are not unique",)


def test_steps_on_an_edge_are_named():
    """A ball that a force just supports touches without force: its gradient is one-sided."""
    ball = fan.loads(BALL)
    lift = np.zeros(6)
    lift[2] = G
    run = ball.rollout(ball.state({"body.z": 0.07}), np.zeros((2, 0)), lift)
    assert not run.differentiable[0]
    assert run.edges_of(0) == ("a point touches without force",)
    run.gradient()
