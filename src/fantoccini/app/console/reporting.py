"""The summary of a run: events, slack, tensions, energy, speed."""

from __future__ import annotations

from collections import Counter

import numpy as np

from fantoccini.app.console.terminal import number, table, write
from fantoccini.motion import EventKind, Trajectory

_MAX_NAMED = 16
"""Largest number of strings and efforts listed by name."""
_FAR = 1.0
"""Way of a rotor that is told [m or rad]."""


def report(run: Trajectory, seconds: float) -> None:
    """Prints the summary of a run, which took ``seconds`` to compute."""
    caught = Counter(e.name for e in run.events if e.kind is EventKind.CATCH)
    released = Counter(e.name for e in run.events if e.kind is EventKind.RELEASE)
    impulse: dict[str, float] = {}
    for event in run.events:
        if event.kind is EventKind.CATCH:
            impulse[event.name] = max(impulse.get(event.name, 0.0), event.impulse)
    table(
        "Strings",
        (
            "name",
            "catches>",
            "releases>",
            "longest slack [s]>",
            "min [N]>",
            "max [N]>",
            "hardest catch [N s]>",
        ),
        [
            (
                name,
                caught[name],
                released[name],
                f"{longest_slack(run, name):.3f}",
                float(np.min(tension)),
                float(np.max(tension)),
                number(impulse[name]) if name in impulse else "",
            )
            for name, tension in run.tension.items()
        ],
    )
    table(
        "Energy [J]",
        tuple(f"{name}>" for name in ("", *run.ledger.names)),
        [
            (label, *(float(values[sample]) for _, values in run.ledger.items()))
            for label, sample in (("start", 0), ("end", -1))
        ],
    )
    kinds = Counter(e.kind for e in run.events)
    listed = ", ".join(f"{n} {kind}" for kind, n in kinds.items()) or "none"
    write(f"events: {listed}")
    for name, drive in run.overloads.items():
        did = "ran away" if drive.ran_away else f"lost steps {drive.lost_steps} times"
        off = "" if drive.error is None else f", {abs(drive.error):.3g} (m, rad) off at the end"
        write(f"{name} {did} from t = {drive.since:.6g} s on{off}")
    for name, way in _turned_freely(run):
        write(f"{name} has no control: its rotor turned freely, by {way:.3g} (m, rad)")
    for line in undetermined_lines(run):
        write(line)
    if run.violation is not None:
        worst = float(np.max(run.violation.values, initial=0.0))
        write(f"largest violation of strings and limits: {worst:.2g} (m, rad)")
    speed = run.duration / max(seconds, 1e-9)
    write(
        f"{run.duration:.6g} s of motion in {seconds:.3g} s, {speed:.3g} times real time "
        f"(method {run.method}, {len(run)} samples): {run.status.message}"
    )


def undetermined_lines(run: Trajectory) -> list[str]:
    """Report lines: tensions and efforts not determined by the motion, with the first time."""
    if run.undetermined is None or not np.any(run.undetermined.values):
        return []
    found = [(name, flags) for name, flags in run.undetermined.items() if np.any(flags)]
    first = min(float(run.t[np.argmax(flags)]) for _, flags in found)
    share = 100.0 * max(float(np.mean(flags)) for _, flags in found)
    names = ", ".join(name for name, _ in found[:_MAX_NAMED])
    more = "" if len(found) <= _MAX_NAMED else f" and {len(found) - _MAX_NAMED} more"
    return [
        f"not determined by the motion, from t = {first:.6g} s on, in up to {share:.3g} % of the "
        f"samples: tension or effort of {names}{more}; other values give the same motion, those of "
        "strings that stretch (--string-model chain) do not"
    ]


def _turned_freely(run: Trajectory) -> list[tuple[str, float]]:
    """The drives without control that went farther than one that runs away."""
    drives = () if run.puppet is None else run.puppet.drives
    free = [name for drive in drives if not drive.follows for name in drive.on]
    table, found = run.coordinates, []
    for name in free:
        if name in table.q_D:
            way = float(np.ptp(run.q_D[:, table.q_D.index(name)]))
            if way > _FAR:
                found.append((name, way))
    return found


def longest_slack(run: Trajectory, string: str) -> float:
    """The longest uninterrupted time that a string is slack [s].

    The active set of a sample holds until the next one.
    """
    longest, slack_since = 0.0, np.nan
    for t, taut in zip(run.t, run.taut[string], strict=True):
        longest = float(np.fmax(longest, t - slack_since))
        if taut:
            slack_since = np.nan
        elif np.isnan(slack_since):
            slack_since = t
    return longest
