"""The objects of the paper, numerically.

Those that :func:`interpreted` gives go through CasADi's interpreter and need no compiler; poses,
points and effort are compiled, since pictures and ledgers evaluate them thousands of times.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np

from fantoccini.base import Array, UnknownNameError
from fantoccini.dynamics.compiled.model import Model
from fantoccini.dynamics.compiled.vector_checks import vector
from fantoccini.kernel.contract import FUNCTIONS
from fantoccini.motion import State


def interpreted(model: Model, name: str, x: State) -> SimpleNamespace:
    """The results of an interpreted function (``contract.FUNCTIONS``) by name, as matrices."""
    model.check_state(x)
    values = {**vars(x), "p": model.p}
    arguments = {a.name: values[a.name] for a in FUNCTIONS[name].arguments}
    found = model.compiled.equations[name](**arguments)
    return SimpleNamespace(**{result: np.array(value) for result, value in found.items()})


def coriolis_full(model: Model, x: State) -> Array:
    """C over (v_D, v_K): dM/dt - 2 C is skew, and C v is the velocity part of the bias."""
    return interpreted(model, "coriolis", x).C


def constraint(model: Model, x: State) -> Array:
    """h(q), (n_rows,), less slip; see :meth:`Marionette.constraint`."""
    h = interpreted(model, "constraint", x).h.ravel()
    h[: len(x.slip)] -= x.slip
    return h


def A_rate(model: Model, x: State) -> tuple[Array, Array]:
    """(dA_D/dt, dA_K/dt) of Eq. 11 along the velocity."""
    found = interpreted(model, "A_rate", x)
    return found.Adot_D, found.Adot_K


def body_velocity(model: Model, x: State, body: str | None = None) -> Array:
    """(v, w) of bodies in their own frames (Eq. 4); see :meth:`Marionette.body_velocity`."""
    V = interpreted(model, "body_velocity", x).V.T
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
    return np.swapaxes(flat.reshape(*flat.shape[:-1], 4, 3), -1, -2)


def string_points(model: Model, q_D: Array, q_K: Array) -> list[Array]:
    """World positions of every string's points: per string (..., n_points, 3) [m]."""
    counts = [len(s.points) for s in model.tree.strings]
    points = model.library.evaluate("points", q_D=q_D, q_K=q_K, p=model.p).points
    return np.split(points.swapaxes(-1, -2), np.cumsum(counts)[:-1], axis=-2) if counts else []


def energies(model: Model, x: State) -> tuple[float, float]:
    """(T, V) through the compiled model [J]."""
    model.check_state(x)
    found = model.library.evaluate("energy", **model.at(x))
    return float(found.T), float(found.V)


def effort(
    model: Model,
    q_D: Array,
    v_D: Array,
    q_K: Array,
    v_K: Array,
    acc_D: Array,
    acc_K: Array,
    tension: Array,
) -> Array:
    """M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda; see :meth:`Marionette.effort`."""
    return model.library.evaluate(
        "effort",
        q_D=q_D,
        v_D=v_D,
        q_K=q_K,
        v_K=v_K,
        acc_D=acc_D,
        acc_K=acc_K,
        lam=-np.asarray(tension)[..., : len(model.tree.strings)],
        p=model.p,
    ).f_K


def wrench_forces(model: Model, x: State, wrenches: Mapping[str, Array]) -> Array:
    """sum_i J_i^T w_i, (n_vD,); see :meth:`Marionette.wrench_forces`."""
    model.check_state(x)
    w = np.zeros((len(model.tree.links), 6))
    for body, wrench in wrenches.items():
        w[link_index(model, body)] += vector(f"wrenches[{body!r}]", wrench, 6)
    at = {"q_D": x.q_D, "q_K": x.q_K, "p": model.p}
    return model.library.evaluate("wrench_forces", **at, wrench=w.T).u_D
