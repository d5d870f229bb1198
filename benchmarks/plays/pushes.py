"""Counts the cues of a live show that hold when hands slip and bodies are pushed.

    python -m benchmarks.plays.pushes PLAY.yaml [SEEDS]

In each run four pushes come at random times, each to a random player:

    slip      a hand is jerked by 2 cm in a random direction within 0.1 s, and returns: the size
              of a slip of a hand
    impulse   a trunk or head gets 0.1 m/s times the player's mass within 0.1 s

A cue holds if every limb that turns at a mark of its gesture does so within 1/60 s of its time
in an undisturbed run, and every body of its player is within 2 cm of its place there
at the cue's beginning, marks and end. A cue is hit if its player is pushed during it.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from scipy.interpolate import CubicSpline

import fantoccini as fan
from fantoccini.theatre.gestures import measure_lateness
from fantoccini.theatre.perform.steady import PlayerBodies
from fantoccini.theatre.plays import CueOfPlay

SEEDS = 20
PUSHES = 4
SLIP, SLIP_TIME = 0.02, 0.1
"""Distance [m] and duration [s] of a hand's slip."""
GIVEN = 0.1
"""Speed of an impulse [m/s]."""
LATE, NEAR = 1 / 60, 0.02
"""Largest lateness of a cue [s] and position error of a body [m]."""


@dataclass
class Run:
    """A show on the play's clock, for :func:`fantoccini.measure_lateness`."""

    t: np.ndarray
    q_D: CubicSpline
    q_K: CubicSpline

    def resample(self, t: np.ndarray) -> SimpleNamespace:
        return SimpleNamespace(q_D=self.q_D(t), q_K=self.q_K(t))


@dataclass
class Pushes:
    """Pushes of a show, with their times."""

    kind: str
    seed: int
    whom: list[tuple[float, str]] = field(default_factory=list)
    """Times [s] and players."""
    jobs: list[tuple[float, Callable[[], None]]] = field(default_factory=list)

    def plan(self, show: fan.theatre.LivePlay) -> None:
        rng = np.random.default_rng(self.seed)
        live, players = show.performance, show.play.cast.players
        for t in np.sort(rng.uniform(1.0, show.play.duration - 1.0, PUSHES)):
            who = str(rng.choice(list(players)))
            own = show.play.cast.prefix(who)
            way = rng.normal(size=3)
            way /= np.linalg.norm(way)
            self.whom.append((float(t), who))
            if self.kind == "slip":
                hands = [handle.name for handle in live.handles if handle.name.startswith(own)]
                hand = str(rng.choice(hands))
                self.jobs += slip_hand(live, hand, SLIP * way, float(t))
            else:
                bodies = [own + "torso", own + "skull"]
                force = GIVEN * players[who].marionette.weight / 9.81 / SLIP_TIME * way
                self.jobs += impulse(live, str(rng.choice(bodies)), force, float(t))
        self.jobs.sort(key=lambda job: job[0])

    def act(self, t: float) -> None:
        while self.jobs and t >= self.jobs[0][0]:
            self.jobs.pop(0)[1]()


def slip_hand(live: fan.Performance, hand: str, way: np.ndarray, t: float):
    def jerk() -> None:
        live.move(hand, live.target(hand)[0] + way)

    def back() -> None:
        live.move(hand, live.target(hand)[0] - way)

    return [(t, jerk), (t + SLIP_TIME, back)]


def impulse(live: fan.Performance, body: str, force: np.ndarray, t: float):
    return [(t, lambda: live.push(body, force)), (t + SLIP_TIME, lambda: live.push(body, None))]


def perform_show(play: fan.theatre.Play, steady: bool, pushes: Pushes | None = None) -> Run:
    """A show from GO to its end; GO is given whenever it waits."""
    show = fan.theatre.LivePlay(play)
    if not steady:
        show.steady = None
    if pushes is not None:
        pushes.plan(show)
    show.go()
    t, q_D, q_K = [], [], []
    while not show.done:
        if show.waiting is not None:
            show.go()
        x = show.advance(show.performance.tick)
        if not t or show.t > t[-1]:
            t.append(show.t)
            q_D.append(x.q_D)
            q_K.append(x.q_K)
        if pushes is not None:
            pushes.act(show.t)
    clock = np.array(t)
    return Run(clock, CubicSpline(clock, q_D), CubicSpline(clock, q_K))


def lateness_of_limbs(play: fan.theatre.Play, run: Run) -> dict[tuple[int, str, str, str], float]:
    """Lateness of limbs by (cue, player, mark, string) [s]."""
    parts = {id(cue): part for cue, part in zip(play.score.cues, play.parts, strict=True)}
    return {
        (*parts[id(late.cue)], late.mark, late.string): late.seconds
        for late in measure_lateness(play.score, run)
    }


def largest_distance(play: fan.theatre.Play, run: Run, still: Run, cue: CueOfPlay) -> float:
    """Largest distance of a body of the cue's players from its place in the other run [m]."""
    largest, links = 0.0, play.marionette.tree.links
    for who in cue.who:
        own = [i for i, b in enumerate(links) if b.name.startswith(play.cast.prefix(who))]
        times = np.clip([*cue.marks[who].values()], run.t[0], run.t[-1])
        there = [
            play.marionette.poses(at.q_D, at.q_K)[:, own, :, 3]
            for at in (run.resample(times), still.resample(times))
        ]
        largest = max(largest, float(np.max(np.linalg.norm(there[0] - there[1], axis=-1))))
    return largest


def main() -> None:
    play = fan.load_play(sys.argv[1])
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else SEEDS
    print(play)
    for steady in (True, False):
        print(f"hands {'shift' if steady else 'do not shift'} against swing")
        still = perform_show(play, steady)
        usual = lateness_of_limbs(play, still)
        print_settling_times(play, steady)
        for kind in ("slip", "impulse"):
            print_counts(play, still, usual, kind, seeds, steady)


def print_settling_times(play: fan.theatre.Play, steady: bool, seeds: int = 6) -> None:
    """Prints the time for which a player's centre of mass is off by 1 cm after an impulse."""
    members, durations = PlayerBodies(play), []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        who = int(rng.integers(len(members.names)))
        begins = float(rng.uniform(3.0, 20.0))
        shows = [fan.theatre.LivePlay(play), fan.theatre.LivePlay(play)]
        for show in shows:
            show.steady = show.steady if steady else None
            show.go()
            show.advance(begins)
        tick, name = shows[0].performance.tick, members.names[who]
        weight = play.cast.players[name].marionette.weight
        force = GIVEN * weight / 9.81 / SLIP_TIME * np.array([0.6, 0.8, 0.0])
        off = []
        for k in range(round(8.0 / tick)):
            body = f"{play.cast.prefix(name)}torso"
            shows[0].performance.push(body, force if k * tick < SLIP_TIME else None)
            places = [
                members.mass_centres(x.q_D, x.q_K)[who] for x in (s.advance(tick) for s in shows)
            ]
            off.append(np.linalg.norm((places[0] - places[1])[:2]))
        far_off = np.flatnonzero(np.array(off) > 0.01)
        durations.append(tick * (far_off[-1] + 1) if len(far_off) else 0.0)
    print(f"off by 1 cm after an impulse on a trunk: median {np.median(durations):.2f} s of 8 s")


def print_counts(play, still: Run, usual, kind: str, seeds: int, steady: bool) -> None:
    began, rows = time.perf_counter(), []
    for seed in range(seeds):
        pushes = Pushes(kind, seed)
        run = perform_show(play, steady, pushes)
        now = lateness_of_limbs(play, run)
        for cue in play.cues:
            if cue.refused:
                continue
            late = max((abs(now[k] - usual[k]) for k in now if k[0] == cue.number), default=0.0)
            hit = any(cue.start <= t <= cue.end and who in cue.who for t, who in pushes.whom)
            rows.append((late, largest_distance(play, run, still, cue), hit))
    late, off, hit = (np.array(column) for column in zip(*rows, strict=True))
    print(f"{kind}: {seeds} runs of {PUSHES}, {time.perf_counter() - began:.0f} s")
    for which, of in (("all cues", np.ones(len(hit), dtype=bool)), ("cues that are hit", hit)):
        on_time, there = late[of] <= LATE, off[of] <= NEAR
        print(
            f"  {which}: {np.sum(on_time & there)} of {np.sum(of)} hold "
            f"({20 * np.mean(on_time & there):.1f} of 20); in time {np.sum(on_time)}, "
            f"near {np.sum(there)}; late by {1e3 * np.quantile(late[of], 0.95):.1f} ms and off by "
            f"{1e3 * np.quantile(off[of], 0.95):.1f} mm at 95 of 100"
        )


if __name__ == "__main__":
    main()
