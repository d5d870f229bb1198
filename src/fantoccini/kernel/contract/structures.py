"""Every structure that Python and compiled code share, field by field: those of runs here."""

from __future__ import annotations

from fantoccini.kernel.contract.derivative_structures import DERIVATIVES
from fantoccini.kernel.contract.lanes import LANE
from fantoccini.kernel.contract.samples import PARTS
from fantoccini.kernel.contract.search_structures import SEARCHES
from fantoccini.kernel.contract.structure import IN, INT, MANY, OUT, Field, Structure

RUNS: tuple[Structure, ...] = (
    Structure(
        "InputArrays",
        "An input: arrays in C order.",
        (
            Field("n_segments", "int", "pieces"),
            Field("breaks", IN, "(n_segments + 1,) [s]"),
            Field("coef", IN, "(n_segments, n_vK, 6)"),
            Field("base", IN, "(n_segments, n_qK)"),
            Field("force", IN, "(n_segments, n_vD, 6) or null"),
        ),
    ),
    Structure(
        "Hull",
        "A convex polytope around the origin.",
        (
            Field("n_vertices", "int"),
            Field("n_facets", "int"),
            Field("n_edges", "int"),
            Field("inner", "double", "radius of the largest ball about the origin inside [m]"),
            Field("outer", "double", "radius of the smallest ball about the origin around it [m]"),
            Field("vertices", IN, "(n_vertices, 3) [m]"),
            Field("planes", IN, "(n_facets, 4) outward unit normal; height above the origin [m]"),
            Field("begins", INT, "(n_facets + 1,) where the corners of each facet begin"),
            Field(
                "corners", INT, "vertices of each facet in turn, anticlockwise seen from outside"
            ),
            Field("sides", INT, "the edge from each corner to the next"),
            Field("edges", INT, "(n_edges, 4) two vertices, the facets to the left and right"),
            Field("around_begins", INT, "(n_vertices + 1,) where the facets of each vertex begin"),
            Field("around", INT, "facets of each vertex"),
        ),
    ),
    Structure(
        "Solid",
        "A solid in the frame of a link or of the world.",
        (
            Field("kind", "int", "SolidKind"),
            Field("link", "int", "-1 for the world"),
            Field(
                "mesh",
                MANY,
                "index of the hull, or of the mesh that this box encloses; or negative",
            ),
            Field("a", "double[3]"),
            Field("b", "double[3]"),
            Field("R", "double[9]", "column by column"),
            Field("half", "double[3]"),
            Field("radius", "double", "[m]"),
            Field("hull", "const Hull*", "null but for hulls"),
        ),
    ),
    Structure(
        "ContactArrays",
        "Solids that may touch, and how.",
        (
            Field("n_solids", MANY),
            Field("n_pairs", MANY),
            Field("n_groups", MANY),
            Field("solids", "const Solid*", "those of the links, then those that stand"),
            Field("pairs", INT, "(n_pairs, 2) of solids; the second may stand in the world"),
            Field(
                "groups",
                INT,
                "(n_groups, 3) of pairs of the same two links, or of a link and a solid that "
                "stands: first link; second link, or -1 - the solid; where the pairs end",
            ),
            Field("friction", IN, "(n_pairs,) coefficient of Coulomb's law"),
            Field("restitution", IN, "(n_pairs,) 0 to 1"),
            Field("meetings", INT, "(n_pairs,) the first pair of parts of the same two names"),
        ),
    ),
    Structure(
        "Options",
        "Options of a run.",
        (
            Field("rtol", "double", "of the event-driven integrator"),
            Field("atol", "double", "likewise"),
            Field("first_step", "double", "[s]"),
            Field("max_step", "double", "[s]"),
            Field("tension_cap", "double", "[N]; times 1 m of a limit, times 1 s of an impulse"),
            Field("energy_scale", "double", "size of the work and loss integrals, for errors [J]"),
            Field("force_scale", "double", "size of forces that balance, M_DD one [kg^1/2 m/s^2]"),
            Field(
                "recovery_speed", "double", "cap on how fast time-stepping undoes a violation [m/s]"
            ),
            Field("dt", "double", "fixed step [s]"),
            Field("max_steps", MANY),
            Field("max_events", MANY),
            Field("save_steps", "int", "save every accepted step"),
            Field("extrapolate", "int", "time-stepping: velocity products half a step ahead"),
            Field("contacts", "const ContactArrays*", "null without contact; must outlive the run"),
        ),
    ),
    Structure(
        "RecordArrays",
        "Where a run writes samples and events.",
        (
            Field("samples", OUT, "(sample_capacity, SampleLayout::width)"),
            Field("sample_capacity", MANY),
            Field("n_samples", MANY, "written"),
            Field("events", OUT, "(event_capacity, EventLayout::width)"),
            Field("event_capacity", MANY),
            Field("n_events", MANY, "written"),
            Field("contacts", OUT, "(contact_capacity, ContactLayout::width)"),
            Field("contact_capacity", MANY),
            Field("n_contacts", MANY, "written"),
        ),
    ),
    Structure(
        "StartArrays",
        "The start of a run.",
        (
            Field("t", "double", "[s]"),
            Field("q_D", IN, "(n_qD,)"),
            Field("v_D", IN, "(n_vD,)"),
            Field("slip", IN, "(n_strings,) [m]"),
            Field("p", IN, "(n_p,)"),
            Field("winches", IN, "(n_strings, WinchLayout::width)"),
            Field("input", "InputArrays"),
            Field("options", "Options"),
            Field(
                "save_at", IN, "(n_save,) times of samples, event-driven; must outlive the run [s]"
            ),
            Field("n_save", MANY),
            Field("save_every", "int", "fixed steps from sample to sample"),
        ),
    ),
    Structure(
        "RunProgress",
        "How far a run is.",
        (
            Field("steps", MANY, "taken"),
            Field("t", "double", "reached [s]"),
            Field("violation", "double", "largest so far, of fixed steps [m or rad]"),
        ),
    ),
    Structure(
        "Shared",
        "An array of every trajectory.",
        (
            Field("first", IN, "or null"),
            Field("stride", MANY, "from one trajectory to the next; 0 where all share one"),
        ),
    ),
    Structure(
        "BatchArrays",
        "A batch: its starts and where its samples go.",
        (
            Field("n", MANY, "trajectories"),
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
            Field("winches", IN, "of all"),
            Field("options", "Options"),
            Field("save_every", "int", "fixed steps from sample to sample"),
            Field("save_at", IN, "(n_samples,) times of event-driven samples, from t to t_end [s]"),
            Field("n_samples", MANY, "of a trajectory"),
            Field("parts", f"void*[{len(PARTS)}]", "(n, n_samples, width) or null; taut in bytes"),
            Field("status", "int*", "(n,) Status"),
            Field("reached", OUT, "(n,) [s]"),
            Field("violation", OUT, "(n,) largest, of fixed steps"),
            Field("catches", "long long*", "(n,)"),
            Field("releases", "long long*", "(n,)"),
            Field("blame", OUT, "(n, n_rows + n_watched)"),
            Field("end_q_D", OUT, "(n, n_qD) the configuration reached"),
            Field("end_v_D", OUT, "(n, n_vD) the velocities there"),
        ),
    ),
    Structure(
        "StepperArrays",
        "Trajectories that are advanced piece by piece, and one piece.",
        (
            Field("n", MANY, "trajectories"),
            Field("duration", "double", "of the piece; 0 only begins those that are fresh [s]"),
            Field("options", "Options"),
            Field("winches", IN, "of all"),
            Field("acc_K", "Shared", "(n_vK,) held over the piece"),
            Field("u_D", "Shared", "(n_vD,) held over the piece, or null"),
            *LANE,
        ),
    ),
)

STRUCTURES = RUNS + DERIVATIVES + SEARCHES
"""Each comes after those that it holds."""
