"""Sound files of scores, with their durations.

A spot is the list of keys that leads to an entry of the file. Mistakes of the file are recorded in
a log.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fantoccini.base import MediaError, sound_duration
from fantoccini.base.documents import Located
from fantoccini.theatre.gestures.score import Sound
from fantoccini.theatre.script import ScriptLog, SoundFile, Spot, Time


def read_sounds(
    entries: Sequence[SoundFile], time_of: Callable[[Time, Spot], float], log: ScriptLog
) -> tuple[Sound, ...]:
    """Sounds of a file.

    Args:
        entries: entries of the file.
        time_of: returns a time of the file, from its keys [s].
        log: collects mistakes.
    """
    return tuple(_sound(entry, i, time_of, log) for i, entry in enumerate(entries))


def spot_of_sound(i: int, located: Located) -> Spot:
    """Keys that lead to sound i of a file, which may give a single sound without a list."""
    return ("sound", i) if isinstance(located.data["sound"], list) else ("sound",)


def _sound(
    entry: SoundFile, i: int, time_of: Callable[[Time, Spot], float], log: ScriptLog
) -> Sound:
    located = log.located
    spot = spot_of_sound(i, located)
    start = time_of(entry.at, (*spot, "at"))
    path = located.file_in_folder(entry.file)
    if path is None:
        text = f"no file of this file's folder is called {entry.file!r}"
        log.mistakes.add((*spot, "file"), text)
        return Sound(located.folder, start, entry.gain, 0.0)
    try:
        duration = sound_duration(path)
    except MediaError as error:
        log.mistakes.add((*spot, "file"), f"{entry.file} {error}")
        duration = 0.0
    return Sound(path, start, entry.gain, duration)
