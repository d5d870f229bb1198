"""A generated function: its arguments, its results and the libraries that contain it.

q_D and v_D are the dynamic coordinates and velocities, q_K and v_K the driven ones, and p the
parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.kernel.contract.arguments import ARGUMENTS
from fantoccini.kernel.contract.quantity import Quantity

MODEL, LANES, CLEARANCE, ROLLOUTS = "model", "lanes", "clearance", "rollouts"
VARIATIONAL, VARIATIONAL_LANES, DERIVATIVES = "variational", "variational_lanes", "derivatives"
STEP_DERIVATIVES, GRADIENTS = "step_derivatives", "gradients"
VARIATIONAL_DERIVATIVES, REACH = "variational_derivatives", "reach"
LIBRARIES = (
    MODEL,
    LANES,
    CLEARANCE,
    ROLLOUTS,
    VARIATIONAL,
    VARIATIONAL_LANES,
    DERIVATIVES,
    STEP_DERIVATIVES,
    GRADIENTS,
    VARIATIONAL_DERIVATIVES,
    REACH,
)
"""The libraries of a puppet, each compiled when it is first needed."""


@dataclass(frozen=True)
class Function:
    """One generated function.

    Attributes:
        name: name of the function.
        purpose: purpose in one sentence.
        arguments, results: arguments and results in the order of compiled code.
        libraries: libraries that contain it; if empty, CasADi's interpreter evaluates it.
        mapped: whether Python may call it over whole arrays.
        exported: whether the C99 export contains it.
        needs: size that is above 0 for puppets with this function; empty if all puppets have it.
        standing: results with many constant entries, which are written once.
    """

    name: str
    purpose: str
    arguments: tuple[Quantity, ...]
    results: tuple[Quantity, ...]
    libraries: tuple[str, ...] = ()
    mapped: bool = False
    exported: bool = False
    needs: str = ""
    standing: tuple[str, ...] = ()


FORCE, PER_VELOCITY = "N or N m", "row's unit / s per velocity's unit"
"""Units that depend on the coordinate."""


def arguments(names: str) -> tuple[Quantity, ...]:
    """The arguments with given names, separated by spaces."""
    return tuple(ARGUMENTS[name] for name in names.split())


STATE = arguments("q_D v_D q_K v_K p")
CONFIGURATION = arguments("q_D q_K p")
ROWS = Quantity("h", ("n_rows",), "m", "path length minus string length; limits as listed")
