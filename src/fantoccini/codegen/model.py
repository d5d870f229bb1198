"""Equations -> source text. No disk, no names from the user's file.

Three files make a compiled puppet: ``model.c`` (CasADi's generated functions), ``model.hpp`` (sizes
and index tables as constants) and ``main.cpp`` (puts both under the runtime's C interface). The
text depends on the equations alone, so it can serve as a golden file and as part of a cache key.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca

from fantoccini.equations import Equations
from fantoccini.puppet import Parameter
from fantoccini.tree import LimitRow, StringRow, Tree

VERSION = "1"
"""Version of the generated text; part of every cache key."""

STEM = "model"
"""The one file name CasADi's generator is given: it enters symbol names."""


@dataclass(frozen=True)
class Generated:
    """Source text of a puppet.

    Attributes:
        files: file name -> text.
        main: the file to compile.
        operations: elementary operations of every generated function.
    """

    files: dict[str, str]
    main: str
    operations: dict[str, int]


def generate(equations: Equations) -> Generated:
    """The source text of a puppet's compiled model.

    Args:
        equations: the derived equations.
    """
    functions = equations.model
    return Generated(
        files={
            f"{STEM}.c": model_text(functions.values()),
            f"{STEM}.hpp": tables_text(equations),
            "main.cpp": _MAIN,
        },
        main="main.cpp",
        operations={name: f.n_instructions() for name, f in functions.items()},
    )


def model_text(functions: Iterable[ca.Function]) -> str:
    """C99 text of the functions, as CasADi writes it."""
    generator = ca.CodeGenerator(
        f"{STEM}.c", {"with_header": False, "with_export": False, "include_math": False}
    )
    for function in functions:
        generator.add(function)
    return generator.dump()


def tables_text(equations: Equations) -> str:
    """``model.hpp``: sizes and index tables of a tree as C++ constants."""
    tree, table = equations.tree, equations.tree.coordinates
    constants = {
        "n_qD": table.n_qD,
        "n_vD": table.n_vD,
        "n_qK": table.n_qK,
        "n_vK": table.n_vK,
        "n_strings": len(tree.strings),
        "n_limits": len(tree.limits),
        "n_rows": tree.n_rows,
        "n_p": len(tree.parameters),
        "n_packed": equations.n_packed,
        "n_points": sum(len(s.points) for s in tree.strings),
    }
    places = [_limit_place(tree, limit) for limit in tree.limits]
    units = {row.name: row.unit for row in table.rows}
    turns = [int(units.get(name, "rad") != "m") for name in table.v_D]
    length_q = [s.length_index[0] if s.length_index else -1 for s in tree.strings]
    lines = ["#pragma once", "", "namespace fan {", "", "struct ModelTables {"]
    lines += [f"  static constexpr int {name} = {value};" for name, value in constants.items()]
    lines += [
        _array("bool", "wire", [int(s.wire) for s in tree.strings]),
        _array("int", "length_q", length_q),
        _array("double", "nominal_length", [_nominal(s) for s in tree.strings]),
        _array("int", "string_points", [len(s.points) for s in tree.strings]),
        _array("bool", "turns", turns),
        _array("int", "limit_v", [first for first, _ in places]),
        _array("int", "limit_n", [n for _, n in places]),
        *_space("Dynamic", table.n_qD, table.n_vD, table.scalars_D, table.quaternions_D),
        *_space("Driven", table.n_qK, table.n_vK, table.scalars_K, table.quaternions_K),
        "};",
        "",
        "}  // namespace fan",
        "",
    ]
    return "\n".join(lines)


def _space(name: str, n_q: int, n_v: int, scalars, quaternions) -> list[str]:
    return [
        f"  struct {name} {{",
        f"    static constexpr int n_q = {n_q}, n_v = {n_v};",
        f"    static constexpr int n_scalars = {len(scalars)};",
        f"    static constexpr int n_quaternions = {len(quaternions)};",
        "  " + _array("int", "scalar_q", [q for q, _ in scalars]),
        "  " + _array("int", "scalar_v", [v for _, v in scalars]),
        "  " + _array("int", "quaternion_q", [q for q, _ in quaternions]),
        "  " + _array("int", "quaternion_v", [v for _, v in quaternions]),
        "  };",
    ]


def _array(kind: str, name: str, values: list) -> str:
    """A constant array; one unused entry where it would be empty, which C++ does not have."""
    body = ", ".join(repr(v) for v in values) or "0"
    return f"  static constexpr {kind} {name}[{max(1, len(values))}] = {{{body}}};"


def _nominal(string: StringRow) -> float:
    if string.length is None:
        return 0.0
    length = string.length
    return length.value if isinstance(length, Parameter) else float(length)


def _limit_place(tree: Tree, limit: LimitRow) -> tuple[int, int]:
    place = tree.links[limit.link].v
    return place.start, place.stop - place.start


_MAIN = """\
// A compiled puppet: the generated model under the runtime's C interface.
#include <cmath>

#include "fantoccini/real.hpp"
#include "model.hpp"

namespace fan {
namespace scalar {
#define casadi_real double
#include "model.c"
#undef casadi_real
}  // namespace scalar

struct Model : ModelTables {
#define FAN_FUNCTION(NAME)                                  \\
  static int NAME(const double** arg, double** res) {       \\
    return scalar::fan_##NAME(arg, res, nullptr, nullptr, 0); \\
  }
  FAN_FUNCTION(dynamics)
  FAN_FUNCTION(exact_dynamics)
  FAN_FUNCTION(rows)
  FAN_FUNCTION(energy)
  FAN_FUNCTION(effort)
  FAN_FUNCTION(wrench_forces)
  FAN_FUNCTION(poses)
  FAN_FUNCTION(points)
  FAN_FUNCTION(forth)
  FAN_FUNCTION(back)
};
}  // namespace fan

#include "fantoccini/abi.hpp"
"""
