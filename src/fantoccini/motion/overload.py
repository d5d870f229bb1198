"""Drives whose motor was too weak, from the events of a run."""

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
        since: when it first did [s].
        lost_steps: how often a stepper motor lost steps, four full steps or more each time.
        ran_away: whether it ran away.
        error: command minus coordinate at the run's end [m or rad]; None for an orientation.
    """

    since: float
    lost_steps: int
    ran_away: bool
    error: float | None


def overloads(
    events: Iterable[EventRecord], table: CoordinateTable, q_D: ConfigD, q_K: ConfigK
) -> dict[str, Overload]:
    """The drives that were too weak, by coordinate, the earliest first.

    Args:
        events: of the run.
        table: names of the coordinates.
        q_D: (n_qD,) dynamic configuration at the run's end [rad, m or 1].
        q_K: (n_qK,) driven configuration there [rad, m or 1].
    """
    found: dict[str, list[EventRecord]] = {}
    for event in weak(events):
        found.setdefault(event.name, []).append(event)
    made = {}
    for name, own in found.items():
        error = None
        if name in table.q_D:
            commanded = q_K[table.q_K.index(table.commands[name])]
            error = float(commanded - q_D[table.q_D.index(name)])
        lost = sum(event.kind is EventKind.LOST_STEP for event in own)
        made[name] = Overload(own[0].t, lost, lost < len(own), error)
    return made


def weak(events: Iterable[EventRecord]) -> list[EventRecord]:
    """The events of drives whose motor was too weak."""
    return [e for e in events if e.kind in (EventKind.LOST_STEP, EventKind.RUNAWAY)]
