"""The contract: what is declared is what is derived, compiled and documented."""

from __future__ import annotations

import ctypes.util

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import BuildError
from fantoccini.kernel import contract
from fantoccini.kernel.contract.cpp import HEADER, header
from fantoccini.kernel.contract.functions import needed
from fantoccini.kernel.contract.table import PAGE, page
from fantoccini.kernel.equations import Derivatives, Equations, Variational, VariationalDerivatives
from fantoccini.kernel.runtime import Library, functions

FRESH = "python -m fantoccini.kernel.contract writes it"


def derived(equations: Equations) -> dict:
    """All CasADi functions of a puppet."""
    names, found = contract.functions, {name: equations[name] for name in equations}
    derivatives = Derivatives(equations.tree)
    for library in (names.DERIVATIVES, names.STEP_DERIVATIVES, names.GRADIENTS, names.REACH):
        found |= derivatives.functions(library)
    found |= VariationalDerivatives(equations).functions(names.VARIATIONAL_DERIVATIVES)
    return found | Variational(equations).functions()


@pytest.mark.parametrize("name", ["arm2d", "arm3d", "crane"])
def test_functions_have_the_arguments_results_and_sizes_that_are_declared(name):
    """18.1: C's shape was documented as (n_vD, n_vD); it has the driven velocities too."""
    equations = getattr(fan.puppets, name)().equations
    assert list(equations.sizes) == list(contract.SIZES)
    made = derived(equations)
    sizes = equations.sizes
    assert set(made) == {f.name for f in contract.FUNCTIONS.values() if needed(f, sizes)}
    for function, f in made.items():
        declared = contract.FUNCTIONS[function]
        assert f.name_in() == [q.name for q in declared.arguments]
        assert f.name_out() == [q.name for q in declared.results]
        wanted = [q.numel(equations.sizes) for q in (*declared.arguments, *declared.results)]
        found = [*map(f.numel_in, range(f.n_in())), *map(f.numel_out, range(f.n_out()))]
        assert found == wanted, function


def test_results_have_their_names_and_shapes():
    """18.1: results come by name, matrices as matrices, numbers as numbers."""
    arm = fan.puppets.arm2d()
    x = arm.rest()
    state = {"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K, "p": arm.p}
    many = arm.library.evaluate(
        "dynamics", **state | {"q_D": np.tile(x.q_D, (5, 1))}, acc_K=0 * x.v_K, u_D=0 * x.v_D
    )
    one = arm.library.evaluate("energy", **state)
    assert list(vars(many)) == [q.name for q in contract.FUNCTIONS["dynamics"].results]
    assert many.W.shape == (5, 2, 1) and many.power0.shape == (5,)
    np.testing.assert_allclose(many.G[0], many.W[0].T @ many.W[0], rtol=1e-12)
    assert one.V.shape == ()
    assert float(one.V) == pytest.approx(arm.potential_energy(x))


@pytest.mark.parametrize(
    "changed", [{"q_D": np.zeros(3)}, {"q_K": None}, {"u_D": np.zeros(2)}], ids=str
)
def test_wrong_arguments_are_told_by_name(changed):
    """18.1: another shape, one that is missing, and one that the function does not take."""
    arm = fan.puppets.arm2d()
    x = arm.rest()
    given = {"q_D": x.q_D, "q_K": x.q_K, "p": arm.p} | changed
    with pytest.raises(ValueError, match=r"rows takes q_D \(2,\), q_K \(2,\), p \(2,\)"):
        arm.library.evaluate("rows", **{n: a for n, a in given.items() if a is not None})


def test_what_is_made_from_the_contract_is_fresh():
    """18.1: ``contract.hpp`` and the page of the docs."""
    assert HEADER.read_text(encoding="utf-8") == header(), FRESH
    assert PAGE.read_text(encoding="utf-8") == page(), FRESH


def test_a_library_of_another_contract_or_puppet_is_refused(monkeypatch):
    """18.1: the digest and the puppet's sizes guard against a stale library."""
    arm = fan.puppets.arm2d()
    path = arm.library.path
    with pytest.raises(BuildError, match=r"n_vD = 2, not \d+"):
        Library(path, fan.puppets.crane().tree)
    with pytest.raises(BuildError, match="cannot be loaded"):
        Library(ctypes.util.find_library("m"), arm.tree)
    monkeypatch.setattr(functions, "digest", lambda: contract.digest() + 1)
    with pytest.raises(BuildError, match="another version"):
        Library(path, arm.tree)
