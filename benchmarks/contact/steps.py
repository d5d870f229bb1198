"""Sections 1 and 2: the time of a step compared with MuJoCo's, and MuJoCo's settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

import fantoccini as fan

from ..speed.figures import Chapter, Goal, in_turns, ratio_text, spread_text, time_text
from ..strings.report import Section, Table, number
from .mujoco_scene import MuJoCoScene
from .programs import Program, compile_scene
from .subject import DT, HEAP, ONE, TWO, Subject

FASTER = 4.0
"""Target speed-up over mj_step for one marionette on its feet."""

LONGEST = 20e-6
"""The longest step of two marionettes [s]."""

SETTLING = 2.0
"""Time before MuJoCo's points and overlaps are read [s]."""


@dataclass(frozen=True)
class Pair:
    """A subject, in our program and in MuJoCo.

    Attributes:
        subject: simulated scene.
        program: our program.
        peer: MuJoCo's scene, with the fastest setting.
        tried: setting -> shortest time of a step [s].
    """

    subject: Subject
    program: Program
    peer: MuJoCoScene
    tried: dict[str, float]


def compiled_pairs(turns: int, steps: int) -> list[Pair]:
    """All subjects, compiled, with MuJoCo's fastest settings."""
    subject_pairs, programs = [], {}
    for subject in (ONE, TWO, HEAP):
        members = len(subject.members)
        if members not in programs:
            programs[members] = compile_scene(subject.marionette, DT)
        program = Program(programs[members].path, subject.marionette, DT)
        x = subject.standing
        peer = MuJoCoScene.of(fan.Marionette(subject.peers_puppet), x.q_K, DT)
        subject_pairs.append(
            Pair(subject, program, peer, peer.find_fastest(x, steps, max(3, turns // 3)))
        )
    return subject_pairs


def chapters(subject_pairs: list[Pair], turns: int, steps: int) -> list[Chapter]:
    """Times, ratios, marks, and MuJoCo's settings."""
    actions: dict[str, Callable[[], float]] = {}
    for pair in subject_pairs:
        actions[_time_fantoccini(pair)] = lambda pair=pair: pair.program.run(
            pair.subject.standing, "step", 1, steps
        ).seconds[0]
        actions[_time_mujoco(pair)] = lambda pair=pair: pair.peer.burst(
            pair.subject.standing, steps, steps // 4
        )
    taken = in_turns(actions, turns)
    ratios = {
        p.subject.name: taken[_time_mujoco(p)].over(taken[_time_fantoccini(p)])
        for p in subject_pairs
    }
    rows = [[name, *spread_text(samples)] for name, samples in taken.items()]
    ratio_rows = [[f"mj_step / ours, {n}", *spread_text(r, ratio_text)] for n, r in ratios.items()]
    goals = [Goal(f"mj_step / ours, {ONE.name}", ratios[ONE.name], FASTER)]
    for pair in subject_pairs[1:]:
        points = pair.program.run(pair.subject.standing, "step", 1, 10).points
        what = f"a step of {pair.subject.name}, {points} points"
        goals.append(Goal(what, taken[_time_fantoccini(pair)], LONGEST, False))
    text = (
        f"A time step of {time_text(DT)} from the puppets' stance after their strings were let "
        f"out, in turn, {turns} times {steps} steps each, in processor time. "
        "Ours: a compiled C++ program with the library's flags that makes the steps of a run and "
        "saves nothing; MuJoCo: one call of `mj_step` with elliptic cones and Newton's method, "
        "and default softness. Ours is compiled for this processor, MuJoCo is the published "
        "wheel. MuJoCo's puppets lack the drag, the neck's spring and the limits of twists of "
        "ours. Ratios are computed turn by turn."
    )
    table = Table(["program, work", "median", "min", "max"], rows)
    ratio_table = Table(["ratio", "median", "min", "max"], ratio_rows)
    parts = [text, table, ratio_table, _contact_forces(subject_pairs)]
    first = Chapter(Section("1. Time steps", parts), goals)
    return [first, _settings(subject_pairs)]


def _contact_forces(subject_pairs: list[Pair]) -> Table:
    """Contact forces of both programs, which show that they simulate the same scene."""
    rows = []
    for pair in subject_pairs:
        burst = pair.program.run(pair.subject.standing, "step", 1, 1000)
        pair.peer.put(pair.subject.standing)
        pair.peer.step(round(SETTLING / DT))
        normal = sum(pair.peer.force(i)[0] for i in range(pair.peer.data.ncon))
        rows.append(
            [
                pair.subject.name,
                f"{burst.points}, {pair.peer.points}",
                f"{burst.force:.2f}, {normal:.2f}",
                f"{number(burst.depth)}, {number(pair.peer.depth)}",
            ]
        )
    header = ["ours, MuJoCo", "points that push", "normal forces [N]", "deepest overlap [m]"]
    return Table(header, rows)


def _settings(subject_pairs: list[Pair]) -> Chapter:
    rows = []
    for pair in subject_pairs:
        shortest = min(pair.tried.values())
        for name, seconds in pair.tried.items():
            text = f"**{time_text(seconds)}**" if seconds == shortest else time_text(seconds)
            rows.append([f"{pair.subject.name}: {name}", text])
    text = (
        f"The fastest of some bursts of MuJoCo {mujoco.__version__} selects the Jacobian and "
        "whether constraints are split into islands; the setting in bold is timed."
    )
    return Chapter(Section("2. MuJoCo's settings", [text, Table(["setting", "a step"], rows)]))


def _time_fantoccini(pair: Pair) -> str:
    return f"fantoccini, {pair.subject.name}"


def _time_mujoco(pair: Pair) -> str:
    return f"MuJoCo {mujoco.__version__}, {pair.subject.name}"
