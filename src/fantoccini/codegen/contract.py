"""What every function of an exported model takes and gives, in words.

The header's comments are made from this. Names from the user's file are data: :func:`shown` lets
through what cannot end a comment, and nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from fantoccini.tree import Tree

_HARMLESS = re.compile(r"[A-Za-z0-9_./-]+", re.ASCII)

FUNCTIONS = {
    "mass_matrix": "M of Eq. 8 and its blocks for the driven coordinates.",
    "coriolis": "C of Eq. 8: C v_D is the velocity's part of the bias with inputs at rest.",
    "bias": "c(q, v) of Eq. 8: Coriolis, gravity and springs, without damping and drag.",
    "gravity": "g(q) of Eq. 8: gradient of the potential energy.",
    "damping": "Force of damping and drag, on the same side as the bias.",
    "energy": "Kinetic energy (Eq. 5) and potential energy (Eq. 6, and springs).",
    "constraint": "h (Eq. 9): a string is slack at h < 0 and taut at h = 0; limits likewise.",
    "A_D": "A_D of Eq. 10: partial derivative of hdot by v_D.",
    "A_K": "A_K of Eq. 10: partial derivative of hdot by v_K.",
    "Adot_v": "dA/dt v of Eq. 11: hddot = A_D acc_D + A_K acc_K + Adot_v.",
    "poses": "World pose of every link (Eqs. 2, 3).",
    "body_velocity": "V^b of every link (Eq. 4).",
    "points": "World positions of the points each string runs through.",
    "wrench_forces": "u_D of Eq. 8 from a wrench on every link.",
    "effort": "Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lam.",
    "dynamics": "All that the accelerations and tensions of any set of taut strings need "
    "(Eqs. 10, 11): acc_D = back(L, w0 + W lam), hddot = gamma + a0 + G lam, lam = -tension.",
    "forth": "y = F^-T x.",
    "back": "y = F^-1 x.",
}
"""Name of an exported function -> what it computes, in the order of the header."""

Shape = tuple[str, ...]

ARGUMENTS: dict[str, tuple[Shape, str]] = {
    "q_D": (("q_D",), "dynamic configuration; quaternions of unit length"),
    "v_D": (("v_D",), "dynamic velocity"),
    "acc_D": (("v_D",), "dynamic acceleration [velocity's unit / s]"),
    "q_K": (("q_K",), "driven configuration; quaternions of unit length"),
    "v_K": (("v_K",), "driven velocity"),
    "acc_K": (("v_K",), "driven acceleration [velocity's unit / s]"),
    "u_D": (("v_D",), "user forces [force's unit]"),
    "lam": (("strings",), "multipliers, minus the tensions [N]"),
    "wrench": (("6", "links"), "force at the centre of mass [N], torque [N m]; world axes"),
    "p": (("p",), "parameters"),
    "L": (("packed",), "numbers of the factor M = F^T F that fan_dynamics gives"),
    "x": (("v_D",), "any vector"),
}
"""Argument -> its shape in orders of entries, its meaning and unit."""

RESULTS: dict[str, tuple[Shape, str]] = {
    "mass_matrix.M": (("v_D", "v_D"), "symmetric, positive definite"),
    "mass_matrix.M_DK": (("v_D", "v_K"), "not zero where a driven joint moves mass"),
    "mass_matrix.M_KK": (("v_K", "v_K"), "symmetric"),
    "coriolis.C": (("v_D", "v_D"), "dM/dt - 2 C is skew"),
    "bias.c": (("v_D",), "[force's unit]"),
    "gravity.g_D": (("v_D",), "[force's unit]"),
    "damping.f": (("v_D",), "[force's unit]"),
    "energy.T": (("1",), "kinetic energy [J]"),
    "energy.V": (("1",), "potential energy [J]"),
    "constraint.h": (("rows",), "path length minus string length [m]; limits as listed"),
    "A_D.A_D": (("rows", "v_D"), "[row's unit / s per velocity's unit]"),
    "A_K.A_K": (("rows", "v_K"), "[row's unit / s per velocity's unit]"),
    "Adot_v.Adot_v": (("rows",), "[row's unit / s^2]"),
    "poses.poses": (("12", "links"), "R column by column [1], then the origin [m]"),
    "body_velocity.V": (("6", "links"), "linear [m/s], then angular [rad/s], in the link's frame"),
    "points.points": (("3", "points"), "x, y, z [m]"),
    "wrench_forces.u_D": (("v_D",), "[force's unit]"),
    "effort.f_K": (("v_K",), "[force's unit]"),
    "dynamics.L": (("packed",), "numbers of the factor M = F^T F, for fan_forth and fan_back only"),
    "dynamics.w0": (("v_D",), "F^-T (u_D - c - damping - M_DK acc_K)"),
    "dynamics.W": (("v_D", "strings"), "F^-T A_D^T"),
    "dynamics.G": (("strings", "strings"), "A_D M^-1 A_D^T = W^T W [1/kg]"),
    "dynamics.h": (("strings",), "path length minus string length [m]"),
    "dynamics.hdot": (("strings",), "its rate [m/s]"),
    "dynamics.gamma": (("strings",), "hddot at acc_D = 0 [m/s^2]"),
    "dynamics.a0": (("strings",), "W^T w0 [m/s^2]"),
    "dynamics.hdot_K": (("strings",), "A_K v_K, the inputs' part of hdot [m/s]"),
    "dynamics.h_limit": (("limits",), "h of the limits"),
    "dynamics.J_limit": (("3", "limits"), "their rows of A_D: the entries of their own joint"),
    "dynamics.gamma_limit": (("limits",), "their hddot at acc_D = 0"),
    "dynamics.power0": (("1",), "power of the inputs at acc_D = 0 without tensions [W]"),
    "dynamics.M_DK_v_K": (("v_D",), "M_DK v_K"),
    "dynamics.loss": (("1",), "power of damping and drag [W]"),
    "forth.y": (("v_D",), "the solution"),
    "back.y": (("v_D",), "the solution"),
}
"""function.result -> its shape in orders of entries, its meaning and unit."""


@dataclass(frozen=True)
class Order:
    """Names and units of the entries of a vector, in their order.

    Attributes:
        title: what is listed.
        entries: a line for every entry.
    """

    title: str
    entries: tuple[str, ...]


def orders(tree: Tree) -> dict[str, Order]:
    """The orders of entries of a tree, by the names that the shapes above use."""
    table = tree.coordinates
    units = {row.name: row.unit for row in table.rows}
    rows = [f"{shown(s.name)} [m]" for s in tree.strings]
    limits = [f"{shown(r.name)} [{_LIMIT_UNITS.get(r.side, 'rad or m')}]" for r in tree.limits]
    parameters = [f"{shown(n)}, in the puppet file {x!r}" for n, x in tree.parameters.items()]
    links = [shown(link.name) for link in tree.links]
    points = [
        f"{shown(s.name)}, point {k + 1} of {len(s.points)}"
        for s in tree.strings
        for k in range(len(s.points))
    ]
    return {
        "q_D": Order("dynamic configuration", _configuration(table.q_D, units)),
        "v_D": Order("dynamic velocities and forces", _velocities(table.v_D, units)),
        "q_K": Order("driven configuration", _configuration(table.q_K, units)),
        "v_K": Order("driven velocities and forces", _velocities(table.v_K, units)),
        "strings": Order("strings", tuple(rows)),
        "limits": Order("limits", tuple(limits)),
        "rows": Order("strings, then limits", tuple(rows + limits)),
        "links": Order("bodies, and the driven ends of strings", tuple(links)),
        "points": Order("points of the strings", tuple(points)),
        "p": Order("parameters", tuple(parameters)),
    }


_LIMIT_UNITS = {"cone": "1", "twist.lower": "rad", "twist.upper": "rad"}


def shown(name: str) -> str:
    """A name as it may stand in a comment.

    Raises:
        ValueError: it has a character that a puppet file's names cannot have.
    """
    if not _HARMLESS.fullmatch(name):
        raise ValueError(f"{name!r} cannot stand in generated text")
    return name


def _configuration(names: Iterable[str], units: dict[str, str]) -> tuple[str, ...]:
    return tuple(f"{shown(name)} [{units[name]}]" for name in names)


def _velocities(names: Iterable[str], units: dict[str, str]) -> tuple[str, ...]:
    """Velocities of a length are in m/s with forces in N, all others in rad/s with N m."""
    of = {"m": "m/s], force [N", "rad": "rad/s], force [N m"}
    return tuple(f"{shown(n)} [{of[units.get(n, 'rad')]}]" for n in names)
