"""Declared functions of the contract are derived, compiled and documented as declared."""

from __future__ import annotations

import ctypes.util

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import BuildError, StateError
from fantoccini.kernel import contract
from fantoccini.kernel.contract.cpp import HEADER, header
from fantoccini.kernel.contract.functions import needed
from fantoccini.kernel.contract.table import PAGE, page
from fantoccini.kernel.equations import Derivatives, Equations, Variational, VariationalDerivatives
from fantoccini.kernel.runtime import Library, functions

FRESH = "python -m fantoccini.kernel.contract writes it"


def derived(equations: Equations) -> dict:
    """All CasADi functions of a puppet."""
    names, functions = contract.functions, {name: equations[name] for name in equations}
    derivatives = Derivatives(equations.tree)
    for library in (names.DERIVATIVES, names.STEP_DERIVATIVES, names.GRADIENTS, names.REACH):
        functions |= derivatives.functions(library)
    functions |= VariationalDerivatives(equations).functions(names.VARIATIONAL_DERIVATIVES)
    return functions | Variational(equations).functions()


@pytest.mark.parametrize("name", ["arm2d", "arm3d", "crane"])
def test_functions_have_the_arguments_results_and_sizes_that_are_declared(name):
    """C's shape was documented as (n_vD, n_vD); it has the driven velocities too."""
    equations = getattr(fan.puppets, name)().equations
    assert list(equations.sizes) == list(contract.SIZES)
    functions = derived(equations)
    sizes = equations.sizes
    assert set(functions) == {f.name for f in contract.FUNCTIONS.values() if needed(f, sizes)}
    for function, f in functions.items():
        declared = contract.FUNCTIONS[function]
        assert f.name_in() == [q.name for q in declared.arguments]
        assert f.name_out() == [q.name for q in declared.results]
        wanted = [q.numel(equations.sizes) for q in (*declared.arguments, *declared.results)]
        sizes_in_file = [*map(f.numel_in, range(f.n_in())), *map(f.numel_out, range(f.n_out()))]
        assert sizes_in_file == wanted, function


def test_results_have_their_names_and_shapes():
    """Results come by name, matrices as matrices, numbers as numbers."""
    arm = fan.puppets.arm2d()
    x = arm.rest()
    state = {"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K, "p": arm.p}
    dynamics = arm.library.evaluate(
        "dynamics", **state | {"q_D": np.tile(x.q_D, (5, 1))}, acc_K=0 * x.v_K, u_D=0 * x.v_D
    )
    energy = arm.library.evaluate("energy", **state)
    assert list(vars(dynamics)) == [q.name for q in contract.FUNCTIONS["dynamics"].results]
    assert dynamics.W.shape == (5, 2, 1) and dynamics.power0.shape == (5,)
    np.testing.assert_allclose(dynamics.G[0], dynamics.W[0].T @ dynamics.W[0], rtol=1e-12)
    assert energy.V.shape == ()
    assert float(energy.V) == pytest.approx(arm.potential_energy(x))


@pytest.mark.parametrize(
    "changed", [{"q_D": np.zeros(3)}, {"q_K": None}, {"u_D": np.zeros(2)}], ids=str
)
def test_wrong_arguments_are_named(changed):
    """These are a wrong shape, a missing argument and an unknown one."""
    arm = fan.puppets.arm2d()
    x = arm.rest()
    arguments = {"q_D": x.q_D, "q_K": x.q_K, "p": arm.p} | changed
    with pytest.raises(StateError, match=r"rows needs q_D \(2,\), q_K \(2,\), p \(2,\)"):
        arm.library.evaluate("rows", **{n: a for n, a in arguments.items() if a is not None})


def test_leading_axes_that_do_not_go_together_are_named():
    arm = fan.puppets.arm2d()
    x = arm.rest()
    q_D, q_K = np.tile(x.q_D, (3, 1)), np.tile(x.q_K, (4, 1))
    with pytest.raises(
        StateError, match=r"leading axes cannot be broadcast.*found q_D \(3,\), q_K \(4,\)"
    ):
        arm.library.evaluate("rows", q_D=q_D, q_K=q_K, p=arm.p)


def test_files_generated_from_the_contract_are_fresh():
    """`contract.hpp` and the page of the docs."""
    assert HEADER.read_text(encoding="utf-8") == header(), FRESH
    assert PAGE.read_text(encoding="utf-8") == page(), FRESH


def test_a_library_of_another_contract_or_puppet_is_refused(monkeypatch):
    """The digest and the puppet's sizes guard against a stale library."""
    arm = fan.puppets.arm2d()
    path = arm.library.path
    with pytest.raises(BuildError, match=r"n_vD = 2, not \d+"):
        Library(path, fan.puppets.crane().tree)
    with pytest.raises(BuildError, match="cannot be loaded"):
        Library(ctypes.util.find_library("m"), arm.tree)
    monkeypatch.setattr(functions, "digest", lambda: contract.digest() + 1)
    with pytest.raises(BuildError, match="another version"):
        Library(path, arm.tree)
