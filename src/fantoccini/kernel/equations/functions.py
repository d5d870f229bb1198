"""CasADi functions of a system: compiled ones of the model, interpreted ones for analysis.

The method ``_name`` derives the function ``name`` of the contract. All results are dense; matrices
are stored column by column.

D stands for dynamic coordinates, K for driven ones. A row is a string or a joint limit with its
gap, A_D and A_K are the derivatives of the gaps; a drive moves a coordinate by a motor. h is the
gap of a string, path length minus string length; hdot and hddot are its rates. A link is a body on
its joint. With the inertia matrix M_DD = F^T F, w0 = F^-T f are the scaled forces f without
strings, and W = F^-T A_D^T those of unit tensions.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, partial

import casadi as ca
import numpy as np

from fantoccini.base import UnknownNameError
from fantoccini.kernel.contract import COLUMN, FUNCTIONS, MODEL, compiled, needed
from fantoccini.kernel.equations import articulated, drives, dynamics
from fantoccini.kernel.equations.algebra import (
    column,
    cross,
    dot,
    elements,
    matrix,
    scaled,
    stacked,
    zeros,
)
from fantoccini.kernel.equations.coriolis import coriolis_matrix
from fantoccini.kernel.equations.declared import declared
from fantoccini.kernel.equations.energy import kinetic_energy, potential_energy
from fantoccini.kernel.equations.system import Loads, System
from fantoccini.model.tree import Link, Role, Tree

_MAX_COLUMNS_SIZE = 5
"""Largest total number of instructions of ``columns``, relative to ``solve_factor_transposed``."""
_MAX_PUSHES_SIZE = 8
"""Largest total number of instructions of ``pushes``, relative to ``solve_factor_transposed``."""


class Equations:
    """The equations of a tree: symbolic expressions and functions of them.

    Attributes:
        tree: the tree.
        system: symbolic expressions of the tree.
    """

    def __init__(self, tree: Tree):
        self.tree = tree
        self.system = System(tree)
        self._functions: dict[str, ca.Function] = {}

    def __iter__(self) -> Iterator[str]:
        """The names of the functions."""
        model_functions = (f for f in FUNCTIONS.values() if MODEL in f.libraries or not f.libraries)
        return (f.name for f in model_functions if needed(f, self.tree.sizes))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in tuple(self)

    def __getitem__(self, name: str) -> ca.Function:
        """A function of the contract that is compiled in the model, or interpreted.

        Raises:
            UnknownNameError: there is no such function.
        """
        if name not in self:
            raise UnknownNameError("function", str(name), self)
        if name not in self._functions:
            self._functions[name] = self._function(name)
        return self._functions[name]

    @cached_property
    def model(self) -> dict[str, ca.Function]:
        """Name -> function of the compiled model."""
        return {name: self[name] for name in compiled(MODEL, self.tree.sizes)}

    @property
    def sizes(self) -> dict[str, int]:
        """The sizes of the tree, and the length of L."""
        return {**self.tree.sizes, "n_packed": self.n_packed}

    def _function(self, name: str) -> ca.Function:
        symbols = self.system.symbols
        if name in ("solve_factor_transposed", "solve_factor"):
            L, factor = self._stored
            transposed = partial(factor.solve_transposed, wrenches={})
            solve = factor.solve if name == "solve_factor" else transposed
            return declared(name, {**symbols, "L": L}, {"y": column(solve(elements(symbols.x)))})
        return declared(name, symbols, getattr(self, f"_{name}")())

    @cached_property
    def factor(self) -> articulated.Factor:
        """F of M_DD = F^T F, with damping and drag over a step dt; stored as L."""
        return self._factor(self.system.symbols.dt)

    def _factor(self, dt: ca.SX) -> articulated.Factor:
        system = self.system
        own = system.armature + drives.forces(system, dt).armature

        def armature(link: Link) -> np.ndarray:
            return own[link.v] + dt * system.value(link.damping)

        inertias = [
            inertia + system.drag_inertia(i, dt) for i, inertia in enumerate(system.regrouped)
        ]
        return articulated.factorise(self.tree, system.joints, inertias, armature)

    def _dynamics(self) -> dict[str, ca.SX]:
        """All quantities of Eqs. 10 and 11 for any active set."""
        results = self._with_factor(self._factor(ca.SX(0)), ca.SX(0), self.system.free_loads)
        motors = drives.forces(self.system, ca.SX(0)).f_D
        results["power0"] = results["power0"] + dot(elements(self.system.symbols.v_D), motors)
        return results

    def _step_dynamics(self) -> dict[str, ca.SX]:
        """All quantities of a step, with damping and drag, without accelerations of rows.

        ``power0`` is without the motors, which exert f_M - y_M dv over the step.
        """
        results = self._with_factor(self.factor, self.system.symbols.dt, self.system.step_loads)
        results = {name: x for name, x in results.items() if name not in ("gamma", "gamma_limit")}
        motors, motor_indices = (
            drives.forces(self.system, self.system.symbols.dt),
            self.tree.driven_v_D,
        )
        return results | {
            "f_M": column(motors.f_D[motor_indices]),
            "y_M": column(motors.velocity_slopes[motor_indices]),
        }

    def _with_factor(self, factor: articulated.Factor, dt: ca.SX, loads: Loads) -> dict[str, ca.SX]:
        system, s, tree = self.system, self.system.symbols, self.tree
        n, m = tree.coordinates.n_vD, len(tree.strings)
        v_K = elements(s.v_K)
        _, f_K = system.generalised(loads)
        loads_by_link = {i: (-torque, -force) for i, (torque, force) in enumerate(loads.wrenches)}
        motors = drives.forces(system, dt).f_D
        w0 = factor.solve_transposed(elements(s.u_D) - loads.f_D + motors, loads_by_link)
        rows = system.string_rows
        W = zeros(n, m)
        for i, row in enumerate(rows):
            W[:, i] = factor.solve_transposed(row.winding, row.wrenches)
        G = zeros(m, m)
        for i in range(m):
            for j in range(i + 1):
                G[i, j] = G[j, i] = dot(W[:, i], W[:, j])
        limits = system.limit_rows
        J = zeros(3, len(limits))
        for i, (_, jacobian, _) in enumerate(limits):
            J[: len(jacobian), i] = jacobian
        return {
            "L": column(factor.pack(self.factor)),
            "w0": column(w0),
            "W": matrix(W),
            "G": matrix(G),
            "h": column([r.length for r in rows]),
            "hdot": column([r.rate for r in rows]),
            "gamma": column([r.bias for r in rows]),
            "a0": column([dot(W[:, i], w0) for i in range(m)]),
            "hdot_K": column([dot(r.A_K, v_K) for r in rows]),
            "h_limit": column([h for h, _, _ in limits]),
            "J_limit": matrix(J),
            "gamma_limit": column([gamma for _, _, gamma in limits]),
            "power0": dot(v_K, f_K),
            "M_DK_v_K": column(system.inertial(None, v_K)),
            "loss": loads.loss,
        }

    @cached_property
    def n_packed(self) -> int:
        """Length of L."""
        return len(self.factor.pack(self.factor))

    @cached_property
    def _stored(self) -> tuple[ca.SX, articulated.Factor]:
        """L as symbols, and the factor with its numbers in L."""
        L = ca.SX.sym("L", self.n_packed)
        return L, self.factor.unpack(elements(L))

    @cached_property
    def columns(self) -> dict[int, tuple[list[int], ca.Function]]:
        """Link with limits -> y = F^-T x for forces x in the link's joint.

        Each value is the list of places of the nonzero entries of y, those on the way to the root,
        and a function (L, x (3,)) -> these entries. Empty if all functions are much longer than
        ``solve_factor_transposed`` in total, as for a long chain with limits in all joints.
        """
        columns: dict[int, tuple[list[int], ca.Function]] = {}
        (L, factor), x = self._stored, self.system.symbols.x_joint
        names_in, names_out = ([q.name for q in p] for p in (COLUMN.arguments, COLUMN.results))
        for i in sorted({limit.link for limit in self.tree.limits}):
            velocities = self.tree.links[i].v
            entries = factor.solve_transposed_from(
                i, elements(x)[: velocities.stop - velocities.start]
            )
            y = ca.cse(column(list(entries.values())))
            function = ca.Function(f"fan_column_{i}", [L, x], [y], names_in, names_out)
            columns[i] = list(entries), function
        total = sum(function.n_instructions() for _, function in columns.values())
        n_whole = self["solve_factor_transposed"].n_instructions()
        return columns if total < _MAX_COLUMNS_SIZE * n_whole else {}

    @cached_property
    def pushes(self) -> dict[int, ca.Function]:
        """Link with contact -> function (L, x) -> y = F^-T x, all entries.

        Only forces x in the joints from the link to the root count. Empty if all functions are
        much longer than ``solve_factor_transposed`` in total, as for a long chain.
        """
        pushes: dict[int, ca.Function] = {}
        (L, factor), x = self._stored, self.system.symbols.x
        for i, link in enumerate(self.tree.links):
            links_to_world = [self.tree.links[j] for j in self.tree.ancestors(i)]
            moving_velocities = [w.v for w in links_to_world if w.role is Role.DYNAMIC]
            if not (self.tree.n_contacts and link.shapes and moving_velocities):
                continue
            force = zeros(self.tree.coordinates.n_vD)
            for velocities in moving_velocities:
                force[velocities] = elements(x)[velocities]
            y = ca.densify(ca.cse(column(factor.solve_transposed(force, {}))))
            pushes[i] = ca.Function(f"fan_push_{i}", [L, x], [y], ["L", "x"], ["y"])
        total = sum(function.n_instructions() for function in pushes.values())
        n_whole = self["solve_factor_transposed"].n_instructions()
        return pushes if total < _MAX_PUSHES_SIZE * n_whole else {}

    def _limit_rates(self) -> dict[str, ca.SX]:
        """hdot of the limits at a velocity, with the constants of their Jacobians inserted."""
        v, J, rates = self.system.symbols.v_D, self.system.symbols.J_limit, []
        limits = zip(self.tree.limits, self.system.limit_rows, strict=True)
        for i, (limit, (_, jacobian, _)) in enumerate(limits):
            velocities = self.tree.links[limit.link].v
            row = [x if ca.SX(x).is_constant() else J[k, i] for k, x in enumerate(jacobian)]
            rates.append(dot(np.array(row, dtype=object), elements(v[velocities])))
        return {"rates": column(rates)}

    def _rows(self) -> dict[str, ca.SX]:
        strings = [row.length for row in self.system.string_rows]
        return {"h": column(strings + [h for h, _, _ in self.system.limit_rows])}

    def _energy(self) -> dict[str, ca.SX]:
        return {"T": kinetic_energy(self.system), "V": potential_energy(self.system)}

    def _momentum(self) -> dict[str, ca.SX]:
        """p = sum_i R_i p_i, l = sum_i (R_i l_i + r_i x R_i p_i) - c x p, c the centre of mass."""
        system, mass = self.system, ca.SX(0)
        moment, linear, angular = zeros(3), zeros(3), zeros(3)
        for inertia, motion in zip(system.inertias, system.free_motions, strict=True):
            own, push = (motion.R.dot(x) for x in inertia.momentum(motion.w, motion.v))
            linear, angular = linear + push, angular + own + cross(motion.r, push)
            mass = mass + inertia.m
            moment = moment + scaled(inertia.m, motion.r) + motion.R.dot(inertia.h)
        centre = zeros(3) if mass.is_zero() else scaled(1 / mass, moment)
        return {"momentum": column([*linear, *(angular - cross(centre, linear))])}

    def _effort(self) -> dict[str, ca.SX]:
        """Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda.

        The force on a command is that of the motor which follows it.
        """
        _, f_K = self.system.generalised(self.system.loads(self.system.full_motions))
        lam = elements(self.system.symbols.lam)
        for i, row in enumerate(self.system.string_rows):
            f_K = f_K - scaled(lam[i], row.A_K)
        motors = drives.forces(self.system, ca.SX(0)).f_D
        for drive in self.tree.drives:
            if drive.command is not None:
                command_start = drive.command[1]
                f_K[command_start : command_start + drive.v.stop - drive.v.start] = motors[drive.v]
        return {"f_K": column(f_K)}

    def _motor_lags(self) -> dict[str, ca.SX]:
        return {name: column(x) for name, x in drives.motor_lags(self.system).items()}

    def _motor_shares(self) -> dict[str, ca.SX]:
        return {"share": column(drives.available_shares(self.system))}

    def _motor_demands(self) -> dict[str, ca.SX]:
        return {"f_D": column(drives.demanded_forces(self.system))}

    def _wrench_forces(self) -> dict[str, ca.SX]:
        """u_D = sum_i J_i^T w_i of wrenches on the links' centres of mass, in world axes."""
        system, tree = self.system, self.tree
        external = []
        for i, motion in enumerate(system.resting_motions):
            wrench = elements(system.symbols.wrench[:, i])
            force = motion.R.T.dot(wrench[:3])
            arm = cross(system.centre_of_mass(i), force)
            external.append((motion.R.T.dot(wrench[3:]) + arm, force))
        forces = dynamics.joint_forces(tree, system.joints, external)
        u = zeros(tree.coordinates.n_vD)
        for link, force in zip(tree.links, forces, strict=True):
            if link.role is Role.DYNAMIC:
                u[link.v] = force
        return {"u_D": column(u)}

    def _poses(self) -> dict[str, ca.SX]:
        """World pose of every link: 12 numbers for each, R column by column and then r."""
        motions = self.system.resting_motions
        return {"poses": column(x for m in motions for x in (*m.R.T.flatten(), *m.r))}

    def _screws(self) -> dict[str, ca.SX]:
        """(v, w) = (R S_v + r x R S_w, R S_w) of every joint, at its link's pose (R, r)."""
        table, screws = self.tree.coordinates, {}
        for role, n in ((Role.DYNAMIC, table.n_vD), (Role.DRIVEN, table.n_vK)):
            screws[role] = zeros(6, n)
        motions = self.system.resting_motions
        for link, joint, motion in zip(self.tree.links, self.system.joints, motions, strict=True):
            if link.role is Role.FIXED:
                continue
            for k in range(link.v.stop - link.v.start):
                w = motion.R.dot(joint.S_w[:, k])
                v = motion.R.dot(joint.S_v[:, k]) + cross(motion.r, w)
                screws[link.role][:, link.v.start + k] = [*v, *w]
        return {
            **self._poses(),
            "screw_D": matrix(screws[Role.DYNAMIC]),
            "screw_K": matrix(screws[Role.DRIVEN]),
        }

    def _points(self) -> dict[str, ca.SX]:
        """World positions of all points of all strings, in order: 3 numbers for each point."""
        arguments = self.system.row_arguments(self.system.resting_motions)
        points = (point for string in self.tree.strings for point in string.points)
        return {"points": column(x for point in points for x in arguments.position(point))}

    def _mass_matrix(self) -> dict[str, ca.SX]:
        dynamic, driven = Role.DYNAMIC, Role.DRIVEN
        mass = self.system.mass
        return {
            "M": matrix(mass(dynamic, dynamic)),
            "M_DK": matrix(mass(dynamic, driven)),
            "M_KK": matrix(mass(driven, driven)),
        }

    def _mass_times(self) -> dict[str, ca.SX]:
        """M_DD acc_D, in operations proportional to the number of links."""
        return {"f": column(self.system.inertial(elements(self.system.symbols.acc_D), None))}

    def _coriolis(self) -> dict[str, ca.SX]:
        return {"C": coriolis_matrix(self.system)}

    def _bias(self) -> dict[str, ca.SX]:
        return {"c": column(self.system.bias_D)}

    def _gravity(self) -> dict[str, ca.SX]:
        return {"g_D": column(self.system.g_D)}

    def _damping(self) -> dict[str, ca.SX]:
        return {"f": column(self.system.dissipation_D)}

    _constraint = _rows

    def _A_D(self) -> dict[str, ca.SX]:
        n, links = self.tree.coordinates.n_vD, self.tree.links
        rows = [row.A_D for row in self.system.string_rows]
        for limit, (_, J, _) in zip(self.tree.limits, self.system.limit_rows, strict=True):
            row = zeros(n)
            row[links[limit.link].v] = J
            rows.append(row)
        return {"A_D": stacked(rows, n)}

    def _A_K(self) -> dict[str, ca.SX]:
        n = self.tree.coordinates.n_vK
        rows = [row.A_K for row in self.system.string_rows]
        rows.extend(zeros(n) for _ in self.tree.limits)
        return {"A_K": stacked(rows, n)}

    def _Adot_v(self) -> dict[str, ca.SX]:
        strings = [
            ca.substitute(r.bias, self.system.symbols.acc_K, 0) for r in self.system.string_rows
        ]
        return {"Adot_v": column(strings + [gamma for _, _, gamma in self.system.limit_rows])}

    def _A_rate(self) -> dict[str, ca.SX]:
        s = self.system.symbols
        q, rate = ca.vertcat(s.q_D, s.q_K), ca.vertcat(*self.system.rates)
        return {
            name: ca.reshape(ca.jtimes(ca.vec(A), q, rate), A.shape)
            for name, A in (("Adot_D", self._A_D()["A_D"]), ("Adot_K", self._A_K()["A_K"]))
        }

    def _body_velocity(self) -> dict[str, ca.SX]:
        entries = [x for m in self.system.free_motions for x in (*m.v, *m.w)]
        return {"V": ca.reshape(column(entries), 6, len(self.tree.links))}

    def _lagrangian(self) -> dict[str, ca.SX]:
        return {"lagrangian": kinetic_energy(self.system) - potential_energy(self.system)}

    _potential = _kinetic = _energy


def derive(tree: Tree) -> Equations:
    """The equations of a tree; expressions are built on first use."""
    return Equations(tree)
