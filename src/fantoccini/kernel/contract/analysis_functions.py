"""Functions for analysis, which no library contains: CasADi's interpreter evaluates them.

A_D and A_K are the derivatives of string gaps by the dynamic and the driven coordinates, M_DD is
the inertia matrix, and acc_D are the dynamic accelerations. h is the gap of a string, path length
minus string length; hdot and hddot are its rates.
"""

from __future__ import annotations

from fantoccini.kernel.contract.function import (
    CONFIGURATION,
    FORCE,
    PER_VELOCITY,
    ROWS,
    STATE,
    Function,
    arguments,
)
from fantoccini.kernel.contract.quantity import Quantity

ANALYSIS: tuple[Function, ...] = (
    Function(
        "mass_matrix",
        "M of Eq. 8 and its blocks for the driven coordinates.",
        CONFIGURATION,
        (
            Quantity("M", ("n_vD", "n_vD"), "", "symmetric, positive definite"),
            Quantity("M_DK", ("n_vD", "n_vK"), "", "not zero where a driven joint moves mass"),
            Quantity("M_KK", ("n_vK", "n_vK"), "", "symmetric"),
        ),
        exported=True,
    ),
    Function(
        "mass_times",
        "M_DD acc_D.",
        arguments("q_D q_K acc_D p"),
        (Quantity("f", ("n_vD",), FORCE, "M_DD acc_D"),),
    ),
    Function(
        "coriolis",
        "C of Eq. 8 over (v_D, v_K): C v is the velocity-dependent part of the bias.",
        STATE,
        (Quantity("C", ("n_v", "n_v"), "", "dM/dt - 2 C is skew"),),
        exported=True,
    ),
    Function(
        "bias",
        "c(q, v) of Eq. 8: Coriolis, gravity and springs, without damping and drag.",
        STATE,
        (Quantity("c", ("n_vD",), FORCE, "bias force"),),
        exported=True,
    ),
    Function(
        "gravity",
        "g(q) of Eq. 8: gradient of the potential energy.",
        CONFIGURATION,
        (Quantity("g_D", ("n_vD",), FORCE, "gradient"),),
        exported=True,
    ),
    Function(
        "damping",
        "Force of damping and drag, with the sign of the bias.",
        STATE,
        (Quantity("f", ("n_vD",), FORCE, "force"),),
        exported=True,
    ),
    Function(
        "constraint",
        "h (Eq. 9): a string is slack at h < 0 and taut at h = 0; limits likewise.",
        CONFIGURATION,
        (ROWS,),
        exported=True,
    ),
    Function(
        "A_D",
        "A_D of Eq. 10: derivative of hdot by v_D.",
        CONFIGURATION,
        (Quantity("A_D", ("n_rows", "n_vD"), PER_VELOCITY, "strings, then limits"),),
        exported=True,
    ),
    Function(
        "A_K",
        "A_K of Eq. 10: derivative of hdot by v_K.",
        CONFIGURATION,
        (Quantity("A_K", ("n_rows", "n_vK"), PER_VELOCITY, "strings, then limits"),),
        exported=True,
    ),
    Function(
        "Adot_v",
        "(dA/dt) v of Eq. 11: hddot = A_D acc_D + A_K acc_K + Adot_v.",
        STATE,
        (Quantity("Adot_v", ("n_rows",), "row's unit / s^2", "strings, then limits"),),
        exported=True,
    ),
    Function(
        "A_rate",
        "dA_D/dt and dA_K/dt of Eq. 11 along the velocity.",
        STATE,
        (
            Quantity("Adot_D", ("n_rows", "n_vD"), "", "rate of A_D"),
            Quantity("Adot_K", ("n_rows", "n_vK"), "", "rate of A_K"),
        ),
    ),
    Function(
        "body_velocity",
        "V^b of every link (Eq. 4).",
        STATE,
        (Quantity("V", (6, "n_links"), "m/s, rad/s", "linear, then angular, in the link's frame"),),
        exported=True,
    ),
    Function(
        "lagrangian", "L = T - V (Eq. 7).", STATE, (Quantity("lagrangian", (), "J", "T - V"),)
    ),
    Function(
        "potential",
        "Potential energy (Eq. 6, and springs).",
        CONFIGURATION,
        (Quantity("V", (), "J", "potential energy"),),
    ),
    Function(
        "kinetic", "Kinetic energy (Eq. 5).", STATE, (Quantity("T", (), "J", "kinetic energy"),)
    ),
)
