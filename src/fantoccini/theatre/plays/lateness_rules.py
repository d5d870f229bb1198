"""Rules that make hands begin earlier, because limbs lag behind them.

A cue is a line of the play, and a mark a named time of its gesture, such as that at which a hand is
up. A spot is the list of keys that leads to an entry of the file. A lane is a list of gestures in
order; the offsets of all lanes add up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import lane_name
from fantoccini.theatre.gestures import PlacedCue, PlayedGesture, Score, measure_lateness
from fantoccini.theatre.plays.placing import IN_TIME
from fantoccini.theatre.plays.rounds import CompileContext, Results, Round, RuleResult
from fantoccini.theatre.script import PlayCue, Spot, is_walk

_GOOD_LATENESS = 0.25 * IN_TIME
"""Lateness below which hands are not moved in time [s]."""
_MAX_TRIES = 4
"""Largest number of times that a cue's hands are moved in time."""
_MAX_LEAD = 0.6
"""Longest time by which hands lead limbs [s]."""


def mark_lateness(context: CompileContext, this_round: Round) -> dict[tuple[Spot, str], float]:
    """Cue and player -> lateness of the limb on the mark in `on` [s]."""
    return {
        (cue.spot, name): lateness_of_cue
        for name, run in this_round.runs.players.items()
        for lateness_of_cue, cue in _limb_lateness(context, name, run, this_round)
    }


def advance_hands(
    results: Results, lateness_by_cue: Mapping[tuple[Spot, str], float]
) -> RuleResult:
    """Makes hands begin earlier whose limbs are late on the marks of their cues."""
    has_changed = False
    for key, seconds in lateness_by_cue.items():
        n_tries = results.hand_tries.get(key, 0)
        if abs(seconds) < _GOOD_LATENESS or n_tries >= _MAX_TRIES:
            continue
        old_lead = results.corrections.leads.get(key, 0.0)
        new_lead = float(np.clip(old_lead + seconds, -_MAX_LEAD, _MAX_LEAD))
        corrections = results.corrections.with_entry("leads", key, new_lead)
        results = replace(
            results, corrections=corrections, hand_tries={**results.hand_tries, key: n_tries + 1}
        )
        has_changed = has_changed or new_lead != old_lead
    return results, has_changed


def refuse_late(
    results: Results, this_round: Round, lateness_by_cue: Mapping[tuple[Spot, str], float]
) -> RuleResult:
    """Refuses cues whose limbs miss their marks, however early the hands begin."""
    before, cue_of = results, {placed.spot: placed for placed in this_round.placement.cues}
    for (spot, name), seconds in lateness_by_cue.items():
        if abs(seconds) > IN_TIME:
            side = "late" if seconds > 0.0 else "early"
            text = f"{name} would be {1e3 * abs(seconds):.0f} ms {side}, whenever its hands begin"
            results = results.with_refusal(cue_of[spot], text) or results
    return results, results is not before


def _limb_lateness(
    context: CompileContext, name: str, run: Trajectory, this_round: Round
) -> list[tuple[float, PlacedCue[PlayCue]]]:
    """Lateness of a player's limbs on the marks in `on` [s], with the cues."""
    cue_of_played: dict[int, PlacedCue[PlayCue]] = {}
    played = []
    for cue in this_round.placement.cues:
        for part in cue.parts if cue.entry.mark and not is_walk(cue.entry) else ():
            if part.who == name:
                lane, name_of_cue = lane_name(part.who, part.lane), cue.cue.name
                played.append(
                    PlayedGesture(lane, name_of_cue, part.start, part.end, part.marks, name_of_cue)
                )
                cue_of_played[id(played[-1])] = cue
    if not cue_of_played:
        return []
    score = Score(
        context.script.cast.players[name].marionette,
        this_round.placement.motions[name],
        tuple(played),
        {},
        (),
        context.beat,
        lanes=this_round.placement.lane_motions[name],
    )
    seconds: dict[Spot, list[float]] = {}
    for limb_lateness in measure_lateness(score, run):
        cue = cue_of_played[id(limb_lateness.cue)]
        if limb_lateness.mark == cue.entry.mark:
            seconds.setdefault(cue.spot, []).append(limb_lateness.seconds)
    result = []
    for cue in cue_of_played.values():
        mean_lateness = float(np.mean(seconds.get(cue.spot, [0.0]))) + _hand_lateness(cue, name)
        # A delay within the cue's patience does not count.
        patience = cue.entry.patience * context.beat
        result.append((mean_lateness - min(max(mean_lateness, 0.0), patience), cue))
    return result


def _hand_lateness(cue: PlacedCue[PlayCue], name: str) -> float:
    """Lateness of a player's hands on the mark in `on` [s]."""
    part = next(part for part in cue.parts if part.who == name)
    return part.marks[cue.entry.mark] - cue.wanted_time
