"""The tables of a play's verification: cues, clearances, strings and hands, with their units."""

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
    """Who plays."""
    play = verification.play
    lines = []
    for name, player in play.cast.players.items():
        start, given = player.start, play.cast.file.cast[name]
        at = given.at if isinstance(given.at, str) else ""
        walked = sum(way.length for way in play.ways.get(name, ()))
        lines.append(
            (
                name,
                given.puppet,
                f"{at} ({start.x:.2f}, {start.y:.2f})".strip(),
                f"{np.degrees(start.heading):.0f}",
                f"{_weight(verification, name):.2f}",
                f"{walked:.2f}",
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
    """The cues of an act: when they are to be, when they are seen, what hinders them."""
    play = verification.play
    seen: dict[int, list[tuple[str, ...]]] = {}
    for one in verification.cues:
        seen.setdefault(one.cue.number, []).append(
            (
                one.who,
                f"{one.wanted:.2f}",
                f"{one.seen:.2f}",
                f"{1e3 * one.late:+.0f}",
                "limb" if one.limb else "hands",
            )
        )
    lines, wrong = list[tuple[str, ...]](), set[int]()
    for cue in play.cues:
        if cue.act != act:
            continue
        first = f"{cue.number}", f"{cue.line}", cue.words + (f" ({cue.mark})" if cue.mark else "")
        if cue.refused:
            wrong.add(len(lines))
            lines.append((*first, ", ".join(cue.who), f"{cue.wanted:.2f}", "", "", "", _why(cue)))
        for k, times in enumerate(seen.get(cue.number, [])):
            note = _pause(verification, cue) if k == 0 else ""
            lines.append((*(first if k == 0 else ("", "", "")), *times, note))
    header = ("cue>", "line>", "what", "who", "wanted [s]>", "seen [s]>", "late [ms]>", "by", "")
    return Table(header, tuple(lines), frozenset(wrong))


def _why(cue: CueOfPlay) -> str:
    return f"{'left out' if cue.optional else 'cannot be done'}: {cue.refused}"


def _pause(verification: Verification, cue: CueOfPlay) -> str:
    """What a cue waits for swing to settle, and what that saves."""
    pause, without, with_it = verification.play.settled.get(cue.number, (0.0, 0.0, 0.0))
    if pause <= 0.0:
        return ""
    return (
        f"waits {pause:.2f} s for swing: trunk {1e3 * with_it:.0f} instead of "
        f"{1e3 * without:.0f} mm/s after it"
    )


def clearance_table(verification: Verification) -> Table:
    """The least distance of every two owners: bodies, then strings."""
    play = verification.play
    clear = play.cast.file.stage.clear
    lines, wrong = list[tuple[str, ...]](), set[int]()
    for one in clearances(play.cast, verification.run):
        least = 0.0 if "floor" in one.owners else clear
        if one.distance < least:
            wrong.add(len(lines))
        lines.append(
            (
                " - ".join(one.owners),
                one.what,
                one.other,
                f"{1e3 * one.distance:.1f}",
                f"{1e3 * least:.0f}",
                play.when(one.t),
            )
        )
    header = ("between", "nearest", "", "least [mm]>", "allowed [mm]>", "when")
    return Table(header, tuple(lines), frozenset(wrong))


def string_table(verification: Verification) -> Table:
    """Largest tensions beside the weight, and catches."""
    cast = verification.play.cast
    hardest: dict[str, float] = {}
    for event in verification.run.events:
        if event.kind is EventKind.CATCH:
            hardest[event.name] = max(hardest.get(event.name, 0.0), event.impulse)
    weights = {name: _weight(verification, name) for name in cast.players}
    lines = []
    for name, tension in verification.tension.items():
        weight = weights.get(cast.owner(name), 0.0)
        share = f"{100.0 * tension / weight:.0f}" if weight > 0.0 else ""
        hit = f"{1e3 * hardest[name]:.1f}" if name in hardest else ""
        lines.append((name, f"{tension:.2f}", share, f"{verification.catches[name]}", hit))
    header = (
        "string",
        "largest tension [N]>",
        "of the player's weight [%]>",
        "catches>",
        "hardest catch [mN s]>",
    )
    return Table(header, tuple(lines))


def hand_table(verification: Verification) -> Table:
    """Of every hand the coordinate that is nearest to its bounds."""
    hands: dict[str, list[tuple[float, float, float, float]]] = {}
    for name, peaks in verification.peaks.items():
        hands.setdefault(name.rpartition(".")[0], []).append(peaks)
    lines, wrong = list[tuple[str, ...]](), set[int]()
    for hand, found in hands.items():
        speed = max(found, key=lambda one: one[0] / one[1])
        change = max(found, key=lambda one: one[2] / one[3])
        shares = 100.0 * speed[0] / speed[1], 100.0 * change[2] / change[3]
        if max(shares) > 100.5:
            wrong.add(len(lines))
        lines.append(
            (
                hand,
                f"{speed[0]:.2f}",
                f"{speed[1]:.2f}",
                f"{shares[0]:.0f}",
                f"{change[2]:.2f}",
                f"{change[3]:.2f}",
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
    return Table(header, tuple(lines), frozenset(wrong))


def space_table(verification: Verification) -> Table:
    """How far hands go, and how far they may."""
    space = verification.play.cast.file.stage.space
    lines = []
    for part, (low, high) in zip("xy", verification.space, strict=True):
        bound = None if space is None else getattr(space, part)
        allowed = "anywhere" if bound is None else f"{bound[0]:g} to {bound[1]:g}"
        shown = f"{round(low, 3) + 0.0:.3f} to {round(high, 3) + 0.0:.3f}"  # no -0.000
        lines.append((part, shown, allowed))
    return Table(("", "hands go [m]", "allowed [m]"), tuple(lines))


def _weight(verification: Verification, name: str) -> float:
    """Of a player [N]."""
    alone = verification.play.cast.players[name].alone
    mass = measure(alone.tree, alone.number).mass
    return float(mass * np.linalg.norm(np.asarray(alone.puppet.gravity, dtype=float)))
