"""Gestures computed from numbers and places: walking, pointing and looking.

A member is a puppet of a scene; its name begins the names of its coordinates. In names, K stands
for driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from fantoccini.base import StateError, UnknownNameError
from fantoccini.base.documents import Mistakes
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State, Table
from fantoccini.theatre.gestures.aiming import Aim, AimTarget, looking_gesture, pointing_gesture
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.control_walk import walk_on_control
from fantoccini.theatre.gestures.ends import Ends
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.walking import walk

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

COMPUTED_GESTURES = {"walk": ("steps", "step", "turn"), "point": ("to",), "look": ("to",)}
"""Bundled gesture -> its parameters; if it has a file, it is computed only with parameters."""


@dataclass(frozen=True)
class Parameters:
    """Parameters of :func:`load_gesture`; None if not given."""

    steps: int | None = None
    step: float | None = None
    turn: float | None = None
    to: AimTarget | None = None

    def computes(self, name: str) -> bool:
        """Whether a bundled gesture is computed from them instead of read from a file."""
        return name == "walk" or (name in COMPUTED_GESTURES and self.to is not None)

    def refuse(self, name: str, allowed: tuple[str, ...] = ()) -> None:
        """Raises an InputError for parameters that a gesture does not have."""
        mistakes = Mistakes.of_inputs()
        for field in fields(self):
            if getattr(self, field.name) is not None and field.name not in allowed:
                other_gestures = [
                    gesture
                    for gesture, parameter_names in COMPUTED_GESTURES.items()
                    if field.name in parameter_names
                ]
                text = f"{name} has no {field.name!r}; those with it: {', '.join(other_gestures)}"
                mistakes.add((field.name,), text)
        mistakes.raise_if_any()


def member_prefix(table: CoordinateTable, member: str) -> str:
    """Prefix of the names of a scene's member.

    Raises:
        UnknownNameError: the scene has no such member.
    """
    if not member:
        return ""
    members = dict.fromkeys(name.split(".")[0] for name in table.q_K if name.count(".") > 1)
    if member not in members:
        raise UnknownNameError("member of a scene", member, list(members))
    return f"{member}."


def computed_gesture(
    puppet: Table, name: str, parameters: Parameters, prefix: str, start: State | None
) -> Gesture:
    """Bundled gesture computed from parameters.

    Raises:
        InputError: the parameters have mistakes; all of them are listed.
        StateError: the puppet lacks a part of the body, or an end or length of a string is not
            driven.
    """
    parameters.refuse(name, COMPUTED_GESTURES[name])
    if not isinstance(puppet, Marionette):
        raise TypeError(f"{name} begins where the puppet hangs; it takes a Marionette")
    if puppet.puppet.members and not prefix:
        members = ", ".join(puppet.puppet.members)
        raise StateError(f"{name} needs `of`, a member of the scene: {members}")
    start, mistakes = puppet.rest() if start is None else start, Mistakes.of_inputs()
    body_parts = BodyParts.for_puppet(puppet, prefix.removesuffix("."))
    if name == "walk" and body_parts.on_control:
        return walk_on_control(
            body_parts, mistakes, parameters.steps, parameters.step, parameters.turn
        )
    ends = Ends(body_parts, start)
    if parameters.to is None:
        return walk(ends, mistakes, parameters.steps, parameters.step, parameters.turn)
    aim = Aim(puppet, start, prefix, parameters.to, mistakes)
    return (pointing_gesture if name == "point" else looking_gesture)(ends, aim, mistakes)
