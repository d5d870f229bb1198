"""Equations -> source text. No disk, no names from the user's file.

A compiled puppet is made of ``model.c`` and its pieces (the functions), ``model.hpp`` (sizes and
index tables as constants) and ``main.cpp`` (puts both under the runtime's C interface); the pieces
can be compiled on their own and in parallel. The text depends on the equations alone, so it can
serve as a golden file and as part of a cache key.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from fantoccini.codegen.straight import alias, dealt, pieces, program
from fantoccini.equations import Equations
from fantoccini.puppet import Parameter
from fantoccini.tree import LimitRow, StringRow, Tree

VERSION = "2"
"""Version of the generated text; part of every cache key."""

STEM = "model"
"""Of the files that hold the model."""


PIECE = 1000
"""Arithmetic statements of a piece."""

UNIT = 6000
"""Statements from which on pieces go to another file."""

APART = 2000
"""Arithmetic statements from which on the files of pieces are compiled apart from the runtime."""


@dataclass(frozen=True)
class Generated:
    """Source text of a puppet.

    Attributes:
        files: file name -> text.
        main: the file to compile.
        units: files to compile beside it, with ``FAN_APART`` defined in all; compiled by itself,
            without that, ``main`` is whole too.
        operations: arithmetic operations of every generated function.
    """

    files: dict[str, str]
    main: str
    units: tuple[str, ...]
    operations: dict[str, int]


def generate(equations: Equations) -> Generated:
    """The source text of a puppet's compiled model.

    Args:
        equations: the derived equations.
    """
    same = {} if equations.damped else {"exact_dynamics": "dynamics"}
    functions = {name: f for name, f in equations.model.items() if name not in same}
    tables = {f"{STEM}.hpp": tables_text(equations)}
    return assembled(functions, operations(equations), tables | {"main.cpp": _MAIN}, same=same)


def generate_lanes(equations: Equations) -> Generated:
    """The source text of a puppet's time-stepper for many trajectories side by side.

    Args:
        equations: the derived equations.
    """
    counts = operations(equations)
    files = {f"{STEM}.hpp": tables_text(equations), "main.cpp": _LANES_MAIN}
    return assembled(
        {name: equations.model[name] for name in _LANE_FUNCTIONS},
        {name: counts[name] for name in _LANE_FUNCTIONS},
        files,
        real=Real("fan::Wide", "wide", "fantoccini/wide.hpp"),
    )


@dataclass(frozen=True)
class Real:
    """The type that functions compute with.

    Attributes:
        type: in C++.
        space: namespace inside ``fan`` that holds the functions.
        header: where the type is declared.
    """

    type: str = "double"
    space: str = "scalar"
    header: str = "fantoccini/real.hpp"


def assembled(
    functions: dict[str, ca.Function],
    counts: dict[str, int],
    files: dict[str, str],
    *,
    same: dict[str, str] | None = None,
    real: Real | None = None,
) -> Generated:
    """Functions with the files that use them; large ones in units to compile apart.

    Args:
        functions: by the name they are called by.
        counts: their operations.
        files: ``main.cpp``, and what it includes beside the functions.
        same: name -> name of another function that computes the same.
        real: the type they compute with; double when not given.
    """
    text, real, units = model_text(functions, same or {}), real or Real(), {}
    if sum(counts.values()) >= APART:
        units = {
            name.replace("pieces", "unit").replace(".c", ".cpp"): _UNIT.format(
                pieces=name, type=real.type, space=real.space, header=real.header
            )
            for name in text
            if name.startswith("pieces")
        }
    return Generated({**text, **units, **files}, "main.cpp", tuple(units), counts)


def operations(equations: Equations) -> dict[str, int]:
    """Arithmetic operations of every compiled function; 0 for one that is another one."""
    same = () if equations.damped else ("exact_dynamics",)
    return {
        name: 0 if name in same else program(f).operations for name, f in equations.model.items()
    }


def model_text(
    functions: dict[str, ca.Function], same: dict[str, str], longest: int = PIECE
) -> dict[str, str]:
    """The functions as C, to be included where ``casadi_real`` is defined.

    ``model.c`` declares the pieces, includes them unless ``FAN_APART`` is defined, and has the
    functions that call them. ``pieces0.c`` and so on have the pieces.

    Args:
        functions: by the name they are called by.
        same: name -> name of another function that computes the same.
        longest: arithmetic statements of a piece.

    Returns:
        File name -> text.
    """
    made = {name: pieces(f, f"fan_{name}", longest) for name, f in functions.items()}
    files = dealt([piece for cut in made.values() for piece in cut.pieces], UNIT)
    names = [f"pieces{k}.c" for k in range(len(files))]
    declarations = [line for cut in made.values() for line in cut.declarations]
    definitions = [cut.definition for cut in made.values()]
    definitions += [alias(f"fan_{name}", f"fan_{other}") for name, other in same.items()]
    text = _MODEL.format(
        declarations="\n".join(declarations),
        includes="\n".join(f'#include "{name}"' for name in names),
        definitions="\n\n".join(definitions),
    )
    return {f"{STEM}.c": text} | dict(zip(names, files, strict=True))


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


_MODEL = """\
#ifndef casadi_int
#define casadi_int long long int
#endif
#ifdef FAN_APART
#define FAN_PIECE
#else
#define FAN_PIECE static __attribute__((noinline))
#endif

{declarations}

#ifndef FAN_APART
{includes}
#endif

{definitions}

#undef FAN_PIECE
"""

_UNIT = """\
// Pieces of a compiled puppet's functions.
#include <cmath>

#include "{header}"

namespace fan {{
namespace {space} {{
#define casadi_real {type}
#define FAN_PIECE
#include "{pieces}"
}}  // namespace {space}
}}  // namespace fan
"""

_LANE_FUNCTIONS = ("dynamics", "energy", "forth", "back")

_LANES_MAIN = """\
// A puppet's time-stepper over bundles of doubles.
#include "fantoccini/wide.hpp"
#include "model.hpp"

namespace fan {
namespace wide {
#define casadi_real fan::Wide
#include "model.c"
#undef casadi_real
}  // namespace wide

struct Model : ModelTables {
#define FAN_FUNCTION(NAME)                                \\
  static int NAME(const Wide** arg, Wide** res) {         \\
    return wide::fan_##NAME(arg, res, nullptr, nullptr, 0); \\
  }
  FAN_FUNCTION(dynamics)
  FAN_FUNCTION(energy)
  FAN_FUNCTION(forth)
  FAN_FUNCTION(back)
};
}  // namespace fan

#include "fantoccini/lane_abi.hpp"
"""

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
