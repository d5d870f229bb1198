"""Sound files, read by ffmpeg as a separate process."""

from __future__ import annotations

import subprocess
from pathlib import Path

from fantoccini.base.errors import FantocciniError

SOUND_FORMATS = {".wav": "wav", ".mp3": "mp3", ".ogg": "ogg", ".oga": "ogg", ".flac": "flac"}
"""Ending of a sound file -> name of its format in ffmpeg."""

_SAMPLE_RATE = 1000  # Hz
"""Rate at which the duration of a sound is measured."""
_MAX_DURATION = 4 * 3600  # s
_READING_TIMEOUT = 120.0  # s


class MediaError(FantocciniError):
    """There is no ffmpeg, or it cannot read a file."""


def ffmpeg() -> str:
    """Path of the ffmpeg program.

    Raises:
        MediaError: there is no ffmpeg.
    """
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as reason:
        raise MediaError(f"there is no ffmpeg on this machine: {reason}") from reason


def sound_input(path: Path) -> list[str]:
    """ffmpeg's arguments that open a sound file, only from disk and only in its ending's format.

    Raises:
        MediaError: the ending is not in :data:`SOUND_FORMATS`.
    """
    format_name = SOUND_FORMATS.get(path.suffix.lower())
    if format_name is None:
        raise MediaError(
            f"ends in {path.suffix!r}; a sound file ends in {', '.join(SOUND_FORMATS)}"
        )
    return ["-protocol_whitelist", "file", "-f", format_name, "-i", f"file:{path.absolute()}"]


def sound_duration(path: Path) -> float:
    """Duration of a sound [s], from reading the whole file.

    Raises:
        MediaError: the file cannot be read, has no sound, or is longer than four hours.
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
        str(_MAX_DURATION + 1),
        "-ac",
        "1",
        "-ar",
        str(_SAMPLE_RATE),
        "-f",
        "s16le",
        "pipe:1",
    ]
    try:
        process = subprocess.run(
            command, capture_output=True, timeout=_READING_TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        raise MediaError(f"could not be read within {_READING_TIMEOUT:g} s") from None
    seconds = len(process.stdout) / (2 * _SAMPLE_RATE)
    if process.returncode != 0 or seconds == 0.0:
        lines = process.stderr.decode("utf-8", "replace").strip().splitlines()
        raise MediaError(f"is no sound that can be read: {lines[-1] if lines else 'it is empty'}")
    if seconds > _MAX_DURATION:
        raise MediaError(f"is longer than {_MAX_DURATION / 3600:g} hours")
    return seconds
