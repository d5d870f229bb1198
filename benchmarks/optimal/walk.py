"""Measures a periodic walk with little slip, and searches for its parameters.

    python -m benchmarks.optimal.walk [--steps 40] [--friction 0.8] [--event] [--mujoco]

Measures the marionette's walk on ``promenade`` with ``MarionetteGait()``: with
five time steps, down to 0.125 ms; with ``--event`` four of its steps event-driven, tens of
thousands of events from a state on the cycle; with ``--mujoco`` in MuJoCo, whose strings and
contacts are soft. Slip is the distance that a sole's corners move along the floor in contact.
``--search`` seeks better parameters for this number of seconds.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass, replace

import numpy as np

import fantoccini as fan
from fantoccini.base import Progress
from fantoccini.control import DrawOptions
from fantoccini.dynamics.mujoco import mujoco_run

from ..contact.mujoco_scene import scene_mjcf
from .marionette_gait import MarionetteGait

STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
"""Time steps [s]."""
SAMPLE = 5e-3
"""Interval of the evaluated samples [s]."""
ON_FLOOR = 1e-4
"""Height below which a corner counts as on the floor [m]."""
SLIP = 1e-3
"""Target: slip of a foot in a step [m]."""
LIFT = 5e-3
"""Target: least height of a lifted sole [m]."""
N_EVALUATED = 8
"""Number of evaluated steps at the end."""
SOLE = np.array([[x, y, -0.141] for x in (-0.02, 0.034) for y in (-0.016, 0.016)])
SPREADS = {
    "lower": 1e-3,
    "nod": 1e-3,
    "lean": 2e-3,
    "slack": 2e-3,
    "ahead": 0.01,
    "apart": 4e-3,
    "lift": 5e-3,
    "lifts": 0.03,
    "highest": 0.04,
    "lands": 0.05,
    "swings": 0.03,
    "arrives": 0.05,
    "beyond": 0.01,
    "sway": 3e-3,
    "sways": 0.05,
    "swayed": 0.05,
    "follows": 0.08,
    "followed": 0.08,
}
"""Initial spreads of a search, by parameter; stride and duration are fixed."""


@dataclass(frozen=True)
class WalkMeasurement:
    """The last steps of a run.

    Attributes:
        slip: (n, 2) slip of every step and foot [m].
        lift: (n,) largest height of the lowest corner of the swinging foot [m].
        cycle_changes: (m,) largest change of a coordinate between pairs of steps, without the
            distance walked [m or rad].
        way: distance of a pair of steps [m].
        weight_share: mean share of the weight on the feet.
        upright: least cosine of the torso's inclination.
        tilt: mean angle of the soles while they are on the floor [deg].
    """

    slip: np.ndarray
    lift: np.ndarray
    cycle_changes: np.ndarray
    way: float
    weight_share: float
    upright: float
    tilt: float

    def __str__(self) -> str:
        return (
            f"slip {1e3 * self.slip.max():.2f} mm at most in a step and foot, lift "
            f"{1e3 * self.lift.min():.1f} mm, way {1e3 * self.way:.1f} mm a pair of steps, repeats "
            f"within {self.cycle_changes.max():.4f}, feet carry {100 * self.weight_share:.0f} %"
        )


def measure_walk(
    stage: fan.Marionette,
    run: fan.Trajectory,
    gait: MarionetteGait,
    steps: int,
    n_evaluated: int = N_EVALUATED,
) -> WalkMeasurement:
    """Measures the last steps of a run before the closing one."""
    D, n_walking, n = gait.duration, steps - 1, n_evaluated
    begin = D * (1 + n_walking - n)
    times = np.arange(begin, begin + n * D + 0.5 * SAMPLE, SAMPLE)
    at = np.minimum(np.searchsorted(run.t, times - 1e-9), len(run.t) - 1)
    q_D, q_K = run.q_D[at], run.q_K[at]
    poses = stage.poses(q_D, q_K)
    shins = [poses[:, stage.link_index(f"shin_{side}")] for side in ("left", "right")]
    corners = np.stack(
        [T[:, None, :, 3] + np.einsum("tij,cj->tci", T[:, :, :3], SOLE) for T in shins], axis=1
    )
    on_floor = corners[..., 2] < ON_FLOOR
    distances = np.linalg.norm(np.diff(corners[..., :2], axis=0), axis=-1)
    distances = np.where(on_floor[1:] & on_floor[:-1], distances, 0.0).max(axis=-1)
    step = np.minimum(((times[:-1] - begin + 1e-9) / D).astype(int), n - 1)
    slip = np.array([distances[step == k].sum(axis=0) for k in range(n)])
    swings = [(n_walking - n + k) % 2 for k in range(n)]
    height = corners[:-1, ..., 2].min(axis=-1)
    lift = np.array([height[step == k, swings[k]].max() for k in range(n)])
    pairs = q_D[np.searchsorted(times, begin + 2 * D * np.arange(n // 2 + 1) - 1e-9)].copy()
    ahead = stage.coordinates.q_D.index("torso.x")
    cycle_distance = float(pairs[-1, ahead] - pairs[0, ahead]) / (n // 2)
    pairs[:, ahead] -= 2.0 * gait.stride * np.arange(len(pairs))
    sole_cosines = np.stack([T[:, 2, 2] for T in shins], axis=1)[on_floor.any(axis=-1)]
    tension = run.tension.values[at].sum(axis=1).mean()
    return WalkMeasurement(
        slip,
        lift,
        np.abs(np.diff(pairs, axis=0)).max(axis=1),
        cycle_distance,
        float(1.0 - tension / stage.weight),
        float(poses[:, stage.link_index("torso"), 2, 2].min()),
        float(np.degrees(np.arccos(np.clip(sole_cosines, -1.0, 1.0))).mean())
        if len(sole_cosines)
        else 90.0,
    )


def cost(stage: fan.Marionette, run: fan.Trajectory, gait: MarionetteGait, steps: int) -> float:
    """The cost of a walk: slip, change from cycle to cycle, and penalties for hardly walking."""
    measured = measure_walk(stage, run, gait, steps)
    slip = 1e3 * measured.slip.max(axis=1)
    return float(
        4.0 * slip.mean()
        + 2.0 * slip.max()
        + 100.0 * measured.cycle_changes.mean()
        + 50.0 * measured.cycle_changes.max()
        + 2e3 * max(0.0, LIFT - measured.lift.min())
        + 2e2 * abs(measured.way - 2.0 * gait.stride)
        + 100.0 * max(0.0, 0.15 - measured.weight_share)
        + 50.0 * max(0.0, 0.98 - measured.upright)
        + 0.3 * measured.tilt
    )


def search_parameters(
    stage: fan.Marionette, first: MarionetteGait, share: float, seconds: float, seed: int
) -> fan.control.TuningResult:
    """Parameters of a walk of 20 steps, drawn around the first by this share of ``SPREADS``."""
    steps, x0, start = 20, stage.rest(), asdict(first)

    def print_progress(at: Progress) -> None:
        best, median = at.best
        print(f"cost {best:.3f}, median {median:.3f}", flush=True)

    return fan.tune(
        stage,
        lambda v: replace(first, **v).inputs(stage, steps, x0),
        {name: (start[name], share * spread) for name, spread in SPREADS.items()},
        lambda run: cost(stage, run, first, steps),
        x0,
        first.duration * (steps + 1),
        method=fan.TimeStepping(dt=0.00025),
        save_every=20,
        draws=DrawOptions(runs=60, generations=1000, time_limit=seconds, seed=seed),
        progress=print_progress,
    )


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--friction", type=float, default=0.8, help="friction of the floor")
    parser.add_argument("--event", action="store_true", help="also event-driven: minutes")
    parser.add_argument("--mujoco", action="store_true", help="also in MuJoCo: a minute")
    parser.add_argument(
        "--search", type=float, default=0.0, help="time to seek better parameters [s]"
    )
    parser.add_argument("--share", type=float, default=1.0, help="initial share of the spreads")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    gait, steps = MarionetteGait(), options.steps
    text = fan.puppets.path("promenade").read_text(encoding="utf-8")
    assert "friction: 0.8" in text
    stage = fan.loads(text.replace("friction: 0.8", f"friction: {options.friction:g}"))
    if options.search:
        tuned = search_parameters(stage, gait, options.share, options.search, options.seed)
        gait = replace(gait, **tuned.values)
        print(tuned.status.name, gait)
    x0 = stage.rest()
    inputs, end = gait.inputs(stage, steps, x0), gait.duration * (steps + 1)
    for dt in STEPS:
        began, method = time.perf_counter(), fan.TimeStepping(dt=dt)
        run = fan.simulate(stage, x0, inputs, end, method=method, save_every=round(2e-3 / dt))
        took = time.perf_counter() - began
        print(f"steps of {1e3 * dt:g} ms: {measure_walk(stage, run, gait, steps)}; {took:.1f} s")
    if options.event:
        began = time.perf_counter()
        run = run_event_driven(stage, x0, inputs, gait, steps)
        took = time.perf_counter() - began
        done = run.status is fan.Status.DONE
        result = str(measure_walk(stage, run, gait, steps, 4)) if done else run.status.message
        print(
            f"event-driven, {len(run.events)} events, {run.t[-1] - run.t[0]:.3f} s: {result}; "
            f"{took:.0f} s"
        )
    if options.mujoco:
        print(f"MuJoCo: {measure_walk(stage, run_in_mujoco(stage, x0, inputs, end), gait, steps)}")


def run_event_driven(
    stage: fan.Marionette, x0: fan.State, inputs: fan.Input, gait: MarionetteGait, steps: int
) -> fan.Trajectory:
    """The last four steps before the closing one, from the state reached by time steps."""
    start, end = gait.duration * (steps - 4), gait.duration * steps
    led = fan.simulate(
        stage, x0, inputs, start, method=fan.TimeStepping(dt=2.5e-4), save_every=10**6
    )
    x = stage.project(led.state(-1))
    return fan.simulate(stage, x, inputs, end, effort=False, throw=False)


def run_in_mujoco(
    stage: fan.Marionette, x0: fan.State, inputs: fan.Input, end: float
) -> fan.Trajectory:
    """The run in MuJoCo with steps of 0.5 ms, elliptic cones and little creep."""
    text = scene_mjcf(stage, None)
    text = text.replace("<option ", '<option impratio="100" cone="elliptic" ', 1)
    return mujoco_run(stage, x0, inputs, end, 5e-4, text)


if __name__ == "__main__":
    main()
