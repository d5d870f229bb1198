"""States of rest: projection, relaxation, descent; vibration modes; plausibility."""

from fantoccini.dynamics.equilibrium import equilibrium, initial_state, projection
from fantoccini.dynamics.equilibrium.initial_state import Values
from fantoccini.dynamics.equilibrium.plausible import InputWarning, input_warnings, warnings
from fantoccini.dynamics.equilibrium.vibration import Mode, Modes, modes

__all__ = [
    "InputWarning",
    "Mode",
    "Modes",
    "Values",
    "equilibrium",
    "initial_state",
    "input_warnings",
    "modes",
    "projection",
    "warnings",
]
