"""Costumes: other colours of a puppet, so that players of one file differ in pictures."""

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
    whole = puppet.expanded()
    shapes = [shape for body in whole.bodies for shape in body.shapes]
    known = {part.colour for part in (*shapes, *whole.strings) if part.colour is not None}
    names = {body.name for body in whole.bodies}
    for key in colours:
        if key not in known | names:
            listed = ", ".join(sorted(known)) or "none"
            text = f"found {key!r}; needed: one of the puppet's colours ({listed}) or of its bodies"
            log.mistakes.add((*spot, key), text + did_you_mean(key, sorted(known | names)))

    def recoloured(part: T, body: str = "") -> T:
        colour = colours.get(body) or colours.get(part.colour or "", part.colour)
        return part.model_copy(update={"colour": colour})

    bodies = tuple(
        body.model_copy(
            update={"shapes": tuple(recoloured(shape, body.name) for shape in body.shapes)}
        )
        for body in whole.bodies
    )
    strings = tuple(recoloured(string) for string in whole.strings)
    return whole.model_copy(update={"bodies": bodies, "strings": strings})
