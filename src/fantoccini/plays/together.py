"""Runs of players put together to one run of the stage.

Puppets that do not touch move as if the others were not there: their hands are kinematic. So the
run of all of them is that of each alone, at common times.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Status
from fantoccini.motion import Columns, EventRecord, Trajectory
from fantoccini.plays.casting import Cast
from fantoccini.tree import CoordinateTable

SAMPLE = 0.005
"""Between samples [s]."""
_SHARED = ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")


def together(cast: Cast, runs: Mapping[str, Trajectory]) -> Trajectory:
    """The run of the stage, 200 samples a second, until the first of the runs ends.

    Props stay where they are at the start. Between two samples a velocity that jumps when a
    string snaps taut is led over.
    """
    end = min(float(run.t[-1]) for run in runs.values())
    t = np.append(np.arange(0.0, end - 0.5 * SAMPLE, SAMPLE), end)
    table, x0, tree = cast.whole.coordinates, cast.x0, cast.whole.tree
    parts: dict[str, Array] = {
        name: np.tile(getattr(x0, name, np.zeros(0)), (len(t), 1))
        if not name.startswith("acc") else np.zeros((len(t), _width(table, name)))
        for name in _SHARED
    }  # fmt: skip
    strings = tuple(one.name for one in tree.strings)
    limits = tuple(one.name for one in tree.limits)
    columns = {
        "tension": Columns(strings, np.zeros((len(t), len(strings))), "string"),
        "taut": Columns(strings, np.zeros((len(t), len(strings)), dtype=bool), "string"),
        "slip": Columns(strings, np.zeros((len(t), len(strings))), "string"),
        "limit_force": Columns(limits, np.zeros((len(t), len(limits))), "limit"),
        "violation": Columns(tree.row_names, np.zeros((len(t), len(tree.row_names)))),
    }
    found = {name: np.array(one.values) for name, one in columns.items()}
    ledger: Array | None = None
    first: Trajectory | None = None
    events: list[EventRecord] = []
    for name, run in runs.items():
        own, prefix = run.resample(t), cast.member(name)
        for part in _SHARED:
            parts[part][:, _places(own, part, prefix, table)] = getattr(own, part)
        for what, all_of in columns.items():
            mine: Columns | None = getattr(own, what)
            if mine is not None:
                places = [all_of.names.index(prefix + one) for one in mine.names]
                found[what][:, places] = mine.values
        ledger = own.ledger.values if ledger is None else ledger + own.ledger.values
        events += [
            dataclasses.replace(e, name=prefix + e.name if e.name else "") for e in own.events
        ]
        first = first or own
    assert first is not None
    assert ledger is not None
    status = next((r.status for r in runs.values() if r.status is not Status.DONE), Status.DONE)
    put = {name: one.like(found[name]) for name, one in columns.items()}
    return Trajectory(
        t, parts["q_D"], parts["v_D"], parts["acc_D"], parts["q_K"], parts["v_K"], parts["acc_K"],
        put["tension"], put["limit_force"], put["taut"], first.ledger.like(ledger),
        tuple(sorted(events, key=lambda e: e.t)), status, first.method, table,
        cast.whole.model.described, violation=put["violation"], slip=put["slip"],
    )  # fmt: skip


def _width(table: CoordinateTable, name: str) -> int:
    return int(getattr(table, f"n_v{name[-1]}"))


def _places(run: Trajectory, part: str, prefix: str, table: CoordinateTable) -> list[int]:
    kind = f"{'q' if part[0] == 'q' else 'v'}_{part[-1]}"
    names, mine = getattr(table, kind), getattr(run.coordinates, kind)
    return [names.index(prefix + one) for one in mine]
