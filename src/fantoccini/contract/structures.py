"""Every structure that Python and compiled code share, field by field."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.contract.samples import PARTS


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
    Structure("InputArrays", "An input: arrays in C order.", (
        Field("n_segments", "int", "pieces"),
        Field("breaks", _IN, "(n_segments + 1,) [s]"),
        Field("coef", _IN, "(n_segments, n_vK, 6)"),
        Field("base", _IN, "(n_segments, n_qK)"),
        Field("force", _IN, "(n_segments, n_vD, 6) or null"),
    )),
    Structure("Hull", "A convex polytope around the origin.", (
        Field("n_vertices", "int"),
        Field("n_facets", "int"),
        Field("n_edges", "int"),
        Field("inner", "double", "radius of the largest ball about the origin inside [m]"),
        Field("outer", "double", "radius of the smallest ball about the origin around it [m]"),
        Field("vertices", _IN, "(n_vertices, 3) [m]"),
        Field("planes", _IN, "(n_facets, 4) outward unit normal; height above the origin [m]"),
        Field("begins", _INT, "(n_facets + 1,) where the corners of each facet begin"),
        Field("corners", _INT, "vertices of each facet in turn, anticlockwise seen from outside"),
        Field("sides", _INT, "the edge from each corner to the next"),
        Field("edges", _INT, "(n_edges, 4) two vertices, the facets to the left and right"),
        Field("around_begins", _INT, "(n_vertices + 1,) where the facets of each vertex begin"),
        Field("around", _INT, "facets of each vertex"),
    )),
    Structure("Solid", "A solid in the frame of a link or of the world.", (
        Field("kind", "int", "SolidKind"),
        Field("link", "int", "-1 for the world"),
        Field("mesh", _MANY,
              "index of the hull, or of the mesh that this box encloses; or negative"),
        Field("a", "double[3]"),
        Field("b", "double[3]"),
        Field("R", "double[9]", "column by column"),
        Field("half", "double[3]"),
        Field("radius", "double", "[m]"),
        Field("hull", "const Hull*", "null but for hulls"),
    )),
    Structure("ContactArrays", "Solids that may touch, and how.", (
        Field("n_solids", _MANY),
        Field("n_pairs", _MANY),
        Field("n_groups", _MANY),
        Field("solids", "const Solid*", "those of the links, then those that stand"),
        Field("pairs", _INT, "(n_pairs, 2) of solids; the second may stand in the world"),
        Field("groups", _INT,
              "(n_groups, 3) of pairs of the same two links, or of a link and a solid that stands: "
              "first link; second link, or -1 - the solid; where the pairs end"),
        Field("friction", _IN, "(n_pairs,) coefficient of Coulomb's law"),
        Field("restitution", _IN, "(n_pairs,) 0 to 1"),
        Field("meetings", _INT, "(n_pairs,) the first pair of parts of the same two names"),
    )),
    Structure("Options", "Options of a run.", (
        Field("rtol", "double", "of the event-driven integrator"),
        Field("atol", "double", "likewise"),
        Field("first_step", "double", "[s]"),
        Field("max_step", "double", "[s]"),
        Field("tension_cap", "double", "[N]; times 1 m of a limit, times 1 s of an impulse"),
        Field("energy_scale", "double", "size of the work and loss integrals, for errors [J]"),
        Field("force_scale", "double", "size of forces that balance, M_DD one [kg^1/2 m/s^2]"),
        Field("recovery_speed", "double", "cap on how fast time-stepping undoes a violation [m/s]"),
        Field("dt", "double", "fixed step [s]"),
        Field("max_steps", _MANY),
        Field("max_events", _MANY),
        Field("save_steps", "int", "save every accepted step"),
        Field("extrapolate", "int", "time-stepping: velocity products half a step ahead"),
        Field("contacts", "const ContactArrays*", "null without contact; must outlive the run"),
    )),
    Structure("RecordArrays", "Where a run writes samples and events.", (
        Field("samples", _OUT, "(sample_capacity, SampleLayout::width)"),
        Field("sample_capacity", _MANY),
        Field("n_samples", _MANY, "written"),
        Field("events", _OUT, "(event_capacity, EventLayout::width)"),
        Field("event_capacity", _MANY),
        Field("n_events", _MANY, "written"),
        Field("contacts", _OUT, "(contact_capacity, ContactLayout::width)"),
        Field("contact_capacity", _MANY),
        Field("n_contacts", _MANY, "written"),
    )),
    Structure("StartArrays", "The start of a run.", (
        Field("t", "double", "[s]"),
        Field("q_D", _IN, "(n_qD,)"),
        Field("v_D", _IN, "(n_vD,)"),
        Field("slip", _IN, "(n_strings,) [m]"),
        Field("p", _IN, "(n_p,)"),
        Field("winches", _IN, "(n_strings, WinchLayout::width)"),
        Field("input", "InputArrays"),
        Field("options", "Options"),
        Field("save_at", _IN, "(n_save,) times of samples, event-driven; must outlive the run [s]"),
        Field("n_save", _MANY),
        Field("save_every", "int", "fixed steps from sample to sample"),
    )),
    Structure("RunProgress", "How far a run is.", (
        Field("steps", _MANY, "taken"),
        Field("t", "double", "reached [s]"),
        Field("violation", "double", "largest so far, of fixed steps [m or rad]"),
    )),
    Structure("Shared", "An array of every trajectory.", (
        Field("first", _IN, "or null"),
        Field("stride", _MANY, "from one trajectory to the next; 0 where all share one"),
    )),
    Structure("BatchArrays", "A batch: its starts and where its samples go.", (
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
        Field("p", "Shared"),
        Field("winches", _IN, "of all"),
        Field("options", "Options"),
        Field("save_every", "int", "fixed steps from sample to sample"),
        Field("save_at", _IN, "(n_samples,) times of event-driven samples, from t to t_end [s]"),
        Field("n_samples", _MANY, "of a trajectory"),
        Field("parts", f"void*[{len(PARTS)}]", "(n, n_samples, width) or null; taut in bytes"),
        Field("status", "int*", "(n,) Status"),
        Field("reached", _OUT, "(n,) [s]"),
        Field("violation", _OUT, "(n,) largest, of fixed steps"),
        Field("catches", "long long*", "(n,)"),
        Field("releases", "long long*", "(n,)"),
        Field("blame", _OUT, "(n, n_rows + n_watched)"),
        Field("end_q_D", _OUT, "(n, n_qD) the configuration reached"),
        Field("end_v_D", _OUT, "(n, n_vD) the velocities there"),
    )),
    Structure("StepperArrays", "Trajectories that are advanced piece by piece, and one piece.", (
        Field("n", _MANY, "trajectories"),
        Field("duration", "double", "of the piece; 0 only begins those that are fresh [s]"),
        Field("options", "Options"),
        Field("winches", _IN, "of all"),
        Field("acc_K", "Shared", "(n_vK,) held over the piece"),
        Field("u_D", "Shared", "(n_vD,) held over the piece, or null"),
        Field("fresh", "unsigned char*",
              "(n,) those that begin anew where the arrays say; cleared"),
        Field("p", _IN, "(n, n_p)"),
        Field("q_D", _OUT, "(n, n_qD) the present state, and then that reached; so the others"),
        Field("v_D", _OUT, "(n, n_vD)"),
        Field("q_K", _OUT, "(n, n_qK)"),
        Field("v_K", _OUT, "(n, n_vK)"),
        Field("slip", _OUT, "(n, n_strings)"),
        Field("tension", _OUT, "(n, n_rows) written"),
        Field("taut", "unsigned char*", "(n, n_rows) written"),
        Field("books", _OUT, "(n, 5) work, damping, impact, slip loss, friction; written [J]"),
        Field("violation", _OUT, "(n,) largest since it began; written"),
        Field("advanced", _OUT, "(n,) time by which it was advanced in the piece; written [s]"),
        Field("status", "int*", "(n,) Status; written"),
        Field("blame", _OUT, "(n, n_rows + n_watched) shares of the blame for it; written"),
    )),
    Structure("StepContact", "A point that pushes in a fixed step, in its mode.", (
        Field("pair", "int", "of ContactArrays"),
        Field("feature", "int", "which of the pair's points"),
        Field("links", "int[2]", "of the two solids; -1 for the world"),
        Field("sticks", "int", "else it slides"),
        Field("turns", "int", "whether the direction of sliding turns with the velocity"),
        Field("friction", "double", "coefficient"),
        Field("gap", "double", "[m]"),
        Field("closes", "double", "d(gap speed)/d(gap) that the step asks for [1/s]"),
        Field("bounces", "double", "restitution that it asks for"),
        Field("at", "double[3]", "place in the world [m]"),
        Field("normal", "double[3]", "from the second solid to the first"),
        Field("force", "double[3]", "on the first solid [N]"),
        Field("velocity", "double[3]", "of the first solid against the second after it [m/s]"),
        Field("along", "double[3]", "direction of sliding; 0 where it sticks"),
        Field("by", "double[42]",
              "(7, 6) gap, place and normal by a twist of the first link about the origin"),
    )),
    Structure("TouchingStepArrays", "First time steps with contact, one for each node.", (
        Field("options", "Options"),
        Field("winches", _IN, "of all"),
        Field("reference_force", "double", "a weight [N]"),
        Field("room", "int", "for points of a node"),
        Field("p", "Shared"),
        Field("acc_K", "Shared", "at the start"),
        Field("u_D", "Shared", "or null"),
        Field("q_D", _IN, "(n, n_qD) starts"),
        Field("v_D", _IN, "(n, n_vD)"),
        Field("q_K", _IN, "(n, n_qK)"),
        Field("v_K", _IN, "(n, n_vK)"),
        Field("rate", _IN, "(n, n_vK) dq_K/dt over the step"),
        Field("mean", _IN, "(n, n_vK) dv_K/dt over the step"),
        Field("q_D_next", _OUT, "(n, n_qD) after the step; so the others"),
        Field("v_D_next", _OUT, "(n, n_vD)"),
        Field("q_K_next", _OUT, "(n, n_qK)"),
        Field("v_K_next", _OUT, "(n, n_vK)"),
        Field("tension", _OUT, "(n, n_rows)"),
        Field("status", "int*", "(n,) Status"),
        Field("edges", "int*", "(n,) StepEdge"),
        Field("n_points", "int*", "(n,) that push"),
        Field("points", "StepContact*", "(n, room)"),
        Field("screws", _OUT, "(n, n_vD + n_vK, 6) at the start, as the function of this name"),
        Field("by_p", _OUT,
              "(n, n_links + n_vD + n_vK, 6, n_p) twists of links and changes of screws by the "
              "parameters; null without any"),
    )),
    Structure("StepDerivativeArrays", "Time steps and their derivatives, one for each node.", (
        Field("dt", "double", "length of all steps [s]"),
        Field("recovery_speed", "double", "as in Options [m/s]"),
        Field("forces", "int", "whether to differentiate by u_D, too"),
        Field("p", "Shared"),
        Field("u_D", "Shared", "or null"),
        Field("q_D", _IN, "(n, n_qD) starts"),
        Field("v_D", _IN, "(n, n_vD)"),
        Field("q_K", _IN, "(n, n_qK)"),
        Field("rate", _IN, "(n, n_vK) dq_K/dt over the step"),
        Field("mean", _IN, "(n, n_vK) dv_K/dt over the step"),
        Field("tension", _IN, "(n, n_rows) of the step"),
        Field("held", "const unsigned char*", "(n, n_rows) rows that the step holds"),
        Field("acc_D", _OUT, "(n, n_vD) mean acceleration over the step"),
        Field("motion", _OUT,
              "(n, 2 n_vD, m) of (dq_D, v_D) after the step by q_D, v_D, q_K, v_K, acc_K, u_D if "
              "asked for, and p; of driven rotations by rate and mean"),
        Field("pull", _OUT, "(n, n_rows, m) of the tensions; null: not asked for"),
        Field("n_points", _INT, "(n,) points that push; null without contact"),
        Field("room", "int", "for points of a node"),
        Field("points", "const StepContact*", "(n, room)"),
        Field("screws", _IN, "as in TouchingStepArrays"),
        Field("by_p", _IN, "likewise"),
        Field("edges", "int*", "(n,) StepEdge; added to"),
    )),
    Structure("ClearanceArrays", "Solids and pairs of them whose clearance is measured.", (
        Field("n_moving", _MANY),
        Field("n_standing", _MANY),
        Field("n_pairs", _MANY),
        Field("moving", "const Solid*", "against all standing solids"),
        Field("standing", "const Solid*"),
        Field("pairs", _INT, "(n_pairs, 2) of moving solids, against one another"),
        Field("left_out", "const unsigned char*",
              "(n_moving, n_standing) those that are not measured against one another"),
        Field("string_radius", _IN, "(n_strings,) against standing solids; negative: not measured"),
        Field("exact", "double(const Solid*, const Solid*)",
              "distance of two solids one of which is a mesh, without radii; null without mesh"),
    )),
    Structure("GoalArrays", "A goal.", (
        Field("kind", "int", "GoalKind"),
        Field("link", "int", "of a point"),
        Field("low", _IN, "(n_qD,) of a pose; an orientation is at low, with its first weight"),
        Field("high", _IN, "(n_qD,)"),
        Field("weight", _IN, "(n_vD,)"),
        Field("v_D", _IN, "(n_vD,) target"),
        Field("v_K", _IN, "(n_vK,) target"),
        Field("at", "double[3]", "the point in its link's frame [m]"),
        Field("place", "double[3]", "low corner of the box it must reach [m]"),
        Field("place_high", "double[3]", "high corner [m]"),
        Field("speed_weight", "double", "of the error of v_D [s]"),
        Field("driven_weight", "double", "of the error of v_K [s]"),
        Field("tolerance", "double", "of the distance; negative: never stop at the goal"),
        Field("n_touches", "int", "touches that are asked for"),
        Field("touches", _INT, "(n_pairs,) of contact: the touch that a pair is part of, or -1"),
        Field("open", "double", "added to the distance while some touch does not push"),
    )),
    Structure("FunnelArrays", "An equilibrium and the gains of the feedback to it.", (
        Field("q_D", _IN, "(n_qD,)"),
        Field("q_K", _IN, "(n_qK,)"),
        Field("gains", _IN, "(n_vK, 2 n_vD + 2 n_vK) on (dq_D, v_D, dq_K, v_K)"),
    )),
    Structure("BoundArrays", "Bounds of the driven coordinates.", (
        Field("speed", _IN, "(n_vK,)"),
        Field("acceleration", _IN, "(n_vK,)"),
        Field("low", _IN, "(n_qK,)"),
        Field("high", _IN, "(n_qK,)"),
    )),
    Structure("SegmentArrays", "Results of every segment: (n, segments, width).", (
        Field("q_D", _OUT, "at its end"),
        Field("v_D", _OUT),
        Field("slip", _OUT),
        Field("q_K", _OUT),
        Field("v_K", _OUT),
        Field("distance", _OUT, "to the goal there"),
        Field("looks", "int*", "it lasted; 0 where there is none"),
        Field("catches", "int*", "of strings and limits"),
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
        Field("kept_off", "const unsigned char*",
              "(n_pairs,) of contact: those that must not touch; null: none"),
        Field("goal", "GoalArrays"),
        Field("out", "SegmentArrays"),
    )),
    Structure("RolloutProgress", "What the threads that simulate rollouts share.", (
        Field("next", _MANY, "next rollout to simulate"),
        Field("reached", _MANY, "first rollout at the goal; n while none is; -1 abandons all"),
    )),
)  # fmt: skip
"""Each comes after those that it holds."""
