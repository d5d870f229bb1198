"""The variational integrator's source text: a library of its own, made when first asked for."""

from __future__ import annotations

from fantoccini.codegen.model import STEM, Generated, assembled, programs, tables_text
from fantoccini.codegen.straight import program
from fantoccini.equations import Equations, Variational

_SHARED = ("limit_rates", "energy", "forth", "back")
"""Functions that the model's library has as well."""


def generate_variational(equations: Equations) -> Generated:
    """The source text of a puppet's variational integrator.

    Args:
        equations: the derived equations.
    """
    own = Variational(equations).functions()
    made = programs(equations, _SHARED) | {name: program(own[name]) for name in own}
    names = [*_SHARED, *own]
    names[names.index("node")] = "node_varying"
    members = "".join(f"  FAN_FUNCTION({name})\n" for name in names)
    files = {f"{STEM}.hpp": tables_text(equations), "main.cpp": _MAIN.format(members=members)}
    return assembled(made, files)


_MAIN = """\
// A puppet's variational integrator.
#include <cmath>

#include "fantoccini/elementary.hpp"
#include "model.hpp"

namespace fan {{
namespace scalar {{
#define casadi_real double
#include "model.c"
#undef casadi_real
}}  // namespace scalar

struct Model : ModelTables {{
#define FAN_FUNCTION(NAME)                                    \\
  static int NAME(const double** arg, double** res) {{         \\
    return scalar::fan_##NAME(arg, res, nullptr, nullptr, 0); \\
  }}
{members}\
  static void node_constants(double** res) {{
    scalar::fan_node_constants(res);
  }}
  static void column(int which, const double** arg, double** res) {{
    scalar::fan_column(which, arg, res);
  }}
}};
}}  // namespace fan

#include "fantoccini/variational_abi.hpp"
"""
