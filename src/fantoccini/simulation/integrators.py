"""Names of the integrators that event-driven runs can be made with, beside the compiled one.

SciPy's integrators take as long to import as all the rest of the package, so only what uses them
imports them.
"""

INTEGRATORS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
"""SciPy's methods."""
