"""The objects of the paper, numerically: M, C, g, h, A_D, A_K, T, V, poses and velocities."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import FUNCTIONS
from fantoccini.errors import Problem, PuppetError, StateError, UnknownNameError
from fantoccini.motion import State
from fantoccini.tree import Tree, joint_inertias

if TYPE_CHECKING:
    from fantoccini.equations import Equations
    from fantoccini.puppet import Number
    from fantoccini.runtime import Library

_SINGULAR = 1e-12


class Analysis:
    """Evaluates a puppet's equations at states.

    M, C, g and their kin go through CasADi's interpreter, so they need no compiler; poses, points
    and effort are compiled, since pictures and ledgers ask for them thousands of times.
    """

    tree: Tree
    p: Array
    equations: Equations
    library: Library
    number: Callable[[Number], float]
    check_state: Callable[[State], None]

    def _interpreted(self, name: str, x: State) -> SimpleNamespace:
        """The results of an interpreted function by name: matrices and columns."""
        self.check_state(x)
        inputs = {**vars(x), "p": self.p}
        wanted = {a.name: inputs[a.name] for a in FUNCTIONS[name].arguments}
        found = self.equations[name](**wanted)
        return SimpleNamespace(**{result: np.array(value) for result, value in found.items()})

    def mass_matrix(self, x: State) -> Array:
        """M(q_D) of Eq. 8, (n_vD, n_vD) [kg, kg m, kg m^2]."""
        return self._interpreted("mass_matrix", x).M

    def mass_matrix_DK(self, x: State) -> Array:
        """M_DK, (n_vD, n_vK): non-zero where a driven joint moves mass."""
        return self._interpreted("mass_matrix", x).M_DK

    def mass_matrix_KK(self, x: State) -> Array:
        """M_KK, (n_vK, n_vK)."""
        return self._interpreted("mass_matrix", x).M_KK

    def coriolis(self, x: State) -> Array:
        """C(q, v) of Eq. 8 over the dynamic velocities, (n_vD, n_vD); see ``coriolis_full``."""
        n = self.tree.coordinates.n_vD
        return self.coriolis_full(x)[:n, :n]

    def coriolis_full(self, x: State) -> Array:
        """C over (v_D, v_K): dM/dt - 2 C is skew, and C v is the velocity part of the bias."""
        return self._interpreted("coriolis", x).C

    def gravity(self, x: State) -> Array:
        """g(q) of Eq. 8, (n_vD,): gradient of the potential energy [N or N m]."""
        return self._interpreted("gravity", x).g_D.ravel()

    def bias(self, x: State) -> Array:
        """c(q, v) = C v + g, (n_vD,) [N or N m]: Eq. 8 is M acc + c = u."""
        return self._interpreted("bias", x).c.ravel()

    def damping(self, x: State) -> Array:
        """(n_vD,) force of damping and drag, on the side of c: u = -damping [N or N m]."""
        return self._interpreted("damping", x).f.ravel()

    def constraint(self, x: State) -> Array:
        """h(q), (n_rows,): path length less string length and slip [m]; limits [m, rad or 1]."""
        h = self._interpreted("constraint", x).h.ravel()
        h[: len(x.slip)] -= x.slip
        return h

    def A_D(self, x: State) -> Array:
        """A_D = dh/dq_D of Eq. 9, acting on velocities, (n_rows, n_vD)."""
        return self._interpreted("A_D", x).A_D

    def A_K(self, x: State) -> Array:
        """A_K = dh/dq_K of Eq. 9, acting on velocities, (n_rows, n_vK)."""
        return self._interpreted("A_K", x).A_K

    def A_rate(self, x: State) -> tuple[Array, Array]:
        """(dA_D/dt, dA_K/dt) of Eq. 11 along the velocity."""
        found = self._interpreted("A_rate", x)
        return found.Adot_D, found.Adot_K

    def Adot_v(self, x: State) -> Array:
        """dA/dt v = dA_D/dt v_D + dA_K/dt v_K of Eq. 11, (n_rows,)."""
        return self._interpreted("Adot_v", x).Adot_v.ravel()

    def kinetic(self, x: State) -> float:
        """T = sum_i 1/2 V_i^T I_i V_i (Eq. 5) [J]."""
        return float(self._interpreted("kinetic", x).T.item())

    def potential(self, x: State) -> float:
        """V (Eq. 6, with gravity's acceleration), plus the energy of springs [J]."""
        return float(self._interpreted("potential", x).V.item())

    def lagrangian(self, x: State) -> float:
        """L = T - V (Eq. 7) [J]."""
        return float(self._interpreted("lagrangian", x).lagrangian.item())

    def body_velocity(self, x: State, body: str | None = None) -> Array:
        """V^b (Eq. 4): (v, w) of bodies in their own frames.

        Args:
            x: the state.
            body: its name; all bodies when not given.

        Returns:
            (6,) of one body or (n_links, 6): linear, then angular [m/s, rad/s].
        """
        V = self._interpreted("body_velocity", x).V.T
        return V if body is None else V[self.link(body)]

    def pose(self, x: State, body: str) -> Array:
        """g (Eqs. 2, 3): (4, 4) homogeneous pose of a body in the world."""
        self.check_state(x)
        out = np.eye(4)
        out[:3] = self.poses(x.q_D, x.q_K)[self.link(body)]
        return out

    def link(self, body: str) -> int:
        """Index of a body among the links."""
        names = [link.name for link in self.tree.links]
        if body not in names:
            raise UnknownNameError("body", body, names)
        return names.index(body)

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """World poses (R | r) of all links.

        Args:
            q_D: (..., n_qD).
            q_K: (..., n_qK).

        Returns:
            (..., n_links, 3, 4).
        """
        flat = self.library.evaluate("poses", q_D=q_D, q_K=q_K, p=self.p).poses.swapaxes(-1, -2)
        by_column = flat.reshape(*flat.shape[:-1], 4, 3)
        return np.swapaxes(by_column, -1, -2)

    def string_points(self, q_D: Array, q_K: Array) -> list[Array]:
        """World positions of every string's points: per string (..., n_points, 3) [m]."""
        counts = [len(s.points) for s in self.tree.strings]
        points = self.library.evaluate("points", q_D=q_D, q_K=q_K, p=self.p).points
        return np.split(points.swapaxes(-1, -2), np.cumsum(counts)[:-1], axis=-2) if counts else []

    def string_lengths(self, q_D: Array, q_K: Array) -> Array:
        """Lengths of the strings at configurations (..., n_qD), (..., n_qK): (..., n) [m]."""
        return self.tree.string_lengths(q_D, q_K, self.number)

    def energies(self, x: State) -> tuple[float, float]:
        """(T, V) through the compiled model [J]."""
        self.check_state(x)
        found = self.library.evaluate(
            "energy", q_D=x.q_D, v_D=x.v_D, q_K=x.q_K, v_K=x.v_K, p=self.p
        )
        return float(found.T), float(found.V)

    def effort(
        self, q_D: Array, v_D: Array, q_K: Array, v_K: Array, acc_D: Array, acc_K: Array,
        tension: Array,
    ) -> Array:  # fmt: skip
        """Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda.

        How heavy the control is in the hand. Arguments (..., n) each; ``tension`` (..., n_strings).

        Returns:
            (..., n_vK) [N or N m].
        """
        return self.library.evaluate(
            "effort", q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K, acc_D=acc_D, acc_K=acc_K,
            lam=-np.asarray(tension), p=self.p,
        ).f_K  # fmt: skip

    def wrench_forces(self, x: State, wrenches: dict[str, Array]) -> Array:
        """u_D of wrenches on bodies, to pass as user forces.

        Args:
            x: the state.
            wrenches: body -> (6,) force on its centre of mass [N] and torque [N m], world axes.

        Returns:
            (n_vD,) [N or N m].
        """
        self.check_state(x)
        w = np.zeros((len(self.tree.links), 6))
        for body, wrench in wrenches.items():
            w[self.link(body)] += np.asarray(wrench, dtype=float)
        if not np.all(np.isfinite(w)):
            raise StateError(f"wrenches: found {wrenches}; forces and torques must be finite")
        places = {"q_D": x.q_D, "q_K": x.q_K, "p": self.p}
        return self.library.evaluate("wrench_forces", **places, wrench=w.T).u_D

    def check_mass_matrix(self) -> None:
        """Raises when a joint moves no mass, in the file's pose or in random ones.

        Raises:
            PuppetError: naming the coordinates that M does not resist.
        """
        table, wrong = self.tree.coordinates, ([], "")
        rng = np.random.default_rng(0)
        for trial in range(3):
            q_D, q_K = (np.nan_to_num(q, nan=1.0) for q in (table.start_D, table.start_K))
            if trial:
                q_D = q_D + rng.normal(size=table.n_qD)
                for q, _ in table.quaternions_D:
                    q_D[q : q + 4] /= np.linalg.norm(q_D[q : q + 4])
            wrong = self._unresisted(q_D, q_K)
            if not wrong[0]:
                return
        raise PuppetError([self._massless(*wrong)])

    def _unresisted(self, q_D: Array, q_K: Array) -> tuple[list[str], str]:
        """Velocities of the joint nearest the leaves that M does not resist, and what M is."""
        for i, held, D in joint_inertias(self.tree, q_D, q_K, self.number):
            names = np.array(self.tree.coordinates.v_D)[self.tree.links[i].v]
            if not np.all(np.isfinite(D)):
                return list(names), "is not finite"
            size = np.diag(held)
            scale = 1.0 / np.sqrt(np.maximum(size, 1e-300))
            values, vectors = np.linalg.eigh(D * np.outer(scale, scale))
            if values[0] <= _SINGULAR or np.any(size <= 1e-300):
                still = np.where(size <= 1e-300, 1.0, np.abs(vectors[:, 0]))
                return list(names[still > 1e-3 * np.max(still)]), "is singular"
        return [], ""

    def _massless(self, names: list[str], what: str) -> Problem:
        owner = names[0].split(".")[0]
        file, line = self.world.puppets[0].locate(owner.split("/")[-1])
        return Problem(
            file,
            line,
            owner,
            f"the mass matrix {what}: look at {', '.join(names)}; give the bodies below this joint "
            "a mass and an inertia that are neither zero nor beyond all measure, or make the joint "
            "driven or fixed",
        )
