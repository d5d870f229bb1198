"""Derivatives of the residual of the equations of motion.

    r = M acc_D + M_DK acc_K + c + damping + A_D^T tension - u_D        (Eq. 10; r = 0)
    hddot = A_D acc_D + A_K acc_K + Adot v                              (Eq. 11; 0 on taut rows)

The derivatives of acc_D and of the tensions follow from the implicit function theorem, with the
factors of M and of the taut rows. The residual is computed by recursive Newton-Euler; it needs a
tenth of the operations of acc_D. Derivatives by a configuration are along tangent vectors delta:
dq = N(q) delta, with qdot = N(q) v. For scalars N = 1; an orientation rotates in the body's frame.

D stands for dynamic coordinates, K for driven ones (ends and lengths of strings). A row is a string
or a joint limit with its gap h; A_D and A_K are the derivatives of h, and a row is taut if h = 0. A
link is a body on its joint.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from itertools import pairwise

import casadi as ca
import numpy as np

from fantoccini.kernel.contract import DERIVATIVES, compiled
from fantoccini.kernel.equations import drives, dynamics
from fantoccini.kernel.equations.algebra import (
    column,
    cross,
    dot,
    elements,
    scaled,
    stacked,
    symbolic,
    zeros,
)
from fantoccini.kernel.equations.declared import declared
from fantoccini.kernel.equations.kinematics import configuration_rate
from fantoccini.kernel.equations.rows import segment_length
from fantoccini.kernel.equations.symbols import Symbols
from fantoccini.kernel.equations.system import System
from fantoccini.model.tree import WORLD, Point, Role, Tree

_FUNCTIONS = (
    "force_by_q",
    "force_by_v",
    "force_by_K",
    "rows_by",
    "row_rates_by",
    "step_back",
    "hanging",
)


class Derivatives:
    """The derivatives of a tree's equations as CasADi functions.

    Attributes:
        tree: the tree.
        system: symbolic expressions of the tree.
    """

    def __init__(self, tree: Tree):
        self.tree = tree
        self.system = System(tree)

    def functions(self, library: str = DERIVATIVES) -> dict[str, ca.Function]:
        """Name -> derivative function of a library; all results are dense."""
        symbols = self.system.symbols
        names = [n for n in compiled(library, self.tree.sizes) if n in _FUNCTIONS]
        if "step_back" in names:
            results = self._residual_gradient()
        elif "hanging" in names:
            results = self._at_rest()
        else:
            results = {**self._forces(symbols.tension), **self._rows()}
        return {name: declared(name, symbols, results) for name in names}

    def residual(self, tension: ca.SX, v_D: ca.SX | None = None) -> ca.SX:
        """Residual r (n_vD,) of Eq. 10 without u_D; damping and drag act on v_D + dt acc_D.

        Tensions are forces on the links. One pass from the leaves to the root projects them onto
        the joints, together with inertia and gravity.

        Args:
            tension: (n_rows,) tensions of strings, forces of limits [N or N m].
            v_D: (n_vD,) velocity in the Coriolis terms; by default that of the state.
        """
        system, s, tree = self.system, self.system.symbols, self.tree
        motions = system.full_motions
        if v_D is not None:
            motions = system.motions(*map(elements, (v_D, s.v_K, s.acc_D, s.acc_K)))
        loads = system.loads(motions)
        tau, string_wrenches = elements(tension), [(zeros(3), zeros(3)) for _ in tree.links]
        for i, string in enumerate(tree.strings):
            self._add_pull(string.points, tau[i], string_wrenches)
        drag_changes = self._drag_change()
        wrenches = [
            (torque - pull[0] + drag[0], force - pull[1] + drag[1])
            for (torque, force), pull, drag in zip(
                loads.wrenches, string_wrenches, drag_changes, strict=True
            )
        ]
        f_D, _ = system.generalised(dataclasses.replace(loads, wrenches=wrenches))
        acc_D, motors = elements(s.acc_D), drives.forces(system, s.dt)
        f_D = f_D + (system.armature + motors.armature) * acc_D - motors.f_D
        for link in tree.links:
            if link.role is Role.DYNAMIC:
                implicit = scaled(s.dt * system.value(link.damping), acc_D[link.v])
                f_D[link.v] = f_D[link.v] + implicit
        for i, row in enumerate(system.string_rows):
            f_D = f_D + scaled(tau[i], row.winding)
        for i, limit in enumerate(tree.limits):
            v = tree.links[limit.link].v
            _, J, _ = system.limit_rows[i]
            f_D[v] = f_D[v] + scaled(tau[len(tree.strings) + i], J)
        return column(f_D)

    def _drag_change(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """(torque, force) of every link: change of its drag over a step with acc_D."""
        system, s = self.system, self.system.symbols
        motions = system.motions(elements(s.acc_D))
        return [
            system.drag_inertia(i, s.dt).momentum(motion.w, motion.v)
            for i, motion in enumerate(motions)
        ]

    def _add_pull(
        self, points: tuple[Point, ...], tension: ca.SX, wrenches: list[dynamics.Wrench]
    ) -> None:
        """Adds the pull of a string to the wrenches on its links, about their origins."""
        system = self.system
        arguments = system.row_arguments(system.full_motions)
        pulls = [zeros(3) for _ in points]
        for k, (first, second) in enumerate(pairwise(points)):
            if first.link == second.link:
                continue
            d = arguments.position(second) - arguments.position(first)
            pull = scaled(tension / segment_length(d), d)
            pulls[k] = pulls[k] + pull
            pulls[k + 1] = pulls[k + 1] - pull
        for point, pull in zip(points, pulls, strict=True):
            if point.link == WORLD:
                continue
            force = system.full_motions[point.link].R.T.dot(pull)
            local_position = symbolic([system.value(x) for x in point.at])
            torque, other_forces = wrenches[point.link]
            wrenches[point.link] = (torque + cross(local_position, force), other_forces + force)

    def _forces(self, tension: ca.SX) -> dict[str, ca.SX]:
        """Derivatives of the residual r."""
        names = {
            "r_q": "q_D",
            "r_v": "v_D",
            "r_qK": "q_K",
            "r_vK": "v_K",
            "M_DK": "acc_K",
            "r_p": "p",
        }
        derivatives = self._derivatives(ca.cse(self.residual(tension)), names.values())
        return {name: derivatives[variable] for name, variable in names.items()}

    def _rows(self) -> dict[str, ca.SX]:
        """A_D, A_K and the derivatives of h, hdot and hddot of strings and limits."""
        system, s, tree = self.system, self.system.symbols, self.tree
        n, n_K = tree.coordinates.n_vD, tree.coordinates.n_vK
        v_D, acc_D = elements(s.v_D), elements(s.acc_D)
        rows = system.full_string_rows
        h, hdot, hddot = ([getattr(r, k) for r in rows] for k in ("length", "rate", "bias"))
        A_D, A_K = [r.A_D for r in rows], [r.A_K for r in rows]
        for limit, (h_limit, J, gamma) in zip(tree.limits, system.limit_rows, strict=True):
            v = tree.links[limit.link].v
            row = zeros(n)
            row[v] = J
            A_D.append(row)
            A_K.append(zeros(n_K))
            h.append(h_limit)
            hdot.append(dot(J, v_D[v]))
            hddot.append(dot(J, acc_D[v]) + gamma)
        results = {"A_D": stacked(A_D, n), "A_K": stacked(A_K, n_K)}
        # A string acts on few links: reverse mode from each row needs fewer operations.
        for name, values, variable in (
            ("h", h, "p"),
            ("hdot", hdot, "q_D q_K p"),
            ("hddot", hddot, "q_D v_D q_K v_K p"),
        ):
            derivatives = self._derivatives(ca.cse(column(values)), variable.split(), backward=True)
            for symbol, x in derivatives.items():
                results[f"{name}_{symbol.removesuffix('_D').replace('_', '')}"] = x
        return results

    def _residual_gradient(self) -> dict[str, ca.SX]:
        """Gradient of z . r + y . hdot + y_h . h by reverse-mode differentiation."""
        s = self.system.symbols
        h, hdot = self._row_values()
        rates = ca.substitute(hdot, s.v_D, s.v_next)
        value = ca.dot(s.z, self.residual(s.tension, s.v_ahead))
        value = ca.cse(value + ca.dot(s.y, rates) + ca.dot(s.y_h, h))
        names = {
            "g_q": "q_D",
            "g_v": "v_D",
            "g_ahead": "v_ahead",
            "g_next": "v_next",
            "g_qK": "q_K",
            "g_vK": "v_K",
            "g_aK": "acc_K",
            "g_p": "p",
        }
        variables = [getattr(s, name) for name in names.values()]
        # One vector for all variables, so that common subexpressions are differentiated once.
        all_variables = ca.SX.sym("all", sum(x.numel() for x in variables))
        splits = np.cumsum([0, *(x.numel() for x in variables)]).tolist()
        value = ca.substitute([value], variables, ca.vertsplit(all_variables, splits))[0]
        gradient = ca.gradient(value, all_variables)
        gradient = ca.substitute(gradient, all_variables, ca.vertcat(*variables))
        return {
            result: tangents(s, self.tree, name).T @ part
            for (result, name), part in zip(
                names.items(), ca.vertsplit(gradient, splits), strict=True
            )
        }

    def _at_rest(self) -> dict[str, ca.SX]:
        """r and h at rest, and their derivatives."""
        s, (h, _) = self.system.symbols, self._row_values()
        moving = [s.v_D, s.v_K, s.acc_D, s.acc_K, s.dt]
        zero = [ca.SX.zeros(*x.shape) for x in moving]
        r = ca.cse(ca.substitute([self.residual(s.tension)], moving, zero)[0])
        suffix_of = {"q_D": "q", "q_K": "qK", "p": "p"}
        r_by = {f"r_{suffix_of[name]}": x for name, x in self._derivatives(r, suffix_of).items()}
        names = {"q_D": "A_D", "q_K": "A_K", "p": "h_p"}
        h_by = self._derivatives(ca.cse(h), names, backward=True)
        return {"r": r, "h": h, **r_by, **{names[name]: x for name, x in h_by.items()}}

    def _row_values(self) -> tuple[ca.SX, ca.SX]:
        """h and hdot (n_rows,) of strings and limits."""
        system, v_D = self.system, elements(self.system.symbols.v_D)
        rows = system.full_string_rows
        h, hdot = [row.length for row in rows], [row.rate for row in rows]
        for limit, (h_limit, J, _) in zip(self.tree.limits, system.limit_rows, strict=True):
            h.append(h_limit)
            hdot.append(dot(J, v_D[self.tree.links[limit.link].v]))
        return column(h), column(hdot)

    def _derivatives(
        self, values: ca.SX, names: Iterable[str], backward: bool = False
    ) -> dict[str, ca.SX]:
        """Name of a symbol -> derivative of a column with respect to it; see `along_tangents`."""
        symbols = self.system.symbols
        return {n: along_tangents(values, symbols, self.tree, n, backward) for n in names}


def along_tangents(
    values: ca.SX, symbols: Symbols, tree: Tree, name: str, backward: bool = False
) -> ca.SX:
    """Derivatives of a column by a symbol, along tangent vectors if it is a configuration.

    Args:
        values: the column.
        symbols, tree: symbols and tree of the equations.
        name: name of the symbol.
        backward: whether to differentiate in reverse mode.
    """
    x, N = symbols[name], tangents(symbols, tree, name)
    if not x.numel() or not values.numel():
        return ca.SX(values.numel(), N.shape[1])
    if backward:
        return ca.jtimes(values, x, ca.SX.eye(values.numel()), True).T @ N
    return ca.jtimes(values, x, N)


def tangents(symbols: Symbols, tree: Tree, name: str) -> ca.SX:
    """N(q) for a configuration, the identity for any other symbol."""
    s, t = symbols, tree.coordinates
    if name == "q_D":
        rate = configuration_rate(s.q_D, s.v_D, t.quaternions_D, t.scalars_D)
        return ca.jacobian(rate, s.v_D)
    if name in ("q_K", "q_mid"):
        rate = configuration_rate(s[name], s.v_K, t.quaternions_K, t.scalars_K)
        return ca.jacobian(rate, s.v_K)
    return ca.SX.eye(s[name].numel())
