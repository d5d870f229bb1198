"""Leashes of a play: slack strings from a player's hand to the neck of another player.

A string is slack if it is longer than its path; it does not pull then. q_D are dynamic coordinates,
q_K driven ones (ends and lengths of strings). A spot is the list of keys that leads to an entry of
the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fantoccini.base import Array, StateError, did_you_mean
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import BodyMap
from fantoccini.model.puppet import Attachment, String
from fantoccini.motion import State
from fantoccini.theatre.cast.players import Player
from fantoccini.theatre.gestures import BodyParts
from fantoccini.theatre.script import PlayFile, ScriptLog, Spot

_LEATHER = "#8a5a34"
"""Colour of leashes."""
_MIN_SLACK = 0.02
"""Minimum slack of a leash: its length minus the distance between its ends [m]. Ends that
separate at 1 m/s move this much farther apart between samples, which are 0.02 s apart."""
_ROUNDING = 1e-9
"""Rounding error of a length [cm]."""


def read_leashes(
    file: PlayFile, players: Mapping[str, Player], log: ScriptLog
) -> tuple[String, ...]:
    """Leashes as strings of the stage; records unknown players and missing body parts."""
    strings = []
    for name, leash in file.leashes.items():
        attachments = []
        for key, player_name in (("held by", leash.held_by), ("to", leash.to)):
            spot: Spot = ("leashes", name, key)
            if player_name not in players:
                text = f"no player is called {player_name!r}{did_you_mean(player_name, players)}"
                log.mistakes.add(spot, text)
                continue
            try:
                body_map = BodyParts.for_puppet(players[player_name].marionette).body_map
            except StateError as error:
                log.mistakes.add(spot, f"{file.cast[player_name].puppet}: {error}")
                continue
            attachment = _neck(body_map) if key == "to" else _hand(body_map, leash.side)
            if attachment is None:
                part = "head" if key == "to" else f"arm_{leash.side}"
                text = f"{file.cast[player_name].puppet} has no {part}; needed: a player with it"
                log.mistakes.add(spot, text)
                continue
            body, at = attachment
            attachments.append(Attachment(body=f"{player_name}.{body}", at=at))
        if len(attachments) == 2:
            path = (attachments[0], attachments[1])
            strings.append(String(name=name, path=path, length=leash.length, colour=_LEATHER))
    return tuple(strings)


def check_leashes(file: PlayFile, marionette: Marionette, x0: State, log: ScriptLog) -> None:
    """Records leashes that are stretched at the start."""
    for name, lengths in needed_lengths(file, marionette, x0.q_D[None], x0.q_K[None]).items():
        length = file.leashes[name].length
        if lengths[0] > length:
            text = f"found {length:g} m; needed at the start: {rounded_up_to_cm(lengths[0]):.2f} m"
            log.mistakes.add(("leashes", name, "length"), text)


def needed_lengths(
    file: PlayFile, marionette: Marionette, q_D: Array, q_K: Array
) -> dict[str, Array]:
    """Name of each leash -> (T,) minimum length at which it counts as slack [m].

    Args:
        file: play.
        marionette: the stage with all players.
        q_D, q_K: (T, ...) configurations of the stage.
    """
    points = marionette.string_points(q_D, q_K)
    return {
        name: np.linalg.norm(points[name][:, 1] - points[name][:, 0], axis=1) + _MIN_SLACK
        for name in file.leashes
    }


def rounded_up_to_cm(length: float) -> float:
    """The length in whole centimetres, rounded up [m]."""
    return 0.01 * math.ceil(100.0 * length - _ROUNDING)


def _hand(body_map: BodyMap, side: str) -> tuple[str, tuple[float, float, float]] | None:
    """Body of a hand, and the hand's position in that body's frame; None without the arm."""
    arm = body_map.parts.get(f"arm_{side}")
    return None if arm is None else (arm.bodies[-1], arm.end)


def _neck(body_map: BodyMap) -> tuple[str, tuple[float, float, float]] | None:
    """Body of the head, and its joint's position in that body's frame; None without a head."""
    return None if body_map.head is None else (body_map.head.body, (0.0, 0.0, 0.0))
