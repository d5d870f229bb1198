"""Run of the stage, assembled from the runs of companies at common times.

Companies do not touch each other, and move independently.

A company is a group of players and props that are simulated together. q_D are dynamic coordinates,
q_K driven ones (ends and lengths of strings); v and acc are velocities and accelerations. The
ledger is the table of energies and work.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from fantoccini.base import Array, Indices, Status
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import LEDGER, Columns, ContactPoints, EventRecord, Trajectory
from fantoccini.theatre.cast import Cast, PropState
from fantoccini.theatre.plays.runs import ENERGY_COLUMNS, Run, Runs, prop_end_state

SAMPLE_INTERVAL = 0.005
"""Time between samples [s]."""
_MOTION_ARRAYS = ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
"""Arrays of a trajectory with the motion."""


def combine_runs(cast: Cast, runs: Runs, interval: float = SAMPLE_INTERVAL) -> Trajectory:
    """Run of the stage, until the first of the players' runs ends.

    The ledger is the sum over the companies, without energies of a prop that stands by itself. A
    prop that nobody touches stays in its place. A velocity that jumps between two samples, when a
    string catches, is interpolated.

    Args:
        cast: cast of the play.
        runs: runs of all companies.
        interval: time between samples [s].
    """
    end = min(float(run.t[-1]) for run in runs.players.values())
    t = np.append(np.arange(0.0, end - 0.5 * interval, interval), end)
    stage = _StageColumns(cast, t)
    for name in cast.props:
        stage.set_prop(name, -1.0, cast.prop_states[name])
    for run in runs.companies:
        stage.add(run)
    first = runs.companies[0].trajectory
    statuses = [run.status for run in runs.players.values()]
    usual_status = Status.STOPPED if runs.stops else Status.DONE
    status = next((status for status in statuses if status is not Status.DONE), usual_status)
    columns = {name: column.like(stage.values[name]) for name, column in stage.columns.items()}
    arrays = stage.arrays
    return Trajectory(
        t,
        arrays["q_D"],
        arrays["v_D"],
        arrays["acc_D"],
        arrays["q_K"],
        arrays["v_K"],
        arrays["acc_K"],
        columns["tension"],
        columns["limit_force"],
        columns["taut"],
        first.ledger.like(stage.ledger),
        tuple(sorted(stage.events, key=lambda e: e.t)),
        status,
        first.method,
        cast.marionette.coordinates,
        cast.marionette.current_puppet,
        violation=columns["violation"],
        slip=columns["slip"],
        contact=_joined(stage.points),
    )


class _StageColumns:
    """Columns of the stage's run while companies are added, in order of their beginnings."""

    def __init__(self, cast: Cast, t: Array):
        self._cast, self._t, self._table = cast, t, cast.marionette.coordinates
        tree, n = cast.marionette.tree, len(t)
        self.arrays = {name: np.zeros((n, _width(self._table, name))) for name in _MOTION_ARRAYS}
        strings = tuple(string.name for string in tree.strings)
        limits = tuple(limit.name for limit in tree.limits)
        self.columns = {
            "tension": Columns(strings, np.zeros((n, len(strings))), "string"),
            "taut": Columns(strings, np.zeros((n, len(strings)), dtype=bool), "string"),
            "slip": Columns(strings, np.zeros((n, len(strings))), "string"),
            "limit_force": Columns(limits, np.zeros((n, len(limits))), "limit"),
            "violation": Columns(tree.row_names, np.zeros((n, len(tree.row_names)))),
        }
        self.values = {name: np.array(column.values) for name, column in self.columns.items()}
        self.ledger = np.zeros((n, len(LEDGER)))
        self.events: list[EventRecord] = []
        self.points: list[ContactPoints] = []

    def set_prop(self, name: str, start_time: float, state: PropState) -> None:
        """Sets the state of a prop that stands after a time [s]."""
        q, v = self._table.q_D.index(f"{name}.x"), self._table.v_D.index(f"{name}.x")
        is_later = self._t > start_time
        self.arrays["q_D"][is_later, q : q + 7] = state[0]
        for array_name in ("v_D", "acc_D"):
            self.arrays[array_name][is_later, v : v + 6] = 0.0

    def add(self, run: Run) -> None:
        """Adds a company's run, at its time."""
        indices = np.flatnonzero((self._t >= run.begin) & (self._t <= run.end))
        if len(indices):
            self._add_samples(run, indices)
        for name in run.scene.props:
            self.set_prop(name, run.end, prop_end_state(run, name, at_rest=True))
        # Losses remain after its end.
        is_energy = np.array([name in ENERGY_COLUMNS for name in LEDGER])
        self.ledger[self._t > run.end] += np.where(is_energy, 0.0, run.trajectory.ledger.values[-1])
        for event in run.trajectory.events:
            name = "|".join(self._stage_name(run, part) for part in event.name.split("|") if part)
            self.events.append(dataclasses.replace(event, t=run.begin + event.t, name=name))

    def _add_samples(self, run: Run, indices: Indices) -> None:
        """Sets the samples of a company's run."""
        samples = run.trajectory.resample(self._t[indices] - run.begin)
        for array_name in _MOTION_ARRAYS:
            name_list = _name_list(array_name)
            all_names = getattr(self._table, name_list)
            names = getattr(samples.coordinates, name_list)
            coordinates = [all_names.index(self._stage_name(run, name)) for name in names]
            self.arrays[array_name][np.ix_(indices, np.array(coordinates))] = getattr(
                samples, array_name
            )
        for quantity, stage_columns in self.columns.items():
            company_columns: Columns | None = getattr(samples, quantity)
            if company_columns is not None:
                columns = [
                    stage_columns.names.index(self._stage_name(run, name))
                    for name in company_columns.names
                ]
                cells = np.ix_(indices, np.array(columns, dtype=int))
                self.values[quantity][cells] = company_columns.values
        # At a change of companies, only the earlier one counts.
        is_first = (self._t[indices] == run.begin) & (run.begin > 0.0)
        self.ledger[indices] += np.where(is_first[:, None], 0.0, samples.ledger.values)
        if samples.contact is not None:
            names = tuple(
                (self._stage_name(run, a), self._stage_name(run, b))
                for a, b in samples.contact.names
            )
            sample = indices[samples.contact.sample]
            self.points.append(dataclasses.replace(samples.contact, sample=sample, names=names))

    def _stage_name(self, run: Run, name: str) -> str:
        """Name on the stage of a name in a company's scene."""
        return self._cast.scene_name(run.scene.on_stage(name))


def _joined(points: list[ContactPoints]) -> ContactPoints | None:
    """All contact points in the order of their samples."""
    if not points:
        return None
    names = tuple(dict.fromkeys(name for point in points for name in point.names))
    pair = np.concatenate(
        [
            np.array([names.index(name) for name in point.names], dtype=int)[point.pair]
            for point in points
        ]
    )
    sample = np.concatenate([point.sample for point in points])
    order = np.argsort(sample, kind="stable")
    arrays = {
        field.name: np.concatenate([getattr(point, field.name) for point in points])[order]
        for field in dataclasses.fields(ContactPoints)
        if field.name not in ("names", "pair", "sample")
    }
    return ContactPoints(sample=sample[order], pair=pair[order], names=names, **arrays)


def _name_list(array_name: str) -> str:
    return f"{'q' if array_name[0] == 'q' else 'v'}_{array_name[-1]}"


def _width(table: CoordinateTable, array_name: str) -> int:
    return int(getattr(table, f"n_{_name_list(array_name)[0]}{array_name[-1]}"))
