"""Event-driven runs of every company of a play.

A run consists of parts, from one rest of the hands to the next; a part depends on the state at its
beginning and on the motion of the hands. A change of the play therefore leaves earlier parts
unchanged, and a play that is compiled after a change equals, to the bit, one compiled from scratch.

A company is a group of players and props that may touch one another and are simulated together. The
hands are the driven coordinates q_K, the ends and lengths of strings; q_D are the dynamic
coordinates. The ledger is the table of energies and work. Breaks are the times at which the pieces
of a motion meet, and `coef` their coefficients.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from fantoccini.base import Array, OnProgress, Status
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.simulation import simulate
from fantoccini.kernel.runtime import default_threads
from fantoccini.motion import LEDGER, Columns, ContactPoints, State, Trajectory
from fantoccini.theatre.cast import (
    SIMULATION_ERRORS,
    CannotBegin,
    Cast,
    Company,
    CompanyScene,
    Meeting,
    PropState,
    ResultCache,
    Span,
    Stop,
    company_scene,
    company_spans,
    digest,
    run_format,
)
from fantoccini.theatre.gestures import Gesture, Motion, piecewise
from fantoccini.theatre.script import StageFile

_MAX_REST_RATE = 1e-9
"""Rate below which hands count as at rest [m/s or rad/s]."""
_MIN_PART_DURATION = 0.5
"""Least duration of a part [s], so that the relative cost of its start is small."""
_TIME_STEPS = {"steps": 1e-3, "fine steps": 2.5e-4}
"""Time steps of companies that touch [s]."""
_SAMPLE_INTERVAL = 5e-3
"""Time between samples of these companies [s]."""
_FINE_STEPS_REASON = "somebody sits or walks on the floor, or a prop stands on something"
"""Reason for fine time steps without an event-driven attempt."""
_MAX_MEMORY_RATE = 4e7
"""Memory for a second of an event-driven run with touches [bytes/s]: about 4000 samples."""
_SAMPLE_ARRAYS = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
"""Arrays of a trajectory with a row for each sample."""
_COLUMNS = ("tension", "limit_force", "taut", "violation", "slip")
"""Columns of a trajectory."""
ENERGY_COLUMNS = ("kinetic", "potential")
"""Columns of a ledger with present values; the others accumulate over time."""


@dataclass(frozen=True, eq=False)
class Run:
    """Run of a company.

    Attributes:
        scene: simulated company.
        begin: beginning of the run [s].
        trajectory: trajectory, from time 0.
        stop_reason: reason for a stop before the end of its span; "" without a stop.
        stepping_reasons: reasons why parts were simulated in fine time steps, not event-driven.
    """

    scene: CompanyScene
    begin: float
    trajectory: Trajectory
    stop_reason: str = ""
    stepping_reasons: tuple[str, ...] = ()

    @property
    def end(self) -> float:
        """End of the run [s]."""
        return self.begin + float(self.trajectory.t[-1])

    def of_player(self, name: str, own_state: State) -> Trajectory:
        """Run of a player in its own coordinates, which are those of ``own_state``."""
        prefix, trajectory = self.scene.prefixes[name], self.trajectory
        if self.scene.company == Company((name,)):
            return trajectory
        table = own_state.coordinates
        assert table is not None
        changes: dict[str, Any] = {}
        for array_name in _SAMPLE_ARRAYS[1:]:
            name_list = f"{'q' if array_name[0] == 'q' else 'v'}_{array_name[-1]}"
            all_names = getattr(trajectory.coordinates, name_list)
            indices = [
                all_names.index(prefix + coordinate) for coordinate in getattr(table, name_list)
            ]
            changes[array_name] = getattr(trajectory, array_name)[:, indices]
        for array_name in _COLUMNS:
            columns: Columns | None = getattr(trajectory, array_name)
            if columns is not None:
                changes[array_name] = _columns_of_player(columns, prefix)
        events = tuple(
            dataclasses.replace(event, name=event.name.removeprefix(prefix))
            for event in trajectory.events
            if event.name.startswith(prefix) and "|" not in event.name
        )
        return dataclasses.replace(
            trajectory,
            **changes,
            events=events,
            coordinates=table,
            contact=None,
            contact_residual=None,
            effort=None,
        )


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs of a play.

    Attributes:
        companies: runs that could begin, in order of their beginnings.
        players: player -> its own run from the start; the ledger is its company's.
        stops: stops of runs, and runs that cannot begin.
    """

    companies: tuple[Run, ...]
    players: Mapping[str, Trajectory]
    stops: tuple[Stop, ...] = ()

    def with_prop(self, name: str, t: float) -> Run | None:
        """Run in which a prop takes part at a time [s]; None if it stands by itself."""
        for company in self.companies:
            if name in company.scene.props and company.begin <= t <= company.end:
                return company
        return None


def runs_of(
    cast: Cast,
    motions: Mapping[str, Gesture],
    starts: Mapping[str, Sequence[float]],
    meetings: Sequence[Meeting],
    cache: ResultCache,
    *,
    exact: bool = False,
) -> Runs:
    """Runs of a play, computed in parallel.

    They are event-driven if nothing may touch, else in time steps of 1 ms. With ``exact`` the
    latter are event-driven, too. They have steps of 0.25 ms if the event-driven run stops, as
    friction may jam, and if somebody sits or walks on the floor, or a prop stands on something, for
    which it would stop or take many minutes.

    Args:
        cast: cast of the play.
        motions: player -> motion of its hands.
        starts: player -> times at which its cues begin [s].
        meetings: players and props that may touch, with times.
        cache: cached parts.
        exact: whether companies that touch are simulated as exactly as possible.

    Raises:
        CannotBegin: a player's run cannot begin.
    """
    end = max(motion.duration for motion in motions.values())
    jobs = _RunJobs(cast, motions, starts, cache, exact)
    with ThreadPoolExecutor(default_threads()) as pool:
        # Each job waits only for earlier ones, which have been started before it.
        futures: list[tuple[Span, Future[Run | Stop | None]]] = []
        for span in company_spans(list(cast.players), meetings, end):
            futures.append((span, pool.submit(jobs.run, span, tuple(futures))))
        results = [future.result() for _, future in futures]
    companies = tuple(result for result in results if isinstance(result, Run))
    stops = [result for result in results if isinstance(result, Stop)]
    stops += [
        Stop(company.scene.company.players, company.end, company.stop_reason)
        for company in companies
        if company.stop_reason
    ]
    players = {}
    for name, player in cast.players.items():
        player_runs = [
            (run.begin, run.of_player(name, player.x0))
            for run in companies
            if name in run.scene.prefixes
        ]
        if not player_runs:
            raise CannotBegin(next(stop for stop in stops if name in stop.players))
        players[name] = _joined(player_runs)
    return Runs(companies, players, tuple(sorted(stops, key=lambda stop: stop.t)))


@dataclass(frozen=True)
class _RunJobs:
    """Jobs that compute the runs of a play; arguments as for :func:`runs_of`."""

    cast: Cast
    motions: Mapping[str, Gesture]
    starts: Mapping[str, Sequence[float]]
    cache: ResultCache
    exact: bool

    def run(
        self, span: Span, earlier_spans: Sequence[tuple[Span, Future[Run | Stop | None]]]
    ) -> Run | Stop | None:
        """Run of a company, or its stop; None if the earlier run of a member stopped."""
        cast, company = self.cast, span.company
        players: dict[str, State] = {}
        props: dict[str, PropState] = {}
        for name in (*company.players, *company.props):
            previous_end, future = _preceding_run(name, span, earlier_spans)
            if future is None:
                if name in cast.players:
                    players[name] = cast.players[name].x0
                else:
                    props[name] = cast.prop_states[name]
                continue
            run = future.result()
            if not isinstance(run, Run) or run.stop_reason:
                return None
            if name in cast.players:
                players[name] = run.of_player(name, cast.players[name].x0).state(-1)
            else:
                props[name] = prop_end_state(run, name, at_rest=previous_end < span.begin)
        scene = company_scene(cast, company, self.cache)
        x = scene.state(players, props)
        motion = scene.motion(
            {
                name: Gesture(
                    self.motions[name].coordinates,
                    *excerpt(self.motions[name], span.begin, span.end),
                )
                for name in company.players
            }
        )
        starts = sorted(t - span.begin for name in company.players for t in self.starts[name])
        parts, stepping_reasons, stop_reason = self._simulate_parts(scene, x, motion, starts)
        if not parts:
            return Stop(company.players, span.begin, stop_reason)
        trajectory = _joined(parts)
        if stop_reason and trajectory.status is Status.DONE:
            trajectory = dataclasses.replace(trajectory, status=Status.STOPPED)
        return Run(scene, span.begin, trajectory, stop_reason, stepping_reasons)

    def _simulate_parts(
        self, scene: CompanyScene, x: State, motion: Gesture, starts: Sequence[float]
    ) -> tuple[list[tuple[float, Trajectory]], tuple[str, ...], str]:
        """Parts of a run, reasons for unwanted time steps, and the reason why it stops."""
        stepping_reasons, parts = list[str](), list[tuple[float, Trajectory]]()
        if self.exact and scene.company.has_resting_contact:
            stepping_reasons.append(_FINE_STEPS_REASON)
        for begin, end in pairwise(_part_boundaries(motion, starts)):
            part_motion = Gesture(motion.coordinates, *excerpt(motion, begin, end))
            try:
                if scene.company.pairs or self._has_contacts:
                    x = scene.marionette.project(x)
            except SIMULATION_ERRORS as error:
                return parts, tuple(stepping_reasons), str(error)
            failed_methods = list[str]()
            for method in self._methods(scene.company):
                run, reason = self._simulate_part(scene, x, part_motion, method)
                if not reason:
                    break
                failed_methods.append(reason)
            if run is not None:
                parts.append((begin, run))
            if reason or run is None:
                return parts, tuple(stepping_reasons), reason
            stepping_reasons += failed_methods
            x = run.state(len(run) - 1).replace(t=0.0)
        return parts, tuple(stepping_reasons), ""

    def _simulate_part(
        self, scene: CompanyScene, x: State, motion: Gesture, method: str
    ) -> tuple[Trajectory | None, str]:
        """Part of a run by a method, and the reason for its stop: a status or an error; or ""."""
        bounds = self.cast.file.stage
        key = digest(
            x, motion, "part", scene.content_key, bounds.speed, bounds.acceleration, method
        )
        job = partial(_simulate, scene, x, motion, bounds, method, self.cache.check)
        try:
            run = self.cache.get(key, job, run_format(scene.marionette))
        except SIMULATION_ERRORS as error:
            return None, str(error)
        return run, "" if run.status is Status.DONE else str(run.status)

    def _methods(self, company: Company) -> tuple[str, ...]:
        """Methods for a company, in the order in which they are tried."""
        if not company.pairs:
            return ("event",)
        if not self.exact:
            return ("steps",)
        return ("fine steps",) if company.has_resting_contact else ("event", "fine steps")

    @property
    def _has_contacts(self) -> bool:
        """Whether states may come from time steps, which keep lengths of strings less exactly."""
        return bool(self.cast.allowed_pairs)


def _preceding_run(
    name: str, span: Span, earlier_spans: Sequence[tuple[Span, Future[Run | Stop | None]]]
) -> tuple[float, Future[Run | Stop | None] | None]:
    """End of the last run of a player or prop before a span [s], and that run."""
    for earlier_span, future in reversed(earlier_spans):
        company = earlier_span.company
        if name in (*company.players, *company.props) and earlier_span.end <= span.begin:
            return earlier_span.end, future
    return 0.0, None


def prop_end_state(run: Run, name: str, *, at_rest: bool = False) -> PropState:
    """State of a prop at a run's end: pose (7,) and velocities (6,), which are 0 if ``at_rest``."""
    scene_name, trajectory = run.scene.props[name], run.trajectory
    q = trajectory.coordinates.q_D.index(f"{scene_name}.x")
    v = trajectory.coordinates.v_D.index(f"{scene_name}.x")
    rates = np.zeros(6) if at_rest else np.array(trajectory.v_D[-1, v : v + 6])
    return np.array(trajectory.q_D[-1, q : q + 7]), rates


def _simulate(
    scene: CompanyScene,
    x: State,
    motion: Gesture,
    bounds: StageFile,
    method: str,
    check: OnProgress,
) -> Trajectory:
    """Run of a scene by a method: ``event``, ``steps`` or ``fine steps``."""
    inputs = motion.inputs(x, speed=bounds.speed, acceleration=bounds.acceleration)
    if method == "event":
        max_memory = _MAX_MEMORY_RATE * motion.duration if scene.company.pairs else None
        return simulate(
            scene.marionette,
            x,
            inputs,
            effort=False,
            throw=False,
            max_memory=max_memory,
            progress=check,
        )
    dt = _TIME_STEPS[method]
    return simulate(
        scene.marionette,
        x,
        inputs,
        method=TimeStepping(dt=dt),
        save_every=round(_SAMPLE_INTERVAL / dt),
        effort=False,
        throw=False,
        progress=check,
    )


def _part_boundaries(motion: Gesture, starts: Sequence[float]) -> list[float]:
    """Times from 0 to the end that separate parts, at rests of the hands."""
    cuts = [0.0]
    for t in sorted(starts):
        if t < cuts[-1] + _MIN_PART_DURATION or t > motion.duration - _MIN_PART_DURATION:
            continue
        if np.max(np.abs(motion.offsets(t)[1])) < _MAX_REST_RATE:
            cuts.append(float(t))
    return [*cuts, motion.duration]


def excerpt(gesture: Gesture, begin: float, end: float) -> Motion:
    """Motion of a gesture between two times [s], with offsets of 0 at its beginning."""
    breaks_with_ends = np.union1d(gesture.breaks, [begin, end])
    coef = piecewise.refine(gesture.breaks, gesture.coef, breaks_with_ends)
    inside = (breaks_with_ends[:-1] >= begin) & (breaks_with_ends[:-1] < end)
    breaks, coef = np.append(breaks_with_ends[:-1][inside], end), coef[inside]
    coef[:, :, 0] -= coef[0, :, 0]
    return Motion(breaks - begin, coef, gesture.named, np.zeros_like(gesture.travel))


def _joined(parts: Sequence[tuple[float, Trajectory]]) -> Trajectory:
    """Successive runs, each with its beginning [s], as one."""
    runs = [run for _, run in parts]
    first_run, last_run = runs[0], runs[-1]
    if len(runs) == 1:
        return first_run
    changes: dict[str, Any] = {
        name: np.concatenate([getattr(run, name) for run in runs]) for name in _SAMPLE_ARRAYS
    }
    # Rounding may put the start of a part before the end of the previous one.
    changes["t"] = np.maximum.accumulate(np.concatenate([begin + run.t for begin, run in parts]))
    for name in _COLUMNS:
        columns: Columns | None = getattr(first_run, name)
        if columns is not None:
            values = np.concatenate([getattr(run, name).values for run in runs])
            changes[name] = columns.like(values)
    if first_run.contact is not None:
        changes["contact"] = _contacts(runs)
        changes["contact_residual"] = np.concatenate(
            [
                np.zeros(len(run)) if run.contact_residual is None else run.contact_residual
                for run in runs
            ]
        )
    events = tuple(
        dataclasses.replace(event, t=begin + event.t)
        for begin, run in parts
        for event in run.events
    )
    return dataclasses.replace(
        first_run,
        **changes,
        ledger=first_run.ledger.like(_ledger(runs)),
        events=events,
        status=last_run.status,
        causes=last_run.causes,
        seconds=None,
    )


def _contacts(runs: Sequence[Trajectory]) -> ContactPoints:
    """Contact points of successive runs with the same pairs."""
    points = [run.contact for run in runs if run.contact is not None]
    first_samples = np.cumsum([0, *(len(run) for run in runs[:-1])])
    arrays: dict[str, Any] = {
        field.name: np.concatenate([getattr(point, field.name) for point in points])
        for field in dataclasses.fields(ContactPoints)
        if field.name not in ("names", "sample")
    }
    sample = np.concatenate(
        [point.sample + n for point, n in zip(points, first_samples, strict=True)]
    )
    return ContactPoints(sample=sample, names=points[0].names, **arrays)


def _columns_of_player(columns: Columns, prefix: str) -> Columns:
    """Columns of a player, with its own names."""
    indices = [i for i, name in enumerate(columns.names) if name.startswith(prefix)]
    names = tuple(columns.names[i].removeprefix(prefix) for i in indices)
    return dataclasses.replace(columns, names=names, values=columns.values[:, indices])


def _ledger(runs: Sequence[Trajectory]) -> Array:
    """Ledger of successive runs; losses and work accumulate."""
    accumulates = np.array([name not in ENERGY_COLUMNS for name in LEDGER])
    parts, totals = [], np.zeros(len(LEDGER))
    for run in runs:
        values = run.ledger.values + totals * accumulates
        totals = values[-1]
        parts.append(values)
    return np.concatenate(parts)
