"""Recorded performances as ``--inputs``: the motion of the hands, the winches and the start.

q_D are the dynamic coordinates, and a winch changes the length of a string.
"""

from __future__ import annotations

from pathlib import Path

from fantoccini.app.cli_support.terminal import format_number, print_message
from fantoccini.base import npz
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import RECORDING_FORMATS, State
from fantoccini.theatre.perform import Recording


def load_recording(path: Path | None) -> Recording | None:
    """Recording in a file; None if the file is not a recording."""
    if path is None or path.suffix.lower() != ".npz":
        return None
    try:
        file_format = npz.about_of(npz.read(path, array_name="about"))["format"]
    except npz.UNREADABLE:
        return None
    return Recording.load(path) if file_format in RECORDING_FORMATS else None


def with_recorded_winches(marionette: Marionette, recording: Recording, quiet: bool) -> Marionette:
    """The puppet with the winches of a recording, if it has the same strings.

    Args:
        marionette: the puppet of FILE; it has the driven coordinates of the recording.
        recording: the performance.
        quiet: whether not to print the differences between the puppets.
    """
    if not quiet:
        for line in _differences(marionette, recording.marionette):
            print_message(f"the puppet of the recording differs from FILE: {line}")
    string_names = [[s.name for s in m.tree.strings] for m in (recording.marionette, marionette)]
    if string_names[0] != string_names[1]:
        return marionette
    return marionette.with_winches(recording.marionette.winches)


def recorded_start(marionette: Marionette, recording: Recording) -> State | None:
    """Start state of a recording; None if the puppet has other dynamic coordinates or strings."""
    x, recorded_marionette = recording.start, recording.marionette
    if recorded_marionette.coordinates.q_D != marionette.coordinates.q_D:
        return None
    if recorded_marionette.tree.row_names != marionette.tree.row_names:
        return None
    return marionette.project(x) if _differences(marionette, recorded_marionette) else x


def _differences(marionette: Marionette, recorded: Marionette) -> list[str]:
    """Differences between a puppet and the recorded one, as clauses."""
    if marionette.coordinates.q_D != recorded.coordinates.q_D:
        return ["FILE has other dynamic coordinates, so it starts at rest"]
    new_values, old_values = (
        dict(zip(m.tree.parameters, m.p.tolist(), strict=True)) for m in (marionette, recorded)
    )
    clauses = [
        f"{name} was {format_number(value)} and is {format_number(new_values[name])} in FILE"
        for name, value in old_values.items()
        if name in new_values and new_values[name] != value
    ]
    texts = [m.puppet.to_yaml() for m in (marionette, recorded)]
    if texts[0] != texts[1]:
        clauses.append("the file has changed since; the recorded hands move the puppet of FILE")
    return clauses
