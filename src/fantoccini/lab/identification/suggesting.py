"""``suggest_motion``: the motion whose record would determine the unknowns best.

For every candidate the Fisher information F of the unknowns is predicted, with unknown
states, and scaled by the sizes of the numbers. The best candidate has the largest

    gain = 1/2 log2 det(1 + F),

the information in bits about numbers of which only the size is known (D-optimality).

A record is measurements of a puppet in motion under known inputs, here the motion of the driven
coordinates q_K: ends and lengths of strings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fantoccini.base import (
    Array,
    FantocciniError,
    OnProgress,
    Progress,
    StateError,
    check_positive,
    write_table,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import checked_integer
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.estimating import (
    DEFAULT_DRIFT,
    NoiseLevels,
    make_fit,
    one_blas_thread,
)
from fantoccini.lab.identification.fit import continuous_point
from fantoccini.lab.identification.record import Record
from fantoccini.lab.identification.result import Combination, error_analysis
from fantoccini.lab.identification.search_point import Weights
from fantoccini.motion import Input

WAYPOINT_INTERVALS = (0.4, 0.8, 1.6)
"""Intervals between the waypoints of random motions [s]."""
REACH_FACTORS = (1.0, 0.4)
"""Amplitudes of random motions, relative to the reach."""
ANGLE_PER_LENGTH = 3.0
"""Ratio of the reach of an angle to that of a length [rad/m]."""
STRING_LENGTH_FACTOR = 0.6
"""Ratio of the reach of a string's length to that of another length."""
SAVE_RATE = 100.0
"""Rate of the samples that are written [Hz]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A motion, with the predicted errors of estimates from its record.

    Attributes:
        name: name of the motion.
        inputs: the motion.
        gain: information about the unknowns [bits].
        deviations: name -> predicted standard deviation; infinite for numbers not determined.
        combinations: combinations of numbers that it would not determine.
        worst: largest deviation relative to the number's size (E-optimality's measure is its
            square); infinite if a number is not determined.
        failure: reason why the motion cannot be simulated; empty if it can.
    """

    name: str
    inputs: Input
    gain: float
    deviations: dict[str, float]
    combinations: tuple[Combination, ...]
    worst: float
    failure: str = ""

    def save(self, path: str | Path) -> None:
        """Writes the motion as an inputs file of samples (CSV).

        Raises:
            StateError: a driven orientation moves.
            FileNotFoundError: the folder does not exist.
        """
        t = np.linspace(
            self.inputs.start, self.inputs.end, 1 + int(np.ceil(SAVE_RATE * self.inputs.duration))
        )
        q_K, v_K, _ = self.inputs.evaluate(t)
        table = self.inputs.coordinates
        for _, v in table.quaternions_K:
            if np.any(v_K[:, v : v + 3]):
                raise StateError(
                    "an orientation moves; an inputs file of samples is written for "
                    "scalar coordinates only"
                )
        scalars = {table.q_K[q]: q_K[:, q] for q, _ in table.scalars_K}
        write_table({"t": t} | scalars, path)


def suggest_motion(
    record: Record,
    candidates: Mapping[str, Input] | None = None,
    *,
    duration: float = 10.0,
    rate: float = 60.0,
    reach: float = 0.05,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    draws: int = 2,
    seed: int = 0,
    segment: float = 0.25,
    dt: float = 0.005,
    threads: int | None = None,
    progress: OnProgress | None = None,
) -> tuple[Candidate, ...]:
    """Motions ranked by the information of their records, the best first.

    Args:
        record: the columns and noise that would be measured, and the unknowns. Its samples are not
            used.
        candidates: name -> inputs, such as gestures; random smooth motions by default.
        duration: duration of random motions [s].
        rate: samples per second.
        reach: largest displacement of random motions from the start [m]; 0.6 of it for
            string lengths, 3 rad per metre for angles.
        ranges: driven coordinate -> (low, high), within which random motions stay.
        draws: number of random motions for every interval and amplitude.
        seed: seed of random motions.
        segment, dt, threads: see :func:`identify`.
        progress: called with the name of every candidate.

    Raises:
        StateError: no candidate can be done.
    """
    check_positive(duration=duration, rate=rate, reach=reach, segment=segment, dt=dt)
    draws = checked_integer("draws", draws, minimum=1)
    if candidates is None:
        candidates = _random_motions(
            record.marionette, record, duration, reach, ranges or {}, draws, seed
        )
    ranked = []
    with one_blas_thread():
        for name, inputs in candidates.items():
            if progress is not None:
                progress(Progress(name))
            ranked.append(_candidate(name, inputs, record, rate, segment, dt, threads))
    ranked.sort(key=lambda candidate: -candidate.gain)
    if ranked[0].failure:
        raise StateError(f"no candidate can be done; {ranked[0].name}: {ranked[0].failure}")
    return tuple(ranked)


def _candidate(
    name: str,
    inputs: Input,
    record: Record,
    rate: float,
    segment: float,
    dt: float,
    threads: int | None,
) -> Candidate:
    t = np.arange(inputs.start, inputs.end, 1.0 / rate)
    columns = {column: np.zeros(len(t)) for column in record.channels.names}
    try:
        planned_record = replace(record, inputs=inputs, t=t + record.delay, columns=columns)
        fit = make_fit(planned_record, segment, dt, threads)
        point = continuous_point(fit, planned_record.start_state(fit.inputs, float(fit.starts[0])))
        noise = NoiseLevels.from_record(planned_record)
        levels = np.where(np.isfinite(noise.given), noise.given, noise.guess)
        prediction = fit.predict(point)
        cost = Cost(replace(fit, y=prediction.y), point, Weights(levels, DEFAULT_DRIFT))
        F = cost.normal_equations(point, prediction, fit.jacobians(point)).information()
    except (FantocciniError, np.linalg.LinAlgError) as error:
        return Candidate(name, inputs, -np.inf, {}, (), np.inf, str(error))
    scaled = F * np.outer(record.scales, record.scales)
    eigenvalues = np.maximum(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)), 0.0)
    deviations, _, combinations = error_analysis(F, record.scales, record.labels)
    return Candidate(
        name,
        inputs,
        float(0.5 * np.sum(np.log2(1.0 + eigenvalues))),
        dict(zip(record.labels, deviations.tolist(), strict=True)),
        combinations,
        float(np.max(deviations / record.scales)),
    )


def _random_motions(
    marionette: Marionette,
    record: Record,
    duration: float,
    reach: float,
    ranges: Mapping[str, tuple[float, float]],
    draws: int,
    seed: int,
) -> dict[str, Input]:
    """Smooth random motions about the start, with several intervals and amplitudes."""
    table = marionette.coordinates
    x0 = marionette.rest({**record.inputs.first_values(), **record.start})
    coordinate_units = {row.name: row.unit for row in table.rows}
    motions = {}
    for interval in WAYPOINT_INTERVALS:
        for factor in REACH_FACTORS:
            for draw in range(draws):
                rng = np.random.default_rng((seed, draw))
                times = np.arange(0.0, duration - 1e-9, interval)
                points: dict[str, list[tuple[float, float]]] = {}
                for q, _ in table.scalars_K:
                    name, start = table.q_K[q], float(x0.q_K[q])
                    amplitude = (
                        reach
                        * factor
                        * (ANGLE_PER_LENGTH if coordinate_units.get(name) == "rad" else 1.0)
                    )
                    amplitude *= STRING_LENGTH_FACTOR if name.endswith(".length") else 1.0
                    values = start + amplitude * rng.uniform(-1.0, 1.0, len(times))
                    values[[0, -1]] = start
                    values = _clip_to_range(name, values, start, ranges)
                    points[name] = list(zip(times.tolist(), values.tolist(), strict=True))
                key = f"random, {interval:g} s, {100 * reach * factor:g} cm, {draw}"
                motions[key] = Input.waypoints(marionette, points)
    return motions


def _clip_to_range(
    name: str, values: Array, start: float, ranges: Mapping[str, tuple[float, float]]
) -> Array:
    if name not in ranges:
        return values
    low, high = ranges[name]
    if not low <= start <= high:
        raise StateError(f"{name} starts at {start:g}, beyond its range of {low:g} to {high:g}")
    return np.clip(values, low, high)
