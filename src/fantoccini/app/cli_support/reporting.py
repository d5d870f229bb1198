"""Summary of a run: events, slack, tensions, energy, speed.

A slack string does not pull. A drive moves a coordinate by a motor, the effort is the force of the
hand on a driven coordinate, and the ledger is the table of energies and work. In names, D stands
for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from fantoccini.app.cli_support.terminal import format_number, print_output, print_table
from fantoccini.motion import EventKind, Trajectory

_MAX_LISTED_NAMES = 16
"""Largest number of strings and efforts listed by name."""
_MIN_ROTOR_TRAVEL = 1.0
"""Travel of a rotor without control above which it is reported [m or rad]."""


def report_run(run: Trajectory, seconds: float) -> None:
    """Prints the summary of a run that took ``seconds`` to compute."""
    n_catches = Counter(e.name for e in run.events if e.kind is EventKind.CATCH)
    n_releases = Counter(e.name for e in run.events if e.kind is EventKind.RELEASE)
    largest_impulse: dict[str, float] = {}
    for event in run.events:
        if event.kind is EventKind.CATCH:
            largest_impulse[event.name] = max(largest_impulse.get(event.name, 0.0), event.impulse)
    print_table(
        "Strings",
        (
            "name",
            "catches>",
            "releases>",
            "longest slack [s]>",
            "min [N]>",
            "max [N]>",
            "largest impulse [N s]>",
        ),
        [
            (
                name,
                n_catches[name],
                n_releases[name],
                f"{longest_slack(run, name):.3f}",
                float(np.min(tension)),
                float(np.max(tension)),
                format_number(largest_impulse[name]) if name in largest_impulse else "",
            )
            for name, tension in run.tension.items()
        ],
    )
    print_table(
        "Energy [J]",
        tuple(f"{name}>" for name in ("", *run.ledger.names)),
        [
            (label, *(float(values[sample]) for _, values in run.ledger.items()))
            for label, sample in (("start", 0), ("end", -1))
        ],
    )
    counts_by_kind = Counter(e.kind for e in run.events)
    counts_text = ", ".join(f"{n} {kind}" for kind, n in counts_by_kind.items()) or "none"
    print_output(f"events: {counts_text}")
    for name, drive in run.overloads.items():
        failure = "ran away" if drive.ran_away else f"lost steps {drive.lost_steps} times"
        error = "" if drive.error is None else f"; error at the end {abs(drive.error):.3g} (m, rad)"
        print_output(f"{name} {failure}, first at t = {drive.since:.6g} s{error}")
    for name, travel in _free_rotors(run):
        print_output(f"{name} has no control: its rotor turned freely, by {travel:.3g} (m, rad)")
    for line in undetermined_lines(run):
        print_output(line)
    if run.violation is not None:
        max_violation = float(np.max(run.violation.values, initial=0.0))
        print_output(f"largest violation of strings and limits: {max_violation:.2g} (m, rad)")
    speed = run.duration / max(seconds, 1e-9)
    print_output(
        f"{run.duration:.6g} s of motion in {seconds:.3g} s, {speed:.3g} times real time "
        f"(method {run.method}, {len(run)} samples): {run.status.message}"
    )


def undetermined_lines(run: Trajectory) -> list[str]:
    """Lines about tensions and efforts that the motion does not determine, with the first time."""
    if run.undetermined is None or not np.any(run.undetermined.values):
        return []
    affected = [(name, flags) for name, flags in run.undetermined.items() if np.any(flags)]
    first_time = min(float(run.t[np.argmax(flags)]) for _, flags in affected)
    share = 100.0 * max(float(np.mean(flags)) for _, flags in affected)
    names = ", ".join(name for name, _ in affected[:_MAX_LISTED_NAMES])
    remainder = (
        ""
        if len(affected) <= _MAX_LISTED_NAMES
        else f" and {len(affected) - _MAX_LISTED_NAMES} more"
    )
    return [
        f"not determined by the motion, from t = {first_time:.6g} s, in up to {share:.3g} % of the "
        f"samples: tension or effort of {names}{remainder}; other values give the same motion; "
        "strings that stretch (--string-model chain) have determined values"
    ]


def _free_rotors(run: Trajectory) -> list[tuple[str, float]]:
    """Drives without control, and their travel, if that is large."""
    drives = () if run.puppet is None else run.puppet.drives
    free_names = [name for drive in drives if not drive.follows for name in drive.on]
    coordinates, travels = run.coordinates, []
    for name in free_names:
        if name in coordinates.q_D:
            travel = float(np.ptp(run.q_D[:, coordinates.q_D.index(name)]))
            if travel > _MIN_ROTOR_TRAVEL:
                travels.append((name, travel))
    return travels


def longest_slack(run: Trajectory, string: str) -> float:
    """Longest uninterrupted time for which a string is slack [s].

    The active set of a sample holds until the next sample.
    """
    longest, slack_since = 0.0, np.nan
    for t, taut in zip(run.t, run.taut[string], strict=True):
        longest = float(np.fmax(longest, t - slack_since))
        if taut:
            slack_since = np.nan
        elif np.isnan(slack_since):
            slack_since = t
    return longest
