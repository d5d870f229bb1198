"""States of rest: projection, relaxation, descent; vibration modes; plausibility.

V is the potential energy. A row is a string or a joint limit with its gap h <= 0 (path length minus
string length); it is taut if h = 0. q_D are the dynamic coordinates, which a search moves, and q_K
the driven ones, which it keeps: ends and lengths of strings, driven joints.
"""

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
