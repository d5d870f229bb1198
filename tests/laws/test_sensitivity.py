"""Sensitivities of whole runs, compared with differences of runs and a closed form."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.perform.demo import performance
from oracles.differences import difference, moved, worst

pytestmark = pytest.mark.slow

DROP = """
puppet: drop
bodies:
  - {name: bob, joint: {type: prismatic, axis: [0, 0, 1]}, mass: 0.5}
strings:
  - name: line
    path: [{body: bob}, {world: [0, 0, 0]}]
    length: {parameter: length, value: 1.0}
    restitution: {parameter: bounce, value: 0.6}
pose: {bob: -0.6}
"""

FINE = {"method": fan.Event(rtol=1e-13, atol=1e-13), "effort": False}


def fallen(z, v, length, e, t_end: float, g: float = 9.81):
    """(z, v) at t_end of a bob that falls, bounces on its string and falls again, and the number
    of bounces.
    """
    t, bounces = 0.0, 0
    while True:
        rest = (v + (v * v + 2.0 * g * (z + length)) ** 0.5) / g
        if (t + rest).real > t_end:
            rest = t_end - t
            return np.array([z + v * rest - g * rest * rest / 2.0, v - g * rest]), bounces
        z, v, t, bounces = -length, -e * (v - g * rest), t + rest, bounces + 1


def test_a_bob_that_bounces_on_its_string():
    """Complex steps through the closed form of three bounces, by start, length and restitution."""
    drop = fan.loads(DROP)
    x0, values = drop.state({"bob": -0.6, "v:bob": 0.2}), np.array([-0.6, 0.2, 1.0, 0.6])
    names = list(drop.tree.parameters)
    order = [names.index(name) for name in ("length", "bounce")]
    wanted = np.zeros((2, 4))
    for i in range(4):
        step = np.zeros(4, dtype=complex)
        step[i] = 1e-30j
        end, bounces = fallen(*(values + step), t_end=0.9)
        wanted[:, i] = end.imag / 1e-30
    assert bounces == 3
    result = fan.dynamics.sensitivity(drop, x0, t_end=0.9)
    assert len(result.passages) == 3 and result.differentiable
    assert worst(result.by_x0[-1], wanted[:, :2]) < 1e-9
    assert worst(result.by_p[-1][:, order], wanted[:, 2:]) < 1e-9
    first = result.passages[0]
    impact = np.sqrt(0.2**2 + 2 * 9.81 * 0.4)
    # dz+ = -e dz-, dv+ = -e dv- - (1 + e) g dz- / speed: the ball on a table.
    by_hand = np.array([[-0.6, 0.0], [1.6 * 9.81 / impact, -0.6]])
    assert worst(first.jump, by_hand) < 1e-9 and abs(first.speed - impact) < 1e-10


@pytest.fixture(scope="module")
def swing() -> tuple[fan.Marionette, fan.State, fan.Input]:
    """The arm, caught and released four times within half a second."""
    arm = fan.puppets.arm2d()
    values = {"shoulder": -0.2, "elbow": 0.6, "hand.length": 0.95, "v:elbow": 0.5}
    x0 = arm.project(arm.state(values | {"v:shoulder": -0.3}))
    lengths = [(0, 0.95), (0.5, 0.70), (0.75, 0.95)]
    points = {"hand.length": lengths, "hand.x": [(0, 0.45), (0.75, 0.6)]}
    return arm, x0, fan.Input.waypoints(arm, points)


def end(puppet: fan.Marionette, x0: fan.State, inputs: fan.Input, t_end: float) -> np.ndarray:
    run = fan.simulate(puppet, x0, inputs, t_end, **FINE)
    return np.concatenate([run.q_D[-1], run.v_D[-1]])


def test_a_run_through_catches_and_releases(swing):
    """Derivatives by the start, the parameters, and towards other inputs."""
    arm, x0, lift = swing
    other = fan.Input.waypoints(
        arm,
        {"hand.length": [(0, 0.96), (0.6, 0.75), (0.75, 0.99)], "hand.x": [(0, 0.45), (0.75, 0.7)]},
    )
    result = fan.dynamics.sensitivity(arm, x0, lift, 0.6, toward=[other], save_at=[0.05, 0.3])
    assert [event.kind for event in result.run.events] == ["catch", "release"] * 2
    assert len(result.passages) == 2 and result.differentiable
    assert {0.05, 0.3} <= set(result.t) and result.t[0] == 0.0 and result.t[-1] == 0.6

    def by_start(d: np.ndarray, t_end: float = 0.6) -> np.ndarray:
        start = x0.replace(q_D=x0.q_D + d[:2], v_D=x0.v_D + d[2:])
        return end(arm, start, lift, t_end)

    def by_parameters(d: np.ndarray) -> np.ndarray:
        values = zip(arm.tree.parameters.items(), d, strict=True)
        changed = arm.with_parameters({name: value + x for (name, value), x in values})
        return end(changed, x0, lift, 0.6)

    breaks = np.union1d(lift.breaks, other.breaks)
    ours, theirs = (on_breaks(inputs, x0, breaks) for inputs in (lift, other))

    def by_inputs(s: np.ndarray) -> np.ndarray:
        mix = {
            name: (1 - s[0]) * getattr(ours, name) + s[0] * getattr(theirs, name)
            for name in ("coef", "base")
        }
        inputs = dataclasses.replace(ours, **mix)
        return end(arm, x0.replace(q_K=inputs.evaluate(0.0)[0]), inputs, 0.6)

    assert worst(result.by_x0[-1], difference(by_start, 4, 1e-4)) < 1e-8
    at = int(np.flatnonzero(result.t == 0.3)[0])
    assert worst(result.by_x0[at], difference(lambda d: by_start(d, 0.3), 4, 1e-4)) < 1e-8
    assert worst(result.by_p[-1], difference(by_parameters, 2, 1e-4)) < 1e-8
    assert worst(result.toward[-1], difference(by_inputs, 1, 1e-4)) < 1e-8


def test_a_run_by_the_values_of_its_waypoints(swing):
    """Derivatives by the value of every waypoint are exact, through catches and releases."""
    arm, x0, _ = swing
    # The second point's slope is a mean, not linear in the values.
    lengths = [(0, 0.95), (0.2, 0.9), (0.5, 0.70), (0.75, 0.95)]
    points = {"hand.length": lengths, "hand.x": [(0, 0.45), (0.3, 0.5), (0.75, 0.6)]}
    by = fan.motion.InputDerivative.of_waypoints(arm, points)
    inputs = fan.Input.waypoints(arm, points)
    result = fan.dynamics.sensitivity(arm, x0, inputs, 0.6, along=by, save_at=[0.3])
    assert result.differentiable and len(result.passages) >= 2
    assert result.toward.shape[-1] == 0 and result.along.shape[1:] == (4, len(by))

    def by_values(d: np.ndarray) -> np.ndarray:
        step = iter(d)
        changed = {
            n: [(t, q + next(step)) for t, q in waypoints] for n, waypoints in points.items()
        }
        changed_inputs = fan.Input.waypoints(arm, changed)
        start = changed_inputs.evaluate(0.0)[0]
        q_K = np.array(x0.q_K)
        for q, v in arm.coordinates.scalars_K:
            q_K[q] = start[q] if changed_inputs.named[v] else q_K[q]
        return end(arm, x0.replace(q_K=q_K), changed_inputs, 0.6)

    assert worst(result.along[-1], difference(by_values, len(by), 1e-4)) < 1e-7


def on_breaks(inputs: fan.Input, x0: fan.State, breaks: np.ndarray) -> fan.Input:
    """The same input with more breaks: its polynomials, shifted to the new pieces."""
    i = np.searchsorted(inputs.breaks, breaks[:-1], side="right") - 1
    coef = np.array(inputs.coef[i])
    for piece, shift in zip(coef, breaks[:-1] - inputs.breaks[i], strict=True):
        for row in piece:
            row[:] = np.polynomial.Polynomial(row)(np.polynomial.Polynomial([shift, 1.0])).coef
    return dataclasses.replace(inputs, breaks=breaks, coef=coef, base=inputs.base[i])


def test_a_start_on_a_taut_string(swing):
    """A change that the string forbids is replaced by the nearest allowed one."""
    arm, _, _ = swing
    x0 = arm.rest({"hand.length": 0.8})
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (0.3, 0.7)]})
    slower = fan.Input.waypoints(arm, {"hand.length": [(0, 0.81), (0.3, 0.72)]})
    result = fan.dynamics.sensitivity(arm, x0, lift, 0.25, toward=[slower])
    A, M = arm.A_D(x0), arm.mass_matrix(x0)
    P = np.eye(2) - np.linalg.solve(M, A.T) @ np.linalg.solve(A @ np.linalg.solve(M, A.T), A)
    assert worst(result.by_x0[0][:2, :2], P) < 1e-12 and worst(result.by_x0[0][2:, 2:], P) < 1e-12
    free = np.linalg.svd(A)[2][1]

    def along(s: np.ndarray) -> np.ndarray:
        """The start moved along the string's circle, and back onto it by Newton's method."""
        x = x0.replace(q_D=x0.q_D + s[0] * free, v_D=s[1] * free)
        for _ in range(6):
            h, A = arm.constraint(x), arm.A_D(x)
            pull = np.linalg.solve(M, A.T)
            x = x.replace(q_D=x.q_D - pull @ np.linalg.solve(A @ pull, h))
        A = arm.A_D(x)
        v_D = x.v_D - A[0] * (A[0] @ x.v_D) / (A[0] @ A[0])
        return end(arm, x.replace(v_D=v_D), lift, 0.25)

    wanted = difference(along, 2, 1e-3)
    mine = result.by_x0[-1] @ np.kron(np.eye(2), free[:, None])
    assert worst(mine, wanted) < 1e-8
    # The start on a longer string is the nearest one.
    assert abs(A[0] @ result.toward[0][:2, 0] - 0.01) < 1e-12


TUMBLER = """
puppet: tumbler
bodies:
  - name: box
    joint: {type: free}
    shapes: [{type: box, size: [0.3, 0.2, 0.1], mass: 0.5}]
    drag: {quadratic: 0.2}
strings:
  - name: left
    path: [{body: box, at: [-0.15, 0.05, 0.05]}, {driven: [x], at: [-0.2, 0, 1]}]
    length: 0.95
  - name: right
    path: [{body: box, at: [0.15, -0.02, 0.05]}, {world: [0.2, 0.1, 1]}]
    length: 1.0
    restitution: {parameter: bounce, value: 0}
"""


@pytest.mark.parametrize(("bounce", "t_end", "catches"), [(0.0, 0.8, 2), (0.4, 0.47, 4)])
def test_a_tumbling_box(bounce, t_end, catches):
    """Orientations and two strings: catches of one while the other is slack or taut, bounces."""
    box = fan.loads(TUMBLER).with_parameters({"bounce": bounce})
    t = box.coordinates
    x0 = box.state({"box.z": 0.3, "v:box.wx": 2.0, "v:box.wy": 1.0, "v:box.x": 0.5, "v:box.z": 1.0})
    result = fan.dynamics.sensitivity(box, x0, t_end=t_end)
    caught = [passage.rows for passage in result.passages]
    assert (
        set(caught) == {("left",), ("right",)} and len(caught) == catches and result.differentiable
    )

    def by_start(d: np.ndarray) -> np.ndarray:
        q_D = moved(x0.q_D, d[:6], t.scalars_D, t.quaternions_D)
        start = x0.replace(q_D=q_D, v_D=x0.v_D + d[6:])
        return outcome(box, start)

    def outcome(puppet: fan.Marionette, start: fan.State) -> np.ndarray:
        run = fan.simulate(puppet, start, t_end=t_end, **FINE)
        assert [e.name for e in run.events] == [e.name for e in result.run.events]
        return np.concatenate([puppet.poses(run.q_D[-1], run.q_K[-1])[0].ravel(), run.v_D[-1]])

    wanted = difference(by_start, 12, 1e-5)
    here = result.run.state(-1)
    to_pose = difference(
        lambda d: box.poses(moved(here.q_D, d, t.scalars_D, t.quaternions_D), here.q_K)[0].ravel(),
        6,
        1e-3,
    )
    mine = np.concatenate([to_pose @ result.by_x0[-1][:6], result.by_x0[-1][6:]])
    assert worst(mine, wanted) < 1e-7
    if bounce:
        wanted = difference(
            lambda d: outcome(box.with_parameters({"bounce": bounce + d[0]}), x0), 1, 1e-5
        )
        mine = np.concatenate([to_pose @ result.by_p[-1][:6], result.by_p[-1][6:]])
        assert worst(mine, wanted) < 1e-7


def test_the_marionettes_catches():
    """A knee's string snaps taut and releases all others, which are caught one after the other."""
    puppet = fan.puppets.marionette()
    x0, inputs, _ = performance(puppet)
    x0 = fan.simulate(puppet, x0, inputs, 3.755, **FINE).state(-1)
    t, taut, t_end = puppet.coordinates, np.flatnonzero(x0.taut), 3.7655
    result = fan.dynamics.sensitivity(puppet, x0, inputs, t_end)
    assert len(result.passages) == 5 and result.passages[0].rows == ("knee_left",)
    change = result.by_x0[0] @ np.random.default_rng(1).normal(size=2 * t.n_vD)

    def ended(s: np.ndarray) -> np.ndarray:
        """v_D at the end after a start moved along the change, and back onto its strings."""
        d = s[0] * change
        q_D = moved(x0.q_D, d[: t.n_vD], t.scalars_D, t.quaternions_D)
        x = x0.replace(q_D=q_D, v_D=x0.v_D + d[t.n_vD :])
        for _ in range(6):
            h, A = puppet.constraint(x)[taut], puppet.A_D(x)[taut]
            pull = np.linalg.solve(puppet.mass_matrix(x), A.T)
            back = -pull @ np.linalg.solve(A @ pull, h)
            x = x.replace(q_D=moved(x.q_D, back, t.scalars_D, t.quaternions_D))
        A = puppet.A_D(x)[taut]
        rate = A @ x.v_D + puppet.A_K(x)[taut] @ x.v_K
        pull = np.linalg.solve(puppet.mass_matrix(x), A.T)
        x = x.replace(v_D=x.v_D - pull @ np.linalg.solve(A @ pull, rate))
        run = fan.simulate(puppet, x, inputs, t_end, **FINE)
        events = [(e.name, e.kind) for e in run.events]
        assert events == [(e.name, e.kind) for e in result.run.events]
        return run.v_D[-1]

    wanted = difference(ended, 1, 1e-6)
    assert worst(result.by_x0[-1][t.n_vD :] @ change[:, None], wanted) < 1e-6


def test_slipping_runs_have_no_sensitivity():
    text = DROP.replace("restitution: {parameter: bounce, value: 0.6}", "max_tension: 8")
    with pytest.raises(fan.errors.StateError, match="line slips"):
        winch = fan.loads(text)
        fan.dynamics.sensitivity(winch, winch.state(), t_end=0.6)


def test_simultaneous_catches_may_separate_by_a_change_of_the_input():
    """Two parallel strings catch together after changes of the state, but not of one length."""
    twins = fan.loads("""
puppet: twins
bodies:
  - {name: load, joint: {type: prismatic, axis: [0, 0, 1]}, mass: 1}
strings:
  - {name: left, path: [{body: load, at: [-1, 0, 0]}, {world: [-1, 0, 1]}], length: driven}
  - {name: right, path: [{body: load, at: [1, 0, 0]}, {world: [1, 0, 1]}], length: driven}
""")
    both = fan.Input.hold(twins, 0.5)
    x0 = twins.state({"load": 0.2, "left.length": 1.0, "right.length": 1.0})
    longer = {"left.length": [(0, 1.0), (0.5, 1.01)]}
    longer_left = fan.Input.waypoints(twins, longer)
    two = fan.Input.waypoints(twins, longer | {"right.length": longer["left.length"]})

    def differentiable(other: fan.Input | None) -> list[bool]:
        toward = [] if other is None else [other]
        answer = fan.dynamics.sensitivity(twins, x0, both, 0.5, toward=toward)
        return [passage.differentiable for passage in answer.passages if "left" in passage.rows]

    assert (
        differentiable(None) == [True]
        and differentiable(two) == [True]
        and differentiable(longer_left) == [False]
    )
