"""Cast of a play: players and props on the stage, read from the play's file."""

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
from fantoccini.theatre.cast.players import Player, placed, values_of
from fantoccini.theatre.cast.props import PlayProp, PropState, read_props
from fantoccini.theatre.cast.starts import Places, start_of
from fantoccini.theatre.gestures import BodyParts
from fantoccini.theatre.script import (
    DIRECTIONS,
    VERBS,
    PlayerFile,
    PlayFile,
    ScriptLog,
    Spot,
    spelled,
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
        whole: scene of all players, props and obstacles.
        x0: state of the scene at the start.
        file: the play's file.
        props: props by name.
        prop_states: prop -> its state at the start of the play.
    """

    players: Mapping[str, Player]
    whole: Marionette
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

    def member(self, name: str) -> str:
        """Prefix of a player's coordinates in the scene."""
        return f"{name}." if len(self.players) > 1 else ""

    def scene_name(self, name: str) -> str:
        """Name in the scene of a name such as ``pierrot.torso``; other names are unchanged."""
        if len(self.players) > 1:
            return name
        (only,) = self.players
        return name.removeprefix(f"{only}.")

    def owner(self, name: str) -> str:
        """Player that owns a body or string of the scene; for other names the name itself."""
        if len(self.players) == 1:
            (only,) = self.players.values()
            tree = only.marionette.tree
            names = {*(link.name for link in tree.links), *(string.name for string in tree.strings)}
            return only.name if name in names else name
        first = name.split(".")[0]
        return first if first in self.players and "." in name else name


def read_cast(file: PlayFile, places: Places, log: ScriptLog) -> Cast:
    """Cast of a play.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    _check_names(file, log)
    log.mistakes.raise_if_any()
    puppets = {name: _puppet(spec, ("cast", name), log) for name, spec in file.cast.items()}
    starts = {
        name: start_of(file, spec, ("cast", name), places, log) for name, spec in file.cast.items()
    }
    for name, mark in file.stage.marks.items():
        places.direction(mark.facing, ("stage", "marks", name, "facing"))
    log.mistakes.raise_if_any()
    compiled: dict[tuple[str, str], tuple[Marionette, State, Pose]] = {}
    players, members = dict[str, Player](), []
    for name, spec in file.cast.items():
        puppet = puppets[name]
        assert puppet is not None
        try:
            key = spec.puppet, repr((spec.lift, sorted(spec.pose.items())))
            if key not in compiled:
                compiled[key] = _in_own_scene(file, puppet, spec)
            marionette, rest_state, pose = compiled[key]
        except (PuppetError, UnknownNameError) as error:
            log.mistakes.add(("cast", name), str(error))
            continue
        except StateError as error:
            text = f"does not hang there with `lift: {spec.lift:g}`: {error}"
            log.mistakes.add(("cast", name), text)
            continue
        fixed_reason = _fixed_reason(marionette)
        if fixed_reason:
            text = (
                f"{spec.puppet} cannot be placed on the stage: {fixed_reason}; needed: a puppet "
                "that hangs free"
            )
            log.mistakes.add(("cast", name, "puppet"), text)
            continue
        x0 = placed(marionette, rest_state, starts[name])
        players[name] = Player(name, marionette, rest_state, x0, starts[name])
        # Only the stage has costumes, so that a file's own scene is compiled once.
        costumed = in_costume(puppet, spec.colours, ("cast", name, "colours"), log)
        members.append(Member(name=name, puppet=costumed, pose=pose))
    log.mistakes.raise_if_any()
    _check_bodies(file, players, log)
    log.mistakes.raise_if_any()
    marionettes = {name: player.marionette for name, player in players.items()}
    props = read_props(file, starts, marionettes, places, log)
    leashes = read_leashes(file, players, log)
    log.mistakes.raise_if_any()
    stage = file.stage
    only = f"{next(iter(players))}." if len(players) == 1 else ""
    bodies = {name: player.bodies for name, player in players.items()}
    rules = contact_rules(allowed_pairs(file, bodies), lambda part: part.removeprefix(only))
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
        whole = Marionette(scene)
    except (PuppetError, FileError) as error:
        for mistake in error.mistakes:
            log.mistakes.add(("stage",), f"{mistake.key}: {mistake.message}")
        log.mistakes.raise_if_any()
    prop_states = {name: prop.start for name, prop in props.items()}
    x0 = all_together(whole, players, prop_states)
    check_leashes(file, whole, x0, log)
    return Cast(players, whole, x0, file, props, prop_states)


def _check_names(file: PlayFile, log: ScriptLog) -> None:
    """Records names that are used twice."""
    taken: dict[str, str] = {
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
        if name in taken:
            log.mistakes.add(spot, f"{name!r} is the name of {taken[name]}; needed: another name")
        taken.setdefault(name, kind)


def _check_bodies(file: PlayFile, players: Mapping[str, Player], log: ScriptLog) -> None:
    """Records cues and props whose players lack the limbs for a seat or the prop."""
    needs: list[tuple[Spot, str, str, tuple[str, ...]]] = [
        (("props", name, "held by"), "hold it", prop.held_by, (f"arm_{prop.side}",))
        for name, prop in file.props.items()
        if prop.held_by is not None
    ]
    for a, act in enumerate(file.acts):
        for c, cue in enumerate(act.cues):
            verb = spelled(cue.verb)
            names = {kind: getattr(cue, key) for key, kind in VERBS[cue.verb].names.items()}
            limbs = _needed_limbs(names)
            others = [names["player"]] if "prop" in names and "player" in names else []
            for who in (*cue.who[:1], *others):
                needs.append((("acts", a, "cues", c, verb), f"do `{verb}`", who, limbs))
    for spot, action, who, limbs in needs:
        if who not in players or not limbs:
            continue
        try:
            parts = BodyParts.of(players[who].marionette).body_map.parts
            missing = [limb for limb in limbs if limb not in parts]
            listed = ", ".join(parts) or "no limbs"
            reason = f"{file.cast[who].puppet} has no {', '.join(missing)}; it has {listed}"
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
    path = log.located.beside(spec.puppet) or bundled(spec.puppet)
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


def _in_own_scene(
    file: PlayFile, puppet: Puppet, spec: PlayerFile
) -> tuple[Marionette, State, Pose]:
    """A player's puppet in its own scene, its lifted rest, and the pose of that rest."""
    as_written = Marionette(_scene_of_one(file, puppet, dict(spec.pose)))
    rest_state = as_written.rest()
    table = as_written.coordinates
    lifted = {
        name: float(rest_state[name] - spec.lift) for name in table.q_K if name.endswith(".length")
    }
    roots = {name: float(rest_state[name] + spec.lift) for name in table.q_D if name.endswith(".z")}
    pose = {**spec.pose, **lifted, **roots}
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


def all_together(
    whole: Marionette, players: Mapping[str, Player], prop_states: Mapping[str, PropState]
) -> State:
    """State of all players and props at the start."""
    x = whole.state()
    q_D, q_K = np.array(x.q_D), np.array(x.q_K)
    for player in players.values():
        prefix = f"{player.name}." if len(players) > 1 else ""
        for name, value in values_of(player.marionette, player.x0).items():
            coordinate = prefix + name
            if coordinate in whole.coordinates.q_D:
                q_D[whole.coordinates.q_D.index(coordinate)] = value
            else:
                q_K[whole.coordinates.q_K.index(coordinate)] = value
    for name, (q, _) in prop_states.items():
        first = whole.coordinates.q_D.index(f"{name}.x")
        q_D[first : first + len(q)] = q
    return dataclasses.replace(x, q_D=q_D, q_K=q_K)
