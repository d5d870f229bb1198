"""Drives whose motor was too weak, as a run's events tell of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fantoccini.motion.state import EventKind, EventRecord

if TYPE_CHECKING:
    from fantoccini.motion.trajectory import Trajectory


@dataclass(frozen=True)
class Overload:
    """A drive that lost steps or ran away.

    Attributes:
        since: when it first did [s].
        lost_steps: how often a stepper lost steps; every time four full steps or more.
        ran_away: whether it ran away.
        error: command less coordinate at the run's end [m or rad]; None of an orientation.
    """

    since: float
    lost_steps: int
    ran_away: bool
    error: float | None


def overloads(run: Trajectory) -> dict[str, Overload]:
    """The drives that were too weak, by coordinate, the earliest first."""
    table, found = run.coordinates, {}
    for event in weak(run.events):
        found.setdefault(event.name, []).append(event)
    made = {}
    for name, events in found.items():
        error = None
        if name in table.q_D:
            told = run.q_K[-1, table.q_K.index(table.commands[name])]
            error = float(told - run.q_D[-1, table.q_D.index(name)])
        lost = sum(event.kind is EventKind.LOST_STEP for event in events)
        made[name] = Overload(events[0].t, lost, lost < len(events), error)
    return made


def weak(events: Iterable[EventRecord]) -> list[EventRecord]:
    """The events that tell of drives whose motor was too weak."""
    return [e for e in events if e.kind in (EventKind.LOST_STEP, EventKind.RUNAWAY)]
