"""Whether props are where cues have brought them, in runs of a play."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.cast import SEATED, Cast, Footing, Meeting, top_of
from fantoccini.theatre.plays.runs import Run, Runs
from fantoccini.theatre.script import MeetingKind, Spot

_EVERY = 0.05
"""Between looks [s]."""
_FAR, _LONG = 0.06, (0.0, 0.14)
"""A handle on a forearm is so near to its axis, and between these along it from the elbow [m]."""
_JUST = 0.5
"""Time after a cue in which a prop counts as misplaced, not as lost [s]."""
_SITS_WITH = 0.15
"""At least this part of the weight a seat bears of who sits on it."""
_LEANS, _OFF = np.cos(np.radians(10.0)), 0.008
"""Least height of a standing prop's axis, and how far from its place it may be in height [m]."""

_STILL = 0.02
"""Speed of a prop that stands [m/s]."""


@dataclass(frozen=True)
class Failure:
    """Something with a prop that does not come true.

    Attributes:
        t: when [s].
        players: who is concerned.
        text: what happens.
        cue: the cue that does not do it; None where it is not known.
    """

    t: float
    players: tuple[str, ...]
    text: str
    cue: Spot | None


def failures(cast: Cast, meetings: Sequence[Meeting], runs: Runs) -> list[Failure]:
    """Failures of runs, in order of time."""
    found: list[Failure] = []
    for meeting in meetings:
        for run, begin, end in _runs(meeting, runs):
            t = np.append(np.arange(begin, end, _EVERY), end) - run.begin
            check = _CHECKS.get(meeting.kind)
            failure = check(cast, meeting, run, t) if check is not None else None
            if failure is not None:
                found.append(failure)
                break
    return sorted(found, key=lambda one: one.t)


def handle_seen(cast: Cast, runs: Runs, meeting: Meeting, t: float) -> tuple[float, float] | None:
    """Distance of a handle from the elbow, and its height, at a time [m]; None if unknown."""
    (prop,), who = meeting.props, meeting.players[0]
    run, handle = runs.with_prop(prop, t), cast.props[prop].handle
    if run is None or handle is None:
        return None
    pose, arm = (_poses(run, x, np.array([t - run.begin]))[0] for x in (prop, _arm(meeting, who)))
    place = pose[:, 3] + handle * pose[:, 2]
    return float(-arm[:, 2] @ (place - arm[:, 3])), float(place[2])


def stands_seen(cast: Cast, runs: Runs, prop: str, t: float) -> Footing | None:
    """Where a prop stands that was put down before a time; None if it was not [s]."""
    before = [run for run in runs.companies if prop in run.staged.props and run.end <= t + 1e-9]
    if not before:
        return None
    run = before[-1]
    pose = _poses(run, prop, run.whole.t[-1:])[0]
    return Footing(float(pose[0, 3]), float(pose[1, 3]), float(np.arctan2(pose[1, 0], pose[0, 0])))


def _runs(meeting: Meeting, runs: Runs) -> Iterator[tuple[Run, float, float]]:
    """The runs in which a meeting is, and its times there [s]."""
    for run in runs.companies:
        company = run.staged.company
        begin, end = max(meeting.begin, run.begin), min(meeting.end, run.end)
        there = {*meeting.players} <= {*company.players} and meeting.pairs <= company.pairs
        if there and begin < end:
            yield run, begin, end


def _hangs(cast: Cast, meeting: Meeting, run: Run, t: Times) -> Failure | None:
    (prop,), (who,) = meeting.props, meeting.players
    forearm = _arm(meeting, who)
    handle = cast.props[prop].handle
    assert handle is not None
    thing, arm = (_poses(run, name, t) for name in (prop, forearm))
    place = thing[:, :, 3] + handle * thing[:, :, 2] - arm[:, :, 3]
    own = np.einsum("tij,ti->tj", arm[:, :, :3], place)
    along, far = -own[:, 2], np.hypot(own[:, 0], own[:, 1])
    off = (far > _FAR) | (along < _LONG[0]) | (along > _LONG[1])
    if not np.any(off):
        return None
    then = run.begin + float(t[int(np.argmax(off))])
    soon = meeting.cue is not None and then <= meeting.begin + _JUST
    text = f"{prop} would not hang on {who}'s arm" if soon else f"{who} would drop {prop}"
    return Failure(then, meeting.players, text, meeting.cue if soon else None)


def _stands(cast: Cast, meeting: Meeting, run: Run, t: Times) -> Failure | None:
    (prop,) = meeting.props
    obstacles = {obstacle.name for obstacle in cast.file.stage.obstacles}
    (on,) = {name for pair in meeting.pairs for name in pair} & obstacles
    pose, top = _poses(run, prop, t[-1:])[0], top_of(cast.file, on)
    assert top is not None
    first = run.whole.coordinates.v_D.index(f"{run.staged.props[prop]}.x")
    rates = run.whole.resample(t[-1:]).v_D[0, first : first + 3]
    still = float(np.linalg.norm(rates)) <= _STILL
    if still and pose[2, 2] >= _LEANS and abs(pose[2, 3] - top) <= _OFF:
        return None
    text = f"{prop} would not stand on {on}"
    return Failure(run.begin + float(t[-1]), meeting.players, text, meeting.cue)


def _sits(cast: Cast, meeting: Meeting, run: Run, _: Times) -> Failure | None:
    (who,) = meeting.players
    since, until = (max(x - run.begin, 0.0) for x in meeting.bears)
    until = min(until, float(run.whole.t[-1]))
    if since >= until or run.whole.contact is None:
        return None
    names = {run.staged.local(f"{who}.{body}") for body in SEATED}
    seat = {run.staged.local(name) for pair in meeting.pairs for name in pair} - names
    points = run.whole.contact
    ours = [bool({a, b} & names) and bool({a, b} & seat) for a, b in points.names]
    clock = run.whole.t
    counts = (clock >= since) & (clock <= until)
    mine = np.array(ours, dtype=bool)[points.pair] & counts[points.sample]
    bears = float(np.sum(np.abs(points.force[mine, 2]))) / max(int(np.sum(counts)), 1)
    weight = cast.players[who].alone.weight
    if bears >= _SITS_WITH * weight:
        return None
    text = f"{who} would not sit: the seat bears {bears / weight:.0%} of its weight"
    return Failure(run.begin + since, meeting.players, text, meeting.cue)


_CHECKS: dict[MeetingKind, Callable[[Cast, Meeting, Run, Times], Failure | None]] = {
    "hangs": _hangs,
    "put": _stands,
    "sits": _sits,
}
"""Kind of meeting -> what must hold in its run."""


def _arm(meeting: Meeting, who: str) -> str:
    """The forearm of a player on which something hangs."""
    names = {name for pair in meeting.pairs for name in pair}
    return next(name for name in sorted(names) if name.startswith(f"{who}.forearm_"))


def _poses(run: Run, name: str, t: Times) -> Array:
    """(T, 3, 4) poses of a body or prop of the stage at times of a run."""
    own = run.whole.resample(np.clip(t, 0.0, run.whole.t[-1]))
    marionette = run.staged.marionette
    poses: Array = marionette.poses(own.q_D, own.q_K)
    return poses[:, marionette.link_index(run.staged.local(name))]
