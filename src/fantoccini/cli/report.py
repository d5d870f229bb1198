"""The short tables after a run: events, slack, tensions, energy, speed."""

from __future__ import annotations

from collections import Counter

import numpy as np

from fantoccini.cli.terminal import number, table, write
from fantoccini.motion import EventKind, Trajectory


def report(run: Trajectory, seconds: float) -> None:
    """Prints what happened.

    Args:
        run: the motion.
        seconds: how long computing it took.
    """
    caught = Counter(e.name for e in run.events if e.kind is EventKind.CATCH)
    released = Counter(e.name for e in run.events if e.kind is EventKind.RELEASE)
    impulse: dict[str, float] = {}
    for event in run.events:
        if event.kind is EventKind.CATCH:
            impulse[event.name] = max(impulse.get(event.name, 0.0), event.impulse)
    table(
        "Strings",
        (
            "name", "catches>", "releases>", "longest slack [s]>", "least [N]>", "most [N]>",
            "hardest catch [N s]>",
        ),
        [
            (
                name, caught[name], released[name], f"{longest_slack(run, name):.3f}",
                float(np.min(tension)), float(np.max(tension)),
                number(impulse[name]) if name in impulse else "",
            )
            for name, tension in run.tension.items()
        ],
    )  # fmt: skip
    table(
        "Energy [J]",
        tuple(f"{name}>" for name in ("", *run.ledger.names)),
        [
            (label, *(float(values[row]) for _, values in run.ledger.items()))
            for label, row in (("start", 0), ("end", -1))
        ],
    )
    kinds = Counter(e.kind for e in run.events)
    listed = ", ".join(f"{n} {kind}" for kind, n in kinds.items()) or "none"
    write(f"events: {listed}")
    for name, drive in run.overloads.items():
        did = "ran away" if drive.ran_away else f"lost steps {drive.lost_steps} times"
        off = "" if drive.error is None else f", {abs(drive.error):.3g} (m, rad) off at the end"
        write(f"{name} {did} from t = {drive.since:.6g} s on{off}")
    if run.violation is not None:
        worst = float(np.max(run.violation.values, initial=0.0))
        write(f"strings and limits overstepped by at most {worst:.2g} (m, rad)")
    speed = run.duration / max(seconds, 1e-9)
    write(
        f"{run.duration:.6g} s of motion in {seconds:.3g} s, {speed:.3g} times real time "
        f"(method {run.method}, {len(run)} rows): {run.status.message}"
    )


def longest_slack(run: Trajectory, string: str) -> float:
    """The longest time without a break that a string is slack [s]; a row's mode holds until the
    next row."""
    slack = ~run.taut[string]
    longest, began = 0.0, None
    for t, now in zip(run.t, slack, strict=True):
        if now and began is None:
            began = t
        elif not now and began is not None:
            longest, began = max(longest, t - began), None
    return float(longest if began is None else max(longest, run.t[-1] - began))
