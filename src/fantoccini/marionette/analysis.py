"""The objects of the paper, numerically: M, C, g, h, A_D, A_K, T, V, poses and velocities.

M, C, g and their kin go through CasADi's interpreter, so they need no compiler; poses, points and
effort are compiled, since pictures and ledgers ask for them thousands of times.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import FUNCTIONS
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.marionette.model import Model
from fantoccini.motion import State


def _interpreted(model: Model, name: str, x: State) -> SimpleNamespace:
    """The results of an interpreted function by name: matrices and columns."""
    model.check_state(x)
    inputs = {**vars(x), "p": model.p}
    wanted = {a.name: inputs[a.name] for a in FUNCTIONS[name].arguments}
    found = model.compiled.equations[name](**wanted)
    return SimpleNamespace(**{result: np.array(value) for result, value in found.items()})


def mass_matrix(model: Model, x: State) -> Array:
    """M(q_D) of Eq. 8, (n_vD, n_vD) [kg, kg m, kg m^2]."""
    return _interpreted(model, "mass_matrix", x).M


def mass_matrix_DK(model: Model, x: State) -> Array:
    """M_DK, (n_vD, n_vK): non-zero where a driven joint moves mass."""
    return _interpreted(model, "mass_matrix", x).M_DK


def mass_matrix_KK(model: Model, x: State) -> Array:
    """M_KK, (n_vK, n_vK)."""
    return _interpreted(model, "mass_matrix", x).M_KK


def coriolis_matrix(model: Model, x: State) -> Array:
    """C(q, v) of Eq. 8 over the dynamic velocities, (n_vD, n_vD); see ``coriolis_full``."""
    n = model.tree.coordinates.n_vD
    return coriolis_full(model, x)[:n, :n]


def coriolis_full(model: Model, x: State) -> Array:
    """C over (v_D, v_K): dM/dt - 2 C is skew, and C v is the velocity part of the bias."""
    return _interpreted(model, "coriolis", x).C


def gravity(model: Model, x: State) -> Array:
    """g(q) of Eq. 8, (n_vD,): gradient of the potential energy [N or N m]."""
    return _interpreted(model, "gravity", x).g_D.ravel()


def bias(model: Model, x: State) -> Array:
    """c(q, v) = C v + g, (n_vD,) [N or N m]: Eq. 8 is M acc + c = u."""
    return _interpreted(model, "bias", x).c.ravel()


def damping(model: Model, x: State) -> Array:
    """(n_vD,) force of damping and drag, on the side of c: u = -damping [N or N m]."""
    return _interpreted(model, "damping", x).f.ravel()


def constraint(model: Model, x: State) -> Array:
    """h(q), (n_rows,): path length less string length and slip [m]; limits [m, rad or 1]."""
    h = _interpreted(model, "constraint", x).h.ravel()
    h[: len(x.slip)] -= x.slip
    return h


def A_D(model: Model, x: State) -> Array:
    """A_D = dh/dq_D of Eq. 9, acting on velocities, (n_rows, n_vD)."""
    return _interpreted(model, "A_D", x).A_D


def A_K(model: Model, x: State) -> Array:
    """A_K = dh/dq_K of Eq. 9, acting on velocities, (n_rows, n_vK)."""
    return _interpreted(model, "A_K", x).A_K


def A_rate(model: Model, x: State) -> tuple[Array, Array]:
    """(dA_D/dt, dA_K/dt) of Eq. 11 along the velocity."""
    found = _interpreted(model, "A_rate", x)
    return found.Adot_D, found.Adot_K


def Adot_v(model: Model, x: State) -> Array:
    """dA/dt v = dA_D/dt v_D + dA_K/dt v_K of Eq. 11, (n_rows,)."""
    return _interpreted(model, "Adot_v", x).Adot_v.ravel()


def kinetic_energy(model: Model, x: State) -> float:
    """T = sum_i 1/2 V_i^T I_i V_i (Eq. 5) [J]."""
    return float(_interpreted(model, "kinetic", x).T.item())


def potential_energy(model: Model, x: State) -> float:
    """V (Eq. 6, with gravity's acceleration), plus the energy of springs [J]."""
    return float(_interpreted(model, "potential", x).V.item())


def lagrangian(model: Model, x: State) -> float:
    """L = T - V (Eq. 7) [J]."""
    return float(_interpreted(model, "lagrangian", x).lagrangian.item())


def body_velocity(model: Model, x: State, body: str | None = None) -> Array:
    """(v, w) of bodies in their own frames (Eq. 4); see :meth:`Marionette.body_velocity`."""
    V = _interpreted(model, "body_velocity", x).V.T
    return V if body is None else V[link_index(model, body)]


def pose(model: Model, x: State, body: str) -> Array:
    """g (Eqs. 2, 3): (4, 4) homogeneous pose of a body in the world."""
    model.check_state(x)
    out = np.eye(4)
    out[:3] = poses(model, x.q_D, x.q_K)[link_index(model, body)]
    return out


def link_index(model: Model, body: str) -> int:
    """Index of a body among the links."""
    names = [link.name for link in model.tree.links]
    if body not in names:
        raise UnknownNameError("body", body, names)
    return names.index(body)


def poses(model: Model, q_D: Array, q_K: Array) -> Array:
    """(..., n_links, 3, 4) world poses (R | r); see :meth:`Marionette.poses`."""
    flat = model.library.evaluate("poses", q_D=q_D, q_K=q_K, p=model.p).poses.swapaxes(-1, -2)
    by_column = flat.reshape(*flat.shape[:-1], 4, 3)
    return np.swapaxes(by_column, -1, -2)


def string_points(model: Model, q_D: Array, q_K: Array) -> list[Array]:
    """World positions of every string's points: per string (..., n_points, 3) [m]."""
    counts = [len(s.points) for s in model.tree.strings]
    points = model.library.evaluate("points", q_D=q_D, q_K=q_K, p=model.p).points
    return np.split(points.swapaxes(-1, -2), np.cumsum(counts)[:-1], axis=-2) if counts else []


def energies(model: Model, x: State) -> tuple[float, float]:
    """(T, V) through the compiled model [J]."""
    model.check_state(x)
    found = model.library.evaluate(
        "energy", q_D=x.q_D, v_D=x.v_D, q_K=x.q_K, v_K=x.v_K, p=model.p
    )
    return float(found.T), float(found.V)


def effort(
    model: Model, q_D: Array, v_D: Array, q_K: Array, v_K: Array, acc_D: Array, acc_K: Array,
    tension: Array,
) -> Array:  # fmt: skip
    """M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda; see :meth:`Marionette.effort`."""
    return model.library.evaluate(
        "effort", q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K, acc_D=acc_D, acc_K=acc_K,
        lam=-np.asarray(tension), p=model.p,
    ).f_K  # fmt: skip


def wrench_forces(model: Model, x: State, wrenches: dict[str, Array]) -> Array:
    """sum_i J_i^T w_i, (n_vD,); see :meth:`Marionette.wrench_forces`."""
    model.check_state(x)
    w = np.zeros((len(model.tree.links), 6))
    for body, wrench in wrenches.items():
        w[link_index(model, body)] += np.asarray(wrench, dtype=float)
    if not np.all(np.isfinite(w)):
        raise StateError(f"wrenches: found {wrenches}; forces and torques must be finite")
    places = {"q_D": x.q_D, "q_K": x.q_K, "p": model.p}
    return model.library.evaluate("wrench_forces", **places, wrench=w.T).u_D
