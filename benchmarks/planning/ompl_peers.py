"""OMPL's control-based planners on our problems: ``python -m benchmarks.planning.ompl_peers``.

The state space is real: (q_D, v_D, q_K, v_K) with velocities times 0.1 s. Segments have a constant
acceleration of the driven coordinates and last 2 to 10 checks; OMPL requests the state after each
check and its validity, and at a segment's end the goal distance. ``own`` answers by our
compiled time-stepper, ``mujoco`` by MuJoCo with Euler steps of the same length; both check
clearance, ranges, speeds and slack strings. EST and KPIECE1 project to q_K, in cells of 0.1 m.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import subprocess
import sys
import time
from dataclasses import asdict, dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.control.problems import Problem

from .propagators import PROPAGATORS, Layout

PLANNERS = ("EST", "RRT", "KPIECE1")

LOOKS = (2, 10)
"""Shortest and longest duration of a segment, in checks."""

CELL = 0.1
"""Size of the cells of EST and KPIECE1, in q_K [m]."""

TIME = 0.1
"""Weight of velocities in OMPL's metric [s]."""

FASTEST = 10.0
"""Largest dynamic velocity that OMPL samples [m/s or rad/s]."""

ROOM = 1.0
"""Largest distance from the start of sampled driven coordinates without a range [m]."""


@dataclass(frozen=True)
class Outcome:
    """Result of a search.

    Attributes:
        planner, propagator, seed: arguments of the command line.
        found: whether it has a plan.
        seconds: its duration [s].
        distance: final distance from the goal of its plan, or of its best attempt.
        duration: duration of that plan [s].
    """

    planner: str
    propagator: str
    seed: int
    found: bool
    seconds: float
    distance: float
    duration: float


def _box(problem: Problem, layout: Layout) -> tuple[Array, Array]:
    """Bounds (n,) of the states that OMPL samples; reached states may lie outside."""
    table, bounds = problem.marionette.coordinates, problem.rollouts.bounds
    low, high = np.full(layout.n, -FASTEST), np.full(layout.n, FASTEST)
    q_D, _, q_K, v_K = layout.parts
    low[q_D], high[q_D] = -math.pi, math.pi
    for q, _ in table.quaternions_D:
        low[q : q + 4], high[q : q + 4] = -1.0, 1.0
    for row in problem.marionette.tree.limits:
        side = high if row.side == "upper" else low
        side[problem.marionette.tree.links[row.link].q] = problem.marionette.number(row.bound)
    low[q_K] = np.maximum(bounds.low, problem.start.q_K - ROOM)
    high[q_K] = np.minimum(bounds.high, problem.start.q_K + ROOM)
    low[v_K], high[v_K] = -bounds.speed, bounds.speed
    return low, high


def solve(problem: Problem, planner: str, propagator: str, seed: int, time_limit: float) -> Outcome:
    """One search. OMPL has one generator per process, which must be seeded only once.

    Args:
        problem: the planning problem.
        planner: one of ``PLANNERS``.
        propagator: one of ``PROPAGATORS``.
        seed: seed of OMPL's generator.
        time_limit: [s].
    """
    from ompl import base, control, util

    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(seed + 1)  # it has no seed 0
    layout, rollouts = Layout(problem), problem.rollouts
    propagation = PROPAGATORS[propagator](problem, layout)
    n, n_K = layout.n, len(rollouts.bounds.speed)
    scale = np.ones(n)
    scale[layout.parts[1]] = scale[layout.parts[3]] = TIME

    def read(state: base.State) -> Array:
        return np.array(state[0:n]) / scale

    def write(row: Array, state: base.State) -> None:
        state[0:n] = (row * scale).tolist()

    def distance(state: base.State) -> float:
        return float(problem.goal.distance(layout.states(read(state)))[0])

    class Near(base.GoalRegion):
        def distanceGoal(self, state: base.State) -> float:
            return distance(state)

    def limits(low: Array, high: Array) -> base.RealVectorBounds:
        bounds = base.RealVectorBounds(len(low))
        for k in range(len(low)):
            bounds.setLow(k, float(low[k]))
            bounds.setHigh(k, float(high[k]))
        return bounds

    def propagate(state, chosen, duration, result) -> None:
        acc_K = np.array([chosen[k] for k in range(n_K)])
        write(propagation.after(read(state), acc_K), result)

    space = base.RealVectorStateSpace(n)
    space.setBounds(limits(*(end * scale for end in _box(problem, layout))))
    places = list(range(layout.parts[2].start, layout.parts[2].stop))
    space.registerDefaultProjection(
        base.RealVectorOrthogonalProjectionEvaluator(space, [CELL] * len(places), places)
    )
    controls = control.RealVectorControlSpace(space, n_K)
    largest = rollouts.bounds.acceleration
    controls.setBounds(limits(-largest, largest))
    setup = control.SimpleSetup(controls)
    info = setup.getSpaceInformation()
    info.setPropagationStepSize(rollouts.options.interval)
    info.setMinMaxControlDuration(*LOOKS)
    setup.setStatePropagator(propagate)
    setup.setStateValidityChecker(lambda state: propagation.clear(read(state)))
    start = space.allocState()
    write(layout.row(problem.root), start)
    setup.setStartState(start)
    goal = Near(info)
    goal.setThreshold(problem.tolerance)
    setup.setGoal(goal)
    setup.setPlanner(getattr(control, planner)(info))
    setup.setup()
    began = time.perf_counter()
    setup.solve(time_limit)
    seconds = time.perf_counter() - began
    has_plan, duration, left = setup.haveExactSolutionPath(), 0.0, problem.distance
    if setup.haveSolutionPath():
        path = setup.getSolutionPath()
        duration, left = sum(path.getControlDurations()), distance(path.getStates()[-1])
    return Outcome(planner, propagator, seed, has_plan, seconds, left, duration)


def easier_problem(problem: Problem) -> Problem:
    """The problem without obstacles, with strings that may go slack and twice the tolerance."""
    bounds = problem.rollouts.bounds
    names = problem.marionette.coordinates.v_K
    return Problem(
        problem.marionette,
        problem.start,
        problem.goal,
        tolerance=2.0 * problem.tolerance,
        bounds=fan.control.Bounds(
            speed=dict(zip(names, bounds.speed, strict=True)),
            acceleration=dict(zip(names, bounds.acceleration, strict=True)),
        ),
        slack=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="OMPL on a problem: one line of JSON per search.")
    parser.add_argument("--problem", default="arm3d_boxes", help="name or file of a problem")
    parser.add_argument("--planner", choices=PLANNERS, required=True)
    parser.add_argument("--propagator", choices=tuple(PROPAGATORS), required=True)
    parser.add_argument(
        "--seeds", type=int, default=1, help="number of seeds, each in its own process"
    )
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--time-limit", type=float, default=30.0, help="[s]")
    parser.add_argument("--tolerance", type=float, help="tolerance of the goal; the problem's")
    parser.add_argument("--easy", action="store_true", help="see `easier`")
    options = parser.parse_args()
    if importlib.util.find_spec("ompl") is None:
        print("OMPL is not installed: pip install 'fantoccini[bench]'", file=sys.stderr)
        raise SystemExit(3)
    if options.seeds > 1:
        for seed in range(options.first, options.first + options.seeds):
            one_search = ["--seeds", "1", "--first", str(seed)]
            subprocess.run(
                [sys.executable, "-m", __spec__.name, *sys.argv[1:], *one_search], check=True
            )
        return
    changed = {} if options.tolerance is None else {"tolerance": options.tolerance}
    problem = fan.control.load_problem(options.problem, **changed)
    problem = easier_problem(problem) if options.easy else problem
    arguments = options.planner, options.propagator, options.first, options.time_limit
    print(json.dumps(asdict(solve(problem, *arguments))), flush=True)


if __name__ == "__main__":
    main()
