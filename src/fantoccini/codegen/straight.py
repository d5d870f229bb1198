"""A CasADi function as straight-line C, cut into pieces that a compiler takes in its stride.

Compilers take straight-line code in a time that grows faster than its length. The statements of a
function are therefore dealt out, in their order, to pieces: functions of their own that are handed
the arguments, the results and a work array. A value that is used in a later piece travels through
the work array, or through the result that it is. Inside a piece values are constants with names.

CasADi turns x (1 / y) into x / y. Where a divisor divides more than once, it is inverted once here:
a division takes as long as five products and more.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from dataclasses import dataclass

import casadi as ca

from fantoccini.codegen.statements import expression, literal

_NOT_ARITHMETIC = (ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT)


@dataclass(frozen=True)
class Statement:
    """An operation; its value's name is its place in the list.

    Attributes:
        operation: CasADi's code.
        of: places of the values it is made of.
        constant: its value, for OP_CONST.
        argument: (which, entry), for OP_INPUT.
    """

    operation: int
    of: tuple[int, ...] = ()
    constant: float = 0.0
    argument: tuple[int, int] = (0, 0)

    @property
    def is_arithmetic(self) -> bool:
        return self.operation not in _NOT_ARITHMETIC


@dataclass(frozen=True)
class Program:
    """The statements of a function, each value assigned once.

    Attributes:
        statements: operands before what is made of them.
        results: (which, entry, place of the value) of every entry of every result.
    """

    statements: list[Statement]
    results: list[tuple[int, int, int]]

    @property
    def operations(self) -> int:
        """Arithmetic operations of one evaluation."""
        return sum(s.is_arithmetic for s in self.statements)


def program(function: ca.Function) -> Program:
    """The statements of a function of dense SX, with shared divisors inverted once."""
    statements: list[Statement] = []
    results: list[tuple[int, int, int]] = []
    holds: dict[int, int] = {}  # place in CasADi's work vector -> statement
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        into, of = function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_OUTPUT:
            results.append((into[0], into[1], holds[of[0]]))
            continue
        if operation == ca.OP_CONST:
            made = Statement(operation, constant=function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            made = Statement(operation, argument=(of[0], of[1]))
        else:
            made = Statement(operation, tuple(holds[i] for i in of))
        holds[into[0]] = len(statements)
        statements.append(made)
    return _inverted(Program(statements, results))


def _inverted(whole: Program) -> Program:
    """The same program with each divisor of several quotients inverted once."""
    divided = Counter(s.of[-1] for s in whole.statements if s.operation in (ca.OP_DIV, ca.OP_INV))
    statements: list[Statement] = []
    place: list[int] = []
    inverse: dict[int, int] = {}

    def add(statement: Statement) -> int:
        statements.append(statement)
        return len(statements) - 1

    for s in whole.statements:
        of = tuple(place[i] for i in s.of)
        if s.operation not in (ca.OP_DIV, ca.OP_INV) or divided[s.of[-1]] == 1:
            place.append(add(Statement(s.operation, of, s.constant, s.argument)))
            continue
        if of[-1] not in inverse:
            inverse[of[-1]] = add(Statement(ca.OP_INV, (of[-1],)))
        reciprocal = inverse[of[-1]]
        product = s.operation == ca.OP_DIV
        place.append(add(Statement(ca.OP_MUL, (of[0], reciprocal))) if product else reciprocal)
    return Program(statements, [(r, k, place[v]) for r, k, v in whole.results])


@dataclass(frozen=True)
class Pieces:
    """The C text of a function.

    Attributes:
        name: of the function.
        declarations: of the pieces.
        pieces: their definitions.
        definition: of the function, which calls them one after the other.
    """

    name: str
    declarations: list[str]
    pieces: list[str]
    definition: str


def pieces(function: ca.Function, name: str, longest: int) -> Pieces:
    """The text of a function in pieces.

    ``casadi_real`` and ``FAN_PIECE`` (qualifiers of the pieces) are for the including file to
    define. No pointer may be null but those of empty arguments and results.

    Args:
        function: its inputs and outputs are dense.
        name: of the C function.
        longest: arithmetic statements of a piece.
    """
    whole = program(function)
    cut = _Cut(whole, longest)
    head = "const casadi_real* const* arg, casadi_real* const* res, casadi_real* w"
    names = [f"{name}_{k}" for k in range(cut.n)]
    texts = [
        "\n".join([f"FAN_PIECE void {n}({head}) {{", *cut.body(k), "}"])
        for k, n in enumerate(names)
    ]
    lines = [
        _head(name),
        f"  casadi_real work[{max(1, cut.n_work)}];",
        *(f"  {n}(arg, res, work);" for n in names),
        "  return 0;",
        "}",
    ]
    return Pieces(name, [f"FAN_PIECE void {n}({head});" for n in names], texts, "\n".join(lines))


def alias(name: str, other: str) -> str:
    """The text of a function that is another one."""
    return f"{_head(name)}\n  return {other}(arg, res, nullptr, nullptr, 0);\n}}"


def _head(name: str) -> str:
    """What a function begins with; it has the arguments of CasADi's generated functions."""
    arguments = "const casadi_real** arg, casadi_real** res, casadi_int*, casadi_real*, int"
    return f"inline int {name}({arguments}) {{"


def dealt(texts: list[str], statements: int) -> list[str]:
    """Texts joined in their order to files of at least so many statements, the last one less."""
    files: list[list[str]] = [[]]
    n = 0
    for text in texts:
        if n >= statements:
            files.append([])
            n = 0
        files[-1].append(text)
        n += text.count("\n")
    return ["\n\n".join(file) + "\n" for file in files]


class _Cut:
    """Where the statements of a program go, and how values travel.

    Args:
        whole: the program.
        longest: arithmetic statements of a piece.
    """

    def __init__(self, whole: Program, longest: int):
        self.whole = whole
        done, self.piece = 0, []
        for s in whole.statements:
            self.piece.append(done // longest)
            done += s.is_arithmetic
        self.n = self.piece[-1] + 1 if self.piece else 1
        self.last = list(self.piece)
        for k, s in enumerate(whole.statements):
            for i in s.of:
                self.last[i] = max(self.last[i], self.piece[k])
        self.results: dict[int, list[tuple[int, int]]] = {}
        for which, entry, value in whole.results:
            self.results.setdefault(value, []).append((which, entry))
        self.slot = self._slots()
        self.n_work = max(self.slot.values(), default=-1) + 1

    def _slots(self) -> dict[int, int]:
        """Places in the work array of the values that travel through it."""
        slot: dict[int, int] = {}
        free: list[int] = []
        ends: dict[int, list[int]] = {}
        used, piece = 0, 0
        for k, s in enumerate(self.whole.statements):
            while piece < self.piece[k]:
                free += ends.pop(piece, [])
                piece += 1
            if not s.is_arithmetic or self.last[k] == self.piece[k] or k in self.results:
                continue
            slot[k] = free.pop() if free else used
            used = max(used, slot[k] + 1)
            ends.setdefault(self.last[k], []).append(slot[k])
        return slot

    def body(self, piece: int) -> list[str]:
        """The statements of a piece, each on a line."""
        lines: list[str] = []
        named: set[int] = set()
        for k in range(bisect_left(self.piece, piece), bisect_right(self.piece, piece)):
            s = self.whole.statements[k]
            if s.is_arithmetic:
                operands = [self._operand(i, piece, named, lines) for i in s.of]
                lines.append(f"  const casadi_real t{k} = {expression(s.operation, operands)};")
                named.add(k)
                if k in self.slot:
                    lines.append(f"  w[{self.slot[k]}] = t{k};")
            for which, entry in self.results.get(k, ()):
                value = self._operand(k, piece, named, lines)
                lines.append(f"  res[{which}][{entry}] = {value};")
        return lines

    def _operand(self, k: int, piece: int, named: set[int], lines: list[str]) -> str:
        """A value in a piece; one made before is fetched when it is first needed."""
        s = self.whole.statements[k]
        if s.operation == ca.OP_CONST:
            return literal(s.constant)
        if s.operation == ca.OP_INPUT:
            return f"arg[{s.argument[0]}][{s.argument[1]}]"
        if k not in named:
            which, entry = self.results[k][0] if k in self.results else (0, 0)
            source = f"w[{self.slot[k]}]" if k in self.slot else f"res[{which}][{entry}]"
            lines.append(f"  const casadi_real t{k} = {source};")
            named.add(k)
        return f"t{k}"
