"""Trial: the study that most sweeps need, one simulation a case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import UnknownNameError
from fantoccini.marionette import Marionette, Method, MethodName, as_method
from fantoccini.motion import Input, State, Trajectory
from fantoccini.simulation import simulate
from fantoccini.sweeps.case import PARAMETER, PUPPET, Case

INPUTS = "inputs"
"""The name under which inputs are varied."""
METHOD = "method"
"""The name under which methods are varied."""
METHOD_OPTIONS = ("integrator", "rtol", "atol", "max_step", "dt", "extrapolate")
"""Options of methods that can be varied, as in a study of convergence."""
OPTIONS = ("t_end", "save_every")
"""Arguments of ``simulate`` that can be varied."""


def _integral(t: Array, x: Array) -> float:
    """By the trapezoidal rule."""
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
"""What can be made of a column (T,) and its times (T,); ``mean``, ``rms`` are means over time."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A study that simulates each case and keeps some figures of the run.

    What the sweep varies goes where its name says: ``puppet`` and ``p:NAME`` to the puppet,
    ``inputs`` to the inputs, ``t_end``, ``method``, ``dt``, ``rtol`` and the like to
    :func:`fantoccini.simulate`, and names of coordinates and velocities (``hand.length``,
    ``v:elbow``) to the start. The puppet starts hanging at rest, its driven coordinates where the
    inputs begin; where a dynamic coordinate or a velocity is given, it starts from the nearest
    state that the strings allow.

    A run that stops before its end is no failure: ``status`` says how it ended.

    Attributes:
        inputs: an ``Input``, or waypoints, name -> [(t [s], value), ...]; all holds still when
            None.
        start: values of the start, as :meth:`Marionette.state` takes them.
        t_end: end of the runs [s]; that of the inputs when None.
        method: of the runs, with its options: ``TimeStepping(dt=0.001)``, or a name.
        options: further arguments of ``simulate``, such as ``{"save_every": 10}``.
        keep: columns of :meth:`Trajectory.columns` to keep: ``"max tension:hand"``,
            ``"last elbow"``, ``"rms effort:hand.length"``, with one of first, last, min, max, mean,
            rms and integral; or ``"elbow"`` for its course at ``times``, NaN after the run's end.
            Beside them there are always ``status``, ``end`` [s], ``events``, ``catches``,
            ``max_tension`` [N] and ``max_impulse`` [N s or N m s], over all strings and limits.
        times: (n,) for which courses are kept [s].
    """

    inputs: Input | Mapping[str, Sequence] | None = None
    start: Mapping[str, Any] = field(default_factory=dict)
    t_end: float | None = None
    method: Method | MethodName = "event"
    options: Mapping[str, Any] = field(default_factory=dict)
    keep: Sequence[str] = ()
    times: Sequence[float] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", np.array(self.times, dtype=float))
        if isinstance(self.keep, str):
            raise TypeError(f"keep is {self.keep!r}; it must be a list of texts, [{self.keep!r}]")
        for wanted in self.keep:
            statistic, _, column = wanted.rpartition(" ")
            if statistic and statistic not in STATISTICS:
                raise UnknownNameError("statistic", statistic, STATISTICS)
            if not statistic and not len(self.times):
                names = ", ".join(STATISTICS)
                raise ValueError(
                    f"keep has {column!r}; say which number of it, 'last {column}' (there are "
                    f"{names}), or give times= for its course"
                )

    def __call__(self, case: Case) -> dict[str, Any]:
        """Simulates a case.

        Returns:
            The figures by name.
        """
        if case.marionette is None:
            raise ValueError("a Trial needs a puppet: sweep(trial, ..., puppet=arm), or in over")
        run = self.run(case)
        return {**_summary(run), **self._kept(run)}

    def run(self, case: Case) -> Trajectory:
        """The whole run of a case, as for a look at one that stands out."""
        marionette, table = case.marionette, case.marionette.coordinates
        start, method, varied = dict(self.start), self.method, {}
        options = {**self.options, "t_end": self.t_end}
        inputs = self.inputs
        places = {*table.q_D, *table.q_K, *(f"v:{name}" for name in (*table.v_D, *table.v_K))}
        places |= {n[:-2] + "rotation" for n in places if n.endswith(".qw")}
        for name, value in case.values.items():
            if name == INPUTS:
                inputs = value
            elif name == METHOD:
                method = value
            elif name in METHOD_OPTIONS:
                varied[name] = value
            elif name in OPTIONS:
                options[name] = value
            elif name in places:
                start[name] = value
            elif name != PUPPET and not name.startswith(PARAMETER):
                known = {*places, *OPTIONS, *METHOD_OPTIONS, METHOD, INPUTS}
                raise UnknownNameError("value of a Trial", name, known)
        if inputs is not None and not isinstance(inputs, Input):
            inputs = Input.waypoints(marionette, inputs)
        x0 = _start(marionette, inputs, start)
        if inputs is None and options["t_end"] is None:
            raise ValueError("a Trial without inputs needs t_end, the end of its runs [s]")
        if isinstance(method, str):
            chosen = as_method(method, **varied)
        else:
            chosen = replace(method, **varied)
        return simulate(marionette, x0, inputs, method=chosen, throw=False, **options)

    def _kept(self, run: Trajectory) -> dict[str, Any]:
        columns, kept = run.columns(), {}
        inside = (self.times >= run.t[0]) & (self.times <= run.t[-1])
        courses = run.resample(self.times[inside]).columns() if inside.any() else {}
        for wanted in self.keep:
            statistic, _, column = wanted.rpartition(" ")
            if column not in columns:
                raise UnknownNameError("column of the run", column, columns)
            if statistic:
                kept[wanted] = STATISTICS[statistic](run.t, columns[column].astype(float))
            else:
                kept[wanted] = np.full(len(self.times), np.nan)
                if inside.any():
                    kept[wanted][inside] = courses[column]
        return kept


def _start(marionette: Marionette, inputs: Input | None, given: Mapping[str, Any]) -> State:
    """Hanging at rest where the inputs begin, or moving where that is asked for."""
    values = {**({} if inputs is None else inputs.first_values()), **given}
    table = marionette.coordinates
    driven = {*table.q_K, *table.rotations, *table.commands}
    if all(name in driven for name in given):
        x = marionette.rest(values)
    else:
        x = marionette.project(marionette.state(values))
    return x if inputs is None else x.replace(t=inputs.start)


def _summary(run: Trajectory) -> dict[str, Any]:
    """What every run has, whatever its strings are called."""
    forces = np.concatenate([run.tension.values.ravel(), [0.0]])
    return {
        "status": run.status.name,
        "end": float(run.t[-1]),
        "events": len(run.events),
        "catches": sum(event.kind == "catch" for event in run.events),
        "max_tension": float(np.max(forces)),
        "max_impulse": max((event.impulse for event in run.events), default=0.0),
    }
