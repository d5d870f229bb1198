"""Functions in pieces: the same arithmetic wherever they are divided."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import fantoccini as fan
from cpp.toolchain import compile_program, equations, run_program
from fantoccini import puppets
from fantoccini.kernel.codegen import generate, model_text
from fantoccini.kernel.codegen.straight import Table, pieces, program, together
from fantoccini.model.puppet import load
from harness import Model

pytestmark = pytest.mark.medium

STAGE = """
scene: stage
floor: 0
contact: true
puppets: [{name: pierrot, puppet: marionette}]
"""

PROGRAM = """
#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>
#include "fantoccini/math/elementary.hpp"
#define casadi_real double
using namespace fan;
namespace whole {
#include "whole/model.c"
}
namespace cut {
#include "cut/model.c"
}
int main() {
  int n_arg, n_res;
  if (std::scanf("%d %d", &n_arg, &n_res) != 2) return 1;
  std::vector<std::vector<double>> arg(n_arg), a(n_res), b(n_res);
  std::vector<const double*> in;
  std::vector<double*> one, other;
  for (auto& x : arg) {
    int n;
    if (std::scanf("%d", &n) != 1) return 1;
    x.resize(n + 1);
    for (int i = 0; i < n; ++i)
      if (std::scanf("%lf", &x[i]) != 1) return 1;
    in.push_back(x.data());
  }
  for (int k = 0; k < n_res; ++k) {
    int n;
    if (std::scanf("%d", &n) != 1) return 1;
    a[k].resize(n + 1);
    b[k].resize(n + 1);
    one.push_back(a[k].data());
    other.push_back(b[k].data());
  }
  whole::fan_it(in.data(), one.data(), nullptr, nullptr, 0);
  cut::fan_it(in.data(), other.data(), nullptr, nullptr, 0);
  int apart = 0;
  for (int k = 0; k < n_res; ++k)
    apart += std::memcmp(a[k].data(), b[k].data(), 8 * a[k].size()) != 0;
  std::printf("%d\\n", apart);
  for (const auto& x : a)
    for (size_t i = 0; i + 1 < x.size(); ++i) std::printf("%.17g\\n", x[i]);
  return 0;
}
"""


@pytest.mark.parametrize(("name", "longest"), [("arm2d", 20), ("marionette", 700)])
@pytest.mark.parametrize("which", ["dynamics", "step_dynamics"])
def test_a_function_in_pieces_gives_the_same_bits(name, which, longest, tmp_path):
    """Compiled without contraction, since compilers fuse products and sums only within a piece."""
    function = equations(name)[which]
    for folder, max_length in (("whole", 10**9), ("cut", longest)):
        (tmp_path / folder).mkdir()
        for file, text in model_text({"it": program(function)}, max_length).items():
            (tmp_path / folder / file).write_text(text, encoding="ascii")
    (tmp_path / "both.cpp").write_text(PROGRAM, encoding="ascii")
    built = compile_program(str(tmp_path / "both.cpp"), tmp_path, "-O1", "-ffp-contract=off")
    state = Model.of(load(puppets.path(name))).random(0)
    values = vars(state) | {"u_D": state.v_D, "dt": np.array([2e-3]), "p": np.zeros(0)}
    values["v_ahead"] = 1.01 * state.v_D
    arguments = [values[argument] for argument in function.name_in()]
    words = [function.n_in(), function.n_out()]
    for x in arguments:
        words += [len(x), *x]
    words += [function.numel_out(i) for i in range(function.n_out())]
    apart, *printed = run_program(built, "\n".join(map(repr, map(_plain, words)))).split()
    assert apart == "0"
    expected = np.concatenate([np.ravel(np.array(x), order="F") for x in function(*arguments)])
    size = np.maximum(1.0, np.abs(expected).max())
    assert np.max(np.abs(np.array(printed, dtype=float) - expected)) <= 1e-13 * size


def _plain(word):
    return float(word) if isinstance(word, np.floating) else word


def test_a_divisor_of_several_quotients_is_inverted_once():
    x, y, z = (ca.SX.sym(n) for n in "xyz")
    both = program(ca.Function("f", [x, y, z], [x / y + z / y, 1 / y]))
    operations = [s.operation for s in both.statements if s.is_arithmetic]
    assert operations.count(ca.OP_INV) == 1
    assert ca.OP_DIV not in operations
    single = program(ca.Function("f", [x, y], [x / y]))
    assert [s.operation for s in single.statements if s.is_arithmetic] == [ca.OP_DIV]


def test_a_sine_and_a_cosine_once_an_angle():
    """The marionette has four hinges; its ball joints have quaternions."""
    for which in ("dynamics", "step_dynamics"):
        operations = [s.operation for s in program(equations("marionette")[which]).statements]
        assert (operations.count(ca.OP_SIN), operations.count(ca.OP_COS)) == (4, 4)


def test_no_operation_with_a_constant_0_or_1_is_left():
    whole = program(equations("marionette")["dynamics"])
    listed = enumerate(whole.statements)
    constants = {k: s.constant for k, s in listed if s.operation == ca.OP_CONST}
    for s in whole.statements:
        if s.operation in (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL):
            values = [constants.get(i) for i in s.of]
            assert 0.0 not in values
            assert s.operation != ca.OP_MUL or 1.0 not in values
            assert values.count(None) > 0, "two constants would have been folded"


def test_pieces_have_at_most_the_requested_length():
    split = pieces(program(equations("marionette")["step_dynamics"]), "f", 500)
    assert len(split.pieces) == len(split.declarations) > 10
    # One line of arithmetic, and at most one each to load two operands and to store the result.
    assert max(text.count("\n") for text in split.pieces) < 4 * 500


def test_numbers_stand_in_units_and_those_of_large_models_are_several():
    small, large = generate(equations("arm2d")), generate(equations("marionette"))
    assert small.units == ("numbers.cpp", "unit0.cpp")
    assert len(large.units) > 2
    assert {*large.units, *large.pieces} <= set(large.files)


def test_transposed_solves_follow_the_path_of_a_link():
    """y = F^-T x maps forces between a link and the root, and is 0 elsewhere."""
    of = fan.loads(STAGE).libraries.equations
    rng, tree = np.random.default_rng(0), of.tree
    L = rng.normal(size=of.n_packed)
    assert len(of.pushes) == 10
    for i, push in of.pushes.items():
        moved = np.zeros(tree.coordinates.n_vD, dtype=bool)
        for j in tree.ancestors(i):
            moved[tree.links[j].v] = True
        x = rng.normal(size=len(moved))
        y = np.array(push(L, x)).ravel()
        assert np.allclose(
            y, np.array(of["solve_factor_transposed"](L, np.where(moved, x, 0.0))).ravel()
        )
        assert not y[~moved].any()


def test_functions_linear_in_x_take_several_x(tmp_path):
    """The template equals the function for each x, in one piece and in several."""
    of = equations("marionette")
    rng, n = np.random.default_rng(0), of.tree.coordinates.n_vD
    L, x = rng.normal(size=of.n_packed), rng.normal(size=(n, 4))
    rows = ", ".join("{" + ", ".join(map(repr, row)) + "}" for row in x.tolist())
    table = Table("numbers")
    functions = [
        together(program(of["solve_factor_transposed"]), "one", 10**9, table),
        together(program(of["solve_factor_transposed"]), "many", 40, table),
    ]
    lines = [
        "#include <cstdio>",
        "typedef double Four __attribute__((vector_size(32)));",
        f"static const double numbers[] = {{{', '.join(map(repr, table.values)) or '0'}}};",
        *functions,
        f"static const double L[] = {{{', '.join(map(repr, L.tolist()))}}};",
        f"static const Four x[] = {{{rows}}};",
        f"static Four y[2][{n}];",
        "int main() {",
        "  one(L, x, y[0]);",
        "  many(L, x, y[1]);",
        "  for (const auto& of : y)",
        "    for (const auto& row : of)",
        '      for (int d = 0; d < 4; ++d) std::printf("%.17g\\n", row[d]);',
        "}",
    ]
    (tmp_path / "several.cpp").write_text("\n".join(lines), encoding="ascii")
    built = compile_program(str(tmp_path / "several.cpp"), tmp_path, "-O1")
    results = np.array(run_program(built, "").split(), dtype=float).reshape(2, n, 4)
    exact = np.stack(
        [np.array(of["solve_factor_transposed"](L, column)).ravel() for column in x.T], axis=1
    )
    assert np.allclose(results, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())
