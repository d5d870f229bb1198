"""Generated tables, compared with the functions that they describe."""

from __future__ import annotations

import re

import casadi as ca
import numpy as np
import pytest

import fantoccini as fan
from cpp.toolchain import equations
from fantoccini import puppets
from fantoccini.kernel.codegen import tables_text
from fantoccini.kernel.codegen.straight import pieces, program

pytestmark = pytest.mark.medium

NAMES = ("arm2d", "arm3d", "crane", "marionette", "marionette_bar", "stand6", "string_pendulum")


def table(name: str, array: str) -> list[int]:
    """An array of integers in the generated tables of a bundled puppet."""
    match = re.search(rf" {array}(?:\[\d+\])? = {{?([^;}}]*)}}?;", tables_text(equations(name)))
    return [int(word) for word in match[1].split(",")]


def varying_entries(name: str, function: str, result: str) -> set[int]:
    """Entries of a result that are not constant zeros."""
    whole_function = program(equations(name)[function])
    index = whole_function.names.index(result)
    zero = {
        entry
        for r, entry, value in whole_function.results
        if r == index
        and whole_function.statements[value].operation == ca.OP_CONST
        and whole_function.statements[value].constant == 0.0
    }
    return {entry for r, entry, _ in whole_function.results if r == index} - zero


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("function", ["dynamics", "step_dynamics"])
def test_a_strings_column_has_only_the_entries_of_the_table(name, function):
    begin, entry = table(name, "string_begin"), table(name, "string_entry")
    n = equations(name).tree.coordinates.n_vD
    listed = {n * r + k for r in range(len(begin) - 1) for k in entry[begin[r] : begin[r + 1]]}
    entries = varying_entries(name, function, "W")
    assert entries <= listed
    assert len(entries) >= 0.8 * len(listed), "the table lists constant zeros"


@pytest.mark.parametrize("name", NAMES)
def test_puppets_that_driven_joints_do_not_carry_are_not_coupled(name):
    (coupled,) = table(name, "coupled")
    assert coupled == bool(varying_entries(name, "step_dynamics", "M_DK_v_K"))


def test_a_load_below_a_driven_cart_is_coupled():
    cart = "{name: cart, joint: {type: prismatic, axis: [1, 0, 0], driven: true}, mass: 1.0}"
    load = (
        "{name: load, parent: cart, joint: {type: revolute, axis: [0, 1, 0]}, mass: 1.0, "
        "com: [0, 0, -1.0]}"
    )
    hung = fan.loads(f"puppet: hung\nbodies:\n  - {cart}\n  - {load}\n").equations
    assert "bool coupled = 1;" in tables_text(hung)
    assert "bool coupled = 0;" in tables_text(equations("marionette"))


@pytest.mark.parametrize("name", NAMES)
def test_rates_of_limits_are_their_jacobians_times_the_velocity(name):
    marionette = getattr(puppets, name)()
    tree, rng = marionette.tree, np.random.default_rng(3)
    x = marionette.rest() if tree.strings else marionette.state()
    v_D = rng.normal(size=tree.coordinates.n_vD)
    limits = len(tree.limits)
    J = marionette.A_D(x)[len(tree.strings) :]
    packed = np.zeros((3, limits))
    for i, limit in enumerate(tree.limits):
        place = tree.links[limit.link].v
        packed[: place.stop - place.start, i] = J[i, place]
    rates = np.array(equations(name)["limit_rates"](packed, v_D)).ravel()
    assert np.allclose(rates, J @ v_D, rtol=1e-14, atol=1e-14)


def test_constants_and_varying_lines_are_the_whole_function():
    whole_function = program(equations("marionette")["step_dynamics"])
    separate = pieces(whole_function, "f", 1000, ("W", "J_limit"))
    together = pieces(whole_function, "f", 1000)
    assert "f_constants" not in together.definition
    constants = [line for line in separate.definition.splitlines() if line.startswith("  res[")]

    def written(lines: list[str]) -> list[str]:
        return sorted(re.findall(r"res\[\d+\]\[\d+\] =", "\n".join(lines)))

    every = written(together.pieces)
    assert written([*separate.pieces, *constants]) == every
    assert len(constants) > 100
