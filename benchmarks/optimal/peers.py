"""Compares fan.optimise with Crocoddyl on the same problems, in turns: time and cost.

    python -m benchmarks.optimal.peers [--turns 5] [--crocoddyl .venv-crocoddyl/bin/python]

Crocoddyl runs in a separate interpreter, since its wheel needs an older Pinocchio. Both begin with
constant inputs and have one thread. One function scores all resulting inputs, by SciPy's
DOP853 with Pinocchio's accelerations; an event-driven run of ours, with the string, does as well.
The last rows are times of a step and its derivatives, MuJoCo's by differences.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.control.tasks.nodes import Nodes

from ..strings import ROOT
from .mujoco_steps import MuJoCoSteps
from .peer_problems import END, SMOOTH, Problem, crane, puppet

DT = 0.005
"""Longest time step of our derivatives [s]."""
TOLERANCE = 1e-6
"""Our KKT residual."""
STOP = 1e-9
"""Crocoddyl's stopping criterion, on its expected decrease."""
INTEGRATORS = ("euler", "rk4")
EXACT_SECONDS = 120.0
"""Time limit of the search with exact derivatives [s]."""


class Crocoddyl:
    """A problem in another process.

    Args:
        python: interpreter with Crocoddyl.
        problem: the problem.
    """

    def __init__(self, python: Path, problem: Problem):
        worker = Path(__file__).with_name("crocoddyl_peer.py")
        alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [python, worker],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | alone,
        )
        self.versions = self._ask(problem.as_json())["versions"]

    def __call__(self, ask: str, **more: Any) -> dict[str, Any]:
        return self._ask({"ask": ask, **more})

    def __enter__(self) -> Crocoddyl:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def _ask(self, question: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None and self._process.stdout is not None
        print(json.dumps(question), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"Crocoddyl ended with {self._process.wait()}; see its error above")
        return json.loads(line)


def event_driven_cost(task: fan.Task, u: Array) -> tuple[float, bool]:
    """The cost of inputs by an event-driven run, and whether the strings stay taut in it."""
    nodes = Nodes.constant(task.marionette, task.x0, task.durations[1], task.n_intervals)
    run = fan.simulate(
        task.marionette, task.x0, replace(nodes, acc_K=u).inputs(), task.durations[1]
    )
    t, left = task.marionette.coordinates, []
    for names, q, v in ((t.q_D, run.q_D, run.v_D), (t.q_K, run.q_K, run.v_K)):
        end = dict(zip(names, zip(q[-1], v[-1], strict=True), strict=True))
        for track in task.tracks:
            if track.name in end:
                left.append(end[track.name][track.kind == "velocity"] - track.path)
    of_u = 0.5 * SMOOTH * nodes.interval * float(np.sum(u**2))
    taut = all(bool(np.all(run.tension[s.name] > 0.0)) for s in task.marionette.tree.strings)
    return of_u + 0.5 * END * float(np.square(left).sum()), taut


def solve_with_fantoccini(task: fan.Task) -> fan.control.Optimum:
    """The optimum with Crocoddyl's tolerance: without an early end at small decreases."""
    return fan.optimise(task, tolerance=TOLERANCE, cost_tolerance=0.0, threads=1)


def compare(problem: Problem, python: Path, turns: int) -> None:
    """Prints a problem's rows."""
    marionette = problem.marionette()
    task = problem.task(marionette, DT)
    solve_with_fantoccini(task)  # compiles
    with Crocoddyl(python, problem) as peer:
        n = len(problem.links) + len(problem.axes)
        print(
            f"\n{problem.name}, {problem.intervals} intervals of {problem.interval:.3g} s, "
            f"{n} degrees of freedom; {peer.versions}"
        )
        taken: dict[str, list[float]] = {name: [] for name in ("ours", *INTEGRATORS)}
        answers: dict[str, dict[str, Any]] = {}
        for _ in range(turns):
            best = solve_with_fantoccini(task)
            taken["ours"].append(best.seconds)
            for integrator in INTEGRATORS:
                answers[integrator] = peer(
                    "solve", integrator=integrator, stop=STOP, iterations=200
                )
                taken[integrator].append(answers[integrator]["seconds"])
        exact = fan.optimise(
            task,
            tolerance=1e-9,
            cost_tolerance=0.0,
            threads=1,
            exact=True,
            time_limit=EXACT_SECONDS,
        )
        solutions = {"ours": (best.nodes.acc_K, best.iterations, best.cost, best.status.name)}
        for name, answer in answers.items():
            done = "SOLVED" if answer["done"] else "not done"
            solutions[name] = np.array(answer["u"]), answer["iterations"], answer["cost"], done
        solutions["ours, exact"] = (
            exact.nodes.acc_K,
            exact.iterations,
            exact.cost,
            exact.status.name,
        )
        taken["ours, exact"] = [exact.seconds]
        scores = {name: peer("score", u=u.tolist())["cost"] for name, (u, *_) in solutions.items()}
    best_cost, best_name = min((J, name) for name, J in scores.items())
    print(f"least cost {best_cost:.9g} ({best_name})")
    for name, (u, iterations, cost, status) in solutions.items():
        seconds = float(np.median(taken[name]))
        own, taut = event_driven_cost(task, u)
        ratio = np.median(np.array(taken[name]) / taken["ours"][: len(taken[name])])
        print(
            f"{name:12} {status:10} {seconds:7.3f} s, {iterations:2} iterations of "
            f"{1e3 * seconds / iterations:6.1f} ms, ratio {ratio:5.2f}; cost {cost:.8g} said, "
            f"{scores[name] / best_cost - 1:.1e} above the least; inputs "
            f"{np.max(np.abs(u - solutions[best_name][0])):.1e} m/s^2 off; our run scores "
            f"{own / scores[name] - 1:+.0e}{'' if taut else ', slack on the way'}"
        )


def derivatives(problem: Problem, python: Path, turns: int) -> None:
    """Prints the times of a step with derivatives."""
    marionette, n = problem.marionette(), problem.intervals
    t, rng = marionette.coordinates, np.random.default_rng(0)
    q, v = 0.2 * rng.standard_normal((2, n, t.n_vD + t.n_vK))
    states = q[:, t.n_vK :], v[:, t.n_vK :], q[:, : t.n_vK], v[:, : t.n_vK]
    mujoco, rows = MuJoCoSteps(problem), []
    acc = rng.standard_normal((n, t.n_vK))
    x = marionette.state().replace(q_D=states[0][0], v_D=states[1][0], v_K=states[3][0])
    acc_D = marionette.forward_dynamics(x, acc[0]).acc_D
    apart = np.max(np.abs(mujoco.accelerations(q[0], v[0], acc[0]) - acc_D))
    print(
        f"\nA step and its derivatives [us]; MuJoCo's accelerations are {apart:.0e} off, of up to "
        f"{np.max(np.abs(acc_D)):.0f} rad/s^2"
    )
    with Crocoddyl(python, problem) as peer:
        for _ in range(turns):
            began = time.perf_counter()
            marionette.linearise_steps(*states, acc, dt=DT, threads=1)
            row = [(time.perf_counter() - began) / n]
            row += [peer("derivatives", integrator=i, turns=n)["seconds"] for i in INTEGRATORS]
            row += [mujoco.derivatives(q, v, centred) for centred in (False, True)]
            rows.append(row)
    names = ("ours", "Crocoddyl, Euler", "Crocoddyl, RK4", "MuJoCo, forward", "MuJoCo, centred")
    for name, column in zip(names, np.array(rows).T, strict=True):
        ratio = np.median(column / np.array(rows)[:, 0])
        print(f"{name:18} {1e6 * np.median(column):7.1f}, ratio {ratio:5.2f}")


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument(
        "--crocoddyl",
        type=Path,
        default=ROOT / ".venv-crocoddyl" / "bin" / "python",
        help="interpreter with Crocoddyl",
    )
    arguments = parser.parse_args()
    if not arguments.crocoddyl.exists():
        parser.error(f"no {arguments.crocoddyl}; `make optimal-peers` installs Crocoddyl there")
    for problem in (crane(), puppet(100), puppet(200)):
        compare(problem, arguments.crocoddyl, arguments.turns)
    derivatives(puppet(), arguments.crocoddyl, 4 * arguments.turns)


if __name__ == "__main__":
    main()
