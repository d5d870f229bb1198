"""A CasADi function as one plain C99 function of named pointers.

CasADi's own generator adds an interface for programs that load the function. The elementary
operations and their order are the same here, and therefore the results.

An operation has one or two operands, and SX is a type of CasADi for expressions of such operations.
"""

from __future__ import annotations

import math
import re

import casadi as ca

_INFIX = {
    ca.OP_ADD: "+",
    ca.OP_SUB: "-",
    ca.OP_MUL: "*",
    ca.OP_DIV: "/",
    ca.OP_LT: "<",
    ca.OP_LE: "<=",
    ca.OP_EQ: "==",
    ca.OP_NE: "!=",
    ca.OP_AND: "&&",
    ca.OP_OR: "||",
}

_CALLS = {
    ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_FABS: "fabs",
    ca.OP_FLOOR: "floor",
    ca.OP_FMIN: "fmin",
    ca.OP_FMAX: "fmax",
}

_SPELLED = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_NOT: "!{0}",
    ca.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}

_LOCAL = re.compile(r"t\d+")
"""Names of local variables, which no argument may have."""


def prototype(function: ca.Function, name: str) -> str:
    """The declaration of a function, without semicolon.

    Args:
        function: CasADi function, whose arguments and results have the same names in C.
        name: name of the C function.
    """
    arguments = [f"const double *{n}" for n in function.name_in()]
    arguments += [f"double *{n}" for n in function.name_out()]
    lines = [f"void {name}("]
    for k, argument in enumerate(arguments):
        word = argument + ("," if k + 1 < len(arguments) else ")")
        if len(lines[-1]) + 1 + len(word) > 96:
            lines.append("   ")
        lines[-1] += word if lines[-1].endswith("(") else f" {word}"
    return "\n".join(lines)


def definition(function: ca.Function, name: str) -> str:
    """The C99 text of a function of dense SX; a result whose pointer is null is not computed.

    Args:
        function: CasADi function with dense inputs and outputs.
        name: name of the C function.

    Raises:
        NotImplementedError: the function contains an operation that C99 does not have.
    """
    names_in, names_out = function.name_in(), function.name_out()
    if clash := [n for n in (*names_in, *names_out) if _LOCAL.fullmatch(n)]:
        raise ValueError(f"{clash[0]} is the name of a local variable")
    body, locals_, used_places = [], set(), set()
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        target, operands = function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_OUTPUT:
            result = names_out[target[0]]
            used_places.add(result)
            body.append(f"if ({result}) {result}[{target[1]}] = t{operands[0]};")
            continue
        locals_.add(target[0])
        if operation == ca.OP_CONST:
            value = _number(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            argument = names_in[operands[0]]
            used_places.add(argument)
            value = f"{argument}[{operands[1]}]"
        else:
            value = expression(operation, [f"t{i}" for i in operands])
        body.append(f"t{target[0]} = {value};")
    unused = [n for n in (*names_in, *names_out) if n not in used_places]
    head = [prototype(function, name), "{", *_declarations(sorted(locals_))]
    return "\n".join(head + [f"  {s}" for s in [*(f"(void){n};" for n in unused), *body]] + ["}"])


def expression(operation: int, operands: list[str]) -> str:
    """The C text of an elementary operation on names and numbers."""
    if operation in _INFIX:
        return f" {_INFIX[operation]} ".join(operands)
    if operation in _CALLS:
        return f"{_CALLS[operation]}({', '.join(operands)})"
    if operation in _SPELLED:
        return _SPELLED[operation].format(*operands)
    raise NotImplementedError(f"operation {operation} has no counterpart in the C99 export")


def literal(value: float) -> str:
    """A number as an operand: in parentheses if it is negative."""
    text = _number(value)
    return f"({text})" if text.startswith("-") else text


def _number(value: float) -> str:
    """A number with all its digits."""
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be a constant of the exported model")
    return repr(float(value))


def _declarations(registers: list[int]) -> list[str]:
    words = [f"t{i}" for i in registers]
    return [f"  double {', '.join(words[i : i + 14])};" for i in range(0, len(words), 14)]
