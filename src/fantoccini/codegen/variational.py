"""The variational integrator's source text: libraries of its own, made when first asked for."""

from __future__ import annotations

from fantoccini.codegen.lanes import WIDE
from fantoccini.codegen.model import (
    STEM,
    Generated,
    Real,
    assembled,
    members,
    programs,
    tables_text,
)
from fantoccini.codegen.straight import program
from fantoccini.equations import Equations, Variational

_SHARED = ("limit_rates", "energy", "forth", "back")
"""Functions that the model's library has as well."""


def generate_variational(equations: Equations) -> Generated:
    """The source text of a puppet's variational integrator.

    Args:
        equations: the derived equations.
    """
    return _generated(equations, Real(), "variational_abi")


def generate_variational_lanes(equations: Equations) -> Generated:
    """The source text of a puppet's variational integrator for many trajectories side by side.

    Args:
        equations: the derived equations.
    """
    return _generated(equations, WIDE, "variational_lane_abi")


def _generated(equations: Equations, real: Real, header: str) -> Generated:
    """The integrator over a type, under the C interface of a header, without its ending."""
    own = Variational(equations).functions()
    shared = (*_SHARED, *equations.watch)
    made = programs(equations, shared) | {name: program(own[name]) for name in own}
    names = [*shared, *own]
    names[names.index("node")] = "node_varying"
    main = _MAIN.format(members=members(names), abi=header, **vars(real))
    files = {f"{STEM}.hpp": tables_text(equations), "main.cpp": main}
    return assembled(made, files, real=real)


_MAIN = """\
// A puppet's variational integrator.
#include <cmath>

#include "{header}"
#include "model.hpp"

namespace fan {{
namespace {space} {{
#define casadi_real {type}
#include "model.c"
#undef casadi_real
}}  // namespace {space}

struct Model : ModelTables {{
#define FAN_FUNCTION(NAME)                                     \\
  static int NAME(const {type}** arg, {type}** res) {{          \\
    return {space}::fan_##NAME(arg, res, nullptr, nullptr, 0); \\
  }}
{members}\
  static void node_constants({type}** res) {{
    {space}::fan_node_constants(res);
  }}
  static void column(int which, const {type}** arg, {type}** res) {{
    {space}::fan_column(which, arg, res);
  }}
}};
}}  // namespace fan

#include "fantoccini/{abi}.hpp"
"""
