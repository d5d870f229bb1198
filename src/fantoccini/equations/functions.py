"""CasADi functions of a system.

Two sets: the *model*, which is generated as C and compiled, and the *analysis*, evaluated by
CasADi's interpreter when a user asks for M, C, g and the other objects of the paper. All outputs
are dense; matrices are column-major, as CasADi has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import casadi as ca
import numpy as np

from fantoccini.equations import articulated, drives, dynamics
from fantoccini.equations.algebra import column, cross, dot, elements, matrix, scaled, zeros
from fantoccini.equations.coriolis import coriolis_matrix
from fantoccini.equations.system import Loads, System
from fantoccini.errors import UnknownNameError
from fantoccini.tree import Link, Role, Tree

STATE = ("q_D", "v_D", "q_K", "v_K")
CONFIGURATION = ("q_D", "q_K")

MODEL_INPUTS: dict[str, tuple[str, ...]] = {
    "dynamics": (*STATE, "acc_K", "u_D", "p"),
    "step_dynamics": (*STATE, "acc_K", "u_D", "v_ahead", "dt", "p"),
    "rows": (*CONFIGURATION, "p"),
    "energy": (*STATE, "p"),
    "effort": (*STATE, "acc_D", "acc_K", "lam", "p"),
    "wrench_forces": (*CONFIGURATION, "wrench", "p"),
    "poses": (*CONFIGURATION, "p"),
    "points": (*CONFIGURATION, "p"),
}
"""Arguments of the compiled functions; ``forth`` and ``back`` take (L, x), ``limit_rates``
(J_limit, v_D)."""

WATCH_INPUTS: dict[str, tuple[str, ...]] = {
    "motor_lags": (*CONFIGURATION, "p"),
    "motor_shares": (*STATE, "acc_K", "p"),
}
"""Arguments of the compiled functions of puppets whose drives may be too weak."""

ANALYSIS_INPUTS: dict[str, tuple[str, ...]] = {
    "mass_matrix": (*CONFIGURATION, "p"),
    "mass_times": (*CONFIGURATION, "acc_D", "p"),
    "coriolis": (*STATE, "p"),
    "bias": (*STATE, "p"),
    "gravity": (*CONFIGURATION, "p"),
    "damping": (*STATE, "p"),
    "constraint": (*CONFIGURATION, "p"),
    "A_D": (*CONFIGURATION, "p"),
    "A_K": (*CONFIGURATION, "p"),
    "Adot_v": (*STATE, "p"),
    "A_rate": (*STATE, "p"),
    "body_velocity": (*STATE, "p"),
    "lagrangian": (*STATE, "p"),
    "potential": (*CONFIGURATION, "p"),
    "kinetic": (*STATE, "p"),
}
"""Arguments of the interpreted functions."""


_MANY = 5
"""Times the instructions of ``forth`` that all ``columns`` may have."""


class Equations:
    """The equations of a tree: symbolic expressions and functions of them.

    Attributes:
        tree: the tree.
        system: its symbolic expressions.
    """

    def __init__(self, tree: Tree):
        self.tree = tree
        self.system = System(tree)
        self._made: dict[str, ca.Function] = {}

    def __iter__(self) -> Iterator[str]:
        """The names of the functions."""
        return iter((*MODEL_INPUTS, *ANALYSIS_INPUTS, "forth", "back", "limit_rates", *self.watch))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in tuple(self)

    def __getitem__(self, name: str) -> ca.Function:
        """The function of a name in ``model`` or ``ANALYSIS_INPUTS``.

        Raises:
            UnknownNameError: there is none.
        """
        if name not in self:
            raise UnknownNameError("function", str(name), self)
        if name not in self._made:
            maker: Callable[[], ca.Function] | None = {
                "forth": self._forth,
                "back": self._back,
                "limit_rates": self._limit_rates,
            }.get(name)
            self._made[name] = maker() if maker else self._function(name)
        return self._made[name]

    @cached_property
    def model(self) -> dict[str, ca.Function]:
        """The functions that are compiled, by name."""
        names = (*MODEL_INPUTS, "forth", "back", "limit_rates", *self.watch)
        return {name: self[name] for name in names}

    @property
    def watch(self) -> tuple[str, ...]:
        """Names of the functions that tell of drives whose motor may be too weak; often none."""
        return tuple(WATCH_INPUTS) if self.tree.watched else ()

    def _function(self, name: str) -> ca.Function:
        inputs = (MODEL_INPUTS | WATCH_INPUTS | ANALYSIS_INPUTS)[name]
        outputs = getattr(self, f"_{name}")()
        arguments = [getattr(self.system.symbols, i) for i in inputs]
        expressions = ca.cse([ca.densify(x) for x in outputs.values()])
        return ca.Function(f"fan_{name}", arguments, expressions, list(inputs), list(outputs))

    @cached_property
    def factor(self) -> articulated.Factor:
        """F of M_DD = F^T F, with damping and drag over a step dt; L are its numbers."""
        return self._factor(self.system.symbols.dt)

    def _factor(self, dt: ca.SX) -> articulated.Factor:
        system = self.system
        own = system.armature + system.motors(dt).armature

        def armature(link: Link) -> np.ndarray:
            return own[link.v] + dt * system.value(link.damping)

        inertias = [
            inertia + system.drag_inertia(i, dt) for i, inertia in enumerate(system.regrouped)
        ]
        return articulated.factorise(self.tree, system.joints, inertias, armature)

    def _dynamics(self) -> dict[str, ca.SX]:
        """What the runtime needs to solve Eqs. 10 and 11 for any set of taut rows."""
        made = self._with_factor(self._factor(ca.SX(0)), ca.SX(0), self.system.free_loads)
        motors = self.system.motors(ca.SX(0)).f_D
        made["power0"] = made["power0"] + dot(elements(self.system.symbols.v_D), motors)
        return made

    def _step_dynamics(self) -> dict[str, ca.SX]:
        """What a step needs: damping and drag over it, and no accelerations of rows.

        The power of the motors is not in ``power0``: over the step they give f_M - y_M dv.
        """
        made = self._with_factor(self.factor, self.system.symbols.dt, self.system.step_loads)
        made = {name: x for name, x in made.items() if name not in ("gamma", "gamma_limit")}
        motors, places = self.system.motors(self.system.symbols.dt), self.tree.motor_places
        return made | {"f_M": column(motors.f_D[places]), "y_M": column(motors.yields[places])}

    def _with_factor(
        self, factor: articulated.Factor, dt: ca.SX, loads: Loads
    ) -> dict[str, ca.SX]:
        system, s, tree = self.system, self.system.symbols, self.tree
        n, m = tree.coordinates.n_vD, len(tree.strings)
        v_K = elements(s.v_K)
        _, f_K = system.generalised(loads)
        needed = {i: (-torque, -force) for i, (torque, force) in enumerate(loads.wrenches)}
        motors = system.motors(dt).f_D
        w0 = factor.forth(elements(s.u_D) - loads.f_D + motors, needed)
        rows = system.string_rows
        W = zeros(n, m)
        for i, row in enumerate(rows):
            W[:, i] = factor.forth(row.winding, row.wrenches)
        G = zeros(m, m)
        for i in range(m):
            for j in range(i + 1):
                G[i, j] = G[j, i] = dot(W[:, i], W[:, j])
        limits = system.limit_rows
        J = zeros(3, len(limits))
        for i, (_, jacobian, _) in enumerate(limits):
            J[: len(jacobian), i] = jacobian
        return {
            "L": column(factor.numbers(self.factor)),
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
        return len(self.factor.numbers(self.factor))

    @cached_property
    def _stored(self) -> tuple[ca.SX, articulated.Factor]:
        """L as symbols, and the factor that it stands for."""
        L = ca.SX.sym("L", self.n_packed)
        return L, self.factor.stored(elements(L))

    def _solve(self, name: str, solve: Callable) -> ca.Function:
        (L, factor), x = self._stored, ca.SX.sym("x", self.factor.n)
        y = ca.cse(column(solve(factor, elements(x))))
        return ca.Function(f"fan_{name}", [L, x], [y], ["L", "x"], ["y"])

    def _forth(self) -> ca.Function:
        return self._solve("forth", lambda factor, x: factor.forth(x, {}))

    @cached_property
    def columns(self) -> dict[int, tuple[list[int], ca.Function]]:
        """link -> its part of ``forth``, for links with limits: y = F^-T x for x in its joint.

        The entries of y that differ from zero, those on the way to the root, and a function
        (L, x (3,)) -> these. Empty where all of them have many more operations than ``forth``, as
        for a long chain with limits all along.
        """
        made: dict[int, tuple[list[int], ca.Function]] = {}
        (L, factor), x = self._stored, ca.SX.sym("x", 3)
        for i in sorted({limit.link for limit in self.tree.limits}):
            place = self.tree.links[i].v
            found = factor.forth_from(i, elements(x)[: place.stop - place.start])
            y = ca.cse(column(list(found.values())))
            made[i] = list(found), ca.Function(f"fan_column_{i}", [L, x], [y], ["L", "x"], ["y"])
        total = sum(function.n_instructions() for _, function in made.values())
        return made if total < _MANY * self["forth"].n_instructions() else {}

    def _back(self) -> ca.Function:
        return self._solve("back", articulated.Factor.back)

    def _limit_rates(self) -> ca.Function:
        """hdot of the limits at a velocity; what is constant in their Jacobians is folded in."""
        limits = self.system.limit_rows
        J, v = ca.SX.sym("J_limit", 3, len(limits)), self.system.symbols.v_D
        rates = []
        for i, (limit, (_, jacobian, _)) in enumerate(zip(self.tree.limits, limits, strict=True)):
            place = self.tree.links[limit.link].v
            given = [x if ca.SX(x).is_constant() else J[k, i] for k, x in enumerate(jacobian)]
            rates.append(dot(np.array(given, dtype=object), elements(v[place])))
        names = ["J_limit", "v_D"], ["rates"]
        return ca.Function("fan_limit_rates", [J, v], [column(rates)], *names)

    def _rows(self) -> dict[str, ca.SX]:
        strings = [row.length for row in self.system.string_rows]
        return {"h": column(strings + [h for h, _, _ in self.system.limit_rows])}

    def _energy(self) -> dict[str, ca.SX]:
        return {"T": self.system.kinetic, "V": self.system.potential}

    def _effort(self) -> dict[str, ca.SX]:
        """Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda.

        That of a command is the force of the motor that follows it.
        """
        _, f_K = self.system.generalised(self.system.loads(self.system.full_motions))
        lam = elements(self.system.symbols.lam)
        for i, row in enumerate(self.system.string_rows):
            f_K = f_K - scaled(lam[i], row.A_K)
        motors = self.system.motors(ca.SX(0)).f_D
        for row in self.tree.drives:
            if row.command is not None:
                place = row.command[1]
                f_K[place : place + row.v.stop - row.v.start] = motors[row.v]
        return {"f_K": column(f_K)}

    def _motor_lags(self) -> dict[str, ca.SX]:
        return {name: column(x) for name, x in drives.lags(self.system).items()}

    def _motor_shares(self) -> dict[str, ca.SX]:
        return {"share": column(drives.shares(self.system))}

    def _wrench_forces(self) -> dict[str, ca.SX]:
        """u_D = sum_i J_i^T w_i of wrenches on the links' centres of mass, in world axes."""
        system, tree = self.system, self.tree
        external = []
        for i, motion in enumerate(system.resting_motions):
            wrench = elements(system.symbols.wrench[:, i])
            force = motion.R.T.dot(wrench[:3])
            arm = cross(system.centre(i), force)
            external.append((motion.R.T.dot(wrench[3:]) + arm, force))
        forces = dynamics.joint_forces(tree, system.joints, external)
        u = zeros(tree.coordinates.n_vD)
        for link, force in zip(tree.links, forces, strict=True):
            if link.role is Role.DYNAMIC:
                u[link.v] = force
        return {"u_D": column(u)}

    def _poses(self) -> dict[str, ca.SX]:
        """World pose of every link: 12 numbers a link, R column by column and then r."""
        entries = []
        for motion in self.system.resting_motions:
            entries.extend(motion.R.T.flatten())
            entries.extend(motion.r)
        return {"poses": column(entries)}

    def _points(self) -> dict[str, ca.SX]:
        """World positions of all points of all strings, in order: 3 numbers a point."""
        around = self.system.around(self.system.resting_motions)
        entries = []
        for string in self.tree.strings:
            for point in string.points:
                entries.extend(around.place(point))
        return {"points": column(entries)}

    def _mass_matrix(self) -> dict[str, ca.SX]:
        dynamic, driven = Role.DYNAMIC, Role.DRIVEN
        mass = self.system.mass
        return {
            "M": matrix(mass(dynamic, dynamic)),
            "M_DK": matrix(mass(dynamic, driven)),
            "M_KK": matrix(mass(driven, driven)),
        }

    def _mass_times(self) -> dict[str, ca.SX]:
        """M_DD acc_D, in a number of operations that grows with the links and not their square."""
        return {"f": column(self.system.inertial(elements(self.system.symbols.acc_D), None))}

    def _coriolis(self) -> dict[str, ca.SX]:
        return {"C": coriolis_matrix(self.system)}

    def _bias(self) -> dict[str, ca.SX]:
        return {"c": column(self.system.bias_D)}

    def _gravity(self) -> dict[str, ca.SX]:
        return {"g_D": column(self.system.g_D)}

    def _damping(self) -> dict[str, ca.SX]:
        return {"f": column(self.system.dissipation_D)}

    def _constraint(self) -> dict[str, ca.SX]:
        return self._rows()

    def _A_D(self) -> dict[str, ca.SX]:
        n, links = self.tree.coordinates.n_vD, self.tree.links
        rows = [row.A_D for row in self.system.string_rows]
        for limit, (_, J, _) in zip(self.tree.limits, self.system.limit_rows, strict=True):
            row = zeros(n)
            row[links[limit.link].v] = J
            rows.append(row)
        return {"A_D": _stacked(rows, n)}

    def _A_K(self) -> dict[str, ca.SX]:
        n = self.tree.coordinates.n_vK
        rows = [row.A_K for row in self.system.string_rows]
        rows.extend(zeros(n) for _ in self.tree.limits)
        return {"A_K": _stacked(rows, n)}

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
            for name, A in (
                ("Adot_D", self._A_D()["A_D"]),
                ("Adot_K", self._A_K()["A_K"]),
            )
        }

    def _body_velocity(self) -> dict[str, ca.SX]:
        entries = [x for m in self.system.free_motions for x in (*m.v, *m.w)]
        return {"V": ca.reshape(column(entries), 6, len(self.tree.links))}

    def _lagrangian(self) -> dict[str, ca.SX]:
        return {"lagrangian": self.system.lagrangian}

    def _potential(self) -> dict[str, ca.SX]:
        return {"V": self.system.potential}

    def _kinetic(self) -> dict[str, ca.SX]:
        return {"T": self.system.kinetic}


def derive(tree: Tree) -> Equations:
    """The equations of a tree; expressions are built when they are first asked for."""
    return Equations(tree)


def _stacked(rows: list[np.ndarray], n: int) -> ca.SX:
    return matrix(np.array(rows, dtype=object)) if rows else ca.SX(0, n)
