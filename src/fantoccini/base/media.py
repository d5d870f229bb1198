"""Sound files, read by ffmpeg as a separate process."""

from __future__ import annotations

import subprocess
from pathlib import Path

from fantoccini.base.errors import FantocciniError

SOUNDS = {".wav": "wav", ".mp3": "mp3", ".ogg": "ogg", ".oga": "ogg", ".flac": "flac"}
"""ffmpeg's name of a sound file's format, by ending."""

_RATE = 1000
"""Samples in a second with which a sound is measured."""
_LONGEST = 4 * 3600
"""Of a sound [s]."""
_PATIENCE = 120.0
"""Time that ffmpeg may take to read a sound [s]."""


class MediaError(FantocciniError):
    """There is no ffmpeg, or it cannot read a file."""


def ffmpeg() -> str:
    """The program's file.

    Raises:
        MediaError: there is none.
    """
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as reason:
        raise MediaError(f"there is no ffmpeg on this machine: {reason}") from reason


def sound_input(path: Path) -> list[str]:
    """ffmpeg's arguments that open a sound file: by its ending's format only, and from disk only.

    Raises:
        MediaError: an ending that is no sound's.
    """
    known = SOUNDS.get(path.suffix.lower())
    if known is None:
        raise MediaError(f"ends in {path.suffix!r}; a sound file ends in {', '.join(SOUNDS)}")
    return ["-protocol_whitelist", "file", "-f", known, "-i", f"file:{path.absolute()}"]


def sound_duration(path: Path) -> float:
    """How long a sound is when it is played [s]; all of it is read.

    Raises:
        MediaError: it cannot be read, has no sound, or is longer than four hours.
    """
    command = [
        ffmpeg(),
        "-hide_banner",
        "-nostdin",
        "-loglevel",
        "error",
        *sound_input(path),
        "-map",
        "0:a:0",
        "-t",
        str(_LONGEST + 1),
        "-ac",
        "1",
        "-ar",
        str(_RATE),
        "-f",
        "s16le",
        "pipe:1",
    ]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        raise MediaError(f"could not be read within {_PATIENCE:g} s") from None
    seconds = len(done.stdout) / (2 * _RATE)
    if done.returncode != 0 or seconds == 0.0:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise MediaError(f"is no sound that can be read: {lines[-1] if lines else 'it is empty'}")
    if seconds > _LONGEST:
        raise MediaError(f"is longer than {_LONGEST / 3600:g} hours")
    return seconds
