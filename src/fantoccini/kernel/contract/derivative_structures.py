"""Structures of derivatives: of steps, and of smooth pieces of runs.

D stands for dynamic coordinates (q_D, v_D), K for driven ones (q_K, v_K, acc_K); n_vD and n_vK are
the numbers of velocities. Slip is the length that a winch has let out. The gap of two solids is
their distance, negative in an overlap. A node is a state from which a time step begins.
"""

from __future__ import annotations

from fantoccini.kernel.contract.structure import IN, INT, MANY, OUT, Field, Structure

DERIVATIVES: tuple[Structure, ...] = (
    Structure(
        "StepContact",
        "A contact point with force in a fixed step, and its mode.",
        (
            Field("pair", "int", "index of the pair in ContactArrays"),
            Field("feature", "int", "index of the point among the pair's points"),
            Field("links", "int[2]", "links of the two solids; -1 for the world"),
            Field("sticks", "int", "whether it sticks; otherwise it slides"),
            Field("turns", "int", "whether the direction of sliding turns with the velocity"),
            Field("friction", "double", "coefficient of friction"),
            Field("gap", "double", "distance of the solids [m]"),
            Field("closes", "double", "d(gap speed)/d(gap) required by the step [1/s]"),
            Field("bounces", "double", "restitution required by the step"),
            Field("at", "double[3]", "position in the world [m]"),
            Field("normal", "double[3]", "unit normal from the second solid to the first"),
            Field("force", "double[3]", "force on the first solid [N]"),
            Field(
                "velocity",
                "double[3]",
                "velocity of the first solid relative to the second after the step [m/s]",
            ),
            Field("along", "double[3]", "direction of sliding; 0 if it sticks"),
            Field(
                "by",
                "double[42]",
                "(7, 6) derivatives of gap, position and normal by a twist of the first link about "
                "the origin",
            ),
        ),
    ),
    Structure(
        "TouchingStepArrays",
        "First time steps with contact, one for each node.",
        (
            Field("options", "Options"),
            Field("winches", IN, "winches of all nodes"),
            Field("reference_force", "double", "size of forces, such as the weight [N]"),
            Field("capacity", "int", "largest number of points of a node"),
            Field("p", "Shared"),
            Field("acc_K", "Shared", "driven acceleration at the start"),
            Field("u_D", "Shared", "user forces, or null"),
            Field("q_D", IN, "(n, n_qD) starts"),
            Field("v_D", IN, "(n, n_vD)"),
            Field("q_K", IN, "(n, n_qK)"),
            Field("v_K", IN, "(n, n_vK)"),
            Field("slip", OUT, "(n, n_strings) slip at the start; then after the step"),
            Field("rate", IN, "(n, n_vK) dq_K/dt over the step"),
            Field("mean", IN, "(n, n_vK) dv_K/dt over the step"),
            Field("q_D_next", OUT, "(n, n_qD) state after the step"),
            Field("v_D_next", OUT, "(n, n_vD)"),
            Field("q_K_next", OUT, "(n, n_qK)"),
            Field("v_K_next", OUT, "(n, n_vK)"),
            Field("tension", OUT, "(n, n_rows)"),
            Field("taut", "unsigned char*", "(n, n_rows)"),
            Field("status", "int*", "(n,) Status"),
            Field(
                "delay",
                OUT,
                "(n,) how long the steps move on before what springs back touches [s]; all of "
                "points and screws is there",
            ),
            Field("edges", "int*", "(n,) StepEdge"),
            Field("n_pairs", "int", "number of pairs in ContactArrays"),
            Field("pair_edges", "int*", "(n, n_pairs) StepEdge of every pair; set to 0 before"),
            Field("n_points", "int*", "(n,) numbers of points with force"),
            Field("points", "StepContact*", "(n, capacity)"),
            Field("screws", OUT, "(n, n_vD + n_vK, 6) results of the function screws at the start"),
            Field(
                "by_p",
                OUT,
                "(n, n_links + n_vD + n_vK, 6, n_p) derivatives by the parameters: twists of "
                "links, changes of screws; null without parameters",
            ),
        ),
    ),
    Structure(
        "StepDerivativeArrays",
        "Time steps and their derivatives, one for each node.",
        (
            Field("dt", "double", "length of all steps [s]"),
            Field("recovery_speed", "double", "recovery_speed of Options [m/s]"),
            Field("forces", "int", "whether to differentiate by u_D as well"),
            Field("p", "Shared"),
            Field("u_D", "Shared", "or null"),
            Field("q_D", IN, "(n, n_qD) starts"),
            Field("v_D", IN, "(n, n_vD)"),
            Field("q_K", IN, "(n, n_qK)"),
            Field("rate", IN, "(n, n_vK) dq_K/dt over the step"),
            Field("mean", IN, "(n, n_vK) dv_K/dt over the step"),
            Field("slip", IN, "(n, n_strings)"),
            Field("tension", IN, "(n, n_rows) tensions of the step"),
            Field("held", "const unsigned char*", "(n, n_rows) rows that the step holds"),
            Field(
                "cap_by", INT, "(n_rows,) parameter that is the row's largest tension; -1 for none"
            ),
            Field("acc_D", OUT, "(n, n_vD) mean acceleration over the step"),
            Field(
                "motion",
                OUT,
                "(n, 2 n_vD, m) derivatives of (dq_D, v_D) after the step by q_D, v_D, q_K, v_K, "
                "acc_K, u_D if requested, and p; for driven rotations by rate and mean",
            ),
            Field("pull", OUT, "(n, n_rows, m) derivatives of the tensions, or null"),
            Field(
                "shares",
                OUT,
                "(n, 3 capacity, m) derivatives of the multipliers, point after point: along the "
                "normal and, if the point sticks, along two tangents; or null",
            ),
            Field(
                "moved",
                OUT,
                "(n, n_vD + n_vK, m) of the configuration where what springs back touches, of "
                "steps in which something does; null without shares",
            ),
            Field("n_points", INT, "(n,) points that push; null without contact"),
            Field("delay", IN, "as in TouchingStepArrays; null without contact"),
            Field("capacity", "int", "for points of a node"),
            Field("points", "const StepContact*", "(n, capacity)"),
            Field("screws", IN, "screws of TouchingStepArrays"),
            Field("by_p", IN, "by_p of TouchingStepArrays"),
            Field("edges", "int*", "(n,) StepEdge; bits are added"),
        ),
    ),
    Structure(
        "FlowDerivativeArrays",
        "A smooth piece of a run, and the evolution of small changes along it.",
        (
            Field("rtol", "double", "relative tolerance of the integration of state and changes"),
            Field("atol", "double", "absolute tolerance, likewise"),
            Field("step", "double", "first step size; at the end, the next step size [s]"),
            Field("start", "double", "time of the start [s]"),
            Field("n_times", MANY),
            Field("times", IN, "(n_times,) times of results, increasing; the last is the end [s]"),
            Field("input", "InputArrays", "input with one piece"),
            Field("m", "int", "number of changes: of the state, of parameters, of the inputs"),
            Field("n_inputs", "int", "number of changes of the inputs"),
            Field(
                "by_inputs",
                IN,
                "(6, 3 n_vK + n_vD, n_inputs) changes of q_K, v_K, acc_K and u_D, in powers of the "
                "time since the start relative to the whole time",
            ),
            Field("p", IN),
            Field("held", "const unsigned char*", "(n_rows,) rows that are held"),
            Field("q_D", IN, "(n_qD,) at the start"),
            Field("v_D", IN, "(n_vD,)"),
            Field("changes", IN, "(2 n_vD, m) changes of (q_D, v_D) at the start"),
            Field("q_D_at", OUT, "(n_times, n_qD)"),
            Field("v_D_at", OUT, "(n_times, n_vD)"),
            Field("changes_at", OUT, "(n_times, 2 n_vD, m)"),
            Field("status", "int", "Status"),
        ),
    ),
)
"""Structures in the order of declaration: after those that they contain, and those of runs."""
