"""A recorded performance as inputs: its hands, its winches and its start."""

from __future__ import annotations

from pathlib import Path

from fantoccini.cli.terminal import number, say
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.motion.archive import RECORDING
from fantoccini.motion.npz import UNREADABLE, about_of, read
from fantoccini.perform import Recording


def take_of(path: Path | None) -> Recording | None:
    """The recording in a file; None where there is none."""
    if path is None or path.suffix.lower() != ".npz":
        return None
    try:
        form = about_of(read(path, only="about"))["format"]
    except UNREADABLE:
        return None
    return Recording.load(path) if form == RECORDING else None


def on_winches(marionette: Marionette, take: Recording, quiet: bool) -> Marionette:
    """The puppet on the winches of a performance, where it has the same strings.

    Args:
        marionette: the puppet of FILE, with the driven coordinates of the recording.
        take: the recording.
        quiet: do not say in what the puppets differ.
    """
    found = [s.name for s in take.marionette.tree.strings]
    if not quiet:
        for line in _differences(marionette, take.marionette):
            say(f"the recording is of another puppet than FILE: {line}")
    if found != [s.name for s in marionette.tree.strings]:
        return marionette
    return marionette.with_winches(take.marionette.winches)


def start_of(marionette: Marionette, take: Recording) -> State | None:
    """The start of a performance; None where the puppet has other dynamic coordinates or rows."""
    x, there = take.start, take.marionette
    if there.coordinates.q_D != marionette.coordinates.q_D:
        return None
    if there.tree.row_names != marionette.tree.row_names:
        return None
    return x if not list(_differences(marionette, there)) else marionette.project(x)


def _differences(here: Marionette, there: Marionette) -> list[str]:
    """In what a puppet differs from the recorded one, in words."""
    table, other = here.coordinates, there.coordinates
    if table.q_D != other.q_D:
        return ["its dynamic coordinates are not those of FILE; it hangs at rest at the start"]
    found = []
    values = [dict(zip(m.tree.parameters, m.p.tolist(), strict=True)) for m in (here, there)]
    found += [
        f"{name} was {number(value)}, and is {number(values[0][name])}"
        for name, value in values[1].items()
        if name in values[0] and values[0][name] != value
    ]
    texts = [[p.to_yaml() for p in m.world.puppets] for m in (here, there)]
    if texts[0] != texts[1]:
        found.append("its text is not FILE's; its hands move FILE's puppet")
    return found
