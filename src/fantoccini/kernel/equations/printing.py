"""Readable equations: converts CasADi's graphs to SymPy expressions in textbook symbols.

A graph is evaluated once over sparse polynomials with rational coefficients. Their generators are
the state, the parameters, cos and sin of every angle, and a symbol for each root, quotient or other
function. sin^2 = 1 - cos^2 and the unit length of quaternions are applied immediately, so that
equal expressions are equal polynomials. Every polynomial is then printed in the shortest of several
forms; one of them has sines and cosines of sums of angles. Equations beyond the bounds raise
TooLargeError.

Constants have 15 digits. The regularisation of segment lengths at coincident points (1e-9 m) is
left out. Otherwise values differ from those of the interpreted equations by rounding only.

D stands for dynamic coordinates, K for driven ones; A_D and A_K are the derivatives of string gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import sympy as sp
from sympy.polys.domains import QQ
from sympy.polys.rings import PolyElement, PolyRing

from fantoccini.base import FantocciniError
from fantoccini.kernel.equations.algebra import REGULAR
from fantoccini.kernel.equations.forms import Form
from fantoccini.kernel.equations.functions import Equations
from fantoccini.kernel.equations.notation import Notation, notation


class PrintingBounds(NamedTuple):
    """Bounds of printed equations, chosen so that printing takes seconds and fits a page.

    Attributes:
        operations: number of operations in a puppet's equations.
        terms: number of terms of a polynomial.
        products: total number of products of terms.
        rounding: largest coefficient that counts as a rounding error of cancelled terms, relative
            to the largest one in the matrix.
        digits: number of digits of a printed number.
    """

    operations: int = 1500
    terms: int = 1200
    products: int = 400_000
    rounding: Any = QQ(1, 10**13)
    digits: int = 6


BOUNDS = PrintingBounds()

_QUANTITIES = {
    "mass_matrix": ("M", "M_DK", "M_KK"),
    "coriolis": ("C",),
    "gravity": ("g",),
    "damping": ("f",),
    "constraint": ("h",),
    "A_D": ("A_D",),
    "A_K": ("A_K",),
    "kinetic": ("T",),
    "potential": ("V",),
}
_ARGUMENTS = ("q_D", "v_D", "q_K", "v_K", "p")

_UNARY = {
    ca.OP_TAN: sp.tan,
    ca.OP_ASIN: sp.asin,
    ca.OP_ACOS: sp.acos,
    ca.OP_ATAN: sp.atan,
    ca.OP_EXP: sp.exp,
    ca.OP_LOG: sp.log,
    ca.OP_FABS: sp.Abs,
    ca.OP_TANH: sp.tanh,
}
_BINARY = {ca.OP_ATAN2: sp.atan2, ca.OP_POW: sp.Pow, ca.OP_CONSTPOW: sp.Pow}
_WITH_OWN_SYMBOL = (ca.OP_SQRT, ca.OP_INV, ca.OP_DIV, ca.OP_SIN, ca.OP_COS, *_UNARY, *_BINARY)


class TooLargeError(FantocciniError):
    """The puppet's equations are too large to print."""


@dataclass(frozen=True)
class Printable:
    """A puppet's equations as SymPy expressions.

    Attributes:
        notation: symbols of the coordinates, velocities and parameters.
        objects: the quantities requested: M, M_DK (n_vD, n_vK), M_KK, C over (v_D, v_K), g,
            f (damping), h, A_D, A_K as matrices; T and V as expressions.
        lengths: symbols and expressions of roots, mainly distances between points of strings; a
            later one may contain earlier ones.
    """

    notation: Notation
    objects: dict[str, sp.Matrix | sp.Expr]
    lengths: tuple[tuple[sp.Symbol, sp.Expr], ...]

    @property
    def lagrangian(self) -> sp.Expr:
        """L = T - V (Eq. 7)."""
        return self.objects["T"] - self.objects["V"]


def operation_counts(
    equations: Equations, functions: tuple[str, ...] = tuple(_QUANTITIES)
) -> dict[str, int]:
    """Number of operations of every function, by the paper's symbols for its results."""
    return {", ".join(_QUANTITIES[f]): equations[f].n_instructions() for f in functions}


def printable(equations: Equations, functions: tuple[str, ...] = tuple(_QUANTITIES)) -> Printable:
    """The equations of a small puppet as SymPy expressions.

    Args:
        equations: the derived equations.
        functions: names of the functions to print; by default all.

    Raises:
        TooLargeError: the equations exceed :data:`BOUNDS`.
    """
    total = sum(operation_counts(equations, functions).values())
    if total > BOUNDS.operations:
        raise TooLargeError(f"{total} operations; up to {BOUNDS.operations} are printed")
    symbols = {name: getattr(equations.system.symbols, name) for name in _ARGUMENTS}
    outputs, shapes = [], {}
    for function in functions:
        derived, names = equations[function], _QUANTITIES[function]
        results = derived.call([symbols[name] for name in derived.name_in()])
        for name, result in zip(names, results, strict=False):
            outputs.append(ca.densify(result))
            shapes[name] = result.shape
    graph = ca.Function("graph", list(symbols.values()), outputs)
    converter = _Converter(graph, notation(equations.tree))
    entries = converter.outputs()
    objects: dict[str, sp.Matrix | sp.Expr] = {}
    for k, (name, (rows, columns)) in enumerate(shapes.items()):
        values = [entries.get((k, i), sp.S.Zero) for i in range(rows * columns)]
        objects[name] = (
            values[0]
            if name in ("T", "V")
            else sp.Matrix(rows, columns, lambda i, j, v=values, n=rows: v[i + n * j])
        )
    return Printable(converter.notation, objects, tuple(converter.lengths))


def decimal(expression: sp.Expr) -> sp.Expr:
    """The expression with fractions as decimals of six digits, except in exponents."""
    if isinstance(expression, sp.MatrixBase):
        return expression.applyfunc(decimal)
    if expression.is_Rational:
        return expression if expression.is_Integer else sp.Float(expression, BOUNDS.digits)
    if expression.is_Pow:
        return sp.Pow(decimal(expression.base), expression.exp)
    if not expression.args:
        return expression
    return expression.func(*(decimal(part) for part in expression.args))


def rational(number: float) -> sp.Rational:
    """A constant of the graph as a fraction of its 15-digit decimal."""
    return sp.Rational(format(number, ".15g"))


def _shortened(coefficient: Any) -> Any:
    """The coefficient, or the shorter decimal from which it differs by rounding only."""
    short = rational(float(coefficient))
    is_close = abs(QQ(short.p, short.q) - coefficient) <= BOUNDS.rounding * abs(coefficient)
    return QQ(short.p, short.q) if is_close and short.q < coefficient.denominator else coefficient


class _Converter:
    """Evaluates a graph over polynomials.

    Args:
        graph: function with the arguments ``_ARGUMENTS``.
        notation: symbols of the arguments' entries.
    """

    def __init__(self, graph: ca.Function, notation: Notation):
        self.graph, self.notation = graph, notation
        self.lengths: list[tuple[sp.Symbol, sp.Expr]] = []
        self._n_products = 0
        inputs = [s for name in _ARGUMENTS for s in notation.symbols[name]]
        self._first = dict(
            zip(
                _ARGUMENTS,
                _first_indices([notation.symbols[name] for name in _ARGUMENTS]),
                strict=True,
            )
        )
        ids = [graph.instruction_id(k) for k in range(graph.n_instructions())]
        trigonometric = sum(i in (ca.OP_SIN, ca.OP_COS) for i in ids)
        n_functions = 2 * trigonometric + sum(i in _WITH_OWN_SYMBOL for i in ids)
        names = [f"g{k}" for k in range(len(inputs) + n_functions)]
        self.ring = PolyRing(names, QQ)
        velocities = {
            self._first[name] + k
            for name in ("v_D", "v_K")
            for k in range(len(notation.symbols[name]))
        }
        self.form = Form(list(inputs), velocities=velocities, inverse=set(), pairs={})
        self._generators: dict[tuple[Any, ...], PolyElement] = {}
        self._squares: dict[int, PolyElement] = {}
        for name, firsts in notation.quaternions.items():
            for first in firsts:
                _, x, y, z = self.ring.gens[self._first[name] + first :][:4]
                self._squares[self._first[name] + first] = 1 - x**2 - y**2 - z**2

    def outputs(self) -> dict[tuple[int, int], sp.Expr]:
        """(index of the output, index of the entry) -> expression."""
        graph = self.graph
        registers: dict[int, _Value] = {}
        values: dict[tuple[int, int], PolyElement] = {}
        for k in range(graph.n_instructions()):
            op = graph.instruction_id(k)
            sources, targets = graph.instruction_input(k), graph.instruction_output(k)
            if op == ca.OP_OUTPUT:
                values[targets[0], targets[1]] = registers[sources[0]].value
            elif op == ca.OP_INPUT:
                first = self._first[_ARGUMENTS[sources[0]]]
                registers[targets[0]] = _Value(self.ring.gens[first + sources[1]])
            elif op == ca.OP_CONST:
                number = graph.instruction_constant(k)
                exact = sp.S.Zero if number == REGULAR.segment**2 else rational(number)
                registers[targets[0]] = _Value(self.ring.ground_new(QQ(exact.p, exact.q)))
            else:
                registers[targets[0]] = self._operation(op, [registers[i] for i in sources])
        shortest: dict[PolyElement, sp.Expr] = {}
        for output in {k for k, _ in values}:
            entries = [entry for entry in values if entry[0] == output]
            largest = max((abs(c) for e in entries for c in values[e].values()), default=0)
            for entry in entries:
                terms = values[entry].items()
                values[entry] = self.ring.from_dict(
                    {m: _shortened(c) for m, c in terms if abs(c) > BOUNDS.rounding * largest}
                )
                if values[entry] not in shortest:
                    shortest[values[entry]] = self.form.shortest(values[entry])
        return {entry: shortest[value] for entry, value in values.items()}

    def _operation(self, op: int, operands: list[_Value]) -> _Value:
        x, y = operands[0], operands[-1]
        match op:
            case ca.OP_ASSIGN:
                return x
            case ca.OP_ADD:
                return _Value(x.value + y.value, (*x.summands, *y.summands))
            case ca.OP_SUB:
                return _Value(x.value - y.value)
            case ca.OP_NEG:
                return _Value(-x.value)
            case ca.OP_TWICE:
                return _Value(2 * x.value)
            case ca.OP_MUL | ca.OP_SQ:
                square = self._product(x.value, y.value)
                is_square = op == ca.OP_SQ or x.value == y.value
                return _Value(square, ((x.value, 2),) if is_square else ())
            case ca.OP_INV:
                return _Value(self._inverse(x.value))
            case ca.OP_DIV:
                return _Value(self._product(x.value, self._inverse(y.value)))
            case ca.OP_SIN | ca.OP_COS:
                return _Value(self._angle(x.value)[op == ca.OP_SIN])
            case ca.OP_SQRT:
                return _Value(self._root(x))
        function = _UNARY.get(op) or _BINARY.get(op)
        if function is None:
            raise TooLargeError(f"they have an operation that is not printed ({op})")
        arguments = [self.form.shortest(v.value) for v in operands]
        return _Value(self._generator((op, *(v.value for v in operands)), function(*arguments)))

    def _product(self, x: PolyElement, y: PolyElement) -> PolyElement:
        self._n_products += len(x) * len(y)
        if self._n_products > BOUNDS.products:
            raise TooLargeError("expanding them takes too long")
        product = self._reduced(x * y)
        if len(product) > BOUNDS.terms:
            raise TooLargeError(f"an expression has more than {BOUNDS.terms} terms")
        return product

    def _reduced(self, value: PolyElement) -> PolyElement:
        """The value with the squares of some generators replaced, as ``_squares`` has them."""
        for generator, square in self._squares.items():
            while high_powers := {m: c for m, c in value.items() if m[generator] > 1}:
                lowered = self.ring.from_dict(
                    {
                        (*m[:generator], m[generator] - 2, *m[generator + 1 :]): high_powers[m]
                        for m in high_powers
                    }
                )
                value = value - self.ring.from_dict(high_powers) + lowered * square
        return value

    def _generator(self, key: tuple[Any, ...], expression: sp.Expr) -> PolyElement:
        """The generator of an expression; the same generator for the same key."""
        if key not in self._generators:
            self._generators[key] = self.ring.gens[len(self.form.meaning)]
            self.form.meaning.append(expression)
        return self._generators[key]

    def _angle(self, angle: PolyElement) -> tuple[PolyElement, PolyElement]:
        expression = self.form.shortest(angle)
        if angle.is_ground:
            numbers = [rational(float(f(expression))) for f in (sp.cos, sp.sin)]
            return tuple(self.ring.ground_new(QQ(n.p, n.q)) for n in numbers)
        cosine = self._generator((ca.OP_COS, angle), sp.cos(expression, evaluate=False))
        sine = self._generator((ca.OP_SIN, angle), sp.sin(expression, evaluate=False))
        generators = self.ring.gens
        self.form.pairs[generators.index(cosine)] = generators.index(sine)
        self._squares[generators.index(sine)] = 1 - cosine**2
        return cosine, sine

    def _inverse(self, value: PolyElement) -> PolyElement:
        if value.is_ground:
            return self.ring.ground_new(1 / value.coeff(1))
        generator = self._generator((ca.OP_INV, value), 1 / self.form.shortest(value))
        self.form.inverse.add(self.ring.gens.index(generator))
        return generator

    def _root(self, value: _Value) -> PolyElement:
        """The generator of a root; a distance is written as the root of a sum of squares."""
        total = value.value
        if total.is_ground:
            number = rational(float(sp.sqrt(self.form.shortest(total))))
            return self.ring.ground_new(QQ(number.p, number.q))
        key = (ca.OP_SQRT, total)
        if key in self._generators:
            return self._generators[key]
        moving = any(m[k] for m in total for k in self.form.velocities)
        symbol = self.notation.fresh("u" if moving else "d")
        parts = value.summands or ((total, 1),)
        squares = sp.Add(*(self.form.shortest(part) ** power for part, power in parts))
        self.lengths.append((symbol, sp.sqrt(squares)))
        return self._generator(key, symbol)


@dataclass(frozen=True)
class _Value:
    """A polynomial.

    Attributes:
        value: the polynomial.
        recorded: summands (polynomial, power) from which it was computed; empty if not recorded.
    """

    value: PolyElement
    recorded: tuple[tuple[PolyElement, int], ...] = ()

    @cached_property
    def summands(self) -> tuple[tuple[PolyElement, int], ...]:
        """Summands (polynomial, power): those recorded if they are few, else the value itself."""
        if self.value == 0:
            return ()
        return self.recorded if 0 < len(self.recorded) <= 4 else ((self.value, 1),)


def _first_indices(parts: list[list[sp.Symbol]]) -> list[int]:
    """Index of each list's first entry in their concatenation."""
    return [sum(len(part) for part in parts[:k]) for k in range(len(parts))]
