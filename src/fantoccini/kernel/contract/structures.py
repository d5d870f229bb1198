"""All structures that Python and compiled code share; those of runs are declared here.

D stands for dynamic coordinates, K for driven ones. `breaks` are the times at which pieces of an
input meet, and `coef` their coefficients; a winch changes the length of a string. A link is a body
on its joint.
"""

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
            Field("n_segments", "int", "number of pieces"),
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
            Field("inner", "double", "radius of the largest ball about the origin in it [m]"),
            Field("outer", "double", "radius of the smallest ball about the origin around it [m]"),
            Field("vertices", IN, "(n_vertices, 3) [m]"),
            Field("planes", IN, "(n_facets, 4) outward unit normal; height above the origin [m]"),
            Field("begins", INT, "(n_facets + 1,) index of each facet's first corner"),
            Field(
                "corners", INT, "vertices of each facet in turn, anticlockwise seen from outside"
            ),
            Field("sides", INT, "edge from each corner to the next"),
            Field("edges", INT, "(n_edges, 4) two vertices, the facets to the left and right"),
            Field("around_begins", INT, "(n_vertices + 1,) index of each vertex's first facet"),
            Field("around", INT, "facets of each vertex in turn"),
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
            Field("hull", "const Hull*", "polytope of a HULL; otherwise null"),
        ),
    ),
    Structure(
        "ContactArrays",
        "Solids that may touch, and the contact laws of their pairs.",
        (
            Field("n_solids", MANY),
            Field("n_pairs", MANY),
            Field("n_groups", MANY),
            Field("solids", "const Solid*", "solids of the links, then solids fixed in the world"),
            Field("pairs", INT, "(n_pairs, 2) solids; the second may be fixed in the world"),
            Field(
                "groups",
                INT,
                "(n_groups, 3) groups of pairs of the same two links, or of a link and a fixed "
                "solid: first link; second link, or -1 - the solid; end of its pairs",
            ),
            Field("friction", IN, "(n_pairs,) coefficient of Coulomb's law"),
            Field("restitution", IN, "(n_pairs,) 0 to 1"),
            Field("meetings", INT, "(n_pairs,) first pair of parts with the same two names"),
        ),
    ),
    Structure(
        "Options",
        "Options of a run.",
        (
            Field("rtol", "double", "relative tolerance of the event-driven integrator"),
            Field("atol", "double", "absolute tolerance, likewise"),
            Field("first_step", "double", "[s]"),
            Field("max_step", "double", "[s]"),
            Field("tension_cap", "double", "[N]; for limits [N m], for impulses [N s]"),
            Field("energy_scale", "double", "scale of work and loss integrals, for errors [J]"),
            Field("force_scale", "double", "scale of forces in coordinates with M_DD = 1"),
            Field(
                "recovery_speed",
                "double",
                "largest speed at which time-stepping removes a violation [m/s]",
            ),
            Field("dt", "double", "fixed step [s]"),
            Field("max_steps", MANY),
            Field("max_events", MANY),
            Field("save_steps", "int", "whether to save every accepted step"),
            Field(
                "extrapolate",
                "int",
                "time-stepping: whether velocity products are half a step ahead",
            ),
            Field("contacts", "const ContactArrays*", "null without contact; must outlive the run"),
        ),
    ),
    Structure(
        "RecordArrays",
        "Memory for the samples and events of a run.",
        (
            Field("samples", OUT, "(sample_capacity, SampleLayout::width)"),
            Field("sample_capacity", MANY),
            Field("n_samples", MANY, "number of samples written"),
            Field("events", OUT, "(event_capacity, EventLayout::width)"),
            Field("event_capacity", MANY),
            Field("n_events", MANY, "number of events written"),
            Field("contacts", OUT, "(contact_capacity, ContactLayout::width)"),
            Field("contact_capacity", MANY),
            Field("n_contacts", MANY, "number of contact points written"),
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
        "Progress of a run.",
        (
            Field("steps", MANY, "number of steps taken"),
            Field("t", "double", "time reached [s]"),
            Field("violation", "double", "largest violation of fixed steps so far [m or rad]"),
        ),
    ),
    Structure(
        "Shared",
        "An array for every trajectory, or one that all share.",
        (
            Field("first", IN, "array of the first trajectory, or null"),
            Field("stride", MANY, "distance of neighbouring trajectories' arrays; 0 if shared"),
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
            Field("attribution", OUT, "(n, n_rows + n_watched)"),
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
"""Structures in the order of declaration: each after those that it contains."""
