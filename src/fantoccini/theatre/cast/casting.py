"""Cast of a play: players and props on the stage, read from the play's file.

q_D are the dynamic coordinates of the scene, q_K the driven ones: ends and lengths of strings. A
member of a scene is one of its puppets, and a body map says which bodies are its trunk and limbs. A
spot is the list of keys that leads to an entry of the file. A link is a body on its joint. Mistakes
of the file are recorded in a log.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.base import FileError, PuppetError, StateError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import scene as scenes
from fantoccini.model.puppet import FLOOR, Puppet, bundled
from fantoccini.model.scene import Member, Scene
from fantoccini.motion import State
from fantoccini.theatre.cast.contacts import Pair, allowed_pairs, contact_rules
from fantoccini.theatre.cast.costumes import in_costume
from fantoccini.theatre.cast.leashes import check_leashes, read_leashes
from fantoccini.theatre.cast.players import Player, moved_to_footing, values_by_name
from fantoccini.theatre.cast.props import PlayProp, PropState, read_props
from fantoccini.theatre.cast.starts import Places, start_of
from fantoccini.theatre.gaits import BUNDLED_GAITS, Gait
from fantoccini.theatre.gestures import BodyParts
from fantoccini.theatre.script import (
    DIRECTIONS,
    VERBS,
    PlayerFile,
    PlayFile,
    ScriptLog,
    Spot,
    file_key,
)

Pose = dict[str, Any]
"""Coordinate -> start value."""

_OWN_SCENE = "player"
"""Name of a player's own scene: the same for all, so that equal puppets are compiled once."""


@dataclass(frozen=True, eq=False)
class Cast:
    """Players, and everything on the stage.

    Attributes:
        players: players by name.
        marionette: scene of all players, props and obstacles.
        x0: state of the scene at the start.
        file: the play's file.
        props: props by name.
        prop_states: prop -> its state at the start of the play.
    """

    players: Mapping[str, Player]
    marionette: Marionette
    x0: State
    file: PlayFile
    props: Mapping[str, PlayProp] = field(default_factory=dict)
    prop_states: Mapping[str, PropState] = field(default_factory=dict)

    @cached_property
    def allowed_pairs(self) -> frozenset[Pair]:
        """Pairs that may touch at some time of the play."""
        return allowed_pairs(
            self.file, {who: player.bodies for who, player in self.players.items()}
        )

    def prefix(self, name: str) -> str:
        """Prefix of a player's coordinates in the scene."""
        return f"{name}." if len(self.players) > 1 else ""

    def scene_name(self, name: str) -> str:
        """Name in the scene of a name such as ``pierrot.torso``; other names are unchanged."""
        if len(self.players) > 1:
            return name
        (player_name,) = self.players
        return name.removeprefix(f"{player_name}.")

    def owner(self, name: str) -> str:
        """Player that owns a body or string of the scene; for other names the name itself."""
        if len(self.players) == 1:
            (player,) = self.players.values()
            tree = player.marionette.tree
            names = {*(link.name for link in tree.links), *(string.name for string in tree.strings)}
            return player.name if name in names else name
        prefix = name.split(".")[0]
        return prefix if prefix in self.players and "." in name else name


def read_cast(file: PlayFile, places: Places, log: ScriptLog) -> Cast:
    """Cast of a play.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    _check_names(file, log)
    log.mistakes.raise_if_any()
    puppets = {name: _puppet(spec, ("cast", name), log) for name, spec in file.cast.items()}
    start_footings = {
        name: start_of(file, spec, ("cast", name), places, log) for name, spec in file.cast.items()
    }
    for name, mark in file.stage.marks.items():
        places.direction(mark.facing, ("stage", "marks", name, "facing"))
    log.mistakes.raise_if_any()
    by_file_and_pose: dict[tuple[str, str], tuple[Marionette, State, Pose]] = {}
    players, members = dict[str, Player](), []
    for name, spec in file.cast.items():
        puppet = puppets[name]
        assert puppet is not None
        try:
            key = spec.puppet, repr((spec.lift, sorted(spec.pose.items())))
            if key not in by_file_and_pose:
                by_file_and_pose[key] = _in_own_scene(file, puppet, spec)
            marionette, rest_state, pose = by_file_and_pose[key]
        except (PuppetError, UnknownNameError) as error:
            log.mistakes.add(("cast", name), str(error))
            continue
        except StateError as error:
            text = f"does not hang there with `lift: {spec.lift:g}`: {error}"
            log.mistakes.add(("cast", name), text)
            continue
        reason = _fixed_reason(marionette)
        if reason:
            text = (
                f"{spec.puppet} cannot be placed on the stage: {reason}; needed: a puppet "
                "that hangs free"
            )
            log.mistakes.add(("cast", name, "puppet"), text)
            continue
        x0 = moved_to_footing(marionette, rest_state, start_footings[name])
        gait = _gait(spec, ("cast", name, "walks"), log)
        players[name] = Player(name, marionette, rest_state, x0, start_footings[name], gait)
        # Only the stage has costumes, so that a file's own scene is compiled once.
        costumed = in_costume(puppet, spec.colours, ("cast", name, "colours"), log)
        members.append(Member(name=name, puppet=costumed, pose=pose))
    log.mistakes.raise_if_any()
    _check_bodies(file, players, log)
    log.mistakes.raise_if_any()
    marionettes = {name: player.marionette for name, player in players.items()}
    props = read_props(file, start_footings, marionettes, places, log)
    leashes = read_leashes(file, players, log)
    log.mistakes.raise_if_any()
    stage = file.stage
    removed_prefix = f"{next(iter(players))}." if len(players) == 1 else ""
    contact_bodies = {name: player.bodies for name, player in players.items()}
    rules = contact_rules(
        allowed_pairs(file, contact_bodies), lambda part: part.removeprefix(removed_prefix)
    )
    try:
        scene = Scene(
            scene=file.play,
            floor=stage.floor,
            puppets=tuple(members),
            obstacles=stage.obstacles,
            strings=leashes,
            props=tuple(prop.prop for prop in props.values()),
            contact=rules if rules.pairs else None,
        )
        stage_marionette = Marionette(scene)
    except (PuppetError, FileError) as error:
        for mistake in error.mistakes:
            log.mistakes.add(("stage",), f"{mistake.key}: {mistake.message}")
        log.mistakes.raise_if_any()
    prop_states = {name: prop.start for name, prop in props.items()}
    x0 = combined_start_state(stage_marionette, players, prop_states)
    check_leashes(file, stage_marionette, x0, log)
    return Cast(players, stage_marionette, x0, file, props, prop_states)


def _check_names(file: PlayFile, log: ScriptLog) -> None:
    """Records names that are used twice."""
    used_names: dict[str, str] = {
        **dict.fromkeys(DIRECTIONS, "a direction"),
        "all": "all players",
        FLOOR: "the floor",
    }
    stage = file.stage
    entries: list[tuple[Spot, str, str]] = [
        *((("cast", name), name, "a player") for name in file.cast),
        *((("stage", "marks", name), name, "a mark") for name in stage.marks),
        *((("props", name), name, "a prop") for name in file.props),
        *((("leashes", name), name, "a leash") for name in file.leashes),
        *(
            (("stage", "obstacles", i), obstacle.name, "an obstacle")
            for i, obstacle in enumerate(stage.obstacles)
        ),
    ]
    for spot, name, kind in entries:
        if name in used_names:
            log.mistakes.add(
                spot, f"{name!r} is the name of {used_names[name]}; needed: another name"
            )
        used_names.setdefault(name, kind)


def _check_bodies(file: PlayFile, players: Mapping[str, Player], log: ScriptLog) -> None:
    """Records cues and props whose players lack the limbs for a seat or the prop."""
    requirements: list[tuple[Spot, str, str, tuple[str, ...]]] = [
        (("props", name, "held by"), "hold it", prop.held_by, (f"arm_{prop.side}",))
        for name, prop in file.props.items()
        if prop.held_by is not None
    ]
    for act_index, act in enumerate(file.acts):
        for cue_index, cue in enumerate(act.cues):
            verb = file_key(cue.verb)
            names_by_kind = {
                kind: getattr(cue, key) for key, kind in VERBS[cue.verb].name_kinds.items()
            }
            limbs = _needed_limbs(names_by_kind)
            receivers = (
                [names_by_kind["player"]]
                if "prop" in names_by_kind and "player" in names_by_kind
                else []
            )
            for who in (*cue.who[:1], *receivers):
                requirements.append(
                    (("acts", act_index, "cues", cue_index, verb), f"do `{verb}`", who, limbs)
                )
    for spot, action, who, limbs in requirements:
        if who not in players or not limbs:
            continue
        try:
            parts = BodyParts.for_puppet(players[who].marionette).body_map.parts
            missing = [limb for limb in limbs if limb not in parts]
            available = ", ".join(parts) or "no limbs"
            reason = f"{file.cast[who].puppet} has no {', '.join(missing)}; it has {available}"
        except StateError as error:
            missing, reason = list(limbs), f"{file.cast[who].puppet}: {error}"
        if missing:
            log.mistakes.add(spot, f"{who} cannot {action}: {reason}")


def _needed_limbs(names: Mapping[str, str]) -> tuple[str, ...]:
    """Limbs that a player needs for a cue with these kinds of names."""
    if "seat" in names:
        return ("leg_left", "leg_right", "arm_left", "arm_right")
    return ("arm_left", "arm_right") if "prop" in names else ()


def _puppet(spec: PlayerFile, spot: Spot, log: ScriptLog) -> Puppet | None:
    """Puppet of a player; None after a mistake."""
    path = log.located.file_in_folder(spec.puppet) or bundled(spec.puppet)
    if path is None:
        text = f"no file beside this one, and no bundled puppet, is called {spec.puppet!r}"
        log.mistakes.add((*spot, "puppet"), text)
        return None
    try:
        puppet = scenes.load(path)
    except PuppetError as error:
        for mistake in error.mistakes:
            log.mistakes.add((*spot, "puppet"), str(mistake))
        return None
    if len(puppet.members) > 1 or puppet.props:
        log.mistakes.add((*spot, "puppet"), f"{spec.puppet} is a scene; needed: one puppet")
        return None
    return puppet


def _gait(spec: PlayerFile, spot: Spot, log: ScriptLog) -> Gait | None:
    """Gait of a player that walks on the floor; None for others, and after a mistake."""
    if spec.walks == "above the floor":
        return None
    is_bundled = log.located.file_in_folder(spec.puppet) is None
    if not is_bundled or spec.puppet not in BUNDLED_GAITS:
        text = (
            f"no gait on the floor is known for {spec.puppet}; needed: `above the floor`, or one "
        )
        log.mistakes.add(spot, text + f"of the bundled puppets {', '.join(BUNDLED_GAITS)}")
        return None
    return BUNDLED_GAITS[spec.puppet]


def _in_own_scene(
    file: PlayFile, puppet: Puppet, spec: PlayerFile
) -> tuple[Marionette, State, Pose]:
    """A player's puppet in its own scene, its lifted rest, and the pose of that rest."""
    unlifted = Marionette(_scene_of_one(file, puppet, dict(spec.pose)))
    rest_state = unlifted.rest()
    table = unlifted.coordinates
    lengths = {
        name: float(rest_state[name] - spec.lift) for name in table.q_K if name.endswith(".length")
    }
    heights = {
        name: float(rest_state[name] + spec.lift) for name in table.q_D if name.endswith(".z")
    }
    pose = {**spec.pose, **lengths, **heights}
    marionette = Marionette(_scene_of_one(file, puppet, pose))
    return marionette, marionette.rest(), pose


def _scene_of_one(file: PlayFile, puppet: Puppet, pose: Pose) -> Scene:
    """Scene of a single puppet."""
    member = Member(name=_OWN_SCENE, puppet=puppet, pose=pose)
    return Scene(scene=_OWN_SCENE, floor=file.stage.floor, puppets=(member,))


def _fixed_reason(marionette: Marionette) -> str:
    """Reason why a puppet is tied to the place in its file; "" if there is none."""
    table, tree = marionette.coordinates, marionette.tree
    moves = {*table.q_D, *table.q_K}
    for link in tree.links:
        name = link.name.removesuffix(".end")  # of a string
        if link.parent < 0 and not {f"{name}.x", f"{name}.y"} <= moves:
            return f"{name} does not move along x and y"
    for string in tree.strings:
        if any(point.link < 0 for point in string.points):
            return f"the string {string.name} ends at a fixed place"
    return ""


def combined_start_state(
    marionette: Marionette, players: Mapping[str, Player], prop_states: Mapping[str, PropState]
) -> State:
    """State of all players and props at the start."""
    x = marionette.state()
    q_D, q_K = np.array(x.q_D), np.array(x.q_K)
    for player in players.values():
        prefix = f"{player.name}." if len(players) > 1 else ""
        for name, value in values_by_name(player.marionette, player.x0).items():
            coordinate = prefix + name
            if coordinate in marionette.coordinates.q_D:
                q_D[marionette.coordinates.q_D.index(coordinate)] = value
            else:
                q_K[marionette.coordinates.q_K.index(coordinate)] = value
    for name, (q, _) in prop_states.items():
        index = marionette.coordinates.q_D.index(f"{name}.x")
        q_D[index : index + len(q)] = q
    return dataclasses.replace(x, q_D=q_D, q_K=q_K)
