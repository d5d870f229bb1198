"""Prints the time of the marionette's programs of stages, with several solvers in turns.

    python -m benchmarks.optimal.solvers [--turns 10]

The programs are first steps of the task ``circle``: unchanged, with all 21 inputs, and with
accelerations bounded so that many bounds are active. PIQP solves them unchanged; HPIPM and
OSQP, from CasADi, without bounds of tensions. HPIPM gets the smallest number of iterations after
which its inputs are within 1e-4 m/s^2 of the solution.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import fantoccini as fan
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.quadratic import StageProgram, StageSolver
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.nodes import Nodes

from .casadi_stages import CasadiSolver
from .piqp_stages import PiqpSolver

DAMPING = 3e-4
"""Damping of the Hessian, in units of the cost: that of the search's first step."""
INPUT_TOLERANCE = 1e-4
"""Largest error of the inputs of a solution [m/s^2]."""


def first_program(task: fan.Task) -> tuple[StageProgram, float]:
    """The program of a task's first step, and its unit."""
    steps = TimeSteps(task.marionette, task.dt, 1)
    runs = EventRuns(steps, ChosenParameters(task.marionette, task.x0, {}))
    motion = runs.run(Nodes.constant(task.marionette, task.x0, task.durations[1], task.n_intervals))
    assert motion is not None
    objective, linear = Objective(task), runs.linearise(motion[0], runs.ends(*motion))
    objective.set_unit(motion[0], linear)
    return objective.program(motion[0], linear, DAMPING * objective.unit, 0.0), objective.unit


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """The result of a call, and its duration [ms]."""
    began = time.perf_counter()
    result = call()
    return result, 1e3 * (time.perf_counter() - began)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=10)
    turns = parser.parse_args().turns
    circle = fan.control.load_task("circle")
    free = replace(circle.bounds, held=())
    tasks = {
        "circle": circle,
        "21 inputs": replace(circle, bounds=free),
        "21 inputs, bounds in force": replace(circle, bounds=replace(free, acceleration=0.3)),
    }
    for name, task in tasks.items():
        program, unit = first_program(task)
        own, other, taken = StageSolver(1e-8), PiqpSolver(1e-8), []
        for _ in range(turns):
            a, own_ms = timed(partial(own.solve, program, unit))
            b, other_ms = timed(partial(other.solve, program, unit))
            taken.append((own_ms, other_ms))
        exact = StageSolver(1e-13).solve(program, unit), PiqpSolver(1e-11).solve(program, unit)
        apart = np.max(np.abs(exact[0].u - exact[1][0]))
        own_ms, other_ms = np.median(taken, axis=0)
        print(
            f"{name}: {own_ms:.1f} ms ({a.iterations} factorisations), PIQP {other_ms:.1f} ms "
            f"({b[1]}), ratio {np.median([y / x for x, y in taken]):.1f}; apart {apart:.1e} m/s^2"
        )
        print_solver_times(replace(task, bounds=replace(task.bounds, tension={})), turns)


def print_solver_times(task: fan.Task, turns: int) -> None:
    """Prints the times of HPIPM, OSQP and our own solver."""
    program, unit = first_program(task)
    exact = StageSolver(1e-13).solve(program, unit).u
    own = StageSolver(1e-8)
    for other, limits in (("hpipm", (1, 2, 4, 8, 12, 16, 24, 32, 60)), ("osqp", (0,))):
        for limit in limits:
            solver = CasadiSolver(other, program, limit)
            apart = float(np.max(np.abs(solver.solve(program, unit)[0] - exact)))
            if apart < INPUT_TOLERANCE:
                break
        taken = []
        for _ in range(turns):
            ms = timed(partial(own.solve, program, unit))[1]
            taken.append((ms, solver.solve(program, unit)[1]))
        own_ms, other_ms = np.median(taken, axis=0)
        ratio = np.median([y / x for x, y in taken])
        its = f" ({limit})" if limit else ""
        print(
            f"  without tensions: {own_ms:.1f} ms, {other.upper()} {other_ms:.1f} ms{its}, ratio "
            f"{ratio:.1f}; apart {apart:.1e} m/s^2"
        )


if __name__ == "__main__":
    main()
