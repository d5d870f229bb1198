"""The status of a run: decided here for single runs, batches and steppers alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from fantoccini.base import ARRIVED, Status
from fantoccini.dynamics.steppers.redundant import Contradiction

Check = Callable[[], tuple[Status, str]]
"""() -> DONE, or the status that a run deserves and the reason in words."""


@dataclass(frozen=True)
class Verdict:
    """How a run ended.

    Attributes:
        status: of the run.
        contradiction: of redundant strings, where these stopped it or made its motion impossible.
        text: why the run is not sound; empty where it is.
    """

    status: Status
    contradiction: Contradiction | None = None
    text: str = ""


def decide(
    reported: Status, contradiction: Contradiction | None = None, checks: Iterable[Check] = ()
) -> Verdict:
    """The verdict on a run.

    Redundant strings whose lengths contradict one another explain whatever the steps report. A run
    that the steps completed has the status of the first check that it fails; others of the same
    status add their reasons.

    Args:
        reported: by the steps, or by what interrupted them.
        contradiction: of redundant strings, if there is one.
        checks: of a run that the steps completed, in this order.
    """
    if contradiction:
        return Verdict(Status.REDUNDANT_STRINGS, contradiction)
    status, reasons = reported, list[str]()
    for check in checks if reported in ARRIVED else ():
        found, reason = check()
        if found is not Status.DONE and status in (*ARRIVED, found):
            status = found
            reasons += [reason] if reason else []
    return Verdict(status, None, "; ".join(reasons))
