"""Overloaded drives: lost steps and runaways, from the events of a run.

A drive is a motor with a controller. It loses steps if a stepper motor lags too far behind its
command, and runs away if its load moves it far outside the range of its commands. q_D and q_K are
the dynamic and driven coordinates.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fantoccini.base import ConfigD, ConfigK
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion.state import EventKind, EventRecord


@dataclass(frozen=True)
class Overload:
    """A drive that lost steps or ran away.

    Attributes:
        since: time of the first loss or runaway [s].
        lost_steps: number of times that a stepper motor lost steps, at least four full steps each.
        ran_away: whether the drive ran away.
        error: command minus coordinate at the run's end [m or rad]; None for an orientation.
    """

    since: float
    lost_steps: int
    ran_away: bool
    error: float | None


def overloads(
    events: Iterable[EventRecord], table: CoordinateTable, q_D: ConfigD, q_K: ConfigK
) -> dict[str, Overload]:
    """Coordinate -> overload of its drive, the earliest first.

    Args:
        events: events of the run.
        table: names of the coordinates.
        q_D: (n_qD,) dynamic configuration at the run's end [rad, m or 1].
        q_K: (n_qK,) driven configuration at the run's end [rad, m or 1].
    """
    events_by_name: dict[str, list[EventRecord]] = {}
    for event in overload_events(events):
        events_by_name.setdefault(event.name, []).append(event)
    result = {}
    for name, drive_events in events_by_name.items():
        error = None
        if name in table.q_D:
            commanded = q_K[table.q_K.index(table.commands[name])]
            error = float(commanded - q_D[table.q_D.index(name)])
        lost_steps = sum(event.kind is EventKind.LOST_STEP for event in drive_events)
        result[name] = Overload(
            drive_events[0].t, lost_steps, lost_steps < len(drive_events), error
        )
    return result


def overload_events(events: Iterable[EventRecord]) -> list[EventRecord]:
    """The events of overloaded drives."""
    return [e for e in events if e.kind in (EventKind.LOST_STEP, EventKind.RUNAWAY)]
