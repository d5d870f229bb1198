"""Equations -> C99 without dependencies, for other programs.

``fan_model.c`` has no state and needs only a C99 compiler and its mathematics library;
``fan_model.h`` documents every function; ``example.c`` evaluates the model once.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings), v and acc
their velocities and accelerations. With the inertia matrix M_DD = F^T F, w0 = F^-T f are the scaled
forces f without strings, and W = F^-T A_D^T those of unit tensions.
"""

from __future__ import annotations

import math
import textwrap

import casadi as ca

from fantoccini.kernel.codegen.orders import NAMES, Order, orders, shown
from fantoccini.kernel.codegen.statements import definition, prototype
from fantoccini.kernel.contract import FUNCTIONS
from fantoccini.kernel.equations import Equations
from fantoccini.model.tree import Tree


def c99_files(equations: Equations) -> dict[str, str]:
    """The files of an exported model: name -> text."""
    functions = {name: equations[name] for name, f in FUNCTIONS.items() if f.exported}
    return {
        "fan_model.h": _header(equations.tree, functions, equations.sizes),
        "fan_model.c": _source(functions),
        "example.c": _example(equations.tree),
    }


def _source(functions: dict[str, ca.Function]) -> str:
    parts = ['#include "fan_model.h"\n\n#include <math.h>']
    parts += [definition(function, f"fan_{name}") for name, function in functions.items()]
    return "\n\n".join(parts) + "\n"


def _header(tree: Tree, functions: dict[str, ca.Function], sizes: dict[str, int]) -> str:
    lists, size_names = orders(tree), NAMES | {"n_v": "v", "n_packed": "packed"}
    parts = [
        _comment([f"The equations of motion of {shown(tree.name)}.", "", *_RULES]),
        "#ifndef FAN_MODEL_H\n#define FAN_MODEL_H\n",
        '#ifdef __cplusplus\nextern "C" {\n#endif\n',
        "enum {\n"
        + ",\n".join(f"  FAN_N_{name.upper()} = {sizes[n]}" for n, name in size_names.items())
        + "\n};\n",
        *(_listed(name, lists[name]) for name in lists if name not in ("strings", "limits")),
    ]
    for name, function in functions.items():
        parts.append(_described(name, function, sizes) + prototype(function, f"fan_{name}") + ";\n")
    parts.append("#ifdef __cplusplus\n}\n#endif\n")
    parts.append("#endif\n")
    return "\n".join(parts)


_RULES = (
    "Every function reads its const arguments, writes its results and does nothing else; it can "
    "be called from any thread. A result whose pointer is null is left out. Matrices are stored "
    "column by column: entry (i, j) of an n x m matrix is [i + n * j]. SI units, z up, angles in "
    "rad; quaternions are w, x, y, z, angular velocities are in the body's frame. Tension is "
    "-lam; M acc_D + M_DK acc_K + c + f = u_D + A_D^T lam. Equation numbers are those of Johnson "
    "and Murphey, Dynamic Modeling and Motion Planning for Marionettes (ICRA 2007).",
)


def _comment(paragraphs: list[str]) -> str:
    lines = []
    for paragraph in paragraphs:
        lines += textwrap.wrap(paragraph, 94, break_long_words=False) or [""]
    return "/* " + "\n * ".join(lines).replace(" * \n", " *\n") + "\n */"


def _listed(name: str, order: Order) -> str:
    entries = [f"{k:4d}  {entry}" for k, entry in enumerate(order.entries)] or ["  none"]
    return "/* " + f"{name}: {order.title}\n * " + "\n * ".join(entries) + "\n */\n"


def _described(name: str, function: ca.Function, sizes: dict[str, int]) -> str:
    declared = FUNCTIONS[name]
    rows = [("in ", q) for q in declared.arguments] + [("out", q) for q in declared.results]
    lines = [f"fan_{name}: {declared.purpose} {function.n_instructions()} operations."]
    lines = textwrap.wrap(lines[0], 94)
    for direction, q in rows:
        size = " x ".join(map(str, q.dimensions(sizes))) or "1"
        size_names = [NAMES[n] for n in q.shape if n in NAMES]
        order = f", by {' x '.join(size_names)}" if size_names and size_names != [q.name] else ""
        lines.append(f"  {direction} {q.name:<12}{size:>9}  {q.described}{order}".rstrip())
    return "/* " + "\n * ".join(lines) + "\n */\n"


def _example(tree: Tree) -> str:
    """A program that evaluates the model in the puppet file's pose, with strings just taut."""
    table = tree.coordinates
    vectors = {
        "q_D": list(table.start_D),
        "v_D": [0.0] * table.n_vD,
        "q_K": [0.0 if math.isnan(x) else x for x in table.start_K],
        "v_K": [0.0] * table.n_vK,
        "p": list(tree.parameters.values()),
    }
    unset = [
        (s.driven_length[0], i)
        for i, s in enumerate(tree.strings)
        if s.driven_length and math.isnan(table.start_K[s.driven_length[0]])
    ]
    reach = "".join(f"  q_K[{q}] += h[{i}];\n" for q, i in unset)
    return _EXAMPLE.format(
        vectors="\n".join(_vector(name, values) for name, values in vectors.items()),
        reach=f"  fan_constraint(q_D, q_K, p, h);\n{reach}" if unset else "",
    )


def _vector(name: str, values: list[float]) -> str:
    """A C array; an empty one gets an unused entry, since C does not allow empty arrays."""
    numbers = ", ".join(repr(float(v)) for v in values) or "0.0"
    text = f"double {name}[{max(1, len(values))}] = {{{numbers}}};"
    return "\n".join(textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="      "))


_EXAMPLE = """\
/* Evaluates the model once, at rest in the puppet file's pose, and lets go of all strings:
 * cc -std=c99 -O2 example.c fan_model.c -lm && ./a.out
 */
#include <stdio.h>

#include "fan_model.h"

static void show(const char *name, const double *values, int n)
{{
  int i;
  printf("%s:", name);
  for (i = 0; i < n; ++i) printf(" %.6g", values[i]);
  printf("\\n");
}}

int main(void)
{{
{vectors}
  double h[FAN_N_ROWS + 1], L[FAN_N_PACKED + 1], w0[FAN_N_V_D + 1], acc_D[FAN_N_V_D + 1], T, V;
{reach}  fan_constraint(q_D, q_K, p, h);
  fan_energy(q_D, v_D, q_K, v_K, p, &T, &V);
  /* v_K and v_D are zero, and so may stand for acc_K and u_D. */
  fan_dynamics(q_D, v_D, q_K, v_K, v_K, v_D, p, L, w0, NULL, NULL, NULL, NULL, NULL, NULL,
      NULL, NULL, NULL, NULL, NULL, NULL, NULL);
  fan_solve_factor(L, w0, acc_D);
  show("h", h, FAN_N_ROWS);
  show("potential energy [J]", &V, 1);
  show("acc_D without strings", acc_D, FAN_N_V_D);
  return 0;
}}
"""
