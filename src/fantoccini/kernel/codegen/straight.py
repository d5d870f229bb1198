"""A CasADi function as straight-line C, cut into pieces that compile fast.

Compile time grows faster than the length of straight-line code. The statements of a function are
therefore split, in order, into pieces: functions that take the arguments, the results and a work
array. A value used in a later piece is passed in the work array, or read back from its result.
Inside a piece values are named constants.

Slow operations are done once: a divisor of several quotients is inverted, a root in a denominator
becomes an inverse root, and sine and cosine of an angle are computed together.

Straight-line code has no loops and no branches.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

import casadi as ca

from fantoccini.kernel.codegen.statements import expression, literal

_NOT_ARITHMETIC = (ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT)

INVERSE_ROOT = -1
"""Operation 1 / sqrt(x), which CasADi does not have."""

CALL_ARGUMENTS = "const casadi_real** arg, casadi_real** res, casadi_int*, casadi_real*, int"
"""Arguments of a function in C."""

_OWN = {
    INVERSE_ROOT: "inverse_root({})",
    ca.OP_ATAN: "arctangent({})",
    ca.OP_LT: "one_if({} < {})",
    ca.OP_LE: "one_if({} <= {})",
    ca.OP_EQ: "one_if({} == {})",
    ca.OP_NE: "one_if({} != {})",
    ca.OP_AND: "one_if({} != 0.0 && {} != 0.0)",
    ca.OP_OR: "one_if({} != 0.0 || {} != 0.0)",
    ca.OP_NOT: "one_if({} == 0.0)",
    ca.OP_IF_ELSE_ZERO: "zero_unless({} != 0.0, {})",
}
"""Functions of the runtime, for doubles and lanes: a comparison of lanes is not a number."""


@dataclass(frozen=True)
class Statement:
    """An operation; its value is named by its index in the list.

    Attributes:
        operation: CasADi's code, or ``INVERSE_ROOT``.
        of: indices of the operands.
        constant: value of an OP_CONST.
        argument: (argument, entry) of an OP_INPUT.
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
        statements: statements, operands first.
        results: (result, entry, index of the value) of every entry of every result.
        names: names of the results.
    """

    statements: list[Statement]
    results: list[tuple[int, int, int]]
    names: tuple[str, ...]

    @property
    def operations(self) -> int:
        """Number of arithmetic operations of one evaluation."""
        return sum(s.is_arithmetic for s in self.statements)


def program(function: ca.Function) -> Program:
    """The statements of a function of dense SX, with slow operations done once."""
    statements: list[Statement] = []
    results: list[tuple[int, int, int]] = []
    holds: dict[int, int] = {}  # place in CasADi's work vector -> index of a statement
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        target, operands = function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_OUTPUT:
            results.append((target[0], target[1], holds[operands[0]]))
            continue
        if operation == ca.OP_CONST:
            statement = Statement(operation, constant=function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            statement = Statement(operation, argument=(operands[0], operands[1]))
        else:
            statement = Statement(operation, tuple(holds[i] for i in operands))
        holds[target[0]] = len(statements)
        statements.append(statement)
    names = tuple(function.name_out())
    return _Rewriting(Program(statements, results, names)).done()


class _Rewriting:
    """Rewrites a program so that slow operations are done once.

    CasADi changes x (1 / y) to x / y: a divisor of several quotients is inverted once, a root in a
    denominator becomes an inverse root (the root itself is x times that, since x is positive), and
    sine and cosine of one angle become neighbours.

    Args:
        program_to_cut: CasADi's program.
    """

    def __init__(self, program_to_cut: Program):
        self.program_to_cut = program_to_cut
        statements = program_to_cut.statements
        quotients = [s for s in statements if s.operation in (ca.OP_DIV, ca.OP_INV)]
        self.divided = Counter(s.of[-1] for s in quotients)
        self.used = Counter(
            [i for s in statements for i in s.of] + [v for *_, v in program_to_cut.results]
        )
        self.statements: list[Statement] = []
        self.place: list[int] = []
        self.inverse: dict[int, int] = {}
        self.sine: dict[int, int] = {}

    def done(self) -> Program:
        for k, s in enumerate(self.program_to_cut.statements):
            self.place.append(self._place(k, s))
        results = [(r, k, self.place[v]) for r, k, v in self.program_to_cut.results]
        return Program(self.statements, results, self.program_to_cut.names)

    def _add(self, operation: int, *of: int) -> int:
        self.statements.append(Statement(operation, of))
        return len(self.statements) - 1

    def _place(self, k: int, s: Statement) -> int:
        """Index in the new program of the value of statement k."""
        of = tuple(self.place[i] for i in s.of)
        if s.operation == ca.OP_SQRT and self.divided[k]:
            self.inverse[k] = self._add(INVERSE_ROOT, *of)
            only_divides = self.used[k] == self.divided[k]
            return self.inverse[k] if only_divides else self._add(ca.OP_MUL, *of, self.inverse[k])
        if s.operation in (ca.OP_DIV, ca.OP_INV):
            divisor = s.of[-1]
            if divisor not in self.inverse and self.divided[divisor] > 1:
                self.inverse[divisor] = self._add(ca.OP_INV, of[-1])
            if divisor in self.inverse:
                reciprocal = self.inverse[divisor]
                product = s.operation == ca.OP_DIV
                return self._add(ca.OP_MUL, of[0], reciprocal) if product else reciprocal
        if s.operation in (ca.OP_SIN, ca.OP_COS):
            return self._sine_or_cosine(s)
        self.statements.append(Statement(s.operation, of, s.constant, s.argument))
        return len(self.statements) - 1

    def _sine_or_cosine(self, s: Statement) -> int:
        """Index of a sine or cosine; the first one of an angle adds both, the sine first."""
        angle = s.of[0]
        if angle not in self.sine:
            self.sine[angle] = self._add(ca.OP_SIN, self.place[angle])
            self._add(ca.OP_COS, self.place[angle])
        return self.sine[angle] + (s.operation == ca.OP_COS)


@dataclass(frozen=True)
class Pieces:
    """The C text of a function.

    Attributes:
        name: name of the function.
        declarations: declarations of the pieces.
        pieces: definitions of the pieces.
        definition: definition of the function, which calls the pieces in order.
    """

    name: str
    declarations: list[str]
    pieces: list[str]
    definition: str


def pieces(
    program_to_cut: Program, name: str, longest: int, standing: Collection[str] = ()
) -> Pieces:
    """The text of a function in pieces.

    The including file defines ``casadi_real``, ``FAN_PIECE`` (qualifiers of the pieces) and
    ``FAN_CALL`` (qualifiers of the functions that call them). Only pointers of empty arguments and
    results may be null.

    Args:
        program_to_cut: statements of the function.
        name: name of the C function.
        longest: largest number of arithmetic statements of a piece.
        standing: names of results whose constants need not be written every time:
            ``name_constants`` writes these, ``name_varying`` the other entries.
    """
    separate = frozenset(r for r, result in enumerate(program_to_cut.names) if result in standing)
    cut = _Cut(program_to_cut, longest, separate)
    head = "const casadi_real* const* arg, casadi_real* const* res, casadi_real* w"
    names = [f"{name}_{k}" for k in range(cut.n)]
    texts = [
        "\n".join([f"FAN_PIECE void {n}({head}) {{", *cut.body(k), "}"])
        for k, n in enumerate(names)
    ]
    whole_name, name = name, f"{name}_varying" if separate else name
    lines = [
        f"FAN_CALL int {name}({CALL_ARGUMENTS}) {{",
        f"  casadi_real work[{max(1, cut.n_work)}];",
        *(f"  {n}(arg, res, work);" for n in names),
        "  return 0;",
        "}",
    ]
    if separate:
        lines += [
            "",
            f"FAN_CALL void {whole_name}_constants(casadi_real** res) {{",
            *cut.constants(),
            "}",
            "",
            f"FAN_CALL int {whole_name}({CALL_ARGUMENTS}) {{",
            f"  {whole_name}_constants(res);",
            f"  return {name}(arg, res, nullptr, nullptr, 0);",
            "}",
        ]
    declarations = [f"FAN_PIECE void {n}({head});" for n in names]
    return Pieces(whole_name, declarations, texts, "\n".join(lines))


def together(program_to_cut: Program, name: str, longest: int, table: Table) -> str:
    """The text of ``name(a, x, y)``: a function of (a, x) that is linear in x, for several x.

    ``a`` is an array of a scalar type ``A``; ``x`` and ``y`` are arrays of a vector type ``V``.

    Args:
        program_to_cut: the function's statements, with two arguments and one result.
        name: name of the C function.
        longest: arithmetic statements of a piece, at most.
        table: takes the constants, so that the text is the same for other numbers.
    """
    cut, lines = _Cut(program_to_cut, longest, frozenset(), table), []
    for k in range(cut.n):
        lines += [
            "template <class A, class V>",
            f"void {name}_{k}(const A* a, const V* x, V* y, V* w) {{",
            "  (void)a, (void)x, (void)y, (void)w;",
            *(_vectorised(line) for line in cut.body(k)),
            "}",
            "",
        ]
    lines += [
        "template <class A, class V>",
        f"inline void {name}(const A* a, const V* x, V* y) {{",
        f"  V work[{max(1, cut.n_work)}];",
        *(f"  {name}_{k}(a, x, y, work);" for k in range(cut.n)),
        "}",
    ]
    return "\n".join(lines)


_NAMES = (
    ("const casadi_real ", "const auto "),
    ("arg[0][", "a["),
    ("arg[1][", "x["),
    ("res[0][", "y["),
)


def _vectorised(line: str) -> str:
    """A line of a piece, in which values that do not depend on x have the type A, others V."""
    for scalar_name, vector_name in _NAMES:
        line = line.replace(scalar_name, vector_name)
    into, value = line.strip(" ;").split(" = ", 1)
    # Values passed to the next piece, and constant results, may be of type A: V{} + value is a V.
    is_double = into.startswith("w[") or (into.startswith("y[") and not value.startswith("t"))
    return f"  {into} = V{{}} + {value};" if is_double else line


def dealt(texts: list[str], statements: int) -> list[str]:
    """Texts joined in order to files of at least ``statements`` statements, except the last."""
    files: list[list[str]] = [[]]
    n = 0
    for text in texts:
        if n >= statements:
            files.append([])
            n = 0
        files[-1].append(text)
        n += text.count("\n")
    return ["\n\n".join(file) + "\n" for file in files]


@dataclass
class Table:
    """Constants that the text of functions reads from an array.

    Attributes:
        name: name of the array in C.
        values: entries.
    """

    name: str
    values: list[float] = field(default_factory=list)

    def entry(self, value: float) -> str:
        """The text of a constant; 0 and 1 come from the structure and are written as they are."""
        if abs(value) in (0.0, 1.0):
            return literal(value)
        self.values.append(value)
        return f"{self.name}[{len(self.values) - 1}]"


class _Cut:
    """The division of a program into pieces, and the places of values that pass between them.

    Args:
        program_to_cut: the program.
        longest: arithmetic statements of a piece, at most.
        kept: results whose constants are written separately.
        table: takes the constants; by default they stand in the text.
    """

    def __init__(
        self,
        program_to_cut: Program,
        longest: int,
        kept: frozenset[int],
        table: Table | None = None,
    ):
        self.program_to_cut, self.kept = program_to_cut, kept
        self._constant = table.entry if table else literal
        done = 0
        self.piece: list[int] = []
        for s in program_to_cut.statements:
            # A cosine stays with its sine.
            follows = s.operation == ca.OP_COS
            self.piece.append(self.piece[-1] if follows else done // longest)
            done += s.is_arithmetic
        self.n = self.piece[-1] + 1 if self.piece else 1
        self.last = list(self.piece)
        for k, s in enumerate(program_to_cut.statements):
            for i in s.of:
                self.last[i] = max(self.last[i], self.piece[k])
        self.results: dict[int, list[tuple[int, int]]] = {}
        for result_index, entry, value in program_to_cut.results:
            self.results.setdefault(value, []).append((result_index, entry))
        self.slot = self._slots()
        self.n_work = max(self.slot.values(), default=-1) + 1

    def _slots(self) -> dict[int, int]:
        """Value that later pieces use -> its place in the work array."""
        slot: dict[int, int] = {}
        free_slots: list[int] = []
        slots_ending: dict[int, list[int]] = {}
        n_slots, piece = 0, 0
        for k, s in enumerate(self.program_to_cut.statements):
            while piece < self.piece[k]:
                free_slots += slots_ending.pop(piece, [])
                piece += 1
            if not s.is_arithmetic or self.last[k] == self.piece[k] or k in self.results:
                continue
            slot[k] = free_slots.pop() if free_slots else n_slots
            n_slots = max(n_slots, slot[k] + 1)
            slots_ending.setdefault(self.last[k], []).append(slot[k])
        return slot

    def _is_apart(self, result_index: int, value: int) -> bool:
        return (
            result_index in self.kept
            and self.program_to_cut.statements[value].operation == ca.OP_CONST
        )

    def constants(self) -> list[str]:
        """Statements that write the constants of ``standing`` results."""
        return [
            f"  res[{result_index}][{entry}] = "
            f"{literal(self.program_to_cut.statements[value].constant)};"
            for result_index, entry, value in self.program_to_cut.results
            if self._is_apart(result_index, value)
        ]

    def body(self, piece: int) -> list[str]:
        """The lines of a piece."""
        lines: list[str] = []
        named_values: set[int] = set()
        for k in range(bisect_left(self.piece, piece), bisect_right(self.piece, piece)):
            s = self.program_to_cut.statements[k]
            if s.is_arithmetic:
                operands = [self._operand(i, piece, named_values, lines) for i in s.of]
                lines += self._text(k, operands)
                named_values.add(k)
                if k in self.slot:
                    lines.append(f"  w[{self.slot[k]}] = t{k};")
            for result_index, entry in self.results.get(k, ()):
                if self._is_apart(result_index, k):
                    continue
                value = self._operand(k, piece, named_values, lines)
                lines.append(f"  res[{result_index}][{entry}] = {value};")
        return lines

    def _text(self, k: int, operands: list[str]) -> list[str]:
        """The lines of statement k; a sine also computes the cosine that follows it."""
        operation = self.program_to_cut.statements[k].operation
        if operation == ca.OP_COS:
            return []
        if operation == ca.OP_SIN:
            called = f"sine_cosine({operands[0]}, &t{k}, &t{k + 1})"
            return [f"  casadi_real t{k}, t{k + 1};", f"  {called};"]
        text = _OWN.get(operation, "").format(*operands) or expression(operation, operands)
        return [f"  const casadi_real t{k} = {text};"]

    def _operand(self, k: int, piece: int, named_values: set[int], lines: list[str]) -> str:
        """The name of a value in a piece; a value of an earlier piece is read on first use."""
        s = self.program_to_cut.statements[k]
        if s.operation == ca.OP_CONST:
            return self._constant(s.constant)
        if s.operation == ca.OP_INPUT:
            return f"arg[{s.argument[0]}][{s.argument[1]}]"
        if k not in named_values:
            result_index, entry = self.results[k][0] if k in self.results else (0, 0)
            source = f"w[{self.slot[k]}]" if k in self.slot else f"res[{result_index}][{entry}]"
            lines.append(f"  const casadi_real t{k} = {source};")
            named_values.add(k)
        return f"t{k}"
