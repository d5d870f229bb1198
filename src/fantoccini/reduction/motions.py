"""The motions that the two models are compared in: fit for any puppet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.errors import SimulationError
from fantoccini.marionette import Evaluation, Event
from fantoccini.motion import EventKind, Input, State, Trajectory, rotation
from fantoccini.reduction.mechanism import Mechanism
from fantoccini.simulation import simulate

_MOVE, _TURN = 0.03, 0.1
"""Largest moves: of a length or place, over the mean length of the strings; of an angle [rad]."""
_LASTS = 3.0
"""Duration, over sqrt(l/g)."""
_FLIGHT = 0.25
"""Time for which a toss rises, over sqrt(l/g)."""
_TRIES = 4
IMPACTS = (EventKind.CATCH, EventKind.LIMIT_ON, EventKind.ACCUMULATION)
"""Events at which velocities jump."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A start state and inputs of the mixed model, and what it does.

    Attributes:
        x0: the start.
        inputs: of the driven coordinates.
        run: the mixed model's motion.
        ends: time up to which no velocity jumps [s].
    """

    x0: State
    inputs: Input
    run: Trajectory
    ends: float

    @property
    def smooth(self) -> bool:
        """Whether nothing catches before the end."""
        return self.ends >= self.inputs.end


def swayed(mechanism: Mechanism, x0: State, seed: int = 0) -> Motion:
    """Every driven coordinate makes a small smooth move, from rest to rest.

    Where strings or limits catch, smaller moves are tried, and that with the latest catch is taken.

    Raises:
        SimulationError: the puppet cannot do even the smallest.
    """
    best, trouble = None, None
    for k in range(_TRIES):
        inputs = moves(mechanism, x0, 0.5**k, seed)
        try:
            found = performed(mechanism, x0, inputs)
        except SimulationError as error:
            trouble = error
            continue
        if best is None or found.ends > best.ends:
            best = found
        if best.smooth:
            break
    if best is None:
        raise trouble
    return best


def tossed(mechanism: Mechanism, x0: State, inputs: Input) -> Motion | None:
    """The puppet is thrown up against its own fall, with all strings let go, and falls into them.

    None where nothing catches, as without gravity or strings.
    """
    mixed = mechanism.mixed
    at = Evaluation.of(mixed.model, x0)
    thrown = x0.replace(v_D=-_FLIGHT * mechanism.pace * at.back(at.w0))
    try:
        found = performed(mechanism, mixed.project(thrown), inputs)
    except SimulationError:
        return None
    return None if found.smooth else found


def moves(mechanism: Mechanism, x0: State, size: float, seed: int = 0) -> Input:
    """Each driven coordinate moves to a random place near its own, and on to another.

    Args:
        mechanism: the puppet.
        x0: where they begin.
        size: of the moves: 1 for the largest.
        seed: of the places.
    """
    table, rng = mechanism.mixed.coordinates, np.random.default_rng(seed)
    times = _LASTS * mechanism.pace * np.array([0.0, 0.5, 1.0])
    points = {}
    for q, v in table.scalars_K:
        most = _MOVE * mechanism.size if mechanism.lengths[v] else _TURN
        way = np.array([0.0, *rng.uniform(-1.0, 1.0, 2)])
        points[table.q_K[q]] = list(zip(times, x0.q_K[q] + size * most * way, strict=True))
    for name, (q, _) in table.rotations.items():
        start = x0.q_K[q : q + 4]
        turns = size * _TURN * rng.uniform(-1.0, 1.0, (2, 3))
        places = [start, *rotation.multiply(start, rotation.exp(turns))]
        points[name] = list(zip(times, places, strict=True))
    return Input.waypoints(table, points)


def performed(
    mechanism: Mechanism, x0: State, inputs: Input, rtol: float = 1e-12, **options
) -> Motion:
    """The mixed model's motion, and when it first catches."""
    run = simulate(
        mechanism.mixed, x0, inputs, inputs.end, method=Event(rtol=rtol, atol=rtol), **options
    )
    caught = [e.t for e in run.events if e.kind in IMPACTS]
    return Motion(x0, inputs, run, min(caught, default=inputs.end))
