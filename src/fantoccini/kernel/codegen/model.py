"""Source text of a puppet's equations, without names from the user's file.

A library consists of ``model.c`` and its pieces (the functions), ``model.hpp`` (sizes and index
tables as constants) and ``main.cpp`` (the C interface). Pieces can be compiled separately, in
parallel. The text depends on the equations only.

A table is a constant array of indices, such as the parents of links. n_vD and n_vK are the numbers
of dynamic and driven velocities; a row is a string or a joint limit. A drive moves a coordinate by
a motor towards its command.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fantoccini.kernel.codegen.straight import CALL_ARGUMENTS, Program, dealt, pieces, program
from fantoccini.kernel.contract import FUNCTIONS
from fantoccini.kernel.equations import Equations

STEM = "model"
"""Name of the files that hold the model, without their endings."""


class PieceSizes(NamedTuple):
    """Sizes at which generated functions are cut, chosen for short compile times (docs/growth.md).

    Attributes:
        piece: largest number of arithmetic statements of a piece.
        file: statements at which the next piece starts another file.
    """

    piece: int = 1000
    file: int = 12000


SIZES = PieceSizes()


@dataclass(frozen=True)
class Generated:
    """Source text of a puppet.

    Attributes:
        files: file name -> text.
        main: the file to compile.
        units: further files to compile, all with ``FAN_APART`` defined; without it ``main`` alone
            is complete.
        pieces: files that the units include.
        operations: arithmetic operations of every generated function.
        shared_units: runtime headers compiled once per machine and linked (see ``build.Source``).
    """

    files: dict[str, str]
    main: str
    units: tuple[str, ...]
    operations: dict[str, int]
    pieces: tuple[str, ...] = ()
    shared_units: tuple[str, ...] = ()


@dataclass(frozen=True)
class Real:
    """The type of the numbers in functions.

    Attributes:
        type: name of the type in C++.
        space: namespace of the functions, inside ``fan``.
        header: header that declares the type.
        stem: beginning of the names of the functions' files.
    """

    type: str = "double"
    space: str = "scalar"
    header: str = "fantoccini/math/elementary.hpp"
    stem: str = STEM


def assembled(
    parts: Mapping[Real, dict[str, Program]], shared_files: dict[str, str], numbers: dict[str, str]
) -> Generated:
    """Functions in units of their own, with the files that call them.

    Args:
        parts: functions by name, for each type that they compute with.
        shared_files: ``main.cpp`` and the files that it includes (:func:`declared_functions`).
        numbers: the files of :func:`numbers_text`; none where ``model.hpp`` has no tables.
    """
    texts, counts = dict[str, str](), dict[str, int]()
    units = {name: text for name, text in numbers.items() if name.endswith(".cpp")}
    included = [name for name in numbers if name not in units]
    texts |= numbers
    for real, functions in parts.items():
        text = model_text(functions, stem=real.stem)
        counts |= _counted(functions)
        texts |= text
        names = [name for name in text if name != f"{real.stem}.c"]
        calls, *piece_files = names
        units |= {
            name.replace("pieces", "unit").replace(".c", ".cpp"): _UNIT.format(
                includes=_includes((calls, name) if k == 0 else (name,)),
                type=real.type,
                space=real.space,
                header=real.header,
            )
            for k, name in enumerate(piece_files)
        }
        included += names
    return Generated(
        texts | units | shared_files, "main.cpp", tuple(units), counts, tuple(included)
    )


def programs(
    equations: Equations, names: Iterable[str] | None = None, columns: bool = True
) -> dict[str, Program]:
    """Name -> statements of a compiled function.

    Args:
        equations: the derived equations.
        names: names of the functions; by default those of the model.
        columns: whether to add ``Equations.columns``, as ``column_0`` and so on.
    """
    names = equations.model if names is None else names
    functions = {name: program(equations[name]) for name in names}
    added = equations.columns.values() if columns else ()
    return functions | {f"column_{k}": program(function) for k, (_, function) in enumerate(added)}


def operations(equations: Equations) -> dict[str, int]:
    """Number of arithmetic operations of every compiled function, and of all ``columns``."""
    return _counted(programs(equations))


def _counted(functions: dict[str, Program]) -> dict[str, int]:
    counts = {n: statements.operations for n, statements in functions.items() if not _is_column(n)}
    columns = [statements.operations for n, statements in functions.items() if _is_column(n)]
    return counts | ({"columns": sum(columns)} if columns else {})


def _is_column(name: str) -> bool:
    return name.startswith("column_")


def model_text(
    functions: dict[str, Program], longest: int = SIZES.piece, stem: str = STEM
) -> dict[str, str]:
    """The C text of functions, to be included after ``casadi_real`` is defined.

    ``model.c`` declares the functions where ``FAN_APART`` is defined, and otherwise includes
    ``calls.c``, which defines them; they call the pieces, which are in ``pieces0.c`` and so on.

    Args:
        functions: name -> statements.
        longest: largest number of arithmetic statements of a piece.
        stem: beginning of the files' names.

    Returns:
        File name -> text.
    """
    all_pieces = {
        name: pieces(statements, f"fan_{name}", longest, _constant_results(name))
        for name, statements in functions.items()
    }
    files = dealt([piece for cut in all_pieces.values() for piece in cut.pieces], SIZES.file)
    first = _prefix(stem)
    names = [f"{first}pieces{k}.c" for k in range(len(files))]
    piece_declarations = [line for cut in all_pieces.values() for line in cut.declarations]
    definitions = [cut.definition for cut in all_pieces.values()] + [_switch(functions)]
    calls = _CALLS.format(
        declarations="\n".join(piece_declarations),
        definitions="\n\n".join(definitions),
        includes=_includes(names),
    )
    texts = {f"{stem}.c": declared_functions(functions, stem), f"{first}calls.c": calls}
    return texts | dict(zip(names, files, strict=True))


def declared_functions(functions: Iterable[str], stem: str = STEM) -> str:
    """The text of ``model.c``: it depends only on the names of the functions.

    Args:
        functions: names of the functions.
        stem: beginning of the files' names.
    """
    heads = ["void fan_column(int which, const casadi_real** arg, casadi_real** res);"]
    for name in filter(lambda name: not _is_column(name), functions):
        variants = (name, f"{name}_varying") if _constant_results(name) else (name,)
        heads += [f"int fan_{variant}({CALL_ARGUMENTS});" for variant in variants]
        if len(variants) > 1:
            heads.append(f"void fan_{name}_constants(casadi_real** res);")
    return _MODEL.format(
        declarations="\n".join(heads), includes=_includes([f"{_prefix(stem)}calls.c"])
    )


def _prefix(stem: str) -> str:
    return "" if stem == STEM else f"{stem}_"


def _includes(names: Iterable[str]) -> str:
    return "\n".join(f'#include "{name}"' for name in names)


def _constant_results(name: str) -> tuple[str, ...]:
    return FUNCTIONS[name].standing if name in FUNCTIONS else ()


def _switch(functions: dict[str, Program]) -> str:
    """The function that calls a column of ``Equations.columns`` by its number."""
    calls = [
        f"    case {k}: fan_{name}(arg, res, nullptr, nullptr, 0); break;"
        for k, name in enumerate(filter(_is_column, functions))
    ]
    head = "FAN_CALL void fan_column(int which, const casadi_real** arg, casadi_real** res) {"
    return "\n".join([head, "  switch (which) {", *calls, "  }", "}"])


_MODEL = """\
#ifndef casadi_int
#define casadi_int long long int
#endif
#ifdef FAN_APART
{declarations}
#else
#define FAN_PIECE static __attribute__((noinline))
#define FAN_CALL inline
{includes}
#undef FAN_PIECE
#undef FAN_CALL
#endif
"""

_CALLS = """\
{declarations}

{definitions}

#ifndef FAN_APART
{includes}
#endif
"""

_UNIT = """\
// Pieces of a compiled puppet's functions.
#include <cmath>

#include "{header}"

namespace fan {{
namespace {space} {{
#define casadi_real {type}
#define casadi_int long long int
#define FAN_PIECE
#define FAN_CALL
{includes}
}}  // namespace {space}
}}  // namespace fan
"""
