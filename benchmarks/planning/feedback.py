"""Prints the arrivals of plans in MuJoCo, open loop and with feedback, and the absorbed kicks.

    python -m benchmarks.planning.feedback [--seeds 40] [--improve 0.5]

A plan arrives if it ends within the tolerance; touches on the way are counted separately.
Strings stay taut; for plans on which they go slack see :mod:`benchmarks.planning.events`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.base.errors import Status
from fantoccini.control.planning import solve
from fantoccini.control.planning.feedback import ClosedLoopRollout, Feedback
from fantoccini.control.problems import Problem
from fantoccini.dynamics.mujoco import MuJoCoPuppet
from fantoccini.motion import State

KICKS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Norms of changes of all joint velocities at the start [rad/s]."""

STEP = 0.001
"""Time step of MuJoCo [s]."""

OF_EACH = 2
"""Number of kicks of one size for a plan."""


@dataclass(frozen=True)
class Row:
    """Arrivals of runs.

    Attributes:
        name: name of the runs.
        runs: number of runs.
        within: number that end within the tolerance.
        clear: number that also touch nothing.
    """

    name: str
    runs: int
    within: int
    clear: int

    @classmethod
    def of(cls, name: str, followed: Sequence, tolerance: float) -> Row:
        """The counts of followed plans."""
        within = sum(run.distance <= tolerance for run in followed)
        return cls(name, len(followed), int(within), sum(run.arrives for run in followed))

    def __str__(self) -> str:
        return f"{self.name:40} {self.within:4d} of {self.runs} arrive, {self.clear} touch nothing"


def measure(problem: Problem, seeds: Iterable[int], improve: float = 0.5) -> list[Row]:
    """Arrivals of plans, one per seed, and of kicked runs of the first quarter of them."""
    plans = [solve(problem, seed=seed, improve=improve) for seed in seeds]
    laws = [plan.feedback() for plan in plans if plan]
    exact = [plan.verify(method="event") for plan in plans if plan]
    rows = [Row.of("open loop, event-driven", exact, problem.tolerance)]
    ways = {"open loop, MuJoCo": False, "feedback, MuJoCo": True}
    for name, closed in ways.items():
        followed = [follow(law, law.plan.start, closed) for law in laws]
        rows.append(Row.of(name, followed, problem.tolerance))
    kicked_laws = laws[: max(1, len(laws) // 4)]
    for name, closed in ways.items():
        for size in KICKS:
            random = np.random.default_rng(0)
            starts = [
                (law, kicked_start(problem, size, random))
                for law in kicked_laws
                for _ in range(OF_EACH)
            ]
            followed = [follow(law, x0, closed) for law, x0 in starts]
            rows.append(Row.of(f"{name}, kicked by {size:g} rad/s", followed, problem.tolerance))
    return rows


def half_absorbed_kick(rows: Sequence[Row], name: str, count: str) -> float:
    """The size of kick that half of the runs absorb, interpolated between tested ones [rad/s].

    Args:
        rows: measured rows.
        name: ``open loop, MuJoCo`` or ``feedback, MuJoCo``.
        count: field of the rows, ``within`` or ``clear``.
    """
    shares = {
        size: getattr(row, count) / row.runs
        for size in KICKS
        for row in rows
        if row.name == f"{name}, kicked by {size:g} rad/s"
    }
    # Shares fall with the size, except for chance.
    falling = np.minimum.accumulate(list(shares.values()))
    return float(np.exp(np.interp(-0.5, -falling, np.log(list(shares)))))


def kicked_start(problem: Problem, size: float, random: np.random.Generator) -> State:
    """The start with other joint velocities that taut strings permit."""
    x = problem.start
    kick = random.normal(size=len(x.v_D))
    return problem.marionette.project(x.replace(v_D=x.v_D + size * kick / np.linalg.norm(kick)))


def follow(law: Feedback, x0: State, closed: bool) -> ClosedLoopRollout:
    """A plan in MuJoCo, check by check; the law is evaluated once per segment."""
    problem, interval = law.plan.problem, law.plan.rollouts.options.interval
    puppet, states, commanded = MuJoCoPuppet(problem.marionette, STEP), [x0], []
    puppet.set_dynamic(x0.q_D, x0.v_D)
    for k, n_checks in enumerate(law.n_checks):
        commanded.append(law.acceleration(k, states[-1]) if closed else law.planned_acceleration[k])
        for _ in range(n_checks):
            states.append(advance_state(puppet, states[-1], interval, commanded[-1]))
    whole = np.all(np.isfinite(np.concatenate([states[-1].q_D, states[-1].v_D])))
    status = Status.DONE if whole else Status.NOT_FINITE
    return ClosedLoopRollout.from_states(problem, states, np.array(commanded), status)


def advance_state(puppet: MuJoCoPuppet, x: State, duration: float, acc_K: Array) -> State:
    """State of a puppet after constant accelerations of its driven coordinates.

    Args:
        puppet: MuJoCo's puppet in the state ``x``.
        x: its state.
        duration: duration, a multiple of the step [s].
        acc_K: (n_vK,) [m/s^2].
    """
    puppet.set_driven(x.q_K, x.v_K, acc_K)
    for _ in range(round(duration / STEP)):
        puppet.evaluate()
        puppet.step()
    puppet.evaluate()
    return x.replace(
        taut=np.concatenate(puppet.forces()) > 0.0,
        t=x.t + duration,
        q_D=puppet.data.qpos[puppet.q_D],
        v_D=puppet.data.qvel[puppet.v_D],
        q_K=x.q_K + duration * (x.v_K + 0.5 * duration * acc_K),
        v_K=x.v_K + duration * acc_K,
    )


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problem", default="arm3d_boxes", help="name or file of a problem")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--improve", type=float, default=0.5, help="seconds of improving [s]")
    arguments = parser.parse_args()
    problem = fan.control.load_problem(arguments.problem)
    rows = measure(problem, range(arguments.seeds), arguments.improve)
    print(*rows, sep="\n")
    for name in ("open loop, MuJoCo", "feedback, MuJoCo"):
        within, clear = (half_absorbed_kick(rows, name, count) for count in ("within", "clear"))
        print(f"{name}: half absorb {within:.2g} rad/s, {clear:.2g} touching nothing")


if __name__ == "__main__":
    main()
