"""Derivatives of accelerations, tensions and steps, with contacts in their modes.

d stands for derivatives with respect to the dynamic coordinates q_D, the driven ones q_K (ends and
lengths of strings, driven joints), their velocities v_D and v_K, the driven accelerations acc_K,
user forces u_D and parameters p. A row is a string or a joint limit with its gap h <= 0; it is held
while it is taut. A contact point sticks, slides or is open: its mode.
"""

from fantoccini.dynamics.derivatives.balancing import balanced_state
from fantoccini.dynamics.derivatives.contact_modes import (
    TOLERANCES,
    closed_without_force,
    geometries,
)
from fantoccini.dynamics.derivatives.contact_rows import (
    ContactMode,
    ContactRows,
    HeldPoint,
    HeldRows,
    PointMode,
)
from fantoccini.dynamics.derivatives.contact_state import FrozenModes, motion_at, with_active_set
from fantoccini.dynamics.derivatives.kkt import KKTSystem
from fantoccini.dynamics.derivatives.linearisation import (
    Linearisation,
    Partials,
    linearise,
    rotation_rate_blocks,
    row_derivatives_at,
)
from fantoccini.dynamics.derivatives.mode_system import ModeSystem, solve_in_modes
from fantoccini.dynamics.derivatives.rollout_gradient import Rollout, RolloutGradient, rollout
from fantoccini.dynamics.derivatives.small_motions import SmallMotions
from fantoccini.dynamics.derivatives.step_linearisation import StepLinearisation, linearise_step
from fantoccini.dynamics.derivatives.step_partials import (
    StepInputs,
    StepKeywords,
    StepLinearisations,
    StepOptions,
    linearise_steps,
)

__all__ = [
    "TOLERANCES",
    "ContactMode",
    "ContactRows",
    "FrozenModes",
    "HeldPoint",
    "HeldRows",
    "KKTSystem",
    "Linearisation",
    "ModeSystem",
    "Partials",
    "PointMode",
    "Rollout",
    "RolloutGradient",
    "SmallMotions",
    "StepInputs",
    "StepKeywords",
    "StepLinearisation",
    "StepLinearisations",
    "StepOptions",
    "balanced_state",
    "closed_without_force",
    "geometries",
    "linearise",
    "linearise_step",
    "linearise_steps",
    "motion_at",
    "rollout",
    "rotation_rate_blocks",
    "row_derivatives_at",
    "solve_in_modes",
    "with_active_set",
]
