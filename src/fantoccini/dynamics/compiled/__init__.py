"""A compiled puppet: its libraries and parameters, and functions of one state.

q_D are the dynamic coordinates, which move by the equations of motion, and q_K the driven ones,
given as functions of time (ends and lengths of strings, driven joints); v and acc are velocities
and accelerations. A row is a string or a joint limit with its gap h <= 0; the active set consists
of the taut rows.
"""

from fantoccini.dynamics.compiled import configurations
from fantoccini.dynamics.compiled.accelerations import ForwardDynamics, forward_dynamics
from fantoccini.dynamics.compiled.active_set import ROW_TOLERANCES, ActiveSet, taut_mask
from fantoccini.dynamics.compiled.checks import (
    as_inputs,
    bind_input,
    bind_inputs,
    check_apart,
    check_memory,
    check_samples,
    check_start,
    check_starts,
    check_step,
    check_steps,
    checked_end,
    count_samples,
    refuse_contact,
)
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.configurations import difference, integrate, retract
from fantoccini.dynamics.compiled.contact_geometry import PairGeometry, Touch
from fantoccini.dynamics.compiled.critical_step import critical_step_of_tensions
from fantoccini.dynamics.compiled.evaluation import Evaluation
from fantoccini.dynamics.compiled.flow import Flow
from fantoccini.dynamics.compiled.limits import LIMITS
from fantoccini.dynamics.compiled.mass_check import check_mass_matrix
from fantoccini.dynamics.compiled.methods import (
    Event,
    Method,
    MethodName,
    TimeStepping,
    Variational,
    as_method,
)
from fantoccini.dynamics.compiled.parameter_values import parameter_rows
from fantoccini.dynamics.compiled.portable import PortablePuppet
from fantoccini.dynamics.compiled.screws import (
    OFFSETS,
    PARAMETER_STEP,
    WEIGHTS,
    Screws,
    bracket,
    moving_and_carrying,
)
from fantoccini.dynamics.compiled.touching import TOUCHING_GAP, touching_links
from fantoccini.dynamics.compiled.vector_checks import vector, vectors

__all__ = [
    "LIMITS",
    "OFFSETS",
    "PARAMETER_STEP",
    "ROW_TOLERANCES",
    "TOUCHING_GAP",
    "WEIGHTS",
    "ActiveSet",
    "CompiledPuppet",
    "Evaluation",
    "Event",
    "Flow",
    "ForwardDynamics",
    "Method",
    "MethodName",
    "PairGeometry",
    "PortablePuppet",
    "Screws",
    "TimeStepping",
    "Touch",
    "Variational",
    "as_inputs",
    "as_method",
    "bind_input",
    "bind_inputs",
    "bracket",
    "check_apart",
    "check_mass_matrix",
    "check_memory",
    "check_samples",
    "check_start",
    "check_starts",
    "check_step",
    "check_steps",
    "checked_end",
    "configurations",
    "count_samples",
    "critical_step_of_tensions",
    "difference",
    "forward_dynamics",
    "integrate",
    "moving_and_carrying",
    "parameter_rows",
    "refuse_contact",
    "retract",
    "taut_mask",
    "touching_links",
    "vector",
    "vectors",
]
