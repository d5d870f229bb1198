"""Gradients of rollouts as dense products of the derivatives of their steps."""

from __future__ import annotations

import numpy as np

import fantoccini as fan


def swept(
    puppet: fan.Marionette,
    run: fan.dynamics.Rollout,
    acc: np.ndarray,
    force: np.ndarray,
    own: list[np.ndarray],
    by_tension: np.ndarray,
) -> dict[str, np.ndarray]:
    """The gradient of a cost by the names of ``RolloutGradient``, from ``linearise_steps``.

    Args:
        puppet: the marionette.
        run: its rollout without extrapolation.
        acc, force: (n, ...) driven accelerations and user forces.
        own: the cost's derivatives by q_D, v_D, q_K and v_K, (n + 1, ...) each.
        by_tension: (n, n_rows) those by the tensions.
    """
    n, t = len(acc), puppet.coordinates
    steps = puppet.linearise_steps(
        run.q_D[:-1],
        run.v_D[:-1],
        run.q_K[:-1],
        run.v_K[:-1],
        acc,
        force,
        dt=run.dt,
        forces=True,
        tension_partials=True,
    )
    assert (steps.active == run.active).all()
    assert (steps.n_contacts == run.n_contacts).all()
    assert np.allclose(steps.v_D, run.v_D[1:], rtol=0, atol=1e-9)
    n_z, k = 2 * (t.n_vD + t.n_vK), t.n_vK
    places = np.cumsum([n_z, k, t.n_vD])
    back = np.concatenate([a[-1] for a in own])
    by_acc, by_u, by_p = np.zeros_like(acc), np.zeros_like(force), np.zeros(len(puppet.p))
    for i in range(n)[::-1]:
        half = back[: 2 * t.n_vD]
        of_pull = np.split(by_tension[i] @ steps.tension_partials[i], places)
        _, _, of_u, of_p = np.split(half @ steps.motion[i], places)
        by_acc[i] = back @ steps.B[i] + of_pull[1]
        by_u[i], by_p = of_u + of_pull[2], by_p + of_p + of_pull[3]
        back = np.concatenate([a[i] for a in own]) + back @ steps.A[i] + of_pull[0]
    widths = np.cumsum([t.n_vD, t.n_vD, t.n_vK])
    names = ("q_D", "v_D", "q_K", "v_K")
    gradient = dict(zip(names, np.split(back, widths), strict=True))
    return gradient | {"acc_K": by_acc, "u_D": by_u, "p": by_p}
