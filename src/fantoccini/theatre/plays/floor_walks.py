"""Walks on the floor: straight parts are steps of a gait, and turns are above the floor.

Before each straight part the player is lowered to the floor; after it, it is raised to where it
hung. Its feet can touch the floor from the one to the other.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from fantoccini.base import polynomial
from fantoccini.theatre.cast import Actor, Cast, Meeting, Player, Walk, walking_pairs
from fantoccini.theatre.gaits import (
    CLOSING_STEPS,
    HANGING_PREPARATION_STEPS,
    MAX_SLIDE,
    MIN_STANDING_SHARE,
    PREPARATION_STEPS,
    RAISING_STEPS,
    Footfalls,
    footfalls,
)
from fantoccini.theatre.gestures import BodyParts, Complex, Gesture, Step, foot_links, gait_phases
from fantoccini.theatre.plays.runs import Run, Runs

FLOOR_PAUSES = HANGING_PREPARATION_STEPS, round(CLOSING_STEPS) + RAISING_STEPS
"""Numbers of steps before and after a straight part in which the body stands."""
_PIECES_PER_SECOND = 12.0
"""Number of polynomial pieces of a second of a turn."""
_SAME_TIME = 1e-6
"""Tolerance of the times of a run [s]."""


@dataclass(frozen=True)
class FloorPart:
    """Straight part of a walk on the floor.

    Attributes:
        begin: time at which the player is lowered [s].
        end: time at which it hangs again [s].
        step: each of its steps.
        n: number of steps.
    """

    begin: float
    end: float
    step: Step
    n: int


@dataclass(frozen=True, eq=False)
class FloorFeet:
    """Feet of a player in a straight part of a walk on the floor.

    Attributes:
        who: the player.
        part: part of the walk.
        feet: slides, heights and standing times of the feet.
        first_steps: foot -> time of its first step [s].
        step_time: time from a step of a foot to its next one [s].
    """

    who: str
    part: FloorPart
    feet: Footfalls
    first_steps: Mapping[str, float]
    step_time: float

    def faults(self) -> Iterator[tuple[float, str]]:
        """Time [s] and text of each fault: the worst step of every foot, and of the whole walk."""
        percent = 100.0 * MIN_STANDING_SHARE
        for j, (foot, first_time) in enumerate(self.first_steps.items()):
            slides, shares = self.feet.slide[:, j], self.feet.stands[:, j]
            if np.max(slides) > MAX_SLIDE:
                k = int(np.argmax(slides))
                text = f"slides {1e3 * slides[k]:.1f} mm; allowed: {1e3 * MAX_SLIDE:g} mm"
                yield self._fault(foot, first_time, k, text)
            if np.nanmin(shares) < MIN_STANDING_SHARE:
                k = int(np.nanargmin(shares))
                text = f"is on the floor for {shares[k]:.0%} of it; needed: {percent:g} %"
                yield self._fault(foot, first_time, k, text)
        if self.feet.falls:
            yield self.part.begin, f"{self.who} falls as it walks: {self.feet.message}"

    def _fault(self, foot: str, first_time: float, k: int, text: str) -> tuple[float, str]:
        return first_time + k * self.step_time, f"step {k + 1} of {self.who}'s {foot}: it {text}"


def floor_parts(walk: Walk) -> list[FloorPart]:
    """Straight parts of a walk on the floor; none of a walk above it."""
    before, after = walk.pauses
    if not before:
        return []
    return [
        FloorPart(
            walk.begin + (first - before) * walk.step_time,
            walk.begin + (first + n + after) * walk.step_time,
            walk.steps[first],
            n,
        )
        for first, n in walk.straight_parts
    ]


def floor_meetings(actor: Actor) -> list[Meeting]:
    """Times in which a player's feet may touch the floor because it walks there."""
    player = actor.player
    pairs = walking_pairs(player.bodies)
    return [
        Meeting(part.begin, part.end, (player.name,), (), pairs, "walks")
        for walk in actor.walks
        for part in floor_parts(walk)
    ]


def floor_walk(player: Player, walk: Walk) -> Gesture:
    """Gesture of a walk on the floor, with the heading of the player's file.

    Raises:
        StateError: the puppet cannot walk; the message has the reason.
    """
    gait = player.gait
    assert gait is not None
    (before, after), gestures, heading = walk.pauses, list[Gesture](), 0.0
    for first, end, is_on_floor in _sections(walk):
        steps = walk.steps[first:end]
        if is_on_floor:
            steps = steps[before : len(steps) - after]
            gesture = gait.gesture(player.ends(), steps, player.standing_lengths, hangs_at_end=True)
            gestures.append(gesture.turned(heading))
            continue
        for step, equal_steps in groupby(steps):
            n = len(list(equal_steps))
            turn = _turn(player, n * step.turn, n * walk.step_time)
            gestures.append(turn.turned(heading))
            heading += n * step.turn
    return gestures[0].then(*gestures[1:]).called("walk")


def _turn(player: Player, angle: float, duration: float) -> Gesture:
    """Turn above the floor by an angle [rad], in a time [s], without steps.

    Steps would swing the puppet about the vertical. Without an angle it stands.
    """
    if angle == 0.0:
        return Gesture.rest(player.marionette, duration, everything=False)
    n_pieces = max(1, round(_PIECES_PER_SECOND * duration))
    progress, ends = np.linspace(0.0, 1.0, n_pieces + 1), player.ends()
    value, rate, change = polynomial.minimum_jerk(progress)
    zero: Complex = np.zeros(n_pieces + 1, dtype=complex)
    heading = angle * value, angle * rate / duration, angle * change / duration**2
    ends.move_rigidly((zero, zero, zero), heading)
    return ends.gesture(duration * progress, "turn", {}, travels=True)


def _sections(walk: Walk) -> Iterator[tuple[int, int, bool]]:
    """First step, end (exclusive), and whether it is on the floor, for each section of a walk."""
    before, after = walk.pauses
    done = 0
    for first, n in walk.straight_parts:
        if first - before > done:
            yield done, first - before, False
        done = first + n + after
        yield first - before, done, True
    if done < len(walk.steps):
        yield done, len(walk.steps), False


def feet_on_floor(
    cast: Cast, walks: Mapping[str, Sequence[Walk]], runs: Runs
) -> Iterator[FloorFeet]:
    """Feet in all straight parts of walks on the floor whose runs reach their ends.

    Args:
        cast: cast of the play.
        walks: player -> its walks.
        runs: runs of the play.
    """
    for who, walks_of_player in walks.items():
        for walk in walks_of_player:
            for part in floor_parts(walk):
                run = _run_of(cast.players[who], part, runs)
                if run is not None:
                    yield _feet(cast.players[who], part, run)


def _run_of(player: Player, part: FloorPart, runs: Runs) -> Run | None:
    """Run that contains a part of a player's walk; None if it stops before."""
    pairs = walking_pairs(player.bodies)
    for run in runs.companies:
        company = run.scene.company
        walks_there = company.players == (player.name,) and pairs <= company.pairs
        is_inside = run.begin <= part.begin + _SAME_TIME and part.end <= run.end + _SAME_TIME
        if walks_there and is_inside:
            return run
    return None


def _feet(player: Player, part: FloorPart, run: Run) -> FloorFeet:
    """Feet of a player in a part of its walk."""
    assert player.gait is not None
    gait = dataclasses.replace(player.gait, stride=part.step.length / player.leg_length)
    body_parts = BodyParts.for_puppet(player.marionette)
    # The preparation of gaits outside of plays is shorter, and they are not raised.
    first_step = part.begin + HANGING_PREPARATION_STEPS * gait.step_time
    begin = first_step - run.begin - PREPARATION_STEPS * gait.step_time
    trajectory = run.trajectory.between(begin, begin + gait.duration(part.n))
    phases, cycle = gait_phases(body_parts.body_map, gait.pattern), 2.0 * gait.step_time
    return FloorFeet(
        player.name,
        part,
        footfalls(body_parts, trajectory, gait, part.n),
        {_foot_name(leg): first_step + phases[leg] * cycle for leg in foot_links(body_parts)},
        cycle,
    )


def _foot_name(leg: str) -> str:
    """Name of the foot of a leg: ``front left foot`` of ``leg_front_left``."""
    return f"{leg.removeprefix('leg_').replace('_', ' ')} foot"
