"""suggest_motion: the motion that would tell most of what is looked for.

For every candidate the Fisher information F of the unknowns is predicted, with the states unknown
as well, and scaled by the sizes of the numbers. The candidate of the largest

    gain = 1/2 log2 det(1 + F)

is best: the bits by which it narrows down numbers of which only the size is known (D-optimality).
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
from fantoccini.kernel.runtime import whole
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.estimating import DRIFT, Noise, fit_of, one_blas_thread
from fantoccini.lab.identification.fit import chained
from fantoccini.lab.identification.point import Weights
from fantoccini.lab.identification.record import Record
from fantoccini.lab.identification.result import Combination, told
from fantoccini.motion import Input

_BEATS = (0.4, 0.8, 1.6)
"""Times between the waypoints of random motions [s]."""
_REACHES = (1.0, 0.4)
"""Sizes of random motions, relative to the reach."""
_ANGLE = 3.0
"""Reach of a driven angle over that of a place [rad/m]."""
_RATE = 100.0
"""Of the samples that are written [Hz]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A motion, and what a record of it would tell.

    Attributes:
        name: of the motion.
        inputs: it.
        gain: bits that it tells.
        deviations: name -> predicted standard deviation; infinite where it does not tell.
        combinations: that it would leave untold.
        worst: largest deviation relative to the number's size (E-optimality's measure is its
            square); infinite where something is not told.
        refused: why it cannot be done; empty where it can.
    """

    name: str
    inputs: Input
    gain: float
    deviations: dict[str, float]
    combinations: tuple[Combination, ...]
    worst: float
    refused: str = ""

    def save(self, path: str | Path) -> None:
        """Writes the motion as an inputs file of samples (CSV).

        Raises:
            StateError: an orientation is driven, which moves.
            FileNotFoundError: the folder does not exist.
        """
        t = np.linspace(
            self.inputs.start, self.inputs.end, 1 + int(np.ceil(_RATE * self.inputs.duration))
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
    """Motions, best first, with the errors that records of them would leave.

    Args:
        record: what would be measured (its columns and noise) and what is looked for. Its samples
            are not used.
        candidates: name -> inputs, such as gestures; random smooth motions when not given.
        duration: of random motions [s].
        rate: samples per second.
        reach: how far random motions go from the start: places and, by 0.6 as much, lengths [m],
            angles by 3 rad per metre.
        ranges: driven coordinate -> (low, high), within which random motions stay.
        draws: random motions of every tempo and size.
        seed: of random motions.
        segment, dt, threads: as of :func:`identify`.
        progress: called with the name of every candidate.

    Raises:
        StateError: no candidate can be done.
    """
    check_positive(duration=duration, rate=rate, reach=reach, segment=segment, dt=dt)
    draws = whole("draws", draws, least=1)
    if candidates is None:
        candidates = _random(record.marionette, record, duration, reach, ranges or {}, draws, seed)
    found = []
    with one_blas_thread():
        for name, inputs in candidates.items():
            if progress is not None:
                progress(Progress(name))
            found.append(_candidate(name, inputs, record, rate, segment, dt, threads))
    found.sort(key=lambda one: -one.gain)
    if found[0].refused:
        raise StateError(f"no candidate can be done; {found[0].name}: {found[0].refused}")
    return tuple(found)


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
        own = replace(record, inputs=inputs, t=t + record.delay, columns=columns)
        fit = fit_of(own, segment, dt, threads)
        at = chained(fit, own.start_state(fit.inputs, float(fit.starts[0])))
        noise = Noise.of(own)
        levels = np.where(np.isfinite(noise.given), noise.given, noise.guess)
        predicted = fit.predict(at)
        cost = Cost(replace(fit, y=predicted.y), at, Weights(levels, DRIFT))
        F = cost.normal(at, predicted, fit.jacobians(at)).information()
    except (FantocciniError, np.linalg.LinAlgError) as error:
        return Candidate(name, inputs, -np.inf, {}, (), np.inf, str(error))
    scaled = F * np.outer(record.scales, record.scales)
    eigenvalues = np.maximum(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)), 0.0)
    deviations, _, combinations = told(F, record.scales, record.labels)
    return Candidate(
        name,
        inputs,
        float(0.5 * np.sum(np.log2(1.0 + eigenvalues))),
        dict(zip(record.labels, deviations.tolist(), strict=True)),
        combinations,
        float(np.max(deviations / record.scales)),
    )


def _random(
    marionette: Marionette,
    record: Record,
    duration: float,
    reach: float,
    ranges: Mapping[str, tuple[float, float]],
    draws: int,
    seed: int,
) -> dict[str, Input]:
    """Smooth random motions about the start, of several tempos and sizes."""
    table = marionette.coordinates
    x0 = marionette.rest({**record.inputs.first_values(), **record.start})
    kinds = {row.name: row.unit for row in table.rows}
    out = {}
    for beat in _BEATS:
        for size in _REACHES:
            for draw in range(draws):
                rng = np.random.default_rng((seed, draw))
                times = np.arange(0.0, duration - 1e-9, beat)
                points: dict[str, list[tuple[float, float]]] = {}
                for q, _ in table.scalars_K:
                    name, still = table.q_K[q], float(x0.q_K[q])
                    far = reach * size * (_ANGLE if kinds.get(name) == "rad" else 1.0)
                    far *= 0.6 if name.endswith(".length") else 1.0
                    values = still + far * rng.uniform(-1.0, 1.0, len(times))
                    values[[0, -1]] = still
                    values = _within(name, values, still, ranges)
                    points[name] = list(zip(times.tolist(), values.tolist(), strict=True))
                key = f"random, {beat:g} s, {100 * reach * size:g} cm, {draw}"
                out[key] = Input.waypoints(marionette, points)
    return out


def _within(
    name: str, values: Array, still: float, ranges: Mapping[str, tuple[float, float]]
) -> Array:
    if name not in ranges:
        return values
    low, high = ranges[name]
    if not low <= still <= high:
        raise StateError(f"{name} starts at {still:g}, beyond its range of {low:g} to {high:g}")
    return np.clip(values, low, high)
