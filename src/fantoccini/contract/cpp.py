"""The contract as C++: ``cpp/fantoccini/contract.hpp``."""

from __future__ import annotations

import textwrap
from pathlib import Path

from fantoccini.contract.functions import COLUMN, DERIVATIVES, FUNCTIONS, Function
from fantoccini.contract.identity import digest
from fantoccini.contract.quantity import SIZES, Quantity

HEADER = Path(__file__).resolve().parents[1] / "cpp" / "fantoccini" / "contract.hpp"


def header() -> str:
    """The text of ``contract.hpp``."""
    called = [f for f in FUNCTIONS.values() if f.libraries and DERIVATIVES not in f.libraries]
    return _HEADER.format(
        digest=f"0x{digest():016x}",
        sizes=_filled("Sizes::", list(SIZES), "      "),
        calls="\n".join(_call(f) for f in (*called, COLUMN)),
    )


def _call(function: Function) -> str:
    """A member of ``Call``: one result goes to an argument, several to members of their names."""
    own, several = function.name, len(function.results) > 1
    parameters = ["int which"] if function is COLUMN else []
    parameters += [_parameter(q, "const Real") for q in function.arguments]
    if several:
        parameters.append("Results& to")
    else:
        parameters.append(_parameter(function.results[0], "Real"))
    if function.standing:
        parameters.append("bool constants")
    arg = _filled("", [q.name if q.shape else f"&{q.name}" for q in function.arguments], "        ")
    names = [f"at(to.{q.name})" if several else f"at({q.name})" for q in function.results]
    which = "which, " if function is COLUMN else ""
    res = _filled("", names, "        ")
    body = [f"    const Real* arg[] = {{{arg}}};", f"    Real* res[] = {{{res}}};"]
    if function.standing:
        body.append(f"    if (constants) Model::{own}_constants(res);")
    body.append(f"    Model::{own}{'_varying' if function.standing else ''}({which}arg, res);")
    lines = [*_comment(function.purpose), *_listed(function)]
    lines += ["  template <class Results>"] if several else []
    lines.append(f"  FAN_FN static void {own}(\n      {_filled('', parameters, '      ')}) {{")
    return "\n".join([*lines, *body, "  }", ""])


def _parameter(quantity: Quantity, type_: str) -> str:
    return f"{type_}{'*' if quantity.shape else '&'} {quantity.name}"


def _listed(function: Function) -> list[str]:
    """The results, one a line."""
    if len(function.results) == 1:
        return _comment(f"{_shaped(function.results[0])} {function.results[0].described}.")
    return [line for q in function.results for line in _comment(f"  {_shaped(q)} {q.described}")]


def _shaped(quantity: Quantity) -> str:
    shape = ", ".join(map(str, quantity.shape))
    return f"{quantity.name} ({shape})" if shape else quantity.name


def _comment(text: str, indent: str = "  ") -> list[str]:
    begin = " " * (len(text) - len(text.lstrip()))
    return [f"{indent}// {begin}{line}" for line in textwrap.wrap(text.strip(), 90 - len(begin))]


def _filled(prefix: str, words: list[str], indent: str) -> str:
    """Words with commas between them, in lines of at most 100 characters."""
    text = ", ".join(f"{prefix}{word}".replace(" ", "\0") for word in words)
    lines = textwrap.wrap(text, 78, break_long_words=False, break_on_hyphens=False)
    return f"\n{indent}".join(lines).replace("\0", " ")


_HEADER = """\
// The contract between Python and compiled code, made by `python -m fantoccini.contract` from
// fantoccini/contract/*.py: change it there.
#pragma once

#include "real.hpp"

namespace fan {{

// A hash of the contract.
constexpr long long contract_digest = {digest};

// Who a library is, as Python checks when it loads it: the contract's hash, how many trajectories
// or configurations are advanced together, and the puppet's sizes.
template <class Sizes>
void identity(int width, long long* out) {{
  const long long values[] = {{
      contract_digest, width, {sizes}}};
  for (long long value : values) *out++ = value;
}}

// The generated functions. A result goes to its argument; several go to members of their names:
// arrays, pointers or numbers. Where `constants` is false, entries that are always the same are
// left as an earlier call with it has written them.
template <class Model, class Real>
struct Call {{
{calls}
 private:
  FAN_FN static Real* at(Real* x) {{ return x; }}
  FAN_FN static Real* at(Real& x) {{ return &x; }}
}};

}}  // namespace fan
"""
