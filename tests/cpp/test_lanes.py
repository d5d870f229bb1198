"""Lanes: the time-stepper at width 8 equals eight independent scalar time-steppers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cpp.toolchain import SANITIZE, compile_program, equations, numbers, run_program, write_model
from fantoccini import puppets

pytestmark = [pytest.mark.slow, pytest.mark.long]

WIDTH, STEPS, DT = 8, 400, 2e-3

SEEDS = (0, 1, 9, 10)
"""Seeds. For some, a string's impulse lets a joint pass its limit within the step, in one lane
only: an active limit of one lane must not affect the others.
"""

TOLERANCE = {"q": 2e-14, "v": 1e-12, "slip": 1e-14, "tension": 1.2e-10, "ledger": 2e-13}
"""Relative tolerance of a step, about twice the measured difference. The step divides h by dt,
and v by dt again for the tension: the last digit of an inverse root, or of a sum that one of the
two has contracted, has 500 times the effect in each. Tensions differ by 1e-11, and by 6e-11 when
a winch has just gripped.
"""


def motions(name: str, seed: int, winches: str) -> str:
    """Starts and inputs of eight lanes that shake the puppet until strings go slack and catch.

    `firm` winches never slip; `slipping` ones do in every other string, at a tension that lets the
    puppet hang, and some rewind.
    """
    marionette = getattr(puppets, name)()
    rest, tree = marionette.rest(), equations(name).tree
    rng, table = np.random.default_rng(seed), tree.coordinates
    words = [STEPS, DT, 1.0, marionette.tension_cap]
    lengths = np.array([n.endswith(".length") for n in table.v_K])
    for lane in range(WIDTH):
        swing = 0.3 * lane / WIDTH
        words += [*rest.q_D, *(swing * rng.normal(size=table.n_vD)), *rest.slip, *rest.q_K]
        # At 4 Hz an amplitude of 2 cm needs more than the acceleration of gravity.
        amplitude = np.where(lengths, rng.uniform(0.04, 0.10), 0.02) * rng.uniform(
            0.5, 1.0, table.n_vK
        )
        words += [*amplitude, *rng.uniform(18, 28, table.n_vK), *rng.uniform(0, 6, table.n_vK)]
    words += list(tree.parameters.values())
    table = np.array([[1e300, 0.0, 0.0]] * len(tree.strings))
    if winches == "slipping":
        _, hanging = marionette.forward_dynamics(rest)
        table[::2, 0] = 1.5 * hanging[: len(table)][::2] + 0.02 * marionette.weight
        table[::4, 1] = 0.2
    words += list(table.ravel())  # type: ignore[attr-defined]
    return "\n".join(repr(float(x)) for x in words)


@pytest.mark.parametrize(
    ("name", "flags"),
    [
        pytest.param("arm2d", ("-O1", "-march=native", *SANITIZE), id="arm2d"),
        pytest.param("marionette", ("-O1", "-march=native"), id="marionette"),
    ],
)
def test_a_lane_equals_a_scalar_stepper_with_any_neighbours(name, flags, tmp_path):
    write_model(name, tmp_path)
    program = compile_program("lanes.cpp", tmp_path, *flags)
    for seed, winches in itertools.product(SEEDS, ("firm", "slipping")):
        counts = numbers(run_program(program, motions(name, seed, winches)))
        assert counts["numbers_left_out"] == 0
        assert counts["fewest_changes"] >= 3, "in every lane a string falls slack and is caught"
        assert counts["steps_unlike"] >= 50, "lanes are in different modes"
        assert counts["lanes_that_slipped"] >= (0 if winches == "firm" else 3)
        assert counts["unsettled"] == 0
        assert counts["modes_apart"] == 0
        for quantity, tolerance in TOLERANCE.items():
            assert counts[quantity] <= tolerance, quantity
        assert counts["bits_apart"] == 0
