"""The source text of a puppet's libraries: generated functions under the runtime's C interfaces."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.codegen.model import SIZES, STEM, Generated, Real, assembled, programs, tables_text
from fantoccini.codegen.straight import Program, program, together
from fantoccini.contract import FUNCTIONS, compiled
from fantoccini.equations import (
    Derivatives,
    Equations,
    Variational,
    VariationalDerivatives,
)

WIDE = Real("fan::Wide", "wide", "fantoccini/wide.hpp")
"""As many doubles as a processor's vector holds: one trajectory or configuration for each lane."""


@dataclass(frozen=True)
class _Kind:
    """Properties of a library.

    Attributes:
        header: its C interface in the runtime, without the ending.
        real: the type that its functions compute with.
        mapped: whether Python calls its functions over arrays.
        columns: whether it has ``column``.
        touches: whether it makes time steps with contact.
        several: whether it has ``forth`` and ``back`` of several vectors at once.
    """

    header: str
    real: Real
    mapped: bool = False
    columns: bool = True
    touches: bool = False
    several: bool = False


_KINDS = {
    "model": _Kind("abi", Real(), mapped=True, touches=True),
    "lanes": _Kind("lane_abi", WIDE, touches=True),
    "clearance": _Kind("clearance_abi", WIDE, columns=False),
    "rollouts": _Kind("rollouts_abi", WIDE, touches=True),
    "variational": _Kind("variational_abi", Real()),
    "variational_lanes": _Kind("variational_lane_abi", WIDE),
    "derivatives": _Kind("map_abi", Real(), mapped=True, columns=False),
    "step_derivatives": _Kind("step_derivatives_abi", Real(), several=True),
    "gradients": _Kind("gradients_abi", Real()),
    "variational_derivatives": _Kind("map_abi", Real(), mapped=True, columns=False),
    "reach": _Kind("reach_abi", Real(), columns=False),
}


def generate(equations: Equations, library: str = "model") -> Generated:
    """The source text of one of a puppet's libraries.

    Args:
        equations: the derived equations.
        library: one of ``fantoccini.contract.LIBRARIES``.
    """
    kind, names = _KINDS[library], compiled(library, equations.tree.sizes)
    made = _programs(equations, library, names, kind.columns)
    plain = library in ("derivatives", "variational_derivatives")
    sizes = {**equations.tree.sizes, "n_packed": 0} if plain else None
    members = [_member(name, kind) for name in (*names, *["column"] * kind.columns)]
    # Contact points push along three directions each. Bundles have a width of 1 on some processors.
    in_threes = kind.touches and equations.tree.n_contacts > 0
    # Lanes whose contacts are not those of the others make their steps one by one, in doubles.
    singly = in_threes and kind.real is WIDE
    if in_threes:
        members.append(_PUSH.format(space=kind.real.space))
    templates = [_pushes(equations, made["forth"])] if in_threes else []
    if kind.several:
        for name in ("forth", "back"):
            templates.append(together(made[name], f"fan_{name}_of", SIZES.piece))
            members.append(_SEVERAL.format(name=name, space=kind.real.space))
    main = _MAIN.format(
        library=library.replace("_", " "),
        members="\n".join(members),
        maps="".join(_map(name) for name in names) if kind.mapped else "",
        abi=kind.header,
        width="1" if kind.real.type == "double" else "FAN_WIDTH",
        functions=_FUNCTIONS.format(
            templates="\n".join([*templates, ""]) if templates else "", **vars(kind.real)
        ),
        singly=_SINGLY.format(**vars(Real())) if singly else "",
        single_members=_single_members(names) if singly else "",
        **vars(kind.real),
    )
    files = {f"{STEM}.hpp": tables_text(equations, sizes), "main.cpp": main}
    return assembled(made, files, reals=[kind.real, *[Real()] * singly])


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


def _pushes(equations: Equations, forth: Program) -> str:
    """``fan_push(link, L, x, y)``: ``forth`` of several x; shorter for one link alone."""
    made = {f"fan_push_{i}": program(function) for i, function in equations.pushes.items()}
    texts = [together(whole, name, SIZES.piece) for name, whole in made.items()]
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
    return "\n".join([*texts, together(forth, "fan_push_all", SIZES.piece), *switch, ""])


def _member(name: str, kind: _Kind) -> str:
    """A function as a member of the C++ struct ``Model``."""
    space, type_ = kind.real.space, kind.real.type
    if name == "column":
        return (
            f"  static void column(int which, const {type_}** arg, {type_}** res) {{\n"
            f"    {space}::fan_column(which, arg, res);\n  }}"
        )
    if not FUNCTIONS[name].standing:
        return f"  FAN_FUNCTION({name})"
    whole = [f"  FAN_FUNCTION({name})"] if kind.mapped else []
    constants = f"static void {name}_constants({type_}** res)"
    return "\n".join(
        [
            *whole,
            f"  FAN_FUNCTION({name}_varying)",
            f"  {constants} {{ {space}::fan_{name}_constants(res); }}",
        ]
    )


def _single_members(names: tuple[str, ...]) -> str:
    """The functions of a library of lanes for doubles."""
    kind = _Kind("", Real())
    members = [_member(name, kind) for name in (*names, "column")]
    return "\n".join(
        [
            "#if FAN_WIDTH > 1",
            "#define FAN_FUNCTION(NAME) \\",
            "  static int NAME(const double** arg, double** res) { \\",
            "    return scalar::fan_##NAME(arg, res, nullptr, nullptr, 0); \\",
            "  }",
            *members,
            "#undef FAN_FUNCTION",
            "#endif",
            "",
        ]
    )


def _map(name: str) -> str:
    """The definition through which Python calls a function over arrays."""
    function = FUNCTIONS[name]
    if not function.mapped:
        return ""
    return f"FAN_MAP({name}, {len(function.arguments)}, {len(function.results)})\n"


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

_FUNCTIONS = """\
namespace {space} {{
#define casadi_real {type}
#include "model.c"
#undef casadi_real
{templates}}}  // namespace {space}
"""

_SINGLY = """\
#if FAN_WIDTH > 1
namespace {space} {{
#define casadi_real {type}
#include "model.c"
#undef casadi_real
}}  // namespace {space}
#endif
"""

_MAIN = """\
// A compiled puppet: its library of {library}.
#include <cmath>

#include "{header}"
#include "model.hpp"

namespace fan {{
{functions}{singly}
struct Model : ModelTables {{
#define FAN_FUNCTION(NAME)                                     \\
  static int NAME(const {type}** arg, {type}** res) {{          \\
    return {space}::fan_##NAME(arg, res, nullptr, nullptr, 0); \\
  }}
{members}
#undef FAN_FUNCTION
{single_members}}};
}}  // namespace fan

#include "fantoccini/{abi}.hpp"

FAN_EXPORT void fan_identity(long long* out) {{ fan::identity<fan::Model>({width}, out); }}
{maps}"""
