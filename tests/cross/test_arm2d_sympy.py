"""The bundled planar arm against the paper's Eqs. 1-15 in SymPy and SciPy."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.documents import Parameter
from harness import Model, State, polynomial_input, start
from oracles import arm2d_events
from oracles.arm2d_sympy import Arm, model

pytestmark = pytest.mark.medium

KNOTS = {
    "ten events": (
        [
            (0, 0.41),
            (0.44, 0.42),
            (0.77, 0.45),
            (1.06, 0.44),
            (1.41, 0.34),
            (1.76, 0.42),
            (2.02, 0.35),
            (2.42, 0.4),
            (2.84, 0.46),
        ],
        [0.58, 0.75, 0.82, 0.77, 0.63, 0.65, 0.73, 0.77],
        10,
    ),
    "hard catches": (
        [
            (0, 0.3),
            (0.21, 0.35),
            (0.54, 0.46),
            (0.87, 0.42),
            (1.14, 0.5),
            (1.37, 0.47),
            (1.57, 0.43),
            (1.87, 0.34),
            (2.17, 0.47),
        ],
        [0.56, 0.84, 0.83, 0.65, 0.7, 0.63, 0.78, 0.84],
        8,
    ),
}
"""Waypoints of x, lengths at the same times after the first, number of events."""

START = np.array([-0.35, 0.85])


def number(value) -> float:
    return value.value if isinstance(value, Parameter) else float(value)


def numbers(puppet) -> Arm:
    """The oracle's numbers, read from the puppet file."""
    upper, lower = puppet.bodies
    (string,) = puppet.strings
    tip, above = string.path
    constants = Arm(
        m1=number(upper.mass),
        m2=number(lower.mass),
        I1=number(upper.inertia[1]),
        I2=number(lower.inertia[1]),
        L1=number(lower.joint.at[0]),
        L2=number(tip.at[0]),
        height=number(above.at[2]),
        gravity=-number(puppet.gravity[2]),
    )
    assert number(upper.com[0]) == constants.L1 / 2 and number(lower.com[0]) == constants.L2 / 2
    return constants


def test_matrices_equal_the_papers(arm):
    """M, C, g, h, A_D, A_K and the rates, to 1e-12 at random states."""
    constants, oracle = numbers(arm.puppet), model()
    ours = Model.of(arm.puppet)
    assert ours.table.v_D == ("shoulder", "elbow")
    assert ours.table.v_K == ("hand.x", "hand.length")
    rng = np.random.default_rng(1)
    for _ in range(50):
        q_D, v_D, v_K = rng.uniform(-3, 3, 2), rng.normal(size=2) * 3, rng.normal(size=2)
        q_K = np.array([rng.uniform(-1, 1), rng.uniform(0.3, 1.0)])
        state = State(q_D, v_D, q_K, v_K, np.zeros(2))
        at = (q_D, v_D, q_K, v_K, constants.numbers())
        pairs = {
            "M": ours.first_output("mass_matrix", state),
            "C": ours.first_output("coriolis", state)[:2, :2],
            "g": ours.first_output("gravity", state)[:, 0],
            "h": ours.first_output("constraint", state)[0, 0],
            "A_D": ours.first_output("A_D", state)[0],
            "A_K": ours.first_output("A_K", state)[0],
            "Adot_v": ours.first_output("Adot_v", state)[0, 0],
            "T": ours.first_output("kinetic", state)[0, 0],
            "V": ours.first_output("potential", state)[0, 0],
        }
        rates = {k: v[0] for k, v in ours.call("A_rate", state).items()}
        for name, value in (pairs | rates).items():
            np.testing.assert_allclose(value, oracle[name](*at), atol=1e-12, err_msg=name)


def test_marionette_gives_the_same_matrices(arm):
    """The marionette returns the same matrices as the derivation."""
    constants, oracle = numbers(arm.puppet), model()
    x = start(
        arm,
        {"shoulder": -0.3, "elbow": 0.9, "hand.x": 0.4, "hand.length": 0.7},
        {"shoulder": 1.0, "elbow": -2.0, "hand.x": 0.3, "hand.length": -0.2},
    )
    at = (x.q_D, x.v_D, x.q_K, x.v_K, constants.numbers())
    for name, value in (
        ("M", arm.mass_matrix(x)),
        ("C", arm.coriolis_matrix(x)[:2, :2]),
        ("g", arm.gravity(x)),
        ("A_D", arm.A_D(x)[0]),
        ("A_K", arm.A_K(x)[0]),
    ):
        np.testing.assert_allclose(value, oracle[name](*at), atol=1e-12, err_msg=name)
    np.testing.assert_allclose(arm.constraint(x)[0], oracle["h"](*at), atol=1e-12)


@pytest.mark.parametrize("case", KNOTS)
def test_event_driven_run_equals_scipys(arm, case):
    """Times, impulses and the end state agree to 1e-8, through slack and taut strings."""
    constants, (knots_x, lengths, n_events) = numbers(arm.puppet), KNOTS[case]
    x0 = knots_x[0][1]
    taut = float(model()["h"](START, (0, 0), (x0, 0.0), (0, 0), constants.numbers()))
    times = [t for t, _ in knots_x]
    drive = arm2d_events.waypoints(knots_x, list(zip(times, [taut, *lengths], strict=True)))
    theirs = arm2d_events.simulate(constants, START, (0.0, 0.0), drive, times[-1])
    assert len(theirs.events) == n_events

    state = start(
        arm, {"shoulder": START[0], "elbow": START[1], "hand.x": x0, "hand.length": taut}, {}
    )
    coef = {"hand.x": drive.coef[:, 0], "hand.length": drive.coef[:, 1]}
    inputs = polynomial_input(arm, drive.breaks, coef, state.q_K)
    run = fan.simulate(
        arm, state, inputs, t_end=times[-1], method=fan.Event(rtol=1e-12, atol=1e-12)
    )
    ours = [e for e in run.events if e.kind in ("catch", "release")]
    assert [e.kind for e in ours] == [kind for _, kind, _, _ in theirs.events]
    for event, (t, _, impulse, _) in zip(ours, theirs.events, strict=True):
        assert event.name == "hand"
        assert event.t == pytest.approx(t, abs=1e-8)
        assert event.impulse == pytest.approx(impulse, abs=1e-8)
    end = np.concatenate([run.q_D[-1], run.v_D[-1]])
    np.testing.assert_allclose(end, theirs.state, atol=1e-8)
