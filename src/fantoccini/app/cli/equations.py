"""``fantoccini equations``: prints a small puppet's equations as text or LaTeX."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Iterator

import sympy as sp
from sympy.printing.pretty.pretty import PrettyPrinter
from sympy.printing.pretty.pretty_symbology import pretty_symbol
from sympy.printing.str import StrPrinter

from fantoccini.app.console import marionette, number, say, table, width, write
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.equations import printing
from fantoccini.model.puppet import PD, ComputedTorque, DirectCurrent, Drive, Servo

Equation = tuple[str, sp.Expr | sp.Matrix]

_MEANING = (
    "e = command - coordinate; for orientations 2 e_w (e_x, e_y, e_z) of the relative rotation. "
    "n is the rotor angle [rad] per unit of the coordinate, v the speed of the coordinate"
)

_UNICODE = "\N{GREEK SMALL LETTER THETA}\N{COMBINING DOT ABOVE}\N{SUBSCRIPT ONE}"


def print_equations(file: str, latex: bool) -> None:
    """Prints Lagrangian, M, C, g, h, A_D and A_K, and the laws of motors.

    Args:
        file: FILE argument.
        latex: as LaTeX instead of text.
    """
    made = marionette(file)
    check_mass_matrix(made.puppet, made.tree)
    try:
        page = printing.printable(made.equations)
    except printing.TooLargeError:
        for symbol, count in printing.operation_counts(made.equations).items():
            say(f"  {symbol}: {count} operations")
        say(
            f"the equations of {made.name} are too large to print; `fantoccini export {file} DIR` "
            "writes them as C99, and marionette.equations has them as CasADi functions"
        )
        raise
    if latex:
        _print_latex(made, page)
    else:
        _print_text(made, page)


def _print_latex(made: Marionette, page: printing.Printable) -> None:
    write("% " + made.name)
    for symbol, name in page.notation.names.items():
        write(f"% ${sp.latex(symbol)}$: {name}")
    for symbol, name, law in _motors(made, page, sp.latex):
        write(f"% motor of ${symbol}$, {name}: {law}")
    lines = [
        f"  {sp.latex(sp.Symbol(left))} &= {sp.latex(printing.decimal(right))}"
        for left, right in [*energies(page), *matrices(made, page), *page_lengths(page)]
    ]
    write("\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}")


def _print_text(made: Marionette, page: printing.Printable) -> None:
    layout = Layout(width(), _has_unicode())
    table("Symbols", ("symbol", "name", "role", "value>"), list(_symbols(made, page, layout)))
    write("Lagrangian T - V (Eqs. 5-7)\n")
    for left, right in energies(page):
        write(layout.equation(left, right) + "\n")
    names = [left for left, _ in matrices(made, page)]
    moving = " + M_DK acc_K" if "M_DK" in names else ""
    moving_v = " + C_DK v_K" if "C_DK" in names else ""
    damped = " + f" if "f" in names else ""
    pull = " + A_D^T lambda, tension = -lambda >= 0" if "A_D" in names else ""
    motors = list(_motors(made, page, layout.text))
    driving = " + f_M" if motors else ""
    write(f"Motion (Eqs. 8-10): M acc_D{moving} + C v_D{moving_v} + g{damped} = u{driving}{pull}\n")
    for left, right in matrices(made, page):
        write(layout.matrix(left, right) + "\n")
    if motors:
        table("f_M: forces of motors", ("symbol", "name", "law"), motors)
        write(textwrap.fill(_MEANING, layout.columns) + "\n")
    for left, right in page_lengths(page):
        write("with\n" + layout.root(left, right) + "\n")
    write("Numbers have six digits. h <= 0; strings come first, then limits.")


def _symbols(
    made: Marionette, page: printing.Printable, layout: Layout
) -> Iterator[tuple[str, str, str, str]]:
    values = made.tree.parameters
    roles = {row.name: row.role for row in made.coordinates.rows}
    for symbol, name in page.notation.names.items():
        role = roles.get(name, "parameter")
        value = number(float(values[name])) if role == "parameter" else ""
        yield layout.text(symbol), name, role, value


def _motors(
    made: Marionette, page: printing.Printable, text: Callable[[sp.Symbol], str]
) -> Iterator[tuple[str, str, str]]:
    """Symbol, name and law of every motor's coordinate."""
    symbols = page.notation.symbols["q_D"]
    for row in made.tree.drives:
        if row.command is not None:
            moved = ", ".join(text(symbol) for symbol in symbols[row.q])
            yield moved, row.name, _law(row.drive)


def _law(drive: Drive) -> str:
    """The law of a motor, with parameters by name."""

    def shown(value: Number) -> str:
        return value.parameter if isinstance(value, Parameter) else number(float(value))

    motor, control = drive.motor, drive.control
    if isinstance(control, PD):
        law = f"{shown(control.stiffness)} e + {shown(control.damping)} edot"
    elif isinstance(control, ComputedTorque):
        w, zeta = shown(control.bandwidth), shown(control.damping_ratio)
        own = f"a = rddot + 2 zeta w edot + w^2 e, w = {w}, zeta = {zeta}"
        law = f"M a + c + friction by inverse dynamics, {own}"
    if motor is None:
        return law
    drum = "" if drive.drum is None else f" / {shown(drive.drum)}"
    ratio = f"n = {shown(drive.gear)}{drum}"
    if isinstance(motor, DirectCurrent):
        k, R = shown(motor.constant), shown(motor.resistance)
        current, voltage = shown(motor.current), shown(motor.voltage)
        bounds = f"|i| <= {current} and |{R} i + {k} n v| <= {voltage}"
        return f"{law} = n {k} i where {bounds}; {ratio}"
    T = shown(motor.torque)
    if isinstance(motor, Servo):
        return f"{law} where |f_M| <= n {T}; {ratio}"
    if motor.corner_speed is not None:
        T += f" min(1, {shown(motor.corner_speed)} / |n rdot|)"
    step, pairs = f"/ ({motor.steps * motor.microsteps} n)", f"{motor.steps / 4:g} n e"
    linear = drive.drum is None and drive.mass is not None
    step, pairs = (f"1 {step}", f"2 pi {pairs}") if linear else (f"2 pi {step}", pairs)
    return f"n {T} sin({pairs}), command in steps of {step}; {ratio}"


def energies(page: printing.Printable) -> list[Equation]:
    """T and V."""
    return [("T", page.objects["T"]), ("V", page.objects["V"])]


def matrices(made: Marionette, page: printing.Printable) -> list[Equation]:
    """M, C, g, h and A_D; M_DK, C_DK, f and A_K unless they are zero."""
    objects, n = page.objects, made.coordinates.n_vD
    C = objects["C"]
    found = [
        ("M", objects["M"]),
        ("M_DK", objects["M_DK"]),
        ("C", C[:n, :n]),
        ("C_DK", C[:n, n:]),
        ("g", objects["g"]),
        ("f", objects["f"]),
        ("h", objects["h"]),
        ("A_D", objects["A_D"]),
        ("A_K", objects["A_K"]),
    ]
    optional = ("M_DK", "C_DK", "f", "A_K")
    return [
        (name, value)
        for name, value in found
        if 0 not in value.shape and not (name in optional and value.is_zero_matrix)
    ]


def page_lengths(page: printing.Printable) -> list[Equation]:
    """Definitions of the symbols for square roots."""
    return [(symbol.name, meaning) for symbol, meaning in page.lengths]


def _has_unicode() -> bool:
    try:
        _UNICODE.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


class Layout:
    """Sets equations on lines of a given width.

    Args:
        columns: characters on a line.
        unicode: Greek letters, dots and subscripts; otherwise ASCII.
    """

    def __init__(self, columns: int, unicode: bool):
        self.columns = columns
        self._printer = PrettyPrinter(
            {"use_unicode": unicode, "wrap_line": False, "full_prec": False}
        )
        self._line = _Line(unicode)

    def text(self, expression: sp.Basic) -> str:
        """An expression, pretty-printed on several lines."""
        return self._printer.doprint(expression)

    def equation(self, left: str, right: sp.Expr) -> str:
        """``left = right``; one line per term if it is too wide."""
        symbol, right = sp.Symbol(left), printing.decimal(right)
        whole = self._side_by_side(symbol, right)
        if self._fits(whole):
            return textwrap.indent(whole, "  ")
        over, under = right.as_numer_denom()
        if under.is_Symbol:
            return self._by_terms(sp.Mul(under, symbol, evaluate=False), over)
        return self._by_terms(symbol, right)

    def root(self, left: str, right: sp.Expr) -> str:
        """``left = right`` for a square root; squared if it is too wide."""
        whole = self._side_by_side(sp.Symbol(left), printing.decimal(right))
        if self._fits(whole):
            return textwrap.indent(whole, "  ")
        return self._by_terms(sp.Symbol(left) ** 2, printing.decimal(right**2))

    def _side_by_side(self, left: sp.Expr, right: sp.Expr | sp.Matrix) -> str:
        return self.text(sp.Eq(left, right, evaluate=False))

    def _by_terms(self, left: sp.Expr, right: sp.Expr) -> str:
        """One line per term, with its sign in front."""
        lines = textwrap.indent(self.text(left), "  ").split("\n")
        lines[-1] += " ="
        for term in right.as_ordered_terms():
            negative = term.could_extract_minus_sign()
            form = self._printer._print(-term if negative else term)
            printed, baseline = str(form).split("\n"), form.baseline
            if max(map(len, printed)) > self.columns - 6:
                line = self._line.doprint(-term if negative else term)
                printed = textwrap.wrap(line, self.columns - 6)
                baseline = 0
            for k, text in enumerate(printed):
                sign = " " if k != baseline else "-" if negative else "+"
                lines.append(f"    {sign} {text}".rstrip())
        return "\n".join(lines)

    def matrix(self, left: str, right: sp.Matrix) -> str:
        """A matrix; entry by entry without zeros if it is too wide."""
        whole = self._side_by_side(sp.Symbol(left), printing.decimal(right))
        if self._fits(whole):
            return textwrap.indent(whole, "  ")
        symmetric = right.is_square and right == right.T
        n, columns = right.shape
        entries = []
        for i in range(n):
            for j in range(i if symmetric else 0, columns):
                if right[i, j] != 0:
                    place = f"{i + 1}" if columns == 1 else f"{i + 1}{j + 1}"
                    joint = "," if "_" in left else "_"
                    entries.append(self.equation(f"{left}{joint}{place}", right[i, j]))
        kind = "symmetric, " if symmetric else ""
        zero = ", zero except for" if 0 in right else ""
        head = f"  {self.text(sp.Symbol(left))}: {kind}{n} x {columns}{zero}"
        return "\n".join([head, *entries])

    def _fits(self, text: str) -> bool:
        return max(map(len, text.split("\n"))) <= self.columns - 2


class _Line(StrPrinter):  # type: ignore[misc]  # SymPy has no types
    """On one line, with the symbols of the pretty printer.

    Args:
        unicode: Greek letters, dots and subscripts; otherwise ASCII.
    """

    def __init__(self, unicode: bool):
        super().__init__({"full_prec": False})
        self._unicode = unicode

    def _print_Symbol(self, symbol: sp.Symbol) -> str:
        return pretty_symbol(symbol.name) if self._unicode else symbol.name
