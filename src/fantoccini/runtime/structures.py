"""The structures that Python and the shared library share: ``options.hpp``, ``drive.hpp`` and
``record.hpp``."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.motion import Input
from fantoccini.runtime.functions import Numbers, pointer, whole

UNLIMITED = 1e300
"""A bound that is none, as the runtime has it."""


class InputArrays(Numbers, ctypes.Structure):
    _fields_ = [
        ("n_segments", ctypes.c_int),
        ("breaks", ctypes.c_void_p),
        ("coef", ctypes.c_void_p),
        ("base", ctypes.c_void_p),
        ("force", ctypes.c_void_p),
    ]


class Options(Numbers, ctypes.Structure):
    _fields_ = [
        ("rtol", ctypes.c_double),
        ("atol", ctypes.c_double),
        ("first_step", ctypes.c_double),
        ("max_step", ctypes.c_double),
        ("tension_cap", ctypes.c_double),
        ("energy_scale", ctypes.c_double),
        ("force_scale", ctypes.c_double),
        ("recovery_speed", ctypes.c_double),
        ("dt", ctypes.c_double),
        ("max_steps", ctypes.c_longlong),
        ("max_events", ctypes.c_longlong),
        ("save_steps", ctypes.c_int),
        ("extrapolate", ctypes.c_int),
    ]


class Record(Numbers, ctypes.Structure):
    _fields_ = [
        ("rows", ctypes.c_void_p),
        ("row_capacity", ctypes.c_longlong),
        ("n_rows", ctypes.c_longlong),
        ("events", ctypes.c_void_p),
        ("event_capacity", ctypes.c_longlong),
        ("n_events", ctypes.c_longlong),
    ]


@dataclass(frozen=True)
class RunOptions:
    """Numbers that steer a run; see :func:`fantoccini.simulation.simulate` for their meaning.

    Attributes:
        rtol, atol: tolerances of the event-driven integrator.
        first_step, max_step: its step sizes [s].
        tension_cap: [N]; also of impulses [N s].
        energy_scale: size of the energies the integrals are compared with [J].
        force_scale: size of the forces that balance at rest, where M_DD is one [kg^1/2 m/s^2].
        recovery_speed: time-stepping's cap on taking back a violation [m/s].
        dt: step of the methods with a fixed one [s].
        max_steps, max_events: bounds.
        save_steps: write every accepted step of the event-driven integrator.
        save_every: write every so many of these steps.
        max_memory: for the rows and events of one run [bytes]; half of what is free when not given.
        extrapolate: time-stepping takes velocity products half a step on.

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

    def __post_init__(self) -> None:
        for name in ("rtol", "atol", "first_step", "max_step", "dt"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; it must be positive")
        for name, kind in (
            ("save_every", ctypes.c_int),
            ("max_steps", ctypes.c_longlong),
            ("max_events", ctypes.c_longlong),
        ):
            object.__setattr__(self, name, whole(name, getattr(self, name), kind, least=1))
        if self.max_memory is not None and not self.max_memory > 0:
            raise ValueError(f"max_memory is {self.max_memory}; it must be positive [bytes]")

    def structure(self) -> Options:
        """As the library takes them."""
        names = [name for name, _ in Options._fields_]
        return Options(**{name: getattr(self, name) for name in names})


def input_arrays(inputs: Input) -> tuple[InputArrays, list[Array]]:
    """The structure, and the arrays that must live as long as it is read."""
    fields = (inputs.breaks, inputs.coef, inputs.base, inputs.force)
    held = [None if a is None else np.ascontiguousarray(a, dtype=float) for a in fields]
    return (
        InputArrays(len(inputs.coef), *(None if a is None else pointer(a) for a in held)),
        held,
    )
