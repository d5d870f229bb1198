"""The same motion at a slower tempo, simulated again: an underactuated puppet moves differently."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, SimulationError, StateError, polynomial
from fantoccini.dynamics.compiled import Method, MethodName, TimeStepping, Variational
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory
from fantoccini.stand.check import StandCheck, check_stand

LARGEST = 4.0
"""Slower than this is not tried."""
GROWS = 1.2
"""From one try to the next."""
SPARE = 1.02
"""Of what speed and acceleration need by themselves."""
_LEAST_GAP = 1e-3
"""Samples of a run nearer than this make no pieces of their own [s]."""
_COMPARED = 120.0
"""Times per second at which two motions are compared."""
_SAVED = 500.0
"""Samples per second of a slower run."""
_UNKNOWN = "slower does not help: the motion does not determine all torques"
_LEAST_STEP = 1e-4
"""Of a run with a fixed step [s]."""


@dataclass(frozen=True, eq=False)
class SlowedRun:
    """A run at a slower tempo.

    Attributes:
        factor: how many times as long it takes.
        run: simulated with the slower inputs.
        check: of the stand.
        apart: largest distance of a body from where it is in the first run, at corresponding times
            [m].
        body: which it is.
        t: when, in the first run's time [s].
        rms: of the distances of all bodies over all times [m].
    """

    factor: float
    run: Trajectory
    check: StandCheck
    apart: float
    body: str
    t: float
    rms: float

    def __str__(self) -> str:
        return (
            f"{self.factor:.3g} times as long: least margin {self.check.margin:.0f} %; the puppet "
            f"moves otherwise, {self.body} by up to {1e3 * self.apart:.0f} mm (at t = {self.t:.2f} "
            f"s of the first run), all bodies by {1e3 * self.rms:.1f} mm (rms)"
        )


def inputs_of(run: Trajectory, factor: float = 1.0) -> Input:
    """The driven motion of a run, ``factor`` times as long; orientations hold still.

    Pieces are quintics through positions, velocities and accelerations at the run's samples. Forces
    u_D are not among them.
    """
    table, t = run.coordinates, run.t
    kept = [0]
    for i in range(1, len(t)):
        if t[i] - t[kept[-1]] >= _LEAST_GAP:
            kept.append(i)
    if t[-1] > t[kept[-1]]:
        kept = [*(kept[:-1] if len(kept) > 1 else kept), len(t) - 1]
    k = np.array(kept)
    breaks = run.t[0] + factor * (t[k] - run.t[0])
    q, v = table.places_K
    ends = (run.q_K[k][:, q], run.v_K[k][:, v] / factor, run.acc_K[k][:, v] / factor**2)
    coef = np.zeros((len(k) - 1, table.n_vK, polynomial.N_COEF))
    first, last = ((q[s], v[s], a[s]) for q, v, a in [ends] for s in (slice(-1), slice(1, None)))
    coef[:, v] = polynomial.hermite(np.diff(breaks)[:, None], first, last)
    base = np.array(run.q_K[k[:-1]])
    turned = [i for place, _ in table.quaternions_K for i in range(place, place + 4)]
    base[:, turned] = run.q_K[0, turned]
    return Input(table, breaks, coef, base, np.ones(table.n_vK, dtype=bool))


def slowed(check: StandCheck, factor: float) -> SlowedRun:
    """The run of a check ``factor`` times as long, simulated and checked again.

    Raises:
        SimulationError: the slower run stops before its end.
    """
    run, marionette = check.run, check.marionette
    x = run.state(0)
    x0 = dataclasses.replace(x, v_D=x.v_D / factor, v_K=x.v_K / factor)
    end, method = float(run.t[0] + factor * run.duration), _method(run)
    n = max(2, round(_SAVED * (end - run.t[0])))
    made = simulate(
        marionette,
        _started(marionette, x0),
        inputs_of(run, factor),
        end,
        method=method,
        save_at=np.linspace(run.t[0], end, n) if method == "event" else None,
    )
    apart, body, t, rms = distances(marionette, run, made, factor)
    again = check_stand(check.map.stand, made, marionette)
    return SlowedRun(factor, made, again, apart, body, t, rms)


def slower(check: StandCheck) -> tuple[SlowedRun | None, str]:
    """The fastest tempo tried at which a stand can do it, and what was found, in words."""
    if any(limit.quantity == "travel" for limit in check.broken):
        return None, "slower does not help: the travel is too short at any tempo"
    if check.undetermined:
        return None, _UNKNOWN
    factor, last = _least(check), None
    while factor <= LARGEST:
        try:
            last = slowed(check, factor)
        except (SimulationError, StateError) as reason:
            return None, f"{factor:.3g} times as long, the simulation stops: {reason}"
        if last.check.ok:
            return last, str(last)
        if last.check.undetermined:
            return None, f"{factor:.3g} times as long, {_UNKNOWN}"
        factor *= GROWS
    if last is None:
        return None, f"slower does not help within {LARGEST:g} times as long"
    first = last.check.first
    assert first is not None
    return None, (
        f"slower does not help: {last.factor:.3g} times as long, the {first.quantity} of "
        f"{first.axis} is still not enough"
    )


def distances(
    marionette: Marionette, run: Trajectory, made: Trajectory, factor: float
) -> tuple[float, str, float, float]:
    """Largest distance of a body between two runs, its name, when, and the rms of all.

    Times correspond by the factor. Bodies are where their frames are, and those with mass count.
    """
    n = max(2, round(_COMPARED * run.duration))
    t = np.linspace(run.t[0], run.t[-1], n)
    later = np.minimum(run.t[0] + factor * (t - run.t[0]), made.t[-1])
    places = []
    for one, times in ((run, t), (made, later)):
        at = one.resample(times)
        places.append(marionette.poses(at.q_D, at.q_K)[..., 3])
    moving = [i for i, link in enumerate(marionette.tree.links) if link.name in _bodies(run)]
    apart: Array = np.linalg.norm(places[0] - places[1], axis=-1)[:, moving]
    i, k = np.unravel_index(int(np.argmax(apart)), apart.shape)
    name = marionette.tree.links[moving[int(k)]].name
    return float(apart[i, k]), name, float(t[i]), float(np.sqrt(np.mean(apart**2)))


def _bodies(run: Trajectory) -> set[str]:
    return set() if run.puppet is None else {body.name for body in run.puppet.bodies}


def _least(check: StandCheck) -> float:
    """What speeds and accelerations need by themselves."""
    need = 1.0
    for limit in check.broken:
        share = max(1.0, 1.0 - limit.margin / 100.0)
        if limit.quantity in ("speed", "step rate"):
            need = max(need, share)
        elif limit.quantity == "acceleration":
            need = max(need, share**0.5)
    return SPARE * need if need > 1.0 else GROWS


def _started(marionette: Marionette, x0: State) -> State:
    """The start of a slower run: of moving strings, what is left of a slack one's speed."""
    return x0 if not np.any(x0.v_D) else marionette.project(x0)


def _method(run: Trajectory) -> Method | MethodName:
    if run.method not in ("timestepping", "variational"):
        return "event"
    steps = np.diff(run.t)
    dt = max(_LEAST_STEP, float(np.min(steps[steps > 0.0])))
    return TimeStepping(dt=dt) if run.method == "timestepping" else Variational(dt=dt)
