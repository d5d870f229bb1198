"""Quantities: what a marionette's compiled and symbolic functions say of one state."""

from __future__ import annotations

from collections.abc import Mapping

from fantoccini.base import Array
from fantoccini.dynamics.compiled import analysis
from fantoccini.dynamics.compiled.analysis import interpreted
from fantoccini.dynamics.compiled.model import Model
from fantoccini.motion import State


class Quantities:
    """The quantities of a model at a state, in the paper's order.

    Attributes:
        model: whose quantities.
    """

    model: Model

    def mass_matrix(self, x: State) -> Array:
        """M(q_D) of Eq. 8, (n_vD, n_vD) [kg, kg m, kg m^2]."""
        return interpreted(self.model, "mass_matrix", x).M

    def mass_matrix_DK(self, x: State) -> Array:
        """M_DK, (n_vD, n_vK): non-zero where a driven joint moves mass."""
        return interpreted(self.model, "mass_matrix", x).M_DK

    def mass_matrix_KK(self, x: State) -> Array:
        """M_KK, (n_vK, n_vK)."""
        return interpreted(self.model, "mass_matrix", x).M_KK

    def coriolis_matrix(self, x: State) -> Array:
        """C(q, v) of Eq. 8 over the dynamic velocities, (n_vD, n_vD)."""
        n = self.model.coordinates.n_vD
        return analysis.coriolis_full(self.model, x)[:n, :n]

    def gravity(self, x: State) -> Array:
        """g(q) of Eq. 8, (n_vD,): gradient of the potential energy [N or N m]."""
        return interpreted(self.model, "gravity", x).g_D.ravel()

    def bias(self, x: State) -> Array:
        """c(q, v) = C v + g, (n_vD,) [N or N m]: Eq. 8 is M acc + c = u."""
        return interpreted(self.model, "bias", x).c.ravel()

    def damping(self, x: State) -> Array:
        """(n_vD,) force of damping and drag, on the side of c: u = -damping [N or N m]."""
        return interpreted(self.model, "damping", x).f.ravel()

    def constraint(self, x: State) -> Array:
        """h(q), (n_rows,): path length less string length and slip [m]; limits [m, rad or 1]."""
        return analysis.constraint(self.model, x)

    def A_D(self, x: State) -> Array:
        """A_D = dh/dq_D of Eq. 9, acting on velocities, (n_rows, n_vD)."""
        return interpreted(self.model, "A_D", x).A_D

    def A_K(self, x: State) -> Array:
        """A_K = dh/dq_K of Eq. 9, acting on velocities, (n_rows, n_vK)."""
        return interpreted(self.model, "A_K", x).A_K

    def Adot_v(self, x: State) -> Array:
        """dA/dt v = dA_D/dt v_D + dA_K/dt v_K of Eq. 11, (n_rows,)."""
        return interpreted(self.model, "Adot_v", x).Adot_v.ravel()

    def kinetic_energy(self, x: State) -> float:
        """T = sum_i 1/2 V_i^T I_i V_i (Eq. 5) [J]."""
        return float(interpreted(self.model, "kinetic", x).T.item())

    def potential_energy(self, x: State) -> float:
        """V (Eq. 6, with gravity's acceleration), plus the energy of springs [J]."""
        return float(interpreted(self.model, "potential", x).V.item())

    def lagrangian(self, x: State) -> float:
        """L = T - V (Eq. 7) [J]."""
        return float(interpreted(self.model, "lagrangian", x).lagrangian.item())

    def momentum(self, x: State) -> Array:
        """(6,) momentum about the centre of mass, in world axes: linear [N s], angular [N m s]."""
        state = {"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K}
        return self.model.library.evaluate("momentum", **state, p=self.model.p).momentum

    def body_velocity(self, x: State, body: str | None = None) -> Array:
        """V^b (Eq. 4) of a body (6,), or of all (n_links, 6), in their own frames.

        Linear, then angular [m/s, rad/s].
        """
        return analysis.body_velocity(self.model, x, body)

    def pose(self, x: State, body: str) -> Array:
        """g (Eqs. 2, 3): (4, 4) homogeneous pose of a body in the world."""
        return analysis.pose(self.model, x, body)

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """World poses (R | r) of all links at (..., n_qD), (..., n_qK): (..., n_links, 3, 4)."""
        return analysis.poses(self.model, q_D, q_K)

    def string_points(self, q_D: Array, q_K: Array) -> list[Array]:
        """World positions of every string's points: per string (..., n_points, 3) [m]."""
        return analysis.string_points(self.model, q_D, q_K)

    def effort(
        self,
        q_D: Array,
        v_D: Array,
        q_K: Array,
        v_K: Array,
        acc_D: Array,
        acc_K: Array,
        tension: Array,
    ) -> Array:
        """Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda.

        How heavy the control is in the hand, (..., n_vK) [N or N m]. The arguments are (..., n)
        each, ``tension`` (..., n_strings), or (..., n_rows) as of :meth:`forward_dynamics`: limits
        do not pull on driven coordinates.
        """
        return analysis.effort(self.model, q_D, v_D, q_K, v_K, acc_D, acc_K, tension)

    def wrench_forces(self, x: State, wrenches: Mapping[str, Array]) -> Array:
        """u_D (n_vD,) of wrenches on bodies, to pass as user forces [N or N m].

        Args:
            x: the state.
            wrenches: body -> (6,) force on its centre of mass [N] and torque [N m], world axes.
        """
        return analysis.wrench_forces(self.model, x, wrenches)
