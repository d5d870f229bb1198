"""Textbook symbols for a puppet's coordinates.

An angle is theta, a slide s, a position x, y, z, a string's length L, a drive's command r, a unit
quaternion e_0 ... e_3 with the angular velocity omega_1 ... omega_3; each has a number if there are
several of its kind. Velocities carry a dot. A parameter keeps its name.

A drive moves a coordinate by a motor towards its command. q_D and q_K are the dynamic and driven
coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import sympy as sp

from fantoccini.model.tree import Role, Tree

_BALL = ("qw", "qx", "qy", "qz")


@dataclass(frozen=True)
class Notation:
    """Symbols of a puppet's coordinates, velocities and parameters.

    Attributes:
        symbols: q_D, v_D, q_K, v_K, p -> symbols of their entries.
        names: symbol of a coordinate or parameter -> its name in the puppet file.
        quaternions: q_D, q_K -> places where a unit quaternion begins.
    """

    symbols: dict[str, list[sp.Symbol]]
    names: dict[sp.Symbol, str]
    quaternions: dict[str, list[int]]
    _taken: dict[str, int] = field(default_factory=dict)

    def fresh(self, letter: str) -> sp.Symbol:
        """A symbol with the letter and the next number."""
        used_names = {s.name for part in self.symbols.values() for s in part}
        while True:
            self._taken[letter] = self._taken.get(letter, 0) + 1
            name = f"{letter}_{self._taken[letter]}"
            if name not in used_names:
                return sp.Symbol(name, real=True)


def notation(tree: Tree) -> Notation:
    """The symbols of a tree's coordinates and parameters."""
    hinges = {link.joint for link in tree.links if link.kind == "revolute"}
    lengths = {f"{string.name}.length" for string in tree.strings}
    table = tree.coordinates
    letters = {
        row.name: _letter(row.name, row.owner in hinges)
        for row in table.rows
        if row.role is not Role.FIXED
    }
    letters |= dict.fromkeys(lengths & letters.keys(), "L")
    letters |= dict.fromkeys(letters.keys() & set(table.commands.values()), "r")
    count: dict[str, list[str]] = {}
    for name, letter in letters.items():
        count.setdefault(letter, []).append(name)
    symbols: dict[str, list[sp.Symbol]] = {}
    names: dict[sp.Symbol, str] = {}
    written: dict[str, tuple[str, str]] = {}
    for name, letter in letters.items():
        names_of_letter = count[letter]
        number = str(names_of_letter.index(name) + 1) if len(names_of_letter) > 1 else ""
        written[name] = (letter, number)
    for role in ("D", "K"):
        q, v = getattr(table, f"q_{role}"), getattr(table, f"v_{role}")
        symbols[f"q_{role}"] = [_symbol(*_split(*written[name])) for name in q]
        names.update(zip(symbols[f"q_{role}"], q, strict=True))
        symbols[f"v_{role}"] = [_velocity(name, written) for name in v]
    used_names = {s.name for part in symbols.values() for s in part}
    symbols["p"] = []
    for name in tree.parameters:
        text = name.replace("-", "_")
        while text in used_names:
            text += "_p"
        used_names.add(text)
        symbols["p"].append(sp.Symbol(text, real=True))
        names[symbols["p"][-1]] = name
    quaternions = {
        "q_D": [q for q, _ in table.quaternions_D],
        "q_K": [q for q, _ in table.quaternions_K],
    }
    return Notation(symbols, names, quaternions)


def _letter(name: str, turns: bool) -> str:
    """The letter of a joint's configuration number; for a quaternion with the component's digit."""
    last = name.rsplit(".", 1)[-1] if "." in name else ""
    if last in _BALL:
        return f"e{_BALL.index(last)}"
    if last in ("x", "y", "z"):
        return last
    return "theta" if turns else "s"


def _split(letter: str, index_text: str) -> tuple[str, str]:
    """Letter and subscript; the component's digit is last in the subscript."""
    return (letter[0], index_text + letter[1]) if letter[0] == "e" else (letter, index_text)


def _velocity(name: str, written: dict[str, tuple[str, str]]) -> sp.Symbol:
    last = name.rsplit(".", 1)[-1]
    if last in ("wx", "wy", "wz"):
        _, index_text = written[f"{name[: -len(last)]}qw"]
        return _symbol("omega", f"{index_text}{('wx', 'wy', 'wz').index(last) + 1}")
    letter, index_text = written[name]
    return _symbol(f"{letter}dot", index_text)


def _symbol(letter: str, subscript: str) -> sp.Symbol:
    return sp.Symbol(f"{letter}_{subscript}" if subscript else letter, real=True)
