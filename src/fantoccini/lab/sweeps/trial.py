"""``Trial``: a ready-made study, one simulation per case.

A study is a function that a sweep applies to many cases. q_D and q_K are the dynamic and driven
coordinates of the start. At a catch, a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fantoccini.base import Array, UnknownNameError
from fantoccini.dynamics.compiled import Method, MethodName, as_method
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.lab.sweeps.case import PARAMETER_PREFIX, PUPPET_KEY, Case
from fantoccini.motion import Input, State, Trajectory

INPUTS_KEY = "inputs"
"""Name of the value that selects the inputs."""
METHOD_KEY = "method"
"""Name of the value that selects the method."""
METHOD_OPTIONS = ("rtol", "atol", "max_step", "dt", "extrapolate")
"""Options of methods that can be varied, for example in a convergence study."""
SIMULATE_OPTIONS = ("t_end", "save_every")
"""Arguments of ``simulate`` that can be varied."""


def _integral(t: Array, x: Array) -> float:
    """Integral of a column by the trapezoidal rule."""
    return float(np.sum(0.5 * (x[1:] + x[:-1]) * np.diff(t)))


def _mean(t: Array, x: Array) -> float:
    return _integral(t, x) / (t[-1] - t[0]) if t[-1] > t[0] else float(x[-1])


STATISTICS = {
    "first": lambda t, x: float(x[0]),
    "last": lambda t, x: float(x[-1]),
    "min": lambda t, x: float(np.min(x)),
    "max": lambda t, x: float(np.max(x)),
    "mean": _mean,
    "rms": lambda t, x: float(np.sqrt(_mean(t, x**2))),
    "integral": _integral,
}
"""Functions of times (T,) and a column (T,); ``mean`` and ``rms`` are weighted by time."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A study that simulates each case and returns figures of the run.

    The name of a varied value decides its use: ``puppet`` and ``p:NAME`` go to the puppet,
    ``inputs`` to the inputs, ``t_end``, ``method``, ``dt``, ``rtol`` and the like to
    :func:`fantoccini.simulate`, and names of coordinates and velocities (``hand.length``,
    ``v:elbow``) to the start state. The puppet starts at rest, with its driven coordinates where
    the inputs begin. If a dynamic coordinate or a velocity is given, it starts from the nearest
    state that the strings allow.

    A run that stops before its end is not a failure: ``status`` gives the reason.

    Attributes:
        inputs: an ``Input``, or waypoints, name -> [(t [s], value), ...]; nothing moves when None.
        start: values of the start state, as :meth:`Marionette.state` takes them.
        t_end: end of the runs [s]; that of the inputs when None.
        method: method of the runs, with its options: ``TimeStepping(dt=0.001)``, or a name.
        options: further arguments of ``simulate``, such as ``{"save_every": 10}``.
        keep: columns of :meth:`Trajectory.columns` to return: ``"max tension:hand"``,
            ``"last elbow"``, ``"rms effort:hand.length"``, with one of first, last, min, max, mean,
            rms and integral; or ``"elbow"`` for its values at ``times``, NaN after the run's end.
            The study always returns ``status``, ``end`` [s], ``events``, ``catches``,
            ``max_tension`` [N] and ``max_impulse`` [N s or N m s], over all strings and limits.
        times: (n,) times of columns without a statistic [s].
    """

    inputs: Input | Mapping[str, Sequence[Any]] | None = None
    start: Mapping[str, Any] = field(default_factory=dict)
    t_end: float | None = None
    method: Method | MethodName = "event"
    options: Mapping[str, Any] = field(default_factory=dict)
    keep: Sequence[str] = ()
    times: Sequence[float] | Array = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", np.array(self.times, dtype=float))
        if isinstance(self.keep, str):
            raise TypeError(f"keep is {self.keep!r}; it must be a list of texts, [{self.keep!r}]")
        for entry in self.keep:
            statistic, _, column = entry.rpartition(" ")
            if statistic and statistic not in STATISTICS:
                raise UnknownNameError("statistic", statistic, STATISTICS)
            if not statistic and not len(self.times):
                names = ", ".join(STATISTICS)
                raise ValueError(
                    f"keep has {column!r}; put a statistic in front, 'last {column}' (one of "
                    f"{names}), or give times="
                )

    def __call__(self, case: Case) -> dict[str, Any]:
        """The figures of a simulated case by name."""
        run = self.run(case)
        return {**_summary(run), **self._requested_columns(run)}

    def run(self, case: Case) -> Trajectory:
        """The trajectory of a case."""
        marionette = case.marionette
        if marionette is None:
            raise ValueError("a Trial needs a puppet: sweep(trial, ..., puppet=arm), or in over")
        table = marionette.coordinates
        start, method, method_options = dict(self.start), self.method, {}
        options = {**self.options, "t_end": self.t_end}
        inputs = self.inputs
        state_names = {*table.q_D, *table.q_K, *(f"v:{name}" for name in (*table.v_D, *table.v_K))}
        state_names |= {n[:-2] + "rotation" for n in state_names if n.endswith(".qw")}
        for name, value in case.values.items():
            if name == INPUTS_KEY:
                inputs = value
            elif name == METHOD_KEY:
                method = value
            elif name in METHOD_OPTIONS:
                method_options[name] = value
            elif name in SIMULATE_OPTIONS:
                options[name] = value
            elif name in state_names:
                start[name] = value
            elif name != PUPPET_KEY and not name.startswith(PARAMETER_PREFIX):
                allowed = {*state_names, *SIMULATE_OPTIONS, *METHOD_OPTIONS, METHOD_KEY, INPUTS_KEY}
                raise UnknownNameError("value of a Trial", name, allowed)
        if inputs is not None and not isinstance(inputs, Input):
            inputs = Input.waypoints(marionette, inputs)
        x0 = start_state(marionette, inputs, start)
        if inputs is None and options["t_end"] is None:
            raise ValueError("a Trial without inputs needs t_end, the end of its runs [s]")
        if isinstance(method, str):
            method_with_options = as_method(method, **method_options)
        else:
            method_with_options = replace(method, **method_options)
        return simulate(marionette, x0, inputs, method=method_with_options, throw=False, **options)

    def _requested_columns(self, run: Trajectory) -> dict[str, Any]:
        columns, times = run.columns(), np.asarray(self.times)
        figures: dict[str, Any] = {}
        is_inside = (times >= run.t[0]) & (times <= run.t[-1])
        resampled = run.resample(times[is_inside]).columns() if is_inside.any() else {}
        for entry in self.keep:
            statistic, _, column = entry.rpartition(" ")
            if column not in columns:
                raise UnknownNameError("column of the run", column, columns)
            if statistic:
                figures[entry] = STATISTICS[statistic](run.t, columns[column].astype(float))
            else:
                figures[entry] = np.full(len(times), np.nan)
                if is_inside.any():
                    figures[entry][is_inside] = resampled[column]
        return figures


def start_state(marionette: Marionette, inputs: Input | None, start: Mapping[str, Any]) -> State:
    """Rest state at the inputs' start; projected onto the strings if q_D or a velocity is given."""
    values = {**({} if inputs is None else inputs.first_values()), **start}
    table = marionette.coordinates
    driven = {*table.q_K, *table.rotations, *table.commands}
    if all(name in driven for name in start):
        x = marionette.rest(values)
    else:
        x = marionette.project(marionette.state(values))
    return x if inputs is None else x.replace(t=inputs.start)


def _summary(run: Trajectory) -> dict[str, Any]:
    """Figures that every run has, independent of the names of its strings."""
    forces = np.concatenate([run.tension.values.ravel(), [0.0]])
    return {
        "status": run.status.name,
        "end": float(run.t[-1]),
        "events": len(run.events),
        "catches": sum(event.kind == "catch" for event in run.events),
        "max_tension": float(np.max(forces)),
        "max_impulse": max((event.impulse for event in run.events), default=0.0),
    }
