"""Search for the parameters of a gait on a puppet's own floor, by simulated steps.

    min over parameters of   0.3 mean slide + 0.7 largest slide + penalties

Feet that lift or stand too little, a tilting trunk and a wrong distance add penalties. A second run
with half the time step then decides whether the puppet walks. Only this one has contact forces: the
search measures how far the lowest points and the corners of boxes slide. The cache keeps gait and
verdict.

A foot slides if it moves over the floor while it carries load; the slide is the distance. A member
is a puppet of a scene.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, StateError, Status, check_positive
from fantoccini.control.optimal import DrawOptions, tune
from fantoccini.control.tasks import AnswerStatus
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.kernel.build import RESULTS, results_fingerprint
from fantoccini.motion import Input, State, Trajectory
from fantoccini.theatre.gaits.gait import SEARCHED_PARAMETERS, Gait
from fantoccini.theatre.gaits.sliding import (
    MAX_SLIDE,
    MIN_STANDING_SHARE,
    Footfalls,
    WalkStatus,
    footfalls,
)
from fantoccini.theatre.gaits.standing import standing_lengths
from fantoccini.theatre.gestures import BodyParts, Ends, Step, leg_length

_GOOD_COST = 0.7
"""Cost below which no further search is made."""
_N_STEPS, _TIME_STEP, _SAVE_STRIDE = 12, 2e-3, 2
"""Number of steps of a run, its time step [s], and the number of time steps between samples."""
_CHECK_TIME_STEP, _CHECK_SAVE_STRIDE = 1e-3, 5
"""Time step of the run that decides whether a gait walks [s], and the steps between samples."""
_SETTLING_TIME = 0.3
"""Time after the last step [s]."""
_MAX_ROUNDS, _DRAWS = 8, DrawOptions(runs=16, generations=4)
"""Default number of searches in a row, and their draws."""
_INITIAL_SPREADS = {
    "duty": 0.05,
    "lower": 0.008,
    "nod": 0.02,
    "slack": 0.008,
    "lift": 0.05,
    "leg_lead": 0.06,
    "body_lead": 0.04,
    "overshoot": 0.05,
    "sway": 0.015,
    "vertical_share": 0.05,
    "peak_share": 0.08,
}
_PARAMETER_RANGES = {
    "duty": (0.25, 0.75),
    "lower": (0.01, 0.1),
    "nod": (-0.1, 0.1),
    "slack": (0.0, 0.1),
    "lift": (0.03, 0.5),
    "leg_lead": (-0.6, 0.6),
    "body_lead": (-0.4, 0.4),
    "overshoot": (-0.2, 0.5),
    "sway": (-0.1, 0.1),
    "vertical_share": (0.0, 0.3),
    "peak_share": (0.2, 0.7),
}
"""Spreads of the first draws, and ranges to which parameters are clipped, in the units of Gait."""
_MIN_SPREAD_SHARE = 0.2
"""Share of the first spreads below which the search ends."""
_MIN_LIFT = 0.03
"""Least lift of a foot, relative to the legs' length."""
_FREE_DISTANCE_ERROR, _FREE_STANDING_SHARE = 0.03, MIN_STANDING_SHARE + 0.05
"""Largest relative error of the distance, and least share of a cycle on the floor, without penalty.

They keep a margin to the bounds of a puppet that walks, since the second run differs.
"""


@dataclass(frozen=True, eq=False)
class TunedGait:
    """Result of a search for a gait. True if the puppet walks in the second run.

    Attributes:
        gait: the gait of the least cost.
        feet: its feet in a run with half the time step of the search.
    """

    gait: Gait
    feet: Footfalls

    @property
    def status(self) -> WalkStatus:
        """Whether the puppet walks, or why it does not."""
        return self.feet.status

    @property
    def message(self) -> str:
        """Status in words, with the numbers that decide it."""
        return self.feet.message

    def __bool__(self) -> bool:
        return bool(self.feet)

    def __repr__(self) -> str:
        return f"<TunedGait {self.status.name}: {self.message}>"


def find_gait(
    stage: Marionette,
    initial: Gait | None = None,
    *,
    member: str = "",
    rounds: int = _MAX_ROUNDS,
    draws: DrawOptions = _DRAWS,
) -> TunedGait:
    """Gait for a puppet on its floor, and whether it walks; from the cache if there.

    Args:
        stage: puppet with contact between its feet and the floor.
        initial: gait with which the search begins; its pattern, step time and stride are kept.
        member: the scene's member that walks; the only one by default.
        rounds: largest number of searches in a row, each around the best gait so far.
        draws: draws of each search; the seed of the first one.

    Raises:
        StateError: it has no contact with a floor, or cannot walk; the message has the reason.
    """
    if stage.puppet.touching is None:
        text = "needed: `contact` and `floor` in its file or scene"
        raise StateError(
            f"{stage.name} cannot touch a floor, so a gait cannot be searched for; {text}"
        )
    initial = Gait() if initial is None else initial
    check_positive(rounds=rounds)
    numbers_of_stage = stage.p.tolist(), stage.winches.tolist()
    search_inputs = stage.puppet.canonical(), numbers_of_stage, initial, member, rounds, draws
    key_text = repr((search_inputs, results_fingerprint()))
    key = hashlib.sha256(f"gait {key_text}".encode()).hexdigest()
    cached = RESULTS.read(key)
    if cached is not None:
        return _from_arrays(initial, cached)
    tuned, is_complete = _search(_GaitTrial.for_member(stage, member), initial, rounds, draws)
    if is_complete:
        RESULTS.write(key, _to_arrays(tuned))
    return tuned


@dataclass(frozen=True, eq=False)
class _GaitTrial:
    """Steps of a search: the puppet, its start, and the lengths at which it stands.

    Attributes:
        body_parts: parts of the puppet.
        x0: rest at the start of all runs.
        lengths: result of :func:`standing_lengths`.
    """

    body_parts: BodyParts
    x0: State
    lengths: Mapping[str, float]

    @classmethod
    def for_member(cls, stage: Marionette, member: str) -> _GaitTrial:
        """Steps of a puppet, or of a scene's member."""
        members = stage.puppet.members
        body_parts = BodyParts.for_puppet(
            stage, member or (members[0] if len(members) == 1 else "")
        )
        x0 = stage.rest()
        return cls(body_parts, x0, standing_lengths(body_parts, x0))

    def inputs(self, gait: Gait) -> Input:
        """Motion of a gait's steps."""
        step_length = gait.stride * leg_length(self.body_parts.body_map)
        steps = [Step(step_length)] * _N_STEPS
        return gait.gesture(Ends(self.body_parts, self.x0), steps, self.lengths).inputs(self.x0)

    def check(self, gait: Gait) -> TunedGait:
        """The gait, with its feet in a separate run."""
        run = simulate(
            self.body_parts.marionette,
            self.x0,
            self.inputs(gait),
            gait.duration(_N_STEPS) + _SETTLING_TIME,
            method=TimeStepping(dt=_CHECK_TIME_STEP),
            save_every=_CHECK_SAVE_STRIDE,
            throw=False,
        )
        return TunedGait(gait, footfalls(self.body_parts, run, gait, _N_STEPS))


def _to_arrays(tuned: TunedGait) -> list[Array]:
    """Arrays of a gait and its feet for the cache."""
    numbers = np.array([getattr(tuned.gait, name) for name in SEARCHED_PARAMETERS])
    values = dataclasses.asdict(tuned.feet)
    return [numbers, *(np.asarray(value, dtype=float) for value in values.values())]


def _from_arrays(initial: Gait, arrays: list[Array]) -> TunedGait:
    """Gait and feet of :func:`_to_arrays`."""
    numbers, slide, lift, stands, *scalars = arrays
    values = dict(zip(SEARCHED_PARAMETERS, numbers.tolist(), strict=True))
    distance, wanted_distance, distance_error, turn, upright, status = map(float, scalars)
    feet = Footfalls(
        slide,
        lift,
        stands,
        distance,
        wanted_distance,
        distance_error,
        turn,
        upright,
        Status(int(status)),
    )
    return TunedGait(dataclasses.replace(initial, **values), feet)


def _search(
    trial: _GaitTrial, initial: Gait, rounds: int, draws: DrawOptions
) -> tuple[TunedGait, bool]:
    """Gait of the least cost with its feet, and whether the search was complete.

    Spreads are halved after a search that finds nothing better. The search ends early when the feet
    hardly slide, or when the spreads are narrow.

    Raises:
        KeyboardInterrupt: Ctrl-C in a search.
    """
    best, lowest_cost, spread_share, is_complete = initial, np.inf, 1.0, True

    def gait_from(values: dict[str, float]) -> Gait:
        clipped: dict[str, Any] = {
            name: float(np.clip(value, *_PARAMETER_RANGES[name])) for name, value in values.items()
        }
        return dataclasses.replace(initial, **clipped)

    for round_index in range(rounds):
        tuned = tune(
            trial.body_parts.marionette,
            lambda values: trial.inputs(gait_from(values)),
            {
                name: (getattr(best, name), spread_share * spread)
                for name, spread in _INITIAL_SPREADS.items()
            },
            lambda run: gait_cost(trial.body_parts, run, initial, _N_STEPS),
            trial.x0,
            initial.duration(_N_STEPS) + _SETTLING_TIME,
            method=TimeStepping(dt=_TIME_STEP),
            save_every=_SAVE_STRIDE,
            draws=dataclasses.replace(draws, seed=draws.seed + round_index),
        )
        if tuned.status is AnswerStatus.STOPPED:
            raise KeyboardInterrupt
        is_complete = is_complete and tuned.status is not AnswerStatus.TIMEOUT
        spread_share *= 1.0 if tuned.cost < lowest_cost else 0.5
        best, lowest_cost = gait_from(tuned.values), tuned.cost
        if lowest_cost < _GOOD_COST or spread_share < _MIN_SPREAD_SHARE:
            break
    return trial.check(best), is_complete


def gait_cost(body_parts: BodyParts, run: Trajectory, gait: Gait, steps: int) -> float:
    """Cost of a run; 1 for a slide of ``MAX_SLIDE`` in every cycle."""
    feet, L = footfalls(body_parts, run, gait, steps), leg_length(body_parts.body_map)
    slide = feet.slide / MAX_SLIDE
    return float(
        0.3 * slide.mean()
        + 0.7 * slide.max()
        + 30.0 * max(0.0, _MIN_LIFT - feet.lift[:-1].min() / L)
        + 20.0 * max(0.0, _FREE_STANDING_SHARE - feet.standing_share)
        + 20.0 * max(0.0, feet.distance_error - _FREE_DISTANCE_ERROR)
        + 20.0 * max(0.0, 0.95 - feet.upright)
    )
