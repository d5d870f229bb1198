"""Runs at a slower tempo. They are simulated again, as the puppet swings differently then.

q_K are the driven coordinates that the stand moves, the ends and lengths of strings, and v_K, acc_K
their velocities and accelerations; v_D are the dynamic velocities. Breaks are the times at which
the pieces of a motion meet, and `coef` their coefficients.
"""

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

MAX_FACTOR = 4.0
"""Largest factor of the duration that is tried."""
FACTOR_GROWTH = 1.2
"""Ratio of successive factors."""
FACTOR_RESERVE = 1.02
"""First factor tried, relative to the one that speeds and accelerations alone require."""
MIN_SAMPLE_INTERVAL = 1e-3
"""Smallest interval between samples of a run that are used for its slower inputs [s]."""
COMPARISON_RATE = 120.0
"""Rate at which two motions are compared [1/s]."""
SAVE_RATE = 500.0
"""Samples per second of a slower run."""
UNDETERMINED_TEXT = "whether slower helps is not determined: other torques give the same motion"
MIN_TIME_STEP = 1e-4
"""Smallest step of a run with a fixed step [s]."""


@dataclass(frozen=True, eq=False)
class SlowedRun:
    """A run at a slower tempo.

    Attributes:
        factor: its duration, relative to that of the first run.
        run: the run, simulated with the slower inputs.
        check: check of the stand for this run.
        deviation: largest distance of a body from its position in the first run at the
            corresponding time [m].
        body: the name of that body.
        t: time of that distance, in the first run's time [s].
        rms: root mean square of all bodies' distances over all times [m].
    """

    factor: float
    run: Trajectory
    check: StandCheck
    deviation: float
    body: str
    t: float
    rms: float

    def __str__(self) -> str:
        return (
            f"{self.factor:.3g} times as long: smallest margin {self.check.margin:.0f} %; the "
            f"puppet moves differently: {self.body} is up to {1e3 * self.deviation:.0f} mm off "
            f"(at t = {self.t:.2f} s of the first run), all bodies {1e3 * self.rms:.1f} mm (rms)"
        )


def inputs_of(run: Trajectory, factor: float = 1.0) -> Input:
    """The driven motion of a run, ``factor`` times as long; driven orientations stay constant.

    Pieces are quintics through positions, velocities and accelerations at the run's samples. The
    run's user forces u_D are left out.
    """
    coordinates, t = run.coordinates, run.t
    sample_list = [0]
    for i in range(1, len(t)):
        if t[i] - t[sample_list[-1]] >= MIN_SAMPLE_INTERVAL:
            sample_list.append(i)
    if t[-1] > t[sample_list[-1]]:
        sample_list = [*(sample_list[:-1] if len(sample_list) > 1 else sample_list), len(t) - 1]
    k = np.array(sample_list)
    breaks = run.t[0] + factor * (t[k] - run.t[0])
    q, v = coordinates.scalar_indices_K
    samples = (run.q_K[k][:, q], run.v_K[k][:, v] / factor, run.acc_K[k][:, v] / factor**2)
    coef = np.zeros((len(k) - 1, coordinates.n_vK, polynomial.N_COEF))
    starts, ends = (tuple(x[part] for x in samples) for part in (slice(-1), slice(1, None)))
    coef[:, v] = polynomial.hermite(np.diff(breaks)[:, None], starts, ends)
    held_values = np.array(run.q_K[k[:-1]])
    rotations = [i for q_first, _ in coordinates.quaternions_K for i in range(q_first, q_first + 4)]
    held_values[:, rotations] = run.q_K[0, rotations]
    return Input(coordinates, breaks, coef, held_values, np.ones(coordinates.n_vK, dtype=bool))


def slow_down(check: StandCheck, factor: float) -> SlowedRun:
    """Simulates and checks a stand's run again, ``factor`` times as long.

    Raises:
        SimulationError: the slower run stops before its end.
    """
    run, marionette = check.run, check.marionette
    start = run.state(0)
    slow_start = dataclasses.replace(start, v_D=start.v_D / factor, v_K=start.v_K / factor)
    t_end, method = float(run.t[0] + factor * run.duration), _method(run)
    n = max(2, round(SAVE_RATE * (t_end - run.t[0])))
    slow_run = simulate(
        marionette,
        _projected_start(marionette, slow_start),
        inputs_of(run, factor),
        t_end,
        method=method,
        save_at=np.linspace(run.t[0], t_end, n) if method == "event" else None,
    )
    deviation, body, t, rms = body_distances(marionette, run, slow_run, factor)
    slow_check = check_stand(check.map.stand, slow_run, marionette)
    return SlowedRun(factor, slow_run, slow_check, deviation, body, t, rms)


def find_slower_tempo(check: StandCheck) -> tuple[SlowedRun | None, str]:
    """Searches for a slower tempo that a stand can follow.

    Returns:
        The run with the smallest factor tried that works, or None; and the outcome in words.
    """
    if any(limit.quantity == "travel" for limit in check.broken):
        return None, "slower does not help: the travel is too short at any tempo"
    if check.undetermined:
        return None, UNDETERMINED_TEXT
    factor, slowed_run = _first_factor(check), None
    while factor <= MAX_FACTOR:
        try:
            slowed_run = slow_down(check, factor)
        except (SimulationError, StateError) as error:
            return None, f"{factor:.3g} times as long, the simulation stops: {error}"
        if slowed_run.check.ok:
            return slowed_run, str(slowed_run)
        if slowed_run.check.undetermined:
            return None, f"{UNDETERMINED_TEXT} (at {factor:.3g} times the duration, too)"
        factor *= FACTOR_GROWTH
    if slowed_run is None:
        return None, f"slower does not help within {MAX_FACTOR:g} times as long"
    first_limit = slowed_run.check.first
    assert first_limit is not None
    return None, (
        f"slower does not help: {slowed_run.factor:.3g} times as long, the {first_limit.quantity} "
        f"of {first_limit.axis} is still insufficient"
    )


def body_distances(
    marionette: Marionette, run: Trajectory, slow_run: Trajectory, factor: float
) -> tuple[float, str, float, float]:
    """Largest distance of a body between two runs, its name, the time, and the rms of all bodies.

    Distances are those of the frames' origins, at times that correspond by the factor.
    """
    n = max(2, round(COMPARISON_RATE * run.duration))
    t = np.linspace(run.t[0], run.t[-1], n)
    slow_t = np.minimum(run.t[0] + factor * (t - run.t[0]), slow_run.t[-1])
    positions = []
    for compared_run, times in ((run, t), (slow_run, slow_t)):
        states = compared_run.resample(times)
        positions.append(marionette.poses(states.q_D, states.q_K)[..., 3])
    body_indices = [
        i for i, link in enumerate(marionette.tree.links) if link.name in _body_names(run)
    ]
    deviation: Array = np.linalg.norm(positions[0] - positions[1], axis=-1)[:, body_indices]
    i, k = np.unravel_index(int(np.argmax(deviation)), deviation.shape)
    name = marionette.tree.links[body_indices[int(k)]].name
    return float(deviation[i, k]), name, float(t[i]), float(np.sqrt(np.mean(deviation**2)))


def _body_names(run: Trajectory) -> set[str]:
    return set() if run.puppet is None else {body.name for body in run.puppet.bodies}


def _first_factor(check: StandCheck) -> float:
    """The first factor to try: as large as the broken speeds and accelerations alone require."""
    factor = 1.0
    for limit in check.broken:
        excess = max(1.0, 1.0 - limit.margin / 100.0)
        if limit.quantity in ("speed", "step rate"):
            factor = max(factor, excess)
        elif limit.quantity == "acceleration":
            factor = max(factor, excess**0.5)
    return FACTOR_RESERVE * factor if factor > 1.0 else FACTOR_GROWTH


def _projected_start(marionette: Marionette, x0: State) -> State:
    """Start state of a slower run, projected so that no taut string lengthens."""
    return x0 if not np.any(x0.v_D) else marionette.project(x0)


def _method(run: Trajectory) -> Method | MethodName:
    if run.method not in ("timestepping", "variational"):
        return "event"
    steps = np.diff(run.t)
    dt = max(MIN_TIME_STEP, float(np.min(steps[steps > 0.0])))
    return TimeStepping(dt=dt) if run.method == "timestepping" else Variational(dt=dt)
