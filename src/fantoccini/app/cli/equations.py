"""``fantoccini equations``: prints the equations of a small puppet as text or LaTeX.

T and V are kinetic and potential energy, M is the inertia matrix, C the matrix of velocity forces,
g the forces of gravity and springs, h the gaps of strings (path length minus string length), and f
the friction of motors. The index D stands for dynamic coordinates, K for driven ones; A are the
derivatives of h. A drive moves a coordinate by a motor towards its command. A row of the tree
describes a string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Iterator

import sympy as sp
from sympy.printing.pretty.pretty import PrettyPrinter
from sympy.printing.pretty.pretty_symbology import pretty_symbol
from sympy.printing.str import StrPrinter

from fantoccini.app.cli_support import (
    format_number,
    load_marionette,
    print_message,
    print_output,
    print_table,
    terminal_width,
)
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.equations import printing
from fantoccini.model.puppet import PD, ComputedTorque, DirectCurrent, Drive, Servo

Equation = tuple[str, sp.Expr | sp.Matrix]

_MOTOR_SYMBOLS = (
    "e = command - coordinate; for orientations 2 e_w (e_x, e_y, e_z) of the relative rotation. "
    "n is the rotor angle [rad] per unit of the coordinate, v the speed of the coordinate"
)

_UNICODE_SAMPLE = "\N{GREEK SMALL LETTER THETA}\N{COMBINING DOT ABOVE}\N{SUBSCRIPT ONE}"


def print_equations(file: str, latex: bool) -> None:
    """Prints the Lagrangian, M, C, g, h, A_D and A_K, and the laws of motors.

    Args:
        file: FILE argument.
        latex: print LaTeX instead of text.
    """
    puppet = load_marionette(file)
    check_mass_matrix(puppet.puppet, puppet.tree)
    try:
        page = printing.printable(puppet.equations)
    except printing.TooLargeError:
        for symbol, count in printing.operation_counts(puppet.equations).items():
            print_message(f"  {symbol}: {count} operations")
        print_message(
            f"the equations of {puppet.name} are too large to print; `fantoccini export {file} "
            "DIR` writes them as C99, and marionette.equations has them as CasADi functions"
        )
        raise
    if latex:
        _print_latex(puppet, page)
    else:
        _print_text(puppet, page)


def _print_latex(puppet: Marionette, page: printing.Printable) -> None:
    print_output("% " + puppet.name)
    for symbol, name in page.notation.names.items():
        print_output(f"% ${sp.latex(symbol)}$: {name}")
    for symbol, name, law in _motor_laws(puppet, page, sp.latex):
        print_output(f"% motor of ${symbol}$, {name}: {law}")
    lines = [
        f"  {sp.latex(sp.Symbol(left))} &= {sp.latex(printing.decimal(right))}"
        for left, right in [*energies(page), *matrices(puppet, page), *square_roots(page)]
    ]
    print_output("\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}")


def _print_text(puppet: Marionette, page: printing.Printable) -> None:
    layout = Layout(terminal_width(), _stdout_has_unicode())
    print_table(
        "Symbols", ("symbol", "name", "role", "value>"), list(_symbols(puppet, page, layout))
    )
    print_output("Lagrangian T - V (Eqs. 5-7)\n")
    for left, right in energies(page):
        print_output(layout.equation(left, right) + "\n")
    names = [left for left, _ in matrices(puppet, page)]
    driven_mass = " + M_DK acc_K" if "M_DK" in names else ""
    driven_bias = " + C_DK v_K" if "C_DK" in names else ""
    damping = " + f" if "f" in names else ""
    string_forces = " + A_D^T lambda, tension = -lambda >= 0" if "A_D" in names else ""
    motors = list(_motor_laws(puppet, page, layout.text))
    motor_forces = " + f_M" if motors else ""
    print_output(
        f"Motion (Eqs. 8-10): M acc_D{driven_mass} + C v_D{driven_bias} + g{damping} "
        f"= u{motor_forces}{string_forces}\n"
    )
    for left, right in matrices(puppet, page):
        print_output(layout.matrix(left, right) + "\n")
    if motors:
        print_table("f_M: forces of motors", ("symbol", "name", "law"), motors)
        print_output(textwrap.fill(_MOTOR_SYMBOLS, layout.columns) + "\n")
    for left, right in square_roots(page):
        print_output("with\n" + layout.root(left, right) + "\n")
    print_output("Numbers have six digits. h <= 0; strings come first, then limits.")


def _symbols(
    puppet: Marionette, page: printing.Printable, layout: Layout
) -> Iterator[tuple[str, str, str, str]]:
    values = puppet.tree.parameters
    roles = {row.name: row.role for row in puppet.coordinates.rows}
    for symbol, name in page.notation.names.items():
        role = roles.get(name, "parameter")
        value = format_number(float(values[name])) if role == "parameter" else ""
        yield layout.text(symbol), name, role, value


def _motor_laws(
    puppet: Marionette, page: printing.Printable, symbol_text: Callable[[sp.Symbol], str]
) -> Iterator[tuple[str, str, str]]:
    """Symbol, name and law of every motor's coordinate."""
    symbols = page.notation.symbols["q_D"]
    for row in puppet.tree.drives:
        if row.command is not None:
            coordinates = ", ".join(symbol_text(symbol) for symbol in symbols[row.q])
            yield coordinates, row.name, _motor_law(row.drive)


def _motor_law(drive: Drive) -> str:
    """Law of a motor, with parameters by name."""

    def number_text(value: Number) -> str:
        return value.parameter if isinstance(value, Parameter) else format_number(float(value))

    motor, control = drive.motor, drive.control
    if isinstance(control, PD):
        law = f"{number_text(control.stiffness)} e + {number_text(control.damping)} edot"
    elif isinstance(control, ComputedTorque):
        w, zeta = number_text(control.bandwidth), number_text(control.damping_ratio)
        reference = f"a = rddot + 2 zeta w edot + w^2 e, w = {w}, zeta = {zeta}"
        law = f"M a + c + friction by inverse dynamics, {reference}"
    if motor is None:
        return law
    drum = "" if drive.drum is None else f" / {number_text(drive.drum)}"
    ratio = f"n = {number_text(drive.gear)}{drum}"
    if isinstance(motor, DirectCurrent):
        k, R = number_text(motor.constant), number_text(motor.resistance)
        current, voltage = number_text(motor.current), number_text(motor.voltage)
        bounds = f"|i| <= {current} and |{R} i + {k} n v| <= {voltage}"
        return f"{law} = n {k} i where {bounds}; {ratio}"
    T = number_text(motor.torque)
    if isinstance(motor, Servo):
        return f"{law} where |f_M| <= n {T}; {ratio}"
    if motor.corner_speed is not None:
        T += f" min(1, {number_text(motor.corner_speed)} / |n rdot|)"
    step_text, phase = f"/ ({motor.steps * motor.microsteps} n)", f"{motor.steps / 4:g} n e"
    linear = drive.drum is None and drive.mass is not None
    step_text, phase = (
        (f"1 {step_text}", f"2 pi {phase}") if linear else (f"2 pi {step_text}", phase)
    )
    return f"n {T} sin({phase}), command in steps of {step_text}; {ratio}"


def energies(page: printing.Printable) -> list[Equation]:
    """Equations of T and V."""
    return [("T", page.objects["T"]), ("V", page.objects["V"])]


def matrices(puppet: Marionette, page: printing.Printable) -> list[Equation]:
    """Equations of M, C, g, h and A_D, and of M_DK, C_DK, f and A_K unless they are zero."""
    objects, n = page.objects, puppet.coordinates.n_vD
    C = objects["C"]
    blocks = [
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
        for name, value in blocks
        if 0 not in value.shape and not (name in optional and value.is_zero_matrix)
    ]


def square_roots(page: printing.Printable) -> list[Equation]:
    """Definitions of the symbols that stand for square roots."""
    return [(symbol.name, meaning) for symbol, meaning in page.lengths]


def _stdout_has_unicode() -> bool:
    try:
        _UNICODE_SAMPLE.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


class Layout:
    """Layout of equations on lines of a given width.

    Args:
        columns: characters per line.
        unicode: use Greek letters, dots and subscripts; otherwise ASCII.
    """

    def __init__(self, columns: int, unicode: bool):
        self.columns = columns
        self._printer = PrettyPrinter(
            {"use_unicode": unicode, "wrap_line": False, "full_prec": False}
        )
        self._line = _LinePrinter(unicode)

    def text(self, expression: sp.Basic) -> str:
        """The expression, pretty-printed on several lines."""
        return self._printer.doprint(expression)

    def equation(self, left: str, right: sp.Expr) -> str:
        """Text of ``left = right``; one line per term if it is too wide."""
        symbol, right = sp.Symbol(left), printing.decimal(right)
        text = self._side_by_side(symbol, right)
        if self._fits(text):
            return textwrap.indent(text, "  ")
        numerator, denominator = right.as_numer_denom()
        if denominator.is_Symbol:
            return self._by_terms(sp.Mul(denominator, symbol, evaluate=False), numerator)
        return self._by_terms(symbol, right)

    def root(self, left: str, right: sp.Expr) -> str:
        """Text of ``left = right`` for a square root; squared if it is too wide."""
        text = self._side_by_side(sp.Symbol(left), printing.decimal(right))
        if self._fits(text):
            return textwrap.indent(text, "  ")
        return self._by_terms(sp.Symbol(left) ** 2, printing.decimal(right**2))

    def _side_by_side(self, left: sp.Expr, right: sp.Expr | sp.Matrix) -> str:
        return self.text(sp.Eq(left, right, evaluate=False))

    def _by_terms(self, left: sp.Expr, right: sp.Expr) -> str:
        """Text with one line per term, with its sign in front."""
        lines = textwrap.indent(self.text(left), "  ").split("\n")
        lines[-1] += " ="
        for term in right.as_ordered_terms():
            negative = term.could_extract_minus_sign()
            printed_form = self._printer._print(-term if negative else term)
            printed, baseline = str(printed_form).split("\n"), printed_form.baseline
            if max(map(len, printed)) > self.columns - 6:
                line = self._line.doprint(-term if negative else term)
                printed = textwrap.wrap(line, self.columns - 6)
                baseline = 0
            for k, text in enumerate(printed):
                sign = " " if k != baseline else "-" if negative else "+"
                lines.append(f"    {sign} {text}".rstrip())
        return "\n".join(lines)

    def matrix(self, left: str, right: sp.Matrix) -> str:
        """Text of a matrix; if it is too wide, its nonzero entries one by one."""
        text = self._side_by_side(sp.Symbol(left), printing.decimal(right))
        if self._fits(text):
            return textwrap.indent(text, "  ")
        symmetric = right.is_square and right == right.T
        n, columns = right.shape
        entries = []
        for i in range(n):
            for j in range(i if symmetric else 0, columns):
                if right[i, j] != 0:
                    indices = f"{i + 1}" if columns == 1 else f"{i + 1}{j + 1}"
                    separator = "," if "_" in left else "_"
                    entries.append(self.equation(f"{left}{separator}{indices}", right[i, j]))
        symmetry = "symmetric, " if symmetric else ""
        zero = ", zero except for" if 0 in right else ""
        heading = f"  {self.text(sp.Symbol(left))}: {symmetry}{n} x {columns}{zero}"
        return "\n".join([heading, *entries])

    def _fits(self, text: str) -> bool:
        return max(map(len, text.split("\n"))) <= self.columns - 2


class _LinePrinter(StrPrinter):  # type: ignore[misc]  # SymPy has no types
    """Printer on one line, with the symbols of the pretty printer.

    Args:
        unicode: use Greek letters, dots and subscripts; otherwise ASCII.
    """

    def __init__(self, unicode: bool):
        super().__init__({"full_prec": False})
        self._unicode = unicode

    def _print_Symbol(self, symbol: sp.Symbol) -> str:
        return pretty_symbol(symbol.name) if self._unicode else symbol.name
