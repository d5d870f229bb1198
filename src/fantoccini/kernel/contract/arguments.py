"""Every argument of the generated functions.

D stands for dynamic coordinates, K for driven ones (ends and lengths of strings, driven joints);
n_vD and n_vK are the numbers of their velocities.
"""

from __future__ import annotations

from fantoccini.kernel.contract.quantity import Quantity

_FORCE = "N or N m"

ARGUMENTS: dict[str, Quantity] = {
    q.name: q
    for q in (
        Quantity("q_D", ("n_qD",), "", "dynamic configuration; quaternions of unit length"),
        Quantity("v_D", ("n_vD",), "", "dynamic velocity"),
        Quantity("acc_D", ("n_vD",), "", "dynamic acceleration"),
        Quantity("q_K", ("n_qK",), "", "driven configuration; quaternions of unit length"),
        Quantity("v_K", ("n_vK",), "", "driven velocity"),
        Quantity("acc_K", ("n_vK",), "", "driven acceleration"),
        Quantity("u_D", ("n_vD",), _FORCE, "user forces"),
        Quantity("v_ahead", ("n_vD",), "", "dynamic velocity in the velocity products"),
        Quantity("dt", (), "s", "step over which damping and drag are implicit"),
        Quantity("lam", ("n_strings",), "N", "multipliers, minus the tensions"),
        Quantity("tension", ("n_rows",), _FORCE, "tensions of strings, forces of limits"),
        Quantity("wrench", (6, "n_links"), "N, N m", "force at the centre of mass, torque; world"),
        Quantity("p", ("n_p",), "", "parameters"),
        Quantity("L", ("n_packed",), "", "factor F of M = F^T F, a result of dynamics"),
        Quantity("x", ("n_vD",), "", "any vector"),
        Quantity("J_limit", (3, "n_limits"), "", "A_D of the limits, for their joints' velocities"),
        Quantity("x_joint", (3,), "", "entries of a vector for the velocities of one joint"),
        Quantity("v_next", ("n_vD",), "", "dynamic velocity after the step"),
        Quantity("z", ("n_vD",), "", "weights of r in a gradient"),
        Quantity("y", ("n_rows",), "", "weights of hdot in a gradient"),
        Quantity("y_h", ("n_rows",), "", "weights of h in a gradient"),
        Quantity("xi", ("n_vD",), "rad or m", "tangent vector of the step"),
        Quantity("q_mid", ("n_qK",), "", "driven configuration at the midpoint"),
        Quantity("v_mid", ("n_vK",), "", "driven velocity at the midpoint"),
        Quantity("acc_mid", ("n_vK",), "", "driven acceleration at the midpoint"),
    )
}
"""Name -> argument of generated functions."""
