"""Section 5: cost of an accurate motion with catches, for MuJoCo and ours.

The arm of ``benchmarks.strings`` is dropped from a slack pose. Its string's end is at rest, since
MuJoCo's limits ignore the speed of a driven end.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.dynamics.mujoco import mjcf
from fantoccini.motion import State
from harness import start
from oracles import arm2d_events

from ..strings.report import Section, Table, number
from ..strings.scenarios import ARM, FALL, arm
from . import by_joint
from .figures import Chapter, Goal, Samples, in_turns, ratio_text, time_text
from .mujoco_peer import MuJoCo, PeerError
from .peers import Peers

SECONDS = 2.0
"""Length of the motion [s]."""

GOAL, MARK = 1e-6, 100.0
"""Target error, and target ratio of MuJoCo's time to ours."""

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
INTEGRATORS = ("Euler", "RK4")
STEPS = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
FINE_STEPS = (3e-6, 1e-6, 3e-7, 1e-7)
"""Steps for only the best settings so far [s]."""

N_REFINED = 2
DAMPINGS = (None, 1.0, 5.0, 30.0, 200.0, 1000.0)
"""Hardness of strings: the default, or the shortest time constant that MuJoCo's safeguard
allows, two steps, the highest impedance, and a damping ratio. With more damping a
catch rebounds less; with 1, by a seventh of the speed at any step."""

MODEL = "arm"


@dataclass(frozen=True)
class Run:
    """One run of MuJoCo.

    Attributes:
        integrator: name of the integrator.
        damping: one of ``DAMPINGS``.
        dt: [s].
        seconds: processor time [s].
        error: largest error of coordinates and velocities at the end; infinite if it failed.
    """

    integrator: str
    damping: float | None
    dt: float
    seconds: float
    error: float

    @property
    def name(self) -> str:
        hard = "default" if self.damping is None else f"stiffest, damping {number(self.damping)}"
        return f"{self.integrator}, {hard}"

    @property
    def setting(self) -> tuple[str, float | None, float]:
        """The setting that reproduces it."""
        return self.integrator, self.damping, self.dt


@dataclass(frozen=True)
class Problem:
    """The motion and its final state.

    Attributes:
        x0: the slack pose.
        end: (4,) coordinates and velocities, by SciPy.
        doubt: change of ``end`` with a tolerance ten times as large.
        catches: number of catches.
    """

    x0: State
    end: Array
    doubt: float
    catches: int

    @classmethod
    def fall(cls) -> Problem:
        """The arm dropped on its slack string."""
        x0 = start(arm(), FALL, {})
        hook = [(t, FALL["hand.x"]) for t in (0, SECONDS)]
        length = [(t, FALL["hand.length"]) for t in (0, SECONDS)]
        drive = arm2d_events.waypoints(hook, length)
        known, other = (
            arm2d_events.simulate(ARM, x0.q_D, x0.v_D, drive, SECONDS, tolerance=tolerance)
            for tolerance in (1e-13, 1e-12)
        )
        doubt = float(np.max(np.abs(known.state - other.state)))
        catches = sum(kind == "catch" for _, kind, *_ in known.events)
        return cls(x0, known.state, doubt, catches)

    def error(self, q: Array, v: Array) -> float:
        """The largest error of coordinates [rad] and velocities [rad/s]."""
        apart = float(np.max(np.abs(np.concatenate([q, v]) - self.end)))
        return apart if math.isfinite(apart) else math.inf

    def ours(self, tolerance: float) -> tuple[float, float]:
        """Processor time [s] and error of an event-driven run."""
        began = time.thread_time()
        run = fan.simulate(
            arm(),
            self.x0,
            None,
            t_end=SECONDS,
            method=fan.Event(rtol=tolerance, atol=tolerance),
            effort=False,
            save_at=[SECONDS],
        )
        return time.thread_time() - began, self.error(run.q_D[-1], run.v_D[-1])

    def theirs(self, peer: MuJoCo, integrator: str, damping: float | None, dt: float) -> Run:
        """A run of MuJoCo."""
        settings = {
            "integrator": integrator,
            "solver": "Newton",
            "jacobian": "dense",
            "islands": False,
            "timestep": dt,
            "tolerance": 1e-14,
            "iterations": 200,
        }
        if damping is not None:
            settings["solref"] = [2.0 * dt, damping]
            settings["solimp"] = [0.9999, 0.9999, 0.001, 0.5, 2.0]
        joints = by_joint.dynamic_joints(arm().tree, self.x0.q_D, self.x0.v_D)
        q, v = ({n: getattr(j, part) for n, j in joints.items()} for part in "qv")
        steps = round(SECONDS / dt)
        try:
            answer = peer.ask("step", model=MODEL, settings=settings, q=q, v=v, steps=steps)
        except PeerError:
            return Run(integrator, damping, dt, math.inf, math.inf)
        end = [by_joint.pack_rates(arm().tree, answer[part]) for part in "qv"]
        return Run(integrator, damping, dt, answer["seconds"] * steps, self.error(*end))


def sweep(run: Callable[[str, float | None, float], Run], budget: float) -> list[Run]:
    """All settings at the coarse steps, the best at finer ones until they reach the goal.

    Args:
        run: function that makes a run.
        budget: largest expected time of a run [s].
    """
    settings = list(itertools.product(INTEGRATORS, DAMPINGS))
    tried = [run(*setting, dt) for setting in settings for dt in STEPS]
    best = {setting: _smallest_error(tried, setting) for setting in settings}
    for setting in sorted(best, key=best.get)[:N_REFINED]:
        for dt in FINE_STEPS:
            last = next(r for r in reversed(tried) if r.setting[:2] == setting)
            if _smallest_error(tried, setting) <= GOAL or last.seconds * last.dt / dt > budget:
                break
            tried.append(run(*setting, dt))
    return tried


def chapter(peers: Peers, turns: int, budget: float) -> Chapter:
    """The cheapest way to the goal on both sides."""
    problem = Problem.fall()
    problem.ours(TOLERANCES[0])  # what is done once is done
    runs = [(tolerance, *problem.ours(tolerance)) for tolerance in TOLERANCES]
    rows = [["fantoccini, event", number(t), time_text(took), number(e)] for t, took, e in runs]
    tolerance = next(t for t, _, error in runs if error <= GOAL)
    text = (
        f"The two-link arm is dropped on its slack string; in {SECONDS:g} s it is caught "
        f"{problem.catches} times. Errors are the largest of angles and rates at the end, against "
        "SciPy's DOP853 at 1e-13 with events located independently (at 1e-12 it ends "
        f"{number(problem.doubt)} away). MuJoCo's runs are dense Newton, converged to 1e-14; "
        "stiffest is a time constant of two steps, the shortest that its safeguard allows, and "
        "an impedance of 0.9999. Its best settings are run with steps down to "
        f"{number(FINE_STEPS[-1])} s while a run takes at most {number(budget)} s. Times are "
        "processor times; ours include the whole call of `fan.simulate`."
    )
    parts: list = [text]
    reached = False
    smallest_ratio: Samples | str = peers.no_mujoco
    for peer in peers.mujoco.values():
        peer.load(mjcf(arm(), problem.x0.q_K), MODEL)
        tried = sweep(functools.partial(problem.theirs, peer), budget)
        best = best_run(tried)
        reached = reached or best.error <= GOAL
        taken = in_turns(
            {
                "ours": lambda: problem.ours(tolerance)[0],
                "theirs": lambda peer=peer, best=best: problem.theirs(peer, *best.setting).seconds,
            },
            turns,
        )
        ratio = taken["theirs"].over(taken["ours"])
        if isinstance(smallest_ratio, str) or ratio.median < smallest_ratio.median:
            smallest_ratio = ratio
        parts.append(_result_text(peer, best, taken, tolerance))
        rows += [
            [
                f"MuJoCo {peer.version}, {r.name}",
                number(r.dt),
                time_text(r.seconds),
                number(r.error),
            ]
            for r in _best_by_step(tried)
        ]
    parts.append(Table(["method", "tolerance or step (s)", "time", "error"], rows))
    what = f"time to {number(GOAL)} on {SECONDS:g} s with catches: MuJoCo's best / ours"
    if peers.mujoco and not reached:
        what += f" (not reached within {number(budget)} s: the time of its smallest error)"
    return Chapter(Section("5. Error and cost", parts), [Goal(what, smallest_ratio, MARK)])


def best_run(tried: list[Run]) -> Run:
    """The cheapest run that reaches the goal, or the most accurate run if none does."""
    there = [run for run in tried if run.error <= GOAL]
    return min(there, key=lambda r: r.seconds) if there else min(tried, key=lambda r: r.error)


def _smallest_error(tried: list[Run], setting: tuple) -> float:
    """The smallest error of a setting."""
    return min(run.error for run in tried if run.setting[:2] == setting)


def _best_by_step(tried: list[Run]) -> list[Run]:
    """The most exact run of every integrator and step."""
    keys = dict.fromkeys((run.integrator, run.dt) for run in tried)
    return [
        min((r for r in tried if (r.integrator, r.dt) == key), key=lambda r: r.error)
        for key in keys
    ]


def _result_text(peer: MuJoCo, best: Run, taken: dict[str, Samples], tolerance: float) -> str:
    """The result of a version, as text."""
    ours, theirs = time_text(taken["ours"].median), time_text(taken["theirs"].median)
    ratio = ratio_text(taken["theirs"].over(taken["ours"]).median)
    run = f"{best.name}, steps of {number(best.dt)} s"
    if best.error <= GOAL:
        reached = f"reaches {number(GOAL)} with {run} in {theirs}, {ratio} ours"
    else:
        reached = (
            f"does not reach {number(GOAL)}: its best is {number(best.error)} ({run}) and takes "
            f"{theirs}, {ratio} ours, a lower bound of the ratio"
        )
    return (
        f"MuJoCo {peer.version} {reached}; ours takes {ours} at a tolerance of {number(tolerance)}."
    )
