"""The structures shared with the compiled library, for ctypes and NumPy."""

from __future__ import annotations

import ctypes
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.arrays import Array, check_positive
from fantoccini.contract import STRUCTURES, Structure
from fantoccini.motion import Input
from fantoccini.runtime.functions import pointer, whole

if TYPE_CHECKING:
    from fantoccini.runtime.contacts import Contacts

UNLIMITED = 1e300
"""A bound that never binds, for compiled code."""

_NUMBERS = {"int": ctypes.c_int, "long long": ctypes.c_longlong, "double": ctypes.c_double}


class Numbers(ctypes.Structure):
    """A C structure that refuses integers too large for their fields."""

    def __setattr__(self, name: str, value: Any) -> None:
        kind = next((field[1] for field in self._fields_ if field[0] == name), None)
        if kind is ctypes.c_int or kind is ctypes.c_longlong:
            value = whole(name, value, kind)
        super().__setattr__(name, value)


def _made() -> dict[str, type[ctypes.Structure]]:
    """The ctypes classes of all structures, by name."""
    made: dict[str, type[ctypes.Structure]] = {}
    for structure in STRUCTURES:
        fields = [(field.name, _type(field.type, made)) for field in structure.fields]
        made[structure.name] = type(structure.name, (Numbers,), {"_fields_": fields})
    return made


def _type(text: str, made: dict[str, type[ctypes.Structure]]) -> Any:
    """The ctypes class of a field's C++ type."""
    if match := re.fullmatch(r"(.+)\[(\d+)\]", text):
        return _type(match[1], made) * int(match[2])
    if match := re.fullmatch(r"(.+?)\((.*)\)", text):
        arguments = (_type(argument, made) for argument in match[2].split(","))
        return ctypes.CFUNCTYPE(_type(match[1], made), *arguments)
    if text.endswith("*"):
        return ctypes.c_void_p
    return _NUMBERS.get(text) or made[text]


structures: dict[str, type[ctypes.Structure]] = _made()
"""ctypes classes by name."""


def dtype_of(structure: Structure) -> np.dtype[np.void]:
    """The NumPy dtype of a structure of numbers and arrays of them."""
    found = ((f.name, _type(f.type, structures)) for f in structure.fields)
    return np.dtype(list(found), align=True)


@dataclass(frozen=True)
class RunOptions:
    """Options of a run; see :func:`fantoccini.simulation.simulate` for their meaning.

    Attributes:
        rtol, atol: tolerances of the event-driven integrator.
        first_step, max_step: its step sizes [s].
        tension_cap: [N]; times 1 m of a limit, times 1 s of an impulse.
        energy_scale: size of the energies the integrals are compared with [J].
        force_scale: size of the forces that balance at rest, where M_DD is one [kg^1/2 m/s^2].
        recovery_speed: cap on how fast time-stepping undoes a violation [m/s].
        dt: step of the methods with a fixed one [s].
        max_steps, max_events: bounds.
        save_steps: save every accepted step of the event-driven integrator.
        save_every: fixed steps from sample to sample.
        max_memory: for the samples and events of one run [bytes]; half of what is free when None.
        extrapolate: time-stepping takes velocity products half a step ahead.
        contacts: solids that may touch, of time-stepping; None where nothing touches anything.

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
            object.__setattr__(self, name, whole(name, getattr(self, name), kind, least=1))
        if self.max_memory is not None and not self.max_memory > 0:
            raise ValueError(f"max_memory is {self.max_memory}; it must be positive [bytes]")

    def structure(self) -> ctypes.Structure:
        """The options for the library."""
        options = structures["Options"]
        given = {field[0]: getattr(self, field[0]) for field in options._fields_}
        if self.contacts is not None:
            given["contacts"] = ctypes.addressof(self.contacts.structure)
        return options(**given)


def input_arrays(inputs: Input) -> tuple[ctypes.Structure, list[Array]]:
    """The structure, and the arrays that must live as long as it is read."""
    given = {name: getattr(inputs, name) for name in ("breaks", "coef", "base", "force")}
    held = {n: np.ascontiguousarray(a, dtype=float) for n, a in given.items() if a is not None}
    addresses = {name: pointer(a) for name, a in held.items()}
    return structures["InputArrays"](n_segments=len(inputs.coef), **addresses), [*held.values()]
