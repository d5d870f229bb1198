"""The three methods of a run, each with its own options.

At a catch a slack string becomes taut, with an impulse; at a release its tension falls to 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from fantoccini.base import check_positive

MethodName = Literal["event", "timestepping", "variational"]


class _Options:
    """Options of a method; numbers are checked on construction."""

    name: ClassVar[MethodName]

    def __post_init__(self) -> None:
        check_positive(**{k: x for k, x in self.options.items() if k != "extrapolate"})

    @property
    def options(self) -> dict[str, Any]:
        """Run options that the method sets."""
        return dict(vars(self))


@dataclass(frozen=True)
class Event(_Options):
    """Event-driven method: adaptive order 8 between located events, with exact impulses.

    Attributes:
        rtol, atol: tolerances of the integrator.
        max_step: largest step of the integrator [s].

    Raises:
        ValueError: a number is not positive and finite.
    """

    rtol: float = 1e-11
    atol: float = 1e-11
    max_step: float = 0.1

    name: ClassVar[MethodName] = "event"


@dataclass(frozen=True)
class TimeStepping(_Options):
    """Fixed steps that include catches and releases: for interaction, planning and batches.

    Attributes:
        dt: length of the steps [s].
        extrapolate: whether velocity products are extrapolated by half a step, from earlier
            accelerations, which keeps the energy of spinning bodies. Otherwise each step depends on
            its state alone, so that a run continues from any sample to the same bits.

    Raises:
        ValueError: the step is not positive and finite.
    """

    dt: float = 0.002
    extrapolate: bool = True

    name: ClassVar[MethodName] = "timestepping"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.extrapolate, bool):
            raise ValueError(f"extrapolate is {self.extrapolate!r}; it must be True or False")


@dataclass(frozen=True)
class Variational(_Options):
    """Fixed steps of second order whose energy does not drift, with exact lengths at every step.

    Attributes:
        dt: step [s].

    Raises:
        ValueError: the step is not positive and finite.
    """

    dt: float = 0.002

    name: ClassVar[MethodName] = "variational"


Method = Event | TimeStepping | Variational

METHODS: dict[str, type[Method]] = {kind.name: kind for kind in (Event, TimeStepping, Variational)}


def as_method(method: Method | MethodName, **options: Any) -> Method:
    """A method with its name and options; a method object is returned unchanged.

    Raises:
        ValueError: there is no such method, or it has no such option.
    """
    if isinstance(method, Method) and not options:
        return method
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(
            f"method is {method!r}; it must be one of {', '.join(map(repr, METHODS))}, or "
            "fan.Event(...), fan.TimeStepping(...) or fan.Variational(...)"
        )
    kind = METHODS[method]
    fields = kind.__dataclass_fields__
    for name in options:
        if name not in fields:
            raise ValueError(
                f"method={method!r} has no option {name}; allowed: {', '.join(fields)}"
            )
    return kind(**options)
