"""Sizes, index tables and numbers of a tree as C++ constants, for the runtime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate

from fantoccini.base.documents import Parameter
from fantoccini.kernel.codegen.model import STEM
from fantoccini.kernel.equations import Equations
from fantoccini.model.tree import TURNS_WITH_LINK, WORLD, LimitRow, Role, StringRow, Tree

NUMBERS = "numbers"
"""Name of the files that hold the numbers in the tables, without their endings."""

IndexPairs = tuple[tuple[int, int], ...]


def tables_text(
    equations: Equations,
    sizes: dict[str, int] | None = None,
    numbers: Mapping[str, Sequence[float]] | None = None,
) -> str:
    """``model.hpp``: sizes and index tables of a tree as C++ constants.

    Args:
        equations: the derived equations.
        sizes: the constants, for functions that need no tables; these are then left out.
        numbers: tables of numbers by name. Their values have a file of their own, so that puppets
            that differ in them alone share compiled code.
    """
    constants = [
        f"  static constexpr int {name} = {value};"
        for name, value in (sizes or equations.sizes).items()
    ]
    tables = [] if sizes else _tables(equations)
    if numbers:
        arrays = [(f"double {name}[{max(1, len(n))}]", _macro(name)) for name, n in numbers.items()]
        tables += ["#ifdef FAN_APART"]
        tables += [f"  static const {array};" for array, _ in arrays]
        tables += ["#else", f'#include "{NUMBERS}.h"']
        tables += [f"  static constexpr {array} = {macro};" for array, macro in arrays]
        tables += ["#endif"]
    lines = ["#pragma once", "", "namespace fan {", "", "struct ModelTables {", *constants, *tables]
    return "\n".join([*lines, "};", "", "}  // namespace fan", ""])


def numbers_text(numbers: Mapping[str, Sequence[float]]) -> dict[str, str]:
    """The files with the values of tables of numbers: a header, and a unit that defines them."""
    values = {name: ", ".join(map(repr, n)) or "0" for name, n in numbers.items()}
    header = [f"#define {_macro(name)} {{{text}}}" for name, text in values.items()]
    unit = [f"const double fan::ModelTables::{name}[] = {_macro(name)};" for name in numbers]
    includes = [f'#include "{NUMBERS}.h"', f'#include "{STEM}.hpp"', ""]
    return {
        f"{NUMBERS}.h": "\n".join([*header, ""]),
        f"{NUMBERS}.cpp": "\n".join([*includes, *unit, ""]),
    }


def nominal_lengths(tree: Tree) -> list[float]:
    """Lengths of the strings whose length is a number [m]; 0 for the others."""
    return [_nominal(string) for string in tree.strings]


def _macro(name: str) -> str:
    return f"FAN_{name.upper()}"


def _tables(equations: Equations) -> list[str]:
    tree, table = equations.tree, equations.tree.coordinates
    columns = equations.columns
    column_of = {link: k for k, link in enumerate(columns)}
    limit_slices = [_limit_velocity(tree, limit) for limit in tree.limits]
    units = {row.name: row.unit for row in table.rows}
    turns = [int(units.get(name, "rad") != "m") for name in table.v_D]
    length_q = [s.driven_length[0] if s.driven_length else -1 for s in tree.strings]
    length_v = [s.driven_length[1] if s.driven_length else -1 for s in tree.strings]
    wound_q = [s.wound_length[0] if s.wound_length else -1 for s in tree.strings]
    return [
        f"  static constexpr bool coupled = {int(_coupled(tree))};",
        # Whether driven accelerations act on dynamic coordinates by themselves, not through rows.
        f"  static constexpr bool accelerated = {int(_coupled(tree) or _has_commands(tree))};",
        _array("bool", "wire", [int(s.wire) for s in tree.strings]),
        # Indices of a length in q_K and v_K, and in q_D if a drive winds it; otherwise -1.
        _array("int", "length_q", length_q),
        _array("int", "length_v", length_v),
        _array("int", "wound_q", wound_q),
        _array("int", "string_points", [len(s.points) for s in tree.strings]),
        # Indices in v_D of the entries of a string's column of W.
        *_lists("string", [_string_velocities(tree, s) for s in tree.strings]),
        _array("bool", "turns", turns),
        _array("int", "motor_v", tree.driven_v_D),
        _array("bool", "watched_steps", [int(row.has_stepper) for row in tree.watched]),
        _array("bool", "watched_turns", [turns[row.v.start] for row in tree.watched]),
        _array("int", "limit_v", [first for first, _ in limit_slices]),
        _array("int", "limit_n", [n for _, n in limit_slices]),
        # Index of a limit's column in Equations.columns, and indices in v_D of its entries.
        f"  static constexpr int n_columns = {len(columns)};",
        _array("int", "limit_column", [column_of[r.link] for r in tree.limits if columns]),
        *_lists("column", [entries for entries, _ in columns.values()]),
        *_contact_tables(tree),
        *_space("Dynamic", table.n_qD, table.n_vD, table.scalars_D, table.quaternions_D),
        *_space("Driven", table.n_qK, table.n_vK, table.scalars_K, table.quaternions_K),
    ]


def _space(
    name: str, n_q: int, n_v: int, scalars: IndexPairs, quaternions: IndexPairs
) -> list[str]:
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


def _array(kind: str, name: str, values: Sequence[float]) -> str:
    """A constant array; an empty one gets an unused entry, since C++ has no empty arrays."""
    body = ", ".join(repr(v) for v in values) or "0"
    return f"  static constexpr {kind} {name}[{max(1, len(values))}] = {{{body}}};"


def _coupled(tree: Tree) -> bool:
    """Whether M_DK is not zero: dynamic and driven joints move a common link."""
    paths = (tree.ancestors(i) for i in range(len(tree.links)))
    return any(len({tree.links[i].role for i in path} - {Role.FIXED}) > 1 for path in paths)


def _has_commands(tree: Tree) -> bool:
    """Whether the force of a drive depends on its command's acceleration."""
    return any(row.command is not None for row in tree.drives)


def _lists(name: str, lists: list[list[int]]) -> list[str]:
    """Concatenated lists ``name_entry``, and the index of each list's start ``name_begin``."""
    starts = accumulate((len(entries) for entries in lists), initial=0)
    return [
        _array("int", f"{name}_begin", list(starts)),
        _array("int", f"{name}_entry", [entry for entries in lists for entry in entries]),
    ]


def _contact_tables(tree: Tree) -> list[str]:
    """For contact: parents of links, and indices of the velocities that move them."""
    if not tree.n_contacts:
        return []
    moving_velocities: dict[Role, list[list[int]]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
    for i in range(len(tree.links)):
        for role, paths in moving_velocities.items():
            links = [tree.links[j] for j in reversed(tree.ancestors(i))]
            paths.append([k for a in links if a.role is role for k in range(a.v.start, a.v.stop)])
    return [
        _array("int", "link_parent", [link.parent for link in tree.links]),
        *_lists("moved_D", moving_velocities[Role.DYNAMIC]),
        *_lists("moved_K", moving_velocities[Role.DRIVEN]),
        *_lists("carried", _carriers(tree, moving_velocities)),
    ]


def _carriers(tree: Tree, moving_velocities: dict[Role, list[list[int]]]) -> list[list[int]]:
    """Velocities that move the axis of each velocity; v_K follows v_D."""
    t = tree.coordinates
    carriers: list[list[int]] = [[] for _ in range(t.n_vD + t.n_vK)]
    for i, link in enumerate(tree.links):
        if link.role is Role.FIXED:
            continue
        first = t.n_vD if link.role is Role.DRIVEN else 0
        for k in range(link.v.start, link.v.stop):
            turns = k - link.v.start in TURNS_WITH_LINK.get(link.kind, ())
            carrier = i if turns else link.parent
            if carrier != WORLD:
                driven = [t.n_vD + j for j in moving_velocities[Role.DRIVEN][carrier]]
                carriers[first + k] = moving_velocities[Role.DYNAMIC][carrier] + driven
    return carriers


def _string_velocities(tree: Tree, string: StringRow) -> list[int]:
    """Indices in v_D of the links between a string's points and the world, in order."""
    paths = (tree.ancestors(point.link) for point in string.points)
    links = {i for path in paths for i in path if tree.links[i].role is Role.DYNAMIC}
    if string.wound_length:
        links |= {d.link for d in tree.drives if d.v.start == string.wound_length[1]}
    return [k for i in sorted(links) for k in range(tree.links[i].v.start, tree.links[i].v.stop)]


def _nominal(string: StringRow) -> float:
    if string.length is None:
        return 0.0
    length = string.length
    return length.value if isinstance(length, Parameter) else float(length)


def _limit_velocity(tree: Tree, limit: LimitRow) -> tuple[int, int]:
    velocities = tree.links[limit.link].v
    return velocities.start, velocities.stop - velocities.start
