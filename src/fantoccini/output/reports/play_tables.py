"""Tables of a play's verification: cast, cues, clearances, strings and hands, with units.

A cue is a line of the play, and an owner a player, an obstacle or the floor. A catch is a slack
string that becomes taut. A marionette is a puppet with its compiled equations; `marionette.puppet`
is the description in its file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fantoccini.model.tree import measure
from fantoccini.motion import EventKind
from fantoccini.output.html import Table
from fantoccini.theatre.plays import clearances

if TYPE_CHECKING:
    from fantoccini.theatre.plays import CueOfPlay, Verification


def cast_table(verification: Verification) -> Table:
    """Table of the players."""
    play = verification.play
    lines = []
    for name, player in play.cast.players.items():
        start, entry = player.start, play.cast.file.cast[name]
        mark = entry.at if isinstance(entry.at, str) else ""
        distance = sum(way.length for way in play.walks.get(name, ()))
        lines.append(
            (
                name,
                entry.puppet,
                f"{mark} ({start.x:.2f}, {start.y:.2f})".strip(),
                f"{np.degrees(start.heading):.0f}",
                f"{_weight(verification, name):.2f}",
                f"{distance:.2f}",
            )
        )
    header = (
        "player",
        "puppet",
        "starts at (x, y) [m]",
        "facing [deg]>",
        "weight [N]>",
        "walks [m]>",
    )
    return Table(header, tuple(lines))


def cue_table(verification: Verification, act: str) -> Table:
    """Cues of an act: planned and observed times, and reasons for refusal."""
    play = verification.play
    cells_by_cue: dict[int, list[tuple[str, ...]]] = {}
    for observation in verification.cues:
        cells_by_cue.setdefault(observation.cue.number, []).append(
            (
                observation.who,
                f"{observation.wanted:.2f}",
                f"{observation.observed:.2f}",
                f"{1e3 * observation.lateness:+.0f}",
                "limb" if observation.is_limb_time else "hands",
            )
        )
    lines, red_lines = list[tuple[str, ...]](), set[int]()
    for cue in play.cues:
        if cue.act != act:
            continue
        cue_cells = (
            f"{cue.number}",
            f"{cue.line}",
            cue.action + (f" ({cue.mark})" if cue.mark else ""),
        )
        if cue.refused:
            red_lines.add(len(lines))
            lines.append(
                (*cue_cells, ", ".join(cue.who), f"{cue.wanted:.2f}", "", "", "", _reason(cue))
            )
        for k, cells in enumerate(cells_by_cue.get(cue.number, [])):
            notes = (cue.passes, _pause(verification, cue)) if k == 0 else ()
            note = "; ".join(filter(None, notes))
            lines.append((*(cue_cells if k == 0 else ("", "", "")), *cells, note))
    header = (
        "cue>",
        "line>",
        "action",
        "players",
        "planned [s]>",
        "observed [s]>",
        "late [ms]>",
        "observed on",
        "",
    )
    return Table(header, tuple(lines), frozenset(red_lines))


def _reason(cue: CueOfPlay) -> str:
    return f"{'left out' if cue.optional else 'cannot be done'}: {cue.refused}"


def _pause(verification: Verification, cue: CueOfPlay) -> str:
    """Pause before a cue until swing has settled, and its effect on the swing."""
    pause, swing_without, swing_with = verification.play.settling_pauses.get(
        cue.number, (0.0, 0.0, 0.0)
    )
    if pause <= 0.0:
        return ""
    return (
        f"waits {pause:.2f} s for swing to settle: trunk speed afterwards {1e3 * swing_with:.0f} "
        f"instead of {1e3 * swing_without:.0f} mm/s"
    )


def clearance_table(verification: Verification) -> Table:
    """Smallest distance between every two owners: bodies, then strings."""
    play = verification.play
    min_clearance = play.cast.file.stage.clear
    lines, red_lines = list[tuple[str, ...]](), set[int]()
    for pair in clearances(play.cast, verification.run):
        allowed = 0.0 if "floor" in pair.owners else min_clearance
        if pair.distance < allowed:
            red_lines.add(len(lines))
        lines.append(
            (
                " - ".join(pair.owners),
                pair.first,
                pair.second,
                f"{1e3 * pair.distance:.1f}",
                f"{1e3 * allowed:.0f}",
                play.when(pair.t),
            )
        )
    header = ("between", "nearest", "", "smallest [mm]>", "allowed [mm]>", "when")
    return Table(header, tuple(lines), frozenset(red_lines))


def string_table(verification: Verification) -> Table:
    """Largest tensions, also relative to the weight, and catches."""
    cast = verification.play.cast
    largest_impulse: dict[str, float] = {}
    for event in verification.run.events:
        if event.kind is EventKind.CATCH:
            largest_impulse[event.name] = max(largest_impulse.get(event.name, 0.0), event.impulse)
    weights = {name: _weight(verification, name) for name in cast.players}
    lines = []
    for name, tension in verification.tension.items():
        weight = weights.get(cast.owner(name), 0.0)
        share = f"{100.0 * tension / weight:.0f}" if weight > 0.0 else ""
        impulse = f"{1e3 * largest_impulse[name]:.1f}" if name in largest_impulse else ""
        lines.append((name, f"{tension:.2f}", share, f"{verification.catches[name]}", impulse))
    header = (
        "string",
        "largest tension [N]>",
        "of the player's weight [%]>",
        "catches>",
        "largest impulse [mN s]>",
    )
    return Table(header, tuple(lines))


def hand_table(verification: Verification) -> Table:
    """Coordinate of every hand that is nearest to its bounds."""
    peaks_by_hand: dict[str, list[tuple[float, float, float, float]]] = {}
    for name, peaks in verification.peaks.items():
        peaks_by_hand.setdefault(name.rpartition(".")[0], []).append(peaks)
    lines, red_lines = list[tuple[str, ...]](), set[int]()
    for hand, coordinates in peaks_by_hand.items():
        speed = max(coordinates, key=lambda peaks: peaks[0] / peaks[1])
        acceleration = max(coordinates, key=lambda peaks: peaks[2] / peaks[3])
        shares = 100.0 * speed[0] / speed[1], 100.0 * acceleration[2] / acceleration[3]
        if max(shares) > 100.5:
            red_lines.add(len(lines))
        lines.append(
            (
                hand,
                f"{speed[0]:.2f}",
                f"{speed[1]:.2f}",
                f"{shares[0]:.0f}",
                f"{acceleration[2]:.2f}",
                f"{acceleration[3]:.2f}",
                f"{shares[1]:.0f}",
            )
        )
    header = (
        "hand",
        "largest speed [m/s]>",
        "bound>",
        "used [%]>",
        "largest acceleration [m/s^2]>",
        "bound>",
        "used [%]>",
    )
    return Table(header, tuple(lines), frozenset(red_lines))


def space_table(verification: Verification) -> Table:
    """Range of the hands, and the allowed range."""
    space = verification.play.cast.file.stage.space
    lines = []
    for part, (low, high) in zip("xy", verification.space, strict=True):
        bound = None if space is None else getattr(space, part)
        allowed = "anywhere" if bound is None else f"{bound[0]:g} to {bound[1]:g}"
        range_text = f"{round(low, 3) + 0.0:.3f} to {round(high, 3) + 0.0:.3f}"  # no -0.000
        lines.append((part, range_text, allowed))
    return Table(("", "hands reach [m]", "allowed [m]"), tuple(lines))


def _weight(verification: Verification, name: str) -> float:
    """Weight of a player [N]."""
    marionette = verification.play.cast.players[name].marionette
    mass = measure(marionette.tree, marionette.number).mass
    return float(mass * np.linalg.norm(np.asarray(marionette.puppet.gravity, dtype=float)))
