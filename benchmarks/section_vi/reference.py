"""Reference motions of the mixed model, for comparison with the full model; for any puppet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.section_vi.mechanism import Mechanism

from fantoccini.base import rotation
from fantoccini.base.errors import SimulationError
from fantoccini.dynamics.compiled import Evaluation, Event
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import EventKind, Input, State, Trajectory

IMPACTS = (EventKind.CATCH, EventKind.LIMIT_ON, EventKind.ACCUMULATION)
"""Events at which velocities jump."""
_EVENT = Event(rtol=1e-12, atol=1e-12)


@dataclass(frozen=True)
class _Moves:
    """Sizes of the reference motions.

    Attributes:
        max_length: largest move of a length or position, relative to the mean string length.
        max_angle: largest rotation [rad].
        duration: duration, relative to sqrt(l/g).
        rise_time: time for which a tossed puppet rises, relative to sqrt(l/g).
        max_halvings: largest number of halvings of the moves until nothing catches.
    """

    max_length: float = 0.03
    max_angle: float = 0.1
    duration: float = 3.0
    rise_time: float = 0.25
    max_halvings: int = 4


_MOVES = _Moves()


@dataclass(frozen=True, eq=False)
class Reference:
    """A motion of the mixed model.

    Attributes:
        x0: start state.
        inputs: inputs of the driven coordinates.
        run: the motion.
        first_impact: time of the first jump of a velocity, or the end [s].
    """

    x0: State
    inputs: Input
    run: Trajectory
    first_impact: float

    @property
    def smooth(self) -> bool:
        """Whether nothing catches before the end."""
        return self.first_impact >= self.inputs.end


def smooth_reference(mechanism: Mechanism, x0: State, seed: int = 0) -> Reference:
    """A motion with a small smooth move of every driven coordinate, from rest to rest.

    If strings or limits catch, smaller moves are tried; the result is that with the latest catch.

    Raises:
        SimulationError: even the smallest moves are impossible.
    """
    best: Reference | None = None
    failure: SimulationError | None = None
    for k in range(_MOVES.max_halvings):
        try:
            motion = simulate_reference(mechanism, x0, random_moves(mechanism, x0, 0.5**k, seed))
        except SimulationError as error:
            failure = error
            continue
        if best is None or motion.first_impact > best.first_impact:
            best = motion
        if best.smooth:
            break
    if best is None:
        assert failure is not None
        raise failure
    return best


def toss(mechanism: Mechanism, x0: State, inputs: Input) -> Reference | None:
    """A motion of the puppet thrown upwards with slack strings, into which it falls.

    None if nothing catches, for example without gravity or strings.
    """
    mixed = mechanism.mixed
    evaluation = Evaluation.at_state(mixed, x0)
    thrown = x0.replace(
        v_D=-_MOVES.rise_time * mechanism.time_scale * evaluation.solve_factor(evaluation.w0)
    )
    try:
        motion = simulate_reference(mechanism, mixed.project(thrown), inputs)
    except SimulationError:
        return None
    return None if motion.smooth else motion


def random_moves(mechanism: Mechanism, x0: State, size: float, seed: int = 0) -> Input:
    """Inputs that move each driven coordinate to two random places near its start.

    Args:
        mechanism: the puppet.
        x0: start state.
        size: size of the moves, 0 to 1.
        seed: seed of the places.
    """
    table, rng = mechanism.mixed.coordinates, np.random.default_rng(seed)
    times = _MOVES.duration * mechanism.time_scale * np.array([0.0, 0.5, 1.0])
    points = {}
    for q, v in table.scalars_K:
        in_metres = mechanism.in_metres[v]
        bounds = _MOVES.max_length * mechanism.length_scale if in_metres else _MOVES.max_angle
        way = np.array([0.0, *rng.uniform(-1.0, 1.0, 2)])
        points[table.q_K[q]] = list(zip(times, x0.q_K[q] + size * bounds * way, strict=True))
    for name, (q, _) in table.rotations.items():
        start = x0.q_K[q : q + 4]
        turns = size * _MOVES.max_angle * rng.uniform(-1.0, 1.0, (2, 3))
        places = [start, *rotation.multiply(start, rotation.exp(turns))]
        points[name] = list(zip(times, places, strict=True))
    return Input.waypoints(table, points)


def simulate_reference(mechanism: Mechanism, x0: State, inputs: Input) -> Reference:
    """The mixed model's motion under some inputs."""
    run = simulate(mechanism.mixed, x0, inputs, inputs.end, method=_EVENT)
    impacts = [e.t for e in run.events if e.kind in IMPACTS]
    return Reference(x0, inputs, run, min(impacts, default=inputs.end))
