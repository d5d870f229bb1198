"""Every generated function: its arguments, its results and the libraries that contain it.

To add a quantity, declare it here and derive it in ``equations/functions.py``. Signatures of the
CasADi functions, callers in C++, named results in Python, the C99 header and ``docs/functions.md``
are made from the entry.

D stands for dynamic coordinates, K for driven ones (ends and lengths of strings, driven joints). h
is the gap of a string, A_D and A_K are its derivatives, and n_rows counts strings and limits. A
drive moves a coordinate by a motor towards its command. A twist is a velocity of a link, linear and
angular; a screw is the twist per unit of one joint velocity.
"""

from __future__ import annotations

from collections.abc import Mapping

from fantoccini.kernel.contract.analysis_functions import ANALYSIS
from fantoccini.kernel.contract.function import (
    CLEARANCE,
    CONFIGURATION,
    DERIVATIVES,
    FORCE,
    GRADIENTS,
    LANES,
    MODEL,
    REACH,
    ROLLOUTS,
    ROWS,
    STATE,
    STEP_DERIVATIVES,
    VARIATIONAL,
    VARIATIONAL_DERIVATIVES,
    VARIATIONAL_LANES,
    Function,
    arguments,
)
from fantoccini.kernel.contract.quantity import Quantity, Shape

_L = Quantity("L", ("n_packed",), "", "factor F of M = F^T F, an argument of its solves")
_STRINGS: Shape = ("n_strings",)
_FACTOR = (
    _L,
    Quantity("w0", ("n_vD",), "", "F^-T (u_D - c - damping - M_DK acc_K)"),
    Quantity("W", ("n_vD", "n_strings"), "", "F^-T A_D^T"),
    Quantity("G", ("n_strings", "n_strings"), "1/kg", "A_D M^-1 A_D^T = W^T W"),
)
_H = Quantity("h", _STRINGS, "m", "path length minus string length")
_HDOT = Quantity("hdot", _STRINGS, "m/s", "rate of h")
_A0 = Quantity("a0", _STRINGS, "m/s^2", "W^T w0")
_HDOT_K = Quantity("hdot_K", _STRINGS, "m/s", "A_K v_K, the inputs' part of hdot")
_LIMITS = (
    Quantity("h_limit", ("n_limits",), "", "h of the limits"),
    Quantity("J_limit", (3, "n_limits"), "", "A_D of the limits, for their joints' velocities"),
)
_POWER = (
    Quantity("power0", (), "W", "power of the inputs at acc_D = 0 without tensions"),
    Quantity("M_DK_v_K", ("n_vD",), "", "M_DK v_K"),
    Quantity("loss", (), "W", "power of damping and drag"),
)
_DYNAMICS = (
    *_FACTOR,
    _H,
    _HDOT,
    Quantity("gamma", _STRINGS, "m/s^2", "hddot at acc_D = 0"),
    _A0,
    _HDOT_K,
    *_LIMITS,
    Quantity("gamma_limit", ("n_limits",), "", "hddot of the limits at acc_D = 0"),
    *_POWER,
)
_STEP = (*_FACTOR, _H, _HDOT, _A0, _HDOT_K, *_LIMITS, *_POWER)
_STANDING = ("W", "J_limit", "M_DK_v_K")
_Y = Quantity("y", ("n_vD",), "", "the solution")
_FULL = arguments("q_D v_D acc_D q_K v_K acc_K tension dt p")
_STEPPING = (LANES, ROLLOUTS, VARIATIONAL, VARIATIONAL_LANES, STEP_DERIVATIVES, GRADIENTS)


def _derivative(name: str, rows: str, variable: str, meaning: str) -> Quantity:
    return Quantity(name, (rows, variable), "", f"derivative of {meaning}")


_BY_RATES = (
    _derivative("A_D", "n_rows", "n_vD", "hdot by v_D"),
    _derivative("A_K", "n_rows", "n_vK", "hdot by v_K"),
    _derivative("h_p", "n_rows", "n_p", "h by the parameters"),
    _derivative("hdot_q", "n_rows", "n_vD", "hdot by tangents of q_D"),
    _derivative("hdot_qK", "n_rows", "n_vK", "hdot by tangents of q_K"),
    _derivative("hdot_p", "n_rows", "n_p", "hdot by the parameters"),
)
_BY_ACCELERATIONS = (
    _derivative("hddot_q", "n_rows", "n_vD", "hddot by tangents of q_D"),
    _derivative("hddot_v", "n_rows", "n_vD", "hddot by v_D"),
    _derivative("hddot_qK", "n_rows", "n_vK", "hddot by tangents of q_K"),
    _derivative("hddot_vK", "n_rows", "n_vK", "hddot by v_K"),
    _derivative("hddot_p", "n_rows", "n_p", "hddot by the parameters"),
)

_ENDS = "before", "after"
_OF_MIDPOINT = (
    ("q", "n_vD", "tangents of q_D"),
    ("xi", "n_vD", "xi"),
    ("qm", "n_vK", "tangents of q_mid"),
    ("vm", "n_vK", "v_mid"),
    ("am", "n_vK", "acc_mid"),
    ("u", "n_vD", "u_D"),
    ("p", "n_p", "the parameters"),
)


_DECLARED = (
    Function(
        "dynamics",
        "Accelerations and tensions of any active set (Eqs. 10, 11): "
        "acc_D = solve_factor(L, w0 + W lam), hddot = gamma + a0 + G lam, lam = -tension.",
        arguments("q_D v_D q_K v_K acc_K u_D p"),
        _DYNAMICS,
        (MODEL, DERIVATIVES),
        mapped=True,
        exported=True,
        standing=_STANDING,
    ),
    Function(
        "step_dynamics",
        "`dynamics` over a step dt: F contains damping and drag, velocity products use v_ahead.",
        arguments("q_D v_D q_K v_K acc_K u_D v_ahead dt p"),
        (
            *_STEP,
            Quantity("f_M", ("n_motors",), FORCE, "force of the motors at dv = 0: f_M - y_M dv"),
            Quantity("y_M", ("n_motors",), "", "decrease of that force per change dv of velocity"),
        ),
        (MODEL, LANES, ROLLOUTS, STEP_DERIVATIVES, GRADIENTS),
        mapped=True,
        standing=_STANDING,
    ),
    Function(
        "limit_rates",
        "hdot of the limits at a velocity.",
        arguments("J_limit v_D"),
        (Quantity("rates", ("n_limits",), "1/s", "hdot of the limits"),),
        (MODEL, *_STEPPING),
    ),
    Function(
        "rows",
        "h of strings and limits, for compiled code.",
        CONFIGURATION,
        (ROWS,),
        (MODEL,),
        mapped=True,
    ),
    Function(
        "energy",
        "Kinetic energy (Eq. 5) and potential energy (Eq. 6, and springs).",
        STATE,
        (Quantity("T", (), "J", "kinetic energy"), Quantity("V", (), "J", "potential energy")),
        (MODEL, LANES, ROLLOUTS, GRADIENTS, VARIATIONAL, VARIATIONAL_LANES),
        mapped=True,
        exported=True,
    ),
    Function(
        "momentum",
        "Momentum of all links about their centre of mass, in world axes.",
        STATE,
        (Quantity("momentum", (6,), "N s, N m s", "linear, then angular"),),
        (MODEL, LANES),
        mapped=True,
        exported=True,
    ),
    Function(
        "effort",
        "Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lam.",
        arguments("q_D v_D q_K v_K acc_D acc_K lam p"),
        (Quantity("f_K", ("n_vK",), FORCE, "force; for a command the force of its motor"),),
        (MODEL,),
        mapped=True,
        exported=True,
    ),
    Function(
        "wrench_forces",
        "User forces u_D of Eq. 8 from a wrench on every link.",
        arguments("q_D q_K wrench p"),
        (Quantity("u_D", ("n_vD",), FORCE, "equivalent user forces"),),
        (MODEL,),
        mapped=True,
        exported=True,
    ),
    Function(
        "poses",
        "World pose of every link (Eqs. 2, 3).",
        CONFIGURATION,
        (Quantity("poses", (12, "n_links"), "1, m", "R column by column, then the origin"),),
        (MODEL, CLEARANCE, ROLLOUTS),
        mapped=True,
        exported=True,
    ),
    Function(
        "points",
        "World positions of the points of every string's path.",
        CONFIGURATION,
        (Quantity("points", (3, "n_points"), "m", "x, y, z"),),
        (MODEL, CLEARANCE, ROLLOUTS),
        mapped=True,
        exported=True,
    ),
    Function(
        "screws",
        "Poses of all links, and the twist about the world's origin that a unit velocity gives all "
        "links beyond its joint.",
        CONFIGURATION,
        (
            Quantity("poses", (12, "n_links"), "1, m", "R column by column, then the origin"),
            Quantity("screw_D", (6, "n_vD"), "1 or m", "v_D's screws: linear, angular; world axes"),
            Quantity("screw_K", (6, "n_vK"), "1 or m", "v_K's screws, likewise"),
        ),
        (MODEL, LANES, ROLLOUTS, GRADIENTS, REACH),
        mapped=True,
    ),
    Function(
        "solve_factor_transposed",
        "y = F^-T x.",
        arguments("L x"),
        (_Y,),
        (MODEL, *_STEPPING, DERIVATIVES),
        mapped=True,
        exported=True,
    ),
    Function(
        "solve_factor",
        "y = F^-1 x.",
        arguments("L x"),
        (_Y,),
        (MODEL, *_STEPPING, DERIVATIVES),
        mapped=True,
        exported=True,
    ),
    Function(
        "motor_lags",
        "Lag of the watched drives behind their commands.",
        CONFIGURATION,
        (
            Quantity("at", ("n_watched",), "rad or m", "position of the drive"),
            Quantity("command", ("n_watched",), "rad or m", "position of its command"),
            Quantity("lag", ("n_watched",), "1", "lag in periods of a stepper motor"),
        ),
        (MODEL, *_STEPPING),
        needs="n_watched",
    ),
    Function(
        "motor_shares",
        "Share of its controller's demanded force that each watched motor can exert.",
        arguments("q_D v_D q_K v_K acc_K p"),
        (Quantity("share", ("n_watched",), "1", "possible force / demanded force, at most 1"),),
        (MODEL, *_STEPPING),
        needs="n_watched",
    ),
    Function(
        "motor_demands",
        "Force that controllers demand, without the bounds of the motors.",
        arguments("q_D v_D q_K v_K acc_K p"),
        (Quantity("f_D", ("n_vD",), FORCE, "demanded force; 0 without a drive"),),
        (MODEL,),
        needs="n_watched",
        mapped=True,
    ),
    Function(
        "node",
        "Dynamics at a node of a variational run, and the factor with damping over dt.",
        arguments("q_D v_D q_K v_K acc_K u_D dt p"),
        (
            *_STEP,
            Quantity("L_firm", ("n_packed",), "", "L with damping and drag over dt"),
            Quantity("W_firm", ("n_vD", "n_strings"), "", "W for L_firm"),
            Quantity("G_firm", ("n_strings", "n_strings"), "1/kg", "G for L_firm"),
        ),
        (VARIATIONAL, VARIATIONAL_LANES),
        standing=("W", "W_firm", "J_limit", "M_DK_v_K"),
    ),
    Function(
        "midpoint_rule",
        "The momenta at both ends of a step by the midpoint rule.",
        arguments("q_D xi q_mid v_mid acc_mid q_K u_D dt p"),
        (
            Quantity("before", ("n_vD",), "", "momentum p_k(xi) at the step's start"),
            Quantity("after", ("n_vD",), "", "momentum p_k+1 at its end"),
            Quantity("q_next", ("n_qD",), "", "configuration q_k+1"),
            Quantity("h", ("n_rows",), "m", "h of all rows at q_k+1"),
            Quantity("work_M", (), "J", "work of the motors"),
        ),
        (VARIATIONAL, VARIATIONAL_LANES),
    ),
    Function(
        "momenta",
        "p_D = M_DD v_D + M_DK v_K.",
        STATE,
        (Quantity("p_D", ("n_vD",), "", "momenta of the dynamic coordinates"),),
        (VARIATIONAL, VARIATIONAL_LANES, VARIATIONAL_DERIVATIVES),
        mapped=True,
    ),
    *(
        Function(
            f"force_by_{by}",
            purpose,
            _FULL,
            results,
            (DERIVATIVES, STEP_DERIVATIVES),
            mapped=True,
            standing=tuple(result.name for result in results),
        )
        for by, purpose, results in (
            (
                "q",
                "Derivative of Eq. 10's residual r by the dynamic configuration.",
                (_derivative("r_q", "n_vD", "n_vD", "r by tangents of q_D"),),
            ),
            (
                "v",
                "Derivative of r by the dynamic velocity.",
                (_derivative("r_v", "n_vD", "n_vD", "r by v_D"),),
            ),
            (
                "K",
                "Derivatives of r by the driven coordinates and the parameters.",
                (
                    _derivative("r_qK", "n_vD", "n_vK", "r by tangents of q_K"),
                    _derivative("r_vK", "n_vD", "n_vK", "r by v_K"),
                    _derivative("M_DK", "n_vD", "n_vK", "r by acc_K"),
                    _derivative("r_p", "n_vD", "n_p", "r by the parameters"),
                ),
            ),
        )
    ),
    Function(
        "rows_by",
        "A_D, A_K and the derivatives of h, hdot and hddot of strings and limits.",
        arguments("q_D v_D acc_D q_K v_K acc_K p"),
        (*_BY_RATES, *_BY_ACCELERATIONS),
        (DERIVATIVES,),
        mapped=True,
        standing=tuple(q.name for q in (*_BY_RATES, *_BY_ACCELERATIONS)),
    ),
    Function(
        "row_rates_by",
        "A_D, A_K and the derivatives of h and hdot of strings and limits.",
        STATE,
        _BY_RATES,
        (STEP_DERIVATIVES, VARIATIONAL_DERIVATIVES),
        mapped=True,
        standing=tuple(q.name for q in _BY_RATES),
    ),
    Function(
        "hanging",
        "Residual force r of Eq. 10 at rest, h, and their derivatives.",
        arguments("q_D q_K tension p"),
        (
            Quantity("r", ("n_vD",), FORCE, "g + A_D^T tension, and springs"),
            Quantity("h", ("n_rows",), "m", "h of strings and limits"),
            _derivative("r_q", "n_vD", "n_vD", "r by tangents of q_D"),
            _derivative("r_qK", "n_vD", "n_vK", "r by tangents of q_K"),
            _derivative("r_p", "n_vD", "n_p", "r by the parameters"),
            _derivative("A_D", "n_rows", "n_vD", "h by tangents of q_D"),
            _derivative("A_K", "n_rows", "n_vK", "h by tangents of q_K"),
            _derivative("h_p", "n_rows", "n_p", "h by the parameters"),
        ),
        (REACH,),
    ),
    Function(
        "momenta_by",
        "e = M v_D + M_DK v_K + A_D^T tension and its derivatives.",
        arguments("q_D v_D q_K v_K tension p"),
        (
            Quantity("e", ("n_vD",), "", "M v_D + M_DK v_K + A_D^T tension"),
            _derivative("e_q", "n_vD", "n_vD", "e by tangents of q_D"),
            _derivative("M", "n_vD", "n_vD", "e by v_D"),
            _derivative("e_qK", "n_vD", "n_vK", "e by tangents of q_K"),
            _derivative("M_DK", "n_vD", "n_vK", "e by v_K"),
            _derivative("e_p", "n_vD", "n_p", "e by the parameters"),
        ),
        (VARIATIONAL_DERIVATIVES,),
        mapped=True,
    ),
    Function(
        "midpoint_by",
        "The midpoint rule's momenta at both ends of a step, and derivatives.",
        arguments("q_D xi q_mid v_mid acc_mid u_D dt p"),
        (
            *(Quantity(end, ("n_vD",), "", f"momenta {end} the step") for end in _ENDS),
            *(
                _derivative(f"{end}_{by}", "n_vD", size, f"`{end}` by {variable}")
                for end in _ENDS
                for by, size, variable in _OF_MIDPOINT
            ),
            _derivative("next_q", "n_vD", "n_vD", "tangents of q_k+1 by tangents of q_k"),
            _derivative("next_xi", "n_vD", "n_vD", "tangents of q_k+1 by xi"),
        ),
        (VARIATIONAL_DERIVATIVES,),
        mapped=True,
    ),
    Function(
        "step_back",
        "Gradient of z . r + y . hdot + y_h . h; r has velocity products of v_ahead, hdot is at "
        "v_next.",
        arguments("q_D v_D v_ahead v_next acc_D q_K v_K acc_K tension z y y_h dt p"),
        (
            Quantity("g_q", ("n_vD",), "", "gradient by tangents of q_D"),
            Quantity("g_v", ("n_vD",), "", "gradient by v_D"),
            Quantity("g_ahead", ("n_vD",), "", "gradient by v_ahead"),
            Quantity("g_next", ("n_vD",), "", "gradient by v_next"),
            Quantity("g_qK", ("n_vK",), "", "gradient by tangents of q_K"),
            Quantity("g_vK", ("n_vK",), "", "gradient by v_K"),
            Quantity("g_aK", ("n_vK",), "", "gradient by acc_K"),
            Quantity("g_p", ("n_p",), "", "gradient by the parameters"),
        ),
        (GRADIENTS,),
    ),
    *ANALYSIS,
)

FUNCTIONS: dict[str, Function] = {f.name: f for f in _DECLARED}
"""Name -> generated function."""

COLUMN = Function(
    "column",
    "The nonzero entries of y = F^-T x for an x that is zero outside one joint.",
    arguments("L x_joint"),
    (Quantity("y", ("n_vD",), "", "nonzero entries, in order"),),
)
"""One function for every joint with limits: ``column(which, ...)`` in compiled code."""


def needed(function: Function, sizes: Mapping[str, int]) -> bool:
    """Whether a puppet of these sizes has a function."""
    return not function.needs or sizes[function.needs] > 0


def compiled(library: str, sizes: Mapping[str, int]) -> tuple[str, ...]:
    """Names of the functions in a library.

    Args:
        library: one of ``LIBRARIES``.
        sizes: sizes of the puppet.
    """
    return tuple(f.name for f in _DECLARED if library in f.libraries and needed(f, sizes))
