"""What is compiled for bundles of doubles, libraries of their own: time-steppers for batches,
clearances, and a planner's motions, which are both."""

from __future__ import annotations

from fantoccini.codegen.model import (
    STEM,
    Generated,
    Real,
    assembled,
    members,
    programs,
    tables_text,
)
from fantoccini.codegen.straight import Program
from fantoccini.equations import Equations

WIDE = Real("fan::Wide", "wide", "fantoccini/wide.hpp")
"""Bundles of doubles, as wide as the processor allows."""


def generate_lanes(equations: Equations) -> Generated:
    """The source text of a puppet's time-stepper for many trajectories side by side.

    Args:
        equations: the derived equations.
    """
    names = ("step_dynamics", "limit_rates", "energy", "forth", "back", *equations.watch)
    functions = ("step_dynamics_varying", *names[1:])
    return _generated(equations, programs(equations, names), functions, _STEPPER, "lane_abi")


def generate_clearance(equations: Equations) -> Generated:
    """The source text of a puppet's distances from obstacles, many configurations side by side.

    Args:
        equations: the derived equations.
    """
    names = ("poses", "points")
    made = {name: whole for name, whole in programs(equations, names).items() if name in names}
    return _generated(equations, made, names, "", "clearance_abi")


def generate_motions(equations: Equations) -> Generated:
    """The source text of a puppet's time-stepper with clearances, for planners.

    Args:
        equations: the derived equations.
    """
    names = (
        "step_dynamics", "limit_rates", "forth", "back", "poses", "points", *equations.watch,
    )  # fmt: skip
    functions = ("step_dynamics_varying", *names[1:])
    return _generated(equations, programs(equations, names), functions, _STEPPER, "motions_abi")


def _generated(
    equations: Equations, made: dict[str, Program], names: tuple[str, ...], more: str, header: str
) -> Generated:
    """Functions under a C interface.

    Args:
        equations: the derived equations.
        made: functions by name.
        names: of those that the runtime calls as members of the model.
        more: other members.
        header: the interface, without its ending.
    """
    main = _MAIN.format(members=members(names) + more, header=header)
    files = {f"{STEM}.hpp": tables_text(equations), "main.cpp": main}
    return assembled(made, files, real=WIDE)


_MAIN = """\
// A puppet over bundles of doubles.
#include "fantoccini/wide.hpp"
#include "model.hpp"

namespace fan {{
namespace wide {{
#define casadi_real fan::Wide
#include "model.c"
#undef casadi_real
}}  // namespace wide

struct Model : ModelTables {{
#define FAN_FUNCTION(NAME)                                \\
  static int NAME(const Wide** arg, Wide** res) {{         \\
    return wide::fan_##NAME(arg, res, nullptr, nullptr, 0); \\
  }}
{members}}};
}}  // namespace fan

#include "fantoccini/{header}.hpp"
"""

_STEPPER = """\
  static void step_dynamics_constants(Wide** res) { wide::fan_step_dynamics_constants(res); }
  static void column(int which, const Wide** arg, Wide** res) {
    wide::fan_column(which, arg, res);
  }
"""
