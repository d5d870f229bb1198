"""The contract as a page of the docs: ``docs/functions.md``.

The contract declares the functions and structures that Python and C++ share. In names, D stands for
dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and lengths
of strings, driven joints.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fantoccini.kernel.contract.arguments import ARGUMENTS
from fantoccini.kernel.contract.constants import CONSTANTS
from fantoccini.kernel.contract.function import Function
from fantoccini.kernel.contract.functions import FUNCTIONS
from fantoccini.kernel.contract.quantity import SIZES, Quantity
from fantoccini.kernel.contract.samples import CONTACT, EVENT, SAMPLE, WINCH

PAGE = Path(__file__).resolve().parents[4] / "docs" / "functions.md"


def page() -> str:
    """The text of ``docs/functions.md``."""
    functions = FUNCTIONS.values()
    results = [(f"{f.name}.{q.name}", q) for f in functions for q in f.results]
    return _PAGE.format(
        sizes="\n".join(f"| `{name}` | {meaning} |" for name, meaning in SIZES.items()),
        functions="\n".join(map(_function_row, functions)),
        arguments=_table("argument", ARGUMENTS.items()),
        results=_table("result", results),
        sample=_table("part", ((q.name, q) for q in SAMPLE)),
        event=_table("part", ((q.name, q) for q in EVENT)),
        contact=_table("part", ((q.name, q) for q in CONTACT)),
        winch=_table("part", ((q.name, q) for q in WINCH)),
        constants="\n".join(
            f"| `{name}` | {float(x):g} | {x.unit} | {x.meaning} |" for name, x in CONSTANTS.items()
        ),
    )


def _function_row(function: Function) -> str:
    arguments = ", ".join(q.name for q in function.arguments)
    results = ", ".join(f"`{q.name}`" for q in function.results)
    libraries = [*function.libraries, *["C99"] * function.exported]
    cells = f"| `{function.name}({arguments})` | {results} | {function.purpose} "
    return f"{cells}| {', '.join(libraries) or 'interpreted'} |"


def _table(title: str, quantities: Iterable[tuple[str, Quantity]]) -> str:
    lines = [f"| {title} | shape | unit | meaning |", "|---|---|---|---|"]
    for name, q in quantities:
        shape = f"({', '.join(map(str, q.shape))}{',' if len(q.shape) == 1 else ''})"
        lines.append(f"| `{name}` | {shape if q.shape else 'number'} | {q.unit} | {q.meaning} |")
    return "\n".join(lines)


_PAGE = """\
# Generated functions

After this page you can call any function that is generated from a puppet's equations, and read the
samples and events of a run. `python -m fantoccini.kernel.contract` generates this page from
`kernel/contract`, and the header `kernel/cpp/fantoccini/contract.hpp`; the ctypes structures and
the C99 header come from the same declarations.

```python
import fantoccini as fan

arm = fan.puppets.arm2d()
x = arm.rest()
at = {{"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K, "p": arm.p}}
results = arm.library.evaluate("dynamics", **at, acc_K=0 * x.v_K, u_D=0 * x.v_D)
print(results.G, results.hdot)               # results by name; leading axes broadcast
M = arm.equations["mass_matrix"](q_D=x.q_D, q_K=x.q_K, p=arm.p)["M"]    # interpreted
```

Compiled functions of `model` and `derivatives` (`arm.libraries.derivatives.at`) are called
from Python, all others by compiled code, as members of `fan::Call`. To add a quantity, declare it
in `kernel/contract/functions.py` and derive it in `kernel/equations/functions.py`, in a method of
its name.

Units that are left out follow from the coordinate: m or rad, velocities per s, forces N or N m.
Matrices are stored column by column.

## Sizes

| size | number of |
|---|---|
{sizes}

## Functions

| function | results | purpose | libraries |
|---|---|---|---|
{functions}

## Arguments

{arguments}

## Results

{results}

## A sample of a run

{sample}

## An event of a run

{event}

## A contact point of a run

{contact}

## A winch

{winch}

## Constants

| constant | value | unit | meaning |
|---|---|---|---|
{constants}
"""
