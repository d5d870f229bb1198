"""Options of a run, for compiled code.

M_DD is the inertia matrix of the dynamic coordinates.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from fantoccini.base import check_positive
from fantoccini.kernel.runtime.contacts import Contacts
from fantoccini.kernel.runtime.functions import checked_integer
from fantoccini.kernel.runtime.packing import packed
from fantoccini.kernel.runtime.structures import structures


@dataclass(frozen=True)
class RunOptions:
    """Options of a run; see :func:`fantoccini.dynamics.simulate` for their meaning.

    Attributes:
        rtol, atol: tolerances of the event-driven integrator.
        first_step, max_step: its step sizes [s].
        tension_cap: largest tension [N]; times 1 m for a limit, times 1 s for an impulse.
        energy_scale: typical energy, for tolerances of the integrals [J].
        force_scale: typical force at rest in units in which M_DD is 1 [kg^1/2 m/s^2].
        recovery_speed: largest speed at which time-stepping corrects a violation [m/s].
        dt: step of the methods with a fixed one [s].
        max_steps, max_events: largest numbers of steps and events.
        save_steps: whether to save every accepted step of the event-driven integrator.
        save_every: number of fixed steps between samples.
        max_memory: bound for samples and events of one run [bytes]; None: half of the free memory.
        extrapolate: whether time-stepping takes velocity products half a step ahead.
        contacts: solids that may touch, for time-stepping; None without contact.

    Raises:
        ValueError: a tolerance, a step or a bound is not positive and finite, or a number of steps
            or events is more than the runtime can count.
    """

    rtol: float
    atol: float
    first_step: float
    max_step: float
    tension_cap: float
    energy_scale: float
    force_scale: float
    recovery_speed: float
    dt: float
    max_steps: int
    max_events: int
    save_steps: bool
    save_every: int = 1
    max_memory: float | None = None
    extrapolate: bool = True
    contacts: Contacts | None = None

    def __post_init__(self) -> None:
        for name in ("rtol", "atol", "first_step", "max_step", "dt"):
            check_positive(**{name: getattr(self, name)})
        for name, kind in (
            ("save_every", ctypes.c_int),
            ("max_steps", ctypes.c_longlong),
            ("max_events", ctypes.c_longlong),
        ):
            object.__setattr__(
                self, name, checked_integer(name, getattr(self, name), kind, minimum=1)
            )
        if self.max_memory is not None and not self.max_memory > 0:
            raise ValueError(f"max_memory is {self.max_memory}; it must be positive [bytes]")

    def structure(self) -> ctypes.Structure:
        """The options for the library."""
        fields = {name: getattr(self, name) for name, *_ in structures["Options"]._fields_}
        if self.contacts is not None:
            fields["contacts"] = self.contacts.structure
        return packed("Options", **fields)
