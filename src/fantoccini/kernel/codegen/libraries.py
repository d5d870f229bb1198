"""The source text of a puppet's libraries: generated functions with the runtime's C interfaces.

Lanes are runs that the vector unit of the processor advances together. A link is a body on its
joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod

from fantoccini.kernel.codegen.model import (
    SIZES,
    STEM,
    Generated,
    Real,
    assembled,
    declared_functions,
    programs,
)
from fantoccini.kernel.codegen.straight import Program, Table, program, together
from fantoccini.kernel.codegen.tables import nominal_lengths, numbers_text, tables_text
from fantoccini.kernel.contract import FUNCTIONS, compiled
from fantoccini.kernel.equations import Derivatives, Equations, Variational, VariationalDerivatives

WIDE = Real("fan::Wide", "wide", "fantoccini/math/wide.hpp")
"""A processor's vector of doubles: one trajectory or configuration for each lane."""

_BESIDE = replace(WIDE, stem="wide")
"""Lanes, in libraries whose other functions compute with doubles."""
_SINGLE = replace(Real(), stem="single")
"""Doubles, in libraries of lanes: lanes with different contacts are advanced one by one."""
_SOLVES = ("solve_factor_transposed", "solve_factor")
_IN_LANES = ("force_by_q", "force_by_v", "force_by_K", "rows_by", "row_rates_by")
"""Functions that libraries ``with_lanes`` evaluate at several states at once."""


@dataclass(frozen=True)
class _Kind:
    """Properties of a library.

    Attributes:
        header: C interface in the runtime's folder `interface`, without the ending.
        real: type of the numbers in its functions.
        mapped: whether Python calls its functions over arrays.
        columns: whether it has ``column``.
        touches: whether it makes time steps with contact.
        several: whether it solves with the factor for several vectors at once.
        with_lanes: whether it evaluates derivatives at several states at once.
    """

    header: str
    real: Real
    mapped: bool = False
    columns: bool = True
    touches: bool = False
    several: bool = False
    with_lanes: bool = False


_KINDS = {
    "model": _Kind("model", Real(), mapped=True, touches=True),
    "lanes": _Kind("lanes", WIDE, touches=True),
    "clearance": _Kind("clearance", WIDE, columns=False),
    "rollouts": _Kind("rollouts", WIDE, touches=True),
    "variational": _Kind("variational", Real()),
    "variational_lanes": _Kind("variational_lanes", WIDE),
    "derivatives": _Kind("derivatives", Real(), mapped=True, several=True, with_lanes=True),
    "step_derivatives": _Kind("step_derivatives", Real(), several=True, with_lanes=True),
    "gradients": _Kind("gradients", Real(), touches=True),
    "variational_derivatives": _Kind("map", Real(), mapped=True, columns=False),
    "reach": _Kind("reach", Real(), columns=False),
}


def generate(equations: Equations, library: str = "model") -> Generated:
    """The source text of one of a puppet's libraries.

    Args:
        equations: the derived equations.
        library: one of ``fantoccini.kernel.contract.LIBRARIES``.
    """
    kind, shared = _KINDS[library], _Shared.of(equations, library)
    functions = _programs(equations, library, shared.names, kind.columns)
    beside = {name: functions.pop(name) for name in shared.beside}
    parts = {kind.real: functions} | ({_BESIDE: beside} if beside else {})
    parts |= {_SINGLE: functions} if shared.singly else {}
    numbers = numbers_text(shared.numbers) if shared.numbers else {}
    generated = assembled(parts, shared.files, numbers)
    return replace(generated, shared_units=shared.units)


def generate_main(equations: Equations, library: str = "model") -> Generated:
    """The part of :func:`generate` that is compiled without the functions: ``main.cpp``.

    Only the factor of the mass matrix is derived for it. The text is the same for puppets that
    differ in numbers alone.
    """
    shared = _Shared.of(equations, library)
    return Generated(shared.files, "main.cpp", (), {}, shared_units=shared.units)


@dataclass(frozen=True)
class _Shared:
    """The main file of a library and the files that it includes.

    Attributes:
        files: file name -> text.
        numbers: tables of numbers, whose values are in a unit of their own.
        names: names of the functions in the library.
        beside: names of those in lanes, in a library whose other functions compute with doubles.
        singly: whether lanes may be advanced one by one.
        units: runtime headers compiled once per machine and linked (see ``build.Source``).
    """

    files: dict[str, str]
    numbers: dict[str, Sequence[float]]
    names: tuple[str, ...]
    beside: tuple[str, ...]
    singly: bool
    units: tuple[str, ...]

    @classmethod
    def of(cls, equations: Equations, library: str) -> _Shared:
        """The main file of a library."""
        kind, names = _KINDS[library], compiled(library, equations.tree.sizes)
        is_scalar_only = library == "variational_derivatives"
        sizes = {**equations.tree.sizes, "n_packed": 0} if is_scalar_only else None
        beside = tuple(name for name in names if kind.with_lanes and name in _IN_LANES)
        own_names = [name for name in names if name not in beside]
        # A contact point has forces in three directions. Vectors have a width of 1 on some
        # processors.
        in_threes = kind.touches and equations.tree.n_contacts > 0
        singly = in_threes and kind.real is WIDE
        solves = Table("ModelTables::solve_number")
        templates = _solve_templates(equations, kind, in_threes, solves)
        space = _SPACE.format(**vars(_BESIDE)) if beside else ""
        if singly:
            space = f"{_SEVERAL_LANES}\n{_SPACE.format(**vars(_SINGLE))}#endif\n"
        main = _MAIN.format(
            library=library.replace("_", " "),
            templates="\n".join([*templates, ""]) if templates else "",
            more_headers=f'#include "{_BESIDE.header}"\n' if beside else "",
            more=space,
            members="\n".join(_members(kind, own_names, beside, in_threes)),
            maps="".join(_map(equations, n, n in beside) for n in names) if kind.mapped else "",
            abi=kind.header,
            width="1" if kind.real.type == "double" else "FAN_WIDTH",
            **vars(kind.real),
        )
        lengths = nominal_lengths(equations.tree)
        numbers: dict[str, Sequence[float]] = (
            {} if is_scalar_only else {"nominal_length": lengths, "solve_number": solves.values}
        )
        stems = {kind.real: own_names} | ({_BESIDE: beside} if beside else {})
        stems |= {_SINGLE: own_names} if singly else {}
        files = {f"{real.stem}.c": declared_functions(n, real.stem) for real, n in stems.items()}
        files |= {f"{STEM}.hpp": tables_text(equations, sizes, numbers), "main.cpp": main}
        shared_units = ("collision/touch_unit",) if equations.tree.n_contacts else ()
        return cls(files, numbers, names, beside, singly, shared_units)


def _members(
    kind: _Kind, names: Sequence[str], beside: Sequence[str], in_threes: bool
) -> list[str]:
    """The members of the C++ struct ``Model``."""
    members = [
        _member(name, kind.real, kind.mapped) for name in (*names, *["column"] * kind.columns)
    ]
    members += [_member(name, _BESIDE, kind.mapped) for name in beside]
    if in_threes:
        members.append(_PUSH.format(space=kind.real.space))
    if in_threes and kind.real is WIDE:
        single = [_member(name, _SINGLE, kind.mapped) for name in (*names, "column")]
        members += [_SEVERAL_LANES, *single, "#endif"]
    if kind.several:
        members += [_SEVERAL.format(name=name, space=kind.real.space) for name in _SOLVES]
    return members


def _solve_templates(equations: Equations, kind: _Kind, in_threes: bool, table: Table) -> list[str]:
    """Solves with the factor for several vectors at once."""
    templates = []
    solves = programs(equations, _SOLVES, columns=False) if in_threes or kind.several else {}
    if in_threes:
        templates.append(_pushes(equations, solves["solve_factor_transposed"], table))
    if kind.several:
        templates += [
            together(solve, f"fan_{name}_of", SIZES.piece, table) for name, solve in solves.items()
        ]
    return templates


def _programs(
    equations: Equations, library: str, names: tuple[str, ...], columns: bool
) -> dict[str, Program]:
    if library in ("derivatives", "step_derivatives", "gradients", "reach"):
        own = Derivatives(equations.tree).functions(library)
    elif library == "variational_derivatives":
        own = VariationalDerivatives(equations).functions(library)
    elif library.startswith("variational"):
        own = Variational(equations).functions()
    else:
        own = {}
    shared = programs(equations, [name for name in names if name not in own], columns=columns)
    return shared | {name: program(function) for name, function in own.items()}


def _pushes(equations: Equations, solve_transposed: Program, table: Table) -> str:
    """``fan_push(link, L, x, y)``: F^-T x of several x; shorter for one link alone."""
    pushes = {f"fan_push_{i}": program(function) for i, function in equations.pushes.items()}
    texts = [together(whole, name, SIZES.piece, table) for name, whole in pushes.items()]
    cases = [f"    case {i}: return fan_push_{i}(L, x, y);" for i in equations.pushes]
    switch = [
        "template <class A, class V>",
        "inline void fan_push(int link, const A* L, const V* x, V* y) {",
        "  switch (link) {",
        *cases,
        "    default: return fan_push_all(L, x, y);",
        "  }",
        "}",
    ]
    texts.append(together(solve_transposed, "fan_push_all", SIZES.piece, table))
    return "\n".join([*texts, *switch, ""])


def _member(name: str, real: Real, mapped: bool) -> str:
    """A function as a member of the C++ struct ``Model``."""
    space, type_ = real.space, real.type
    if name == "column":
        return (
            f"  static void column(int which, const {type_}** arg, {type_}** res) {{\n"
            f"    {space}::fan_column(which, arg, res);\n  }}"
        )
    varying = [name] if mapped or not FUNCTIONS[name].standing else []
    lines = []
    if FUNCTIONS[name].standing:
        varying.append(f"{name}_varying")
        constants = f"static void {name}_constants({type_}** res)"
        lines.append(f"  {constants} {{ {space}::fan_{name}_constants(res); }}")
    lines += [
        f"  static int {member}(const {type_}** arg, {type_}** res) {{\n"
        f"    return {space}::fan_{member}(arg, res, nullptr, nullptr, 0);\n  }}"
        for member in varying
    ]
    return "\n".join(lines)


def _map(equations: Equations, name: str, in_lanes: bool) -> str:
    """The definition of the entry point with which Python calls a function over arrays."""
    function = FUNCTIONS[name]
    if not function.mapped:
        return ""
    if not in_lanes:
        return f"FAN_MAP({name}, {len(function.arguments)}, {len(function.results)})\n"
    sizes = equations.tree.sizes
    widths = (
        ", ".join(str(prod(q.dimensions(sizes))) for q in quantities)
        for quantities in (function.arguments, function.results)
    )
    return "FAN_MAP_IN_LANES({}, ({}), ({}))\n".format(name, *widths)


_PUSH = """\
  template <class A, class V>
  static void push(int link, const A* L, const V* x, V* y) {{
    {space}::fan_push(link, L, x, y);
  }}"""

_SEVERAL = """\
  template <class V>
  static void {name}_of(const double* L, const V* x, V* y) {{
    {space}::fan_{name}_of(L, x, y);
  }}"""

_SEVERAL_LANES = "#if FAN_WIDTH > 1"

_SPACE = """\
namespace {space} {{
#define casadi_real {type}
#include "{stem}.c"
#undef casadi_real
}}  // namespace {space}
"""

_MAIN = """\
// A compiled puppet: its library of {library}.
#define FAN_TOUCH_EXTERNAL
#include <cmath>

#include "{header}"
{more_headers}#include "model.hpp"

namespace fan {{
namespace {space} {{
#define casadi_real {type}
#include "model.c"
#undef casadi_real
{templates}}}  // namespace {space}
{more}
struct Model : ModelTables {{
{members}
}};
}}  // namespace fan

#include "fantoccini/interface/{abi}.hpp"

FAN_EXPORT void fan_identity(long long* out) {{ fan::identity<fan::Model>({width}, out); }}
{maps}"""
