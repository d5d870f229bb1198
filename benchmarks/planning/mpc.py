"""Prints the arrivals of kicked plans in MuJoCo: open loop, with LQR gains, and under MPC.

    python -m benchmarks.planning.mpc [--plans 10] [--kick 2.0] [--reserve 0.3]

MPC tracks the plan's coordinates and velocities, within the problem's bounds. Plans leave the
reserve unused. Runs are evaluated
at the plan's end and a second later: MPC continues, other hands stop.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.base.errors import StateError, Status
from fantoccini.control.planning import solve
from fantoccini.control.planning.feedback import ClosedLoopRollout, Feedback
from fantoccini.control.tasks import RolloutOptions, StateArrays
from fantoccini.dynamics.mujoco import MuJoCoPuppet
from fantoccini.motion import State

from .feedback import OF_EACH, STEP, advance_state, follow, kicked_start

INTERVAL = 0.02
"""Interval of MPC [s]."""
HORIZON = 2.0
"""Horizon of MPC [s]."""
ALONG, AT_END = 0.2, 10.0
"""Factors of weights along a plan, and from its end on."""
LATER = 1.0
"""Delay of the second evaluation after a plan's end [s]."""


def following_task(law: Feedback) -> fan.Task:
    """The task of following a plan within its bounds, with the largest weight on the end."""
    plan, marionette = law.plan, law.plan.problem.marionette
    run, table, bounds = plan.trajectory, marionette.coordinates, plan.problem.bounds
    at = np.flatnonzero(np.append(np.diff(run.t) > 0.0, True))
    t, tracks = run.t[at] - run.t[0] + plan.start.t, []
    states = [plan.start.replace(q_D=run.q_D[i], q_K=run.q_K[i]) for i in at]
    for link in marionette.tree.links:
        turned = [marionette.pose(x, link.name)[:3, :3] for x in states]
        path = Rotation.from_matrix(turned).as_quat(scalar_first=True)
        signs = np.sign(np.sum(path[1:] * path[:-1], axis=1))
        path[1:] *= np.cumprod(signs)[:, None]
        tracks.append(
            fan.control.Track.orientation(link.name, (t, path), weight=10.0, end_weight=10.0)
        )
    for v, name in enumerate(table.v_D):
        path = run.v_D[at, v]
        tracks.append(fan.control.Track.velocity(name, (t, path), weight=0.3, end_weight=0.3))
    for q, v in table.scalars_K:
        tracks.append(fan.control.Track.coordinate(table.q_K[q], (t, run.q_K[at, q]), weight=0.01))
        tracks.append(fan.control.Track.velocity(table.v_K[v], (t, run.v_K[at, v]), weight=0.003))
    # A kick costs time that the plan does not have: arrival counts more than the path.
    end = t[-1] - 0.5 * INTERVAL
    tracks = [
        *(scaled_track(track, AT_END, start=end) for track in tracks if track.kind != "coordinate"),
        *(scaled_track(track, ALONG) for track in tracks),
    ]
    bound = dict(zip(table.v_K, bounds.acceleration, strict=True))
    fastest = dict(zip(table.v_K, bounds.speed, strict=True))
    limits = fan.control.Bounds(
        acceleration={name: float(a) for name, a in bound.items() if a > 0.0},
        speed={name: float(s) for name, s in fastest.items() if s > 0.0},
        position={
            table.q_K[q]: (float(bounds.low[q]), float(bounds.high[q]))
            for q, _ in table.scalars_K
            if np.isfinite(bounds.low[q]) or np.isfinite(bounds.high[q])
        },
        held=tuple(name for name, a in bound.items() if not a > 0.0),
    )
    smooth = fan.control.Smooth(acceleration=3e-5, jerk=1e-7)
    return fan.Task(marionette, plan.start, HORIZON, tracks, smooth, limits, interval=INTERVAL)


def scaled_track(track: fan.control.Track, by: float, **more: float) -> fan.control.Track:
    """A track with scaled weights."""
    weights = {"weight": by * track.weight, "end_weight": by * track.end_weight}
    return replace(track, **weights, **more)


class Run(NamedTuple):
    """A run along a plan.

    Attributes:
        followed: the run until the plan's end.
        later: distance from the goal ``LATER`` seconds after it.
        latency: longest of MPC's last updates [s]; 0 without.
    """

    followed: ClosedLoopRollout
    later: float
    latency: float = 0.0


def follow_and_stop(law: Feedback, x0: State, closed: bool) -> Run:
    """Like :func:`follow`; then the hands stop."""
    followed, problem = follow(law, x0, closed), law.plan.problem
    last = followed.states[-1]
    x = x0.replace(t=float(followed.t[-1]), **last.parts)
    puppet = MuJoCoPuppet(problem.marionette, STEP)
    puppet.set_dynamic(x.q_D, x.v_D)
    bound = problem.bounds.acceleration
    for _ in range(round(LATER / INTERVAL)):
        x = advance_state(puppet, x, INTERVAL, np.clip(-x.v_K / INTERVAL, -bound, bound))
    return Run(followed, float(problem.goal.distance(StateArrays.of(x))[0]))


def follow_mpc(law: Feedback, x0: State) -> Run:
    """A plan in MuJoCo under MPC, without latency."""
    problem, interval = law.plan.problem, law.plan.rollouts.options.interval
    mpc = fan.MPC(problem.marionette, following_task(law), HORIZON, round(HORIZON / INTERVAL))
    puppet, states, commanded, x = MuJoCoPuppet(problem.marionette, STEP), [x0], [], x0
    puppet.set_dynamic(x0.q_D, x0.v_D)
    end = x0.t + interval * int(np.sum(law.n_checks))
    while x.t < end - 1e-9:
        commanded.append(mpc.step(x))
        x = advance_state(puppet, x, min(INTERVAL, end - x.t), commanded[-1])
        states.append(x)
    whole = np.all(np.isfinite(np.concatenate([x.q_D, x.v_D])))
    status = Status.DONE if whole else Status.NOT_FINITE
    followed = ClosedLoopRollout.from_states(problem, states, np.array(commanded), status)
    for _ in range(round(LATER / INTERVAL)):
        x = advance_state(puppet, x, INTERVAL, mpc.step(x))
    return Run(followed, float(problem.goal.distance(StateArrays.of(x))[0]), mpc.latency)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problem", default="arm3d_boxes")
    parser.add_argument("--plans", type=int, default=10)
    parser.add_argument("--kick", type=float, default=2.0, help="[rad/s]")
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the first plan, and of the kicks"
    )
    parser.add_argument(
        "--reserve", type=float, default=0.0, help="unused share of the bounds, 0 to 1"
    )
    parser.add_argument("--improve", type=float, default=0.5, help="[s]")
    arguments = parser.parse_args()
    rollouts = RolloutOptions(reserve=arguments.reserve)
    problem = fan.control.load_problem(arguments.problem, rollouts=rollouts)
    seeds = range(arguments.seed, arguments.seed + arguments.plans)
    plans = [solve(problem, seed=s, improve=arguments.improve) for s in seeds]
    laws = [plan.feedback() for plan in plans if plan]
    random = np.random.default_rng(arguments.seed)
    starts = [
        (law, kicked_start(problem, arguments.kick, random)) for law in laws for _ in range(OF_EACH)
    ]
    ways = {
        "open loop": [attempt(follow_and_stop, law, x0, False) for law, x0 in starts],
        "LQR gains": [attempt(follow_and_stop, law, x0, True) for law, x0 in starts],
        "MPC": [attempt(follow_mpc, law, x0) for law, x0 in starts],
    }
    for name, runs in ways.items():
        ended = [run for run in runs if run is not None]
        within = sum(run.followed.distance <= problem.tolerance for run in ended)
        clear = sum(run.followed.arrives for run in ended)
        later = sum(run.later <= problem.tolerance for run in ended)
        median = np.median([np.inf if run is None else run.followed.distance for run in runs])
        print(
            f"{name:10} {within} of {len(runs)} arrive, {clear} touch nothing, "
            f"median {median:.3g}; {later} are there {LATER:g} s later"
        )
    taken = [run.latency for run in ways["MPC"] if run is not None]
    print(f"of its last updates a run's longest takes {1e3 * np.median(taken):.1f} ms (median)")


def attempt(way: Callable[..., Any], *arguments: Any) -> Any:
    """The outcome of one control law; None if MuJoCo's state stops being finite."""
    try:
        return way(*arguments)
    except StateError:
        return None


if __name__ == "__main__":
    main()
