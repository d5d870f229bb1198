"""Run of the stage, assembled from the runs of companies at common times.

Companies do not touch each other, and move independently.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from fantoccini.base import Array, Indices, Status
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import LEDGER, Columns, ContactPoints, EventRecord, Trajectory
from fantoccini.theatre.cast import Cast, PropState
from fantoccini.theatre.plays.runs import ENERGIES, Run, Runs, prop_states

SAMPLE = 0.005
"""Time between samples [s]."""
_MOTION = ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
"""Arrays of a trajectory with the motion."""


def together(cast: Cast, runs: Runs, sample: float = SAMPLE) -> Trajectory:
    """Run of the stage, until the first of the players' runs ends.

    The ledger is the sum over the companies, without energies of a prop that stands by itself. A
    prop that nobody touches stays in its place. A velocity that jumps between two samples, when a
    string catches, is interpolated.

    Args:
        cast: cast of the play.
        runs: runs of all companies.
        sample: time between samples [s].
    """
    end = min(float(run.t[-1]) for run in runs.players.values())
    t = np.append(np.arange(0.0, end - 0.5 * sample, sample), end)
    whole = _Whole(cast, t)
    for name in cast.props:
        whole.set_prop(name, -1.0, cast.prop_states[name])
    for run in runs.companies:
        whole.add(run)
    first = runs.companies[0].whole
    statuses = [run.status for run in runs.players.values()]
    default = Status.STOPPED if runs.stops else Status.DONE
    status = next((status for status in statuses if status is not Status.DONE), default)
    columns = {name: column.like(whole.values[name]) for name, column in whole.columns.items()}
    parts = whole.parts
    return Trajectory(
        t,
        parts["q_D"],
        parts["v_D"],
        parts["acc_D"],
        parts["q_K"],
        parts["v_K"],
        parts["acc_K"],
        columns["tension"],
        columns["limit_force"],
        columns["taut"],
        first.ledger.like(whole.ledger),
        tuple(sorted(whole.events, key=lambda e: e.t)),
        status,
        first.method,
        cast.whole.coordinates,
        cast.whole.current_puppet,
        violation=columns["violation"],
        slip=columns["slip"],
        contact=_joined(whole.points),
    )


class _Whole:
    """Columns of the stage's run while companies are added, in order of their beginnings."""

    def __init__(self, cast: Cast, t: Array):
        self._cast, self._t, self._table = cast, t, cast.whole.coordinates
        tree, n = cast.whole.tree, len(t)
        self.parts = {name: np.zeros((n, _width(self._table, name))) for name in _MOTION}
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

    def set_prop(self, name: str, since: float, state: PropState) -> None:
        """Sets the state of a prop that stands after a time [s]."""
        q, v = self._table.q_D.index(f"{name}.x"), self._table.v_D.index(f"{name}.x")
        later = self._t > since
        self.parts["q_D"][later, q : q + 7] = state[0]
        for part in ("v_D", "acc_D"):
            self.parts[part][later, v : v + 6] = 0.0

    def add(self, run: Run) -> None:
        """Adds a company's run, at its time."""
        inside = np.flatnonzero((self._t >= run.begin) & (self._t <= run.end))
        if len(inside):
            self._put(run, inside)
        for name in run.staged.props:
            self.set_prop(name, run.end, prop_states(run, name, still=True))
        # Losses remain after its end.
        energies = np.array([name in ENERGIES for name in LEDGER])
        self.ledger[self._t > run.end] += np.where(energies, 0.0, run.whole.ledger.values[-1])
        for event in run.whole.events:
            name = "|".join(self._named(run, part) for part in event.name.split("|") if part)
            self.events.append(dataclasses.replace(event, t=run.begin + event.t, name=name))

    def _put(self, run: Run, inside: Indices) -> None:
        """Sets the samples of a company's run."""
        own = run.whole.resample(self._t[inside] - run.begin)
        for part in _MOTION:
            kind = _kind(part)
            all_names = getattr(self._table, kind)
            names = getattr(own.coordinates, kind)
            places = [all_names.index(self._named(run, name)) for name in names]
            self.parts[part][np.ix_(inside, np.array(places))] = getattr(own, part)
        for quantity, stage_columns in self.columns.items():
            own_columns: Columns | None = getattr(own, quantity)
            if own_columns is not None:
                columns = [
                    stage_columns.names.index(self._named(run, name)) for name in own_columns.names
                ]
                cells = np.ix_(inside, np.array(columns, dtype=int))
                self.values[quantity][cells] = own_columns.values
        # At a change of companies, only the earlier one counts.
        first = (self._t[inside] == run.begin) & (run.begin > 0.0)
        self.ledger[inside] += np.where(first[:, None], 0.0, own.ledger.values)
        if own.contact is not None:
            names = tuple((self._named(run, a), self._named(run, b)) for a, b in own.contact.names)
            sample = inside[own.contact.sample]
            self.points.append(dataclasses.replace(own.contact, sample=sample, names=names))

    def _named(self, run: Run, name: str) -> str:
        """Name on the stage of a name in a company's scene."""
        return self._cast.scene_name(run.staged.on_stage(name))


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


def _kind(part: str) -> str:
    return f"{'q' if part[0] == 'q' else 'v'}_{part[-1]}"


def _width(table: CoordinateTable, part: str) -> int:
    return int(getattr(table, f"n_{_kind(part)[0]}{part[-1]}"))
