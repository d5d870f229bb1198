"""Every structure that Python and compiled code share, field by field."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.contract.rows import PARTS


@dataclass(frozen=True)
class Field:
    """A field of a structure.

    Attributes:
        name: the same in Python and C++.
        type: in C++: a number, an array ``double[3]``, a pointer, a structure, or a function
            ``double(const Solid*, const Solid*)``.
        meaning: with its shape and unit.
    """

    name: str
    type: str
    meaning: str = ""


@dataclass(frozen=True)
class Structure:
    """A structure as C lays it out.

    Attributes:
        name: the same in Python and C++.
        meaning: in one sentence.
        fields: in order.
    """

    name: str
    meaning: str
    fields: tuple[Field, ...]


_IN, _OUT, _MANY, _INT = "const double*", "double*", "long long", "const int*"

STRUCTURES: tuple[Structure, ...] = (
    Structure("InputArrays", "An input, row by row as NumPy has it.", (
        Field("n_segments", "int", "pieces"),
        Field("breaks", _IN, "(n_segments + 1,) [s]"),
        Field("coef", _IN, "(n_segments, n_vK, 6)"),
        Field("base", _IN, "(n_segments, n_qK)"),
        Field("force", _IN, "(n_segments, n_vD, 6) or null"),
    )),
    Structure("Options", "Numbers that steer a run.", (
        Field("rtol", "double", "of the event-driven integrator"),
        Field("atol", "double", "likewise"),
        Field("first_step", "double", "[s]"),
        Field("max_step", "double", "[s]"),
        Field("tension_cap", "double", "[N]; also of impulses [N s]"),
        Field("energy_scale", "double", "size of the work and loss integrals, for errors [J]"),
        Field("force_scale", "double", "size of forces that balance, M_DD one [kg^1/2 m/s^2]"),
        Field("recovery_speed", "double", "time-stepping's cap on taking back a violation [m/s]"),
        Field("dt", "double", "step of the methods with a fixed one [s]"),
        Field("max_steps", _MANY),
        Field("max_events", _MANY),
        Field("save_steps", "int", "write every accepted step"),
        Field("extrapolate", "int", "time-stepping: velocity products half a step on"),
    )),
    Structure("RecordArrays", "Where a run writes: rows and events (contract/rows.py).", (
        Field("rows", _OUT, "(row_capacity, RowLayout::width)"),
        Field("row_capacity", _MANY),
        Field("n_rows", _MANY, "written"),
        Field("events", _OUT, "(event_capacity, EventLayout::width)"),
        Field("event_capacity", _MANY),
        Field("n_events", _MANY, "written"),
    )),
    Structure("StartArrays", "What a run starts from.", (
        Field("t", "double", "[s]"),
        Field("q_D", _IN, "(n_qD,)"),
        Field("v_D", _IN, "(n_vD,)"),
        Field("slip", _IN, "(n_strings,) [m]"),
        Field("p", _IN, "(n_p,)"),
        Field("winches", _IN, "(n_strings, 3) largest tension [N], rewinding speed, restitution"),
        Field("input", "InputArrays"),
        Field("options", "Options"),
        Field("save_at", _IN, "(n_save,) times of rows, event-driven; must outlive the run [s]"),
        Field("n_save", _MANY),
        Field("save_every", "int", "fixed steps from row to row"),
    )),
    Structure("RunProgress", "How far a run is.", (
        Field("steps", _MANY, "taken"),
        Field("t", "double", "reached [s]"),
        Field("violation", "double", "worst so far, of fixed steps [m or rad]"),
    )),
    Structure("Shared", "Numbers of each trajectory.", (
        Field("first", _IN, "or null"),
        Field("stride", _MANY, "from one to the next; 0 shares one"),
    )),
    Structure("BatchArrays", "A batch: what it starts from and where its rows go.", (
        Field("n", _MANY, "trajectories"),
        Field("t", "double", "start of all [s]"),
        Field("t_end", "double", "end of all [s]"),
        Field("q_D", "Shared"),
        Field("v_D", "Shared"),
        Field("slip", "Shared"),
        Field("n_segments", "int", "of every input"),
        Field("breaks", "Shared"),
        Field("coef", "Shared"),
        Field("base", "Shared"),
        Field("force", "Shared"),
        Field("p", _IN, "of all"),
        Field("winches", _IN, "of all"),
        Field("options", "Options"),
        Field("save_every", "int", "fixed steps from row to row"),
        Field("save_at", _IN, "(n_rows,) times of event-driven rows, from t to t_end [s]"),
        Field("n_rows", _MANY, "of a trajectory"),
        Field("parts", f"void*[{len(PARTS)}]", "(n, n_rows, width) or null; taut in bytes"),
        Field("status", "int*", "(n,) Status"),
        Field("reached", _OUT, "(n,) [s]"),
        Field("violation", _OUT, "(n,) worst, of fixed steps"),
        Field("catches", "long long*", "(n,)"),
        Field("releases", "long long*", "(n,)"),
        Field("blame", _OUT, "(n, n_rows + n_watched)"),
        Field("end_q_D", _OUT, "(n, n_qD) the configuration reached"),
        Field("end_v_D", _OUT, "(n, n_vD) the velocities there"),
    )),
    Structure("Solid", "A solid in the frame of a link, or of the world.", (
        Field("kind", "int", "SolidKind"),
        Field("link", "int", "-1 for the world"),
        Field("mesh", _MANY, "the mesh that it is the box about, or negative"),
        Field("a", "double[3]"),
        Field("b", "double[3]"),
        Field("R", "double[9]", "column by column"),
        Field("half", "double[3]"),
        Field("radius", "double", "[m]"),
    )),
    Structure("ClearanceArrays", "What is measured against what.", (
        Field("n_moving", _MANY),
        Field("n_standing", _MANY),
        Field("n_pairs", _MANY),
        Field("moving", "const Solid*", "against standing ones"),
        Field("standing", "const Solid*"),
        Field("pairs", _INT, "(n_pairs, 2) of moving ones, against one another"),
        Field("string_radius", _IN, "(n_strings,) against standing ones; negative: not at all"),
        Field("exact", "double(const Solid*, const Solid*)",
              "distance of two, a mesh one of them, before radii are taken off; null without mesh"),
    )),
    Structure("GoalArrays", "A goal.", (
        Field("kind", "int", "GoalKind"),
        Field("link", "int", "of a point"),
        Field("low", _IN, "(n_qD,) of a pose; a rotation, whose weight is its first, is at low"),
        Field("high", _IN, "(n_qD,)"),
        Field("weight", _IN, "(n_vD,)"),
        Field("v_D", _IN, "(n_vD,) wanted"),
        Field("v_K", _IN, "(n_vK,) wanted"),
        Field("at", "double[3]", "of a point in its link's frame [m]"),
        Field("place", "double[3]", "low corner of the box it is to be in [m]"),
        Field("place_high", "double[3]", "high corner [m]"),
        Field("speed_weight", "double", "of what v_D lacks [s]"),
        Field("driven_weight", "double", "of what v_K lacks [s]"),
        Field("tolerance", "double", "of the distance; negative where rollouts pass the goal"),
    )),
    Structure("FunnelArrays", "An equilibrium and the gains of the law that leads there.", (
        Field("q_D", _IN, "(n_qD,)"),
        Field("q_K", _IN, "(n_qK,)"),
        Field("gains", _IN, "(n_vK, 2 n_vD + 2 n_vK) on (dq_D, v_D, dq_K, v_K)"),
    )),
    Structure("BoundArrays", "What the driven coordinates may do.", (
        Field("speed", _IN, "(n_vK,)"),
        Field("acceleration", _IN, "(n_vK,)"),
        Field("low", _IN, "(n_qK,)"),
        Field("high", _IN, "(n_qK,)"),
    )),
    Structure("SegmentArrays", "What is written of every segment: (n, segments, width).", (
        Field("q_D", _OUT, "at its end"),
        Field("v_D", _OUT),
        Field("slip", _OUT),
        Field("q_K", _OUT),
        Field("v_K", _OUT),
        Field("distance", _OUT, "from the goal there"),
        Field("looks", "int*", "it lasted; 0 where it was not made"),
        Field("catches", "int*", "strings and limits that were caught"),
    )),
    Structure("RolloutArrays", "A planner's rollouts.", (
        Field("n", _MANY, "rollouts"),
        Field("segments", "int", "of a rollout, at most"),
        Field("looks", "int", "of a segment"),
        Field("steps", "int", "of a look"),
        Field("options", "Options"),
        Field("p", _IN),
        Field("winches", _IN),
        Field("start", "const long long*", "(n,) index of the start of each rollout"),
        Field("q_D", _IN, "starts"),
        Field("v_D", _IN),
        Field("slip", _IN),
        Field("q_K", _IN),
        Field("v_K", _IN),
        Field("acc_K", _OUT, "(n, segments, n_vK); those not given are led, and written"),
        Field("n_segments", _INT, "(n,) segments of each, at least one"),
        Field("n_given", _INT, "(n,) leading segments whose accelerations are given"),
        Field("funnel", _INT, "(n,) index of its funnel"),
        Field("lead_time", _IN, "(n,) time by which its reference runs ahead [s]"),
        Field("funnels", "const FunnelArrays*"),
        Field("bounds", "BoundArrays"),
        Field("margin", "double", "least clearance [m]"),
        Field("may_slacken", "int", "whether strings that pull may go slack"),
        Field("solids", "const ClearanceArrays*"),
        Field("goal", "GoalArrays"),
        Field("out", "SegmentArrays"),
    )),
    Structure("RolloutProgress", "What the threads that simulate rollouts share.", (
        Field("next", _MANY, "next rollout to simulate"),
        Field("reached", _MANY, "first rollout at the goal; n while none is; -1 abandons all"),
    )),
)  # fmt: skip
"""In an order in which each comes after those that it holds."""
