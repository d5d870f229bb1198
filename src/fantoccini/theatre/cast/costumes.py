"""Costumes: other colours of a puppet, so that players of one file differ in pictures.

A player is a puppet of a play. A spot is the list of keys that leads to an entry of the file.
Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from fantoccini.base import did_you_mean
from fantoccini.model.puppet import Puppet, Shape, String
from fantoccini.theatre.script import ScriptLog, Spot

T = TypeVar("T", Shape, String)


def in_costume(puppet: Puppet, colours: Mapping[str, str], spot: Spot, log: ScriptLog) -> Puppet:
    """The puppet with other colours; records keys that are neither its colours nor its bodies.

    Args:
        puppet: the puppet.
        colours: colour of the puppet's file, or name of a body -> new colour; that of a body
            applies to all its shapes.
        spot: keys of ``colours`` in the play's file.
        log: collects mistakes.
    """
    if not colours:
        return puppet
    expanded = puppet.expanded()
    shapes = [shape for body in expanded.bodies for shape in body.shapes]
    colours_of_puppet = {
        part.colour for part in (*shapes, *expanded.strings) if part.colour is not None
    }
    body_names = {body.name for body in expanded.bodies}
    for key in colours:
        if key not in colours_of_puppet | body_names:
            allowed = ", ".join(sorted(colours_of_puppet)) or "none"
            text = (
                f"found {key!r}; needed: one of the puppet's colours ({allowed}) or of its bodies"
            )
            log.mistakes.add(
                (*spot, key), text + did_you_mean(key, sorted(colours_of_puppet | body_names))
            )

    def recoloured(part: T, body: str = "") -> T:
        colour = colours.get(body) or colours.get(part.colour or "", part.colour)
        return part.model_copy(update={"colour": colour})

    bodies = tuple(
        body.model_copy(
            update={"shapes": tuple(recoloured(shape, body.name) for shape in body.shapes)}
        )
        for body in expanded.bodies
    )
    strings = tuple(recoloured(string) for string in expanded.strings)
    return expanded.model_copy(update={"bodies": bodies, "strings": strings})
