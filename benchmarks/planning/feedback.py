"""Prints how many plans arrive in MuJoCo, open loop and with feedback, and what they absorb.

    python -m benchmarks.planning.feedback [--seeds 40] [--improve 0.5]

A plan arrives when it ends within the tolerance; what it touches on the way is counted apart.
Strings pull all the way; for plans on which they go slack see :mod:`benchmarks.planning.events`.
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
from fantoccini.control.planning.feedback import Feedback, Followed
from fantoccini.control.problems import Problem
from fantoccini.dynamics.mujoco import MuJoCoPuppet
from fantoccini.motion import State

KICKS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Sizes of changes of all joint velocities at the start, together [rad/s]."""

STEP = 0.001
"""Of MuJoCo [s]."""

OF_EACH = 2
"""Kicks of one size for a plan."""


@dataclass(frozen=True)
class Row:
    """How many of some runs arrive.

    Attributes:
        name: of the runs.
        runs: how many there are.
        within: that end within the tolerance.
        clear: that touch nothing either.
    """

    name: str
    runs: int
    within: int
    clear: int

    @classmethod
    def of(cls, name: str, found: Sequence, tolerance: float) -> Row:
        """Counts what was found."""
        within = sum(one.distance <= tolerance for one in found)
        return cls(name, len(found), int(within), sum(one.arrives for one in found))

    def __str__(self) -> str:
        return f"{self.name:40} {self.within:4d} of {self.runs} arrive, {self.clear} touch nothing"


def measure(problem: Problem, seeds: Iterable[int], improve: float = 0.5) -> list[Row]:
    """Arrivals of plans, one a seed, and of kicked runs of the first quarter of them."""
    found = [solve(problem, seed=seed, improve=improve) for seed in seeds]
    laws = [plan.feedback() for plan in found if plan]
    exact = [law.plan.verify(method="event") for law in laws]
    rows = [Row.of("open loop, event-driven", exact, problem.tolerance)]
    ways = {"open loop, MuJoCo": False, "feedback, MuJoCo": True}
    for name, closed in ways.items():
        followed = [follow(law, law.plan.start, closed) for law in laws]
        rows.append(Row.of(name, followed, problem.tolerance))
    few = laws[: max(1, len(laws) // 4)]
    for name, closed in ways.items():
        for size in KICKS:
            random = np.random.default_rng(0)
            starts = [(law, kicked(problem, size, random)) for law in few for _ in range(OF_EACH)]
            followed = [follow(law, x0, closed) for law, x0 in starts]
            rows.append(Row.of(f"{name}, kicked by {size:g} rad/s", followed, problem.tolerance))
    return rows


def half(rows: Sequence[Row], name: str, what: str) -> float:
    """The size of kick that half of the runs absorb, between those that were tried [rad/s].

    Args:
        rows: what was measured.
        name: ``open loop, MuJoCo`` or ``feedback, MuJoCo``.
        what: ``within`` or ``clear``.
    """
    shares = {
        size: getattr(row, what) / row.runs
        for size in KICKS
        for row in rows
        if row.name == f"{name}, kicked by {size:g} rad/s"
    }
    # Shares fall with the size, but for chance.
    falling = np.minimum.accumulate(list(shares.values()))
    return float(np.exp(np.interp(-0.5, -falling, np.log(list(shares)))))


def kicked(problem: Problem, size: float, random: np.random.Generator) -> State:
    """The start with other joint velocities, as far as strings that are taut let them be."""
    x = problem.start
    kick = random.normal(size=len(x.v_D))
    return problem.marionette.project(x.replace(v_D=x.v_D + size * kick / np.linalg.norm(kick)))


def follow(law: Feedback, x0: State, closed: bool) -> Followed:
    """A plan in MuJoCo, from look to look; the law is evaluated once per segment."""
    problem, interval = law.plan.problem, law.plan.rollouts.options.interval
    puppet, states, commanded = MuJoCoPuppet(problem.marionette, STEP), [x0], []
    puppet.put(x0.q_D, x0.v_D)
    for k, looks in enumerate(law.looks):
        commanded.append(law.acceleration(k, states[-1]) if closed else law.planned[k])
        for _ in range(looks):
            states.append(advanced(puppet, states[-1], interval, commanded[-1]))
    whole = np.all(np.isfinite(np.concatenate([states[-1].q_D, states[-1].v_D])))
    status = Status.DONE if whole else Status.NOT_FINITE
    return Followed.of(problem, states, np.array(commanded), status)


def advanced(puppet: MuJoCoPuppet, x: State, duration: float, acc_K: Array) -> State:
    """Where a puppet is that goes on with constant accelerations of its driven coordinates.

    Args:
        puppet: stands as in ``x``.
        x: where it is.
        duration: a multiple of the step [s].
        acc_K: (n_vK,) [m/s^2].
    """
    puppet.drive(x.q_K, x.v_K, acc_K)
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
        within, clear = (half(rows, name, what) for what in ("within", "clear"))
        print(f"{name}: half absorb {within:.2g} rad/s, {clear:.2g} touching nothing")


if __name__ == "__main__":
    main()
