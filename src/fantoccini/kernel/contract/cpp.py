"""The contract as C++: ``kernel/cpp/fantoccini/contract.hpp``.

The contract declares the functions and structures that Python and C++ share.
"""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

from fantoccini.base import Status
from fantoccini.kernel.contract.codes import CODES, SCOPED, Code, Hold
from fantoccini.kernel.contract.constants import CONSTANTS
from fantoccini.kernel.contract.function import VARIATIONAL_DERIVATIVES, Function
from fantoccini.kernel.contract.functions import COLUMN, FUNCTIONS
from fantoccini.kernel.contract.identity import digest
from fantoccini.kernel.contract.quantity import SIZES, Quantity
from fantoccini.kernel.contract.samples import CONTACT, EVENT, PARTS, SAMPLE, WINCH
from fantoccini.kernel.contract.structure import Field, Structure
from fantoccini.kernel.contract.structures import STRUCTURES

HEADER = Path(__file__).resolve().parents[1] / "cpp" / "fantoccini" / "contract.hpp"


def header() -> str:
    """The text of ``contract.hpp``."""
    functions = [f for f in FUNCTIONS.values() if set(f.libraries) - {VARIATIONAL_DERIVATIVES}]
    return _HEADER.format(
        digest=f"0x{digest():016x}",
        sizes=_joined("Sizes::", list(SIZES), "      "),
        calls="\n".join(_call(f) for f in (*functions, COLUMN)),
        constants=_constants(),
        codes="\n".join(map(_code, CODES)),
        structures="\n".join(map(_structure, STRUCTURES)),
        layout=_layout(SAMPLE),
        contact=_layout(CONTACT),
        event=", ".join(q.name for q in EVENT),
        winch=", ".join(q.name for q in WINCH),
        part=_joined("", [q.name for q in PARTS], "    "),
        widths=_joined("", [_numel(q) for q in PARTS], "      "),
    )


def _constants() -> str:
    lines: list[str] = []
    for name, x in CONSTANTS.items():
        unit = "" if x.unit == "1" else f" [{x.unit}]"
        lines += _with_meaning(
            f"  static constexpr double {name} = {float(x)!r};", x.meaning + unit
        )
    return "\n".join(lines)


def _code(code: type[Code] | type[Status]) -> str:
    kind = "enum class" if code in SCOPED else "enum"
    type_ = "signed char" if code is Hold else "int"
    members: list[str] = []
    for m in code:
        meaning = m.message if isinstance(m, Status) else m.meaning
        members += _with_meaning(f"  {m.name} = {m.value},", meaning)
    comment = _comment((code.__doc__ or "").partition("\n")[0], "")
    return "\n".join([*comment, f"{kind} {code.__name__} : {type_} {{", *members, "};", ""])


def _structure(structure: Structure) -> str:
    fields = [
        line for f in structure.fields for line in _with_meaning(f"  {_field(f)};", f.meaning)
    ]
    comment = _comment(structure.meaning, "")
    return "\n".join([*comment, f"struct {structure.name} {{", *fields, "};", ""])


def _with_meaning(code: str, meaning: str) -> list[str]:
    """A line of code with its meaning after it; before it if the line would be too long."""
    if not meaning:
        return [code]
    line = f"{code}  // {meaning}"
    return [line] if len(line) <= 100 else [*_comment(meaning), code]


def _field(field: Field) -> str:
    if match := re.fullmatch(r"(.+)\[(\d+)\]", field.type):
        return f"{match[1]} {field.name}[{match[2]}]"
    if match := re.fullmatch(r"(.+?)(\(.*\))", field.type):
        return f"{match[1]} (*{field.name}){match[2]}"
    return f"{field.type} {field.name}"


def _numel(quantity: Quantity) -> str:
    """Number of entries, as a C++ expression."""
    factors = (f"Model::{n}" if isinstance(n, str) else str(n) for n in quantity.shape)
    return " * ".join(factors) or "1"


def _layout(parts: tuple[Quantity, ...]) -> str:
    lines, before = [], "0"
    for q in parts:
        lines += _with_meaning(f"  static constexpr int {q.name} = {before};", q.described)
        before = f"{q.name} + {_numel(q)}"
    return "\n".join([*lines, f"  static constexpr int width = {before};"])


def _call(function: Function) -> str:
    """A member of ``Call``: a single result is an argument, several are members of a structure."""
    name, several = function.name, len(function.results) > 1
    parameters = ["int which"] if function is COLUMN else []
    parameters += [_parameter(q, "const Real") for q in function.arguments]
    if several:
        parameters.append("Results& to")
    else:
        parameters.append(_parameter(function.results[0], "Real"))
    if function.standing:
        parameters.append("bool constants")
    arg = _joined("", [q.name if q.shape else f"&{q.name}" for q in function.arguments], "        ")
    names = [f"at(to.{q.name})" if several else f"at({q.name})" for q in function.results]
    which = "which, " if function is COLUMN else ""
    res = _joined("", names, "        ")
    body = [f"    const Real* arg[] = {{{arg}}};", f"    Real* res[] = {{{res}}};"]
    if function.standing:
        body.append(f"    if (constants) Model::{name}_constants(res);")
    body.append(f"    Model::{name}{'_varying' if function.standing else ''}({which}arg, res);")
    lines = _comment(function.purpose)
    lines += ["  template <class Results>"] if several else []
    lines.append(f"  FAN_FN static void {name}(\n      {_joined('', parameters, '      ')}) {{")
    return "\n".join([*lines, *body, "  }", ""])


def _parameter(quantity: Quantity, type_: str) -> str:
    return f"{type_}{'*' if quantity.shape else '&'} {quantity.name}"


def _comment(text: str, indent: str = "  ") -> list[str]:
    return [f"{indent}// {line}" for line in textwrap.wrap(text, 90)]


def _joined(prefix: str, words: list[str], indent: str) -> str:
    """Words joined by commas, wrapped to lines of at most 100 characters."""
    text = ", ".join(f"{prefix}{word}".replace(" ", "\0") for word in words)
    lines = textwrap.wrap(text, 78, break_long_words=False, break_on_hyphens=False)
    return f"\n{indent}".join(lines).replace("\0", " ")


_HEADER = """\
// The contract between Python and compiled code, generated from fantoccini/kernel/contract/*.py
// by `python -m fantoccini.kernel.contract`: make changes there.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {{

// A hash of the contract.
constexpr long long contract_digest = {digest};

// Identity of a library, which Python checks when it loads it: the contract's hash, the number of
// trajectories or configurations that are advanced together, and the puppet's sizes.
template <class Sizes>
void identity(int width, long long* out) {{
  const long long values[] = {{
      contract_digest, width, {sizes}}};
  for (long long value : values) *out++ = value;
}}

// Constants shared with Python.
struct Constants {{
{constants}
}};

{codes}
{structures}
// Offsets of the parts of a sample.
template <class Model>
struct SampleLayout {{
{layout}
}};

// Offsets of the parts of an event.
struct EventLayout {{
  enum : int {{ {event}, width }};
}};

// Offsets of the parts of a contact point.
struct ContactLayout {{
{contact}
}};

// Offsets of the numbers of a winch.
struct WinchLayout {{
  enum : int {{ {winch}, width }};
}};

// Parts of a sample that a batch can save, in the order of the sample.
struct Part {{
  enum : int {{
    {part}, n
  }};
}};

// Number of entries of a part.
template <class Model>
constexpr int part_width(int part) {{
  const int widths[] = {{
      {widths}}};
  return widths[part];
}}

// The generated functions. A single result is written to the last argument; several are written to
// the members of `to` with their names (arrays, pointers or numbers). If `constants` is false,
// constant entries are not written: they keep the values of an earlier call with `constants`.
template <class Model, class Real>
struct Call {{
{calls}
 private:
  FAN_FN static Real* at(Real* x) {{ return x; }}
  FAN_FN static Real* at(Real& x) {{ return &x; }}
}};

}}  // namespace fan
"""
