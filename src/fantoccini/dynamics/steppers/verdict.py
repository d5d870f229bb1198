"""Status of a run: one decision for single runs, batches and steppers.

A verdict is the status with which a run ends, and its reason in words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from fantoccini.base import ARRIVED, Status
from fantoccini.dynamics.steppers.redundant import Contradiction

Check = Callable[[], tuple[Status, str]]
"""Callback: () -> ``DONE``, or another status with its reason in words."""


@dataclass(frozen=True)
class Verdict:
    """Outcome of a run.

    Attributes:
        status: status of the run.
        contradiction: contradiction of redundant strings that stopped it, if any.
        text: reason that the run is not sound; empty for a sound run.
    """

    status: Status
    contradiction: Contradiction | None = None
    text: str = ""


def decide(
    reported: Status, contradiction: Contradiction | None = None, checks: Iterable[Check] = ()
) -> Verdict:
    """Verdict on a run.

    A contradiction of redundant strings explains any status of the steps. A run that the steps
    completed has the status of the first check that it fails; others of the same status add their
    reasons.

    Args:
        reported: status from the steps, or from an interruption.
        contradiction: contradiction of redundant strings, if any.
        checks: checks of a completed run, in this order.
    """
    if contradiction:
        return Verdict(Status.REDUNDANT_STRINGS, contradiction)
    status, reasons = reported, list[str]()
    for check in checks if reported in ARRIVED else ():
        check_status, reason = check()
        if check_status is not Status.DONE and status in (*ARRIVED, check_status):
            status = check_status
            reasons += [reason] if reason else []
    return Verdict(status, None, "; ".join(reasons))
