"""Sounds of a film: arguments of ffmpeg that mix them and add them to the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fantoccini.base import sound_input

if TYPE_CHECKING:
    from fantoccini.theatre.gestures import Sound

SPEED_RANGE = (0.25, 4.0)
"""Speed range of films with sound."""

_SAMPLE_RATE = 48000
"""Sample rate of a film's sound [Hz]."""
_MIN_TEMPO = 0.5
"""Smallest factor of ffmpeg's atempo filter."""


def soundtrack(
    sounds: Sequence[Sound], start: float, seconds: float, speed: float = 1.0
) -> tuple[list[str], list[str]]:
    """Arguments of ffmpeg for the sounds of a film whose first input is its pictures.

    The sound track lasts as long as the film, padded with silence. In slow and fast films sounds
    keep their pitch.

    Args:
        sounds: sounds, with their starts in the time of the motion.
        start: time of the motion at which the film begins [s].
        seconds: duration of the film [s].
        speed: seconds of motion per second of film, from 0.25 to 4.

    Returns:
        Arguments for the inputs and for the output; without sounds none and ``-an``.

    Raises:
        ValueError: the speed is out of range.
        MediaError: the name of a file does not end like that of a sound file.
    """
    end = start + speed * seconds
    audible = [s for s in sounds if s.start + s.duration > start and s.start < end]
    if not audible:
        return [], ["-an"]
    if not SPEED_RANGE[0] <= speed <= SPEED_RANGE[1]:
        raise ValueError(
            f"speed is {speed:g}; a film with sound needs {SPEED_RANGE[0]:g} to "
            f"{SPEED_RANGE[1]:g}, or no sounds"
        )
    inputs, filter_chains = list[str](), list[str]()
    for i, sound in enumerate(audible, start=1):
        delay = (sound.start - start) / speed
        if delay < 0.0:
            inputs += ["-ss", f"{start - sound.start:.6f}"]
        inputs += sound_input(sound.path)
        steps = [
            f"aresample={_SAMPLE_RATE}",
            "aformat=channel_layouts=stereo",
            *_tempo_filters(speed),
            f"volume={sound.gain:.6f}",
            f"adelay={1e3 * max(delay, 0.0):.3f}:all=1",
            "asetpts=N/SR/TB",  # atempo produces times before 0
        ]
        filter_chains.append(f"[{i}:a:0]{','.join(steps)}[sound{i}]")
    labels = "".join(f"[sound{i}]" for i in range(1, len(audible) + 1))
    filter_chains.append(
        f"{labels}amix=inputs={len(audible)}:normalize=0:duration=longest,apad,"
        f"atrim=end={seconds:.6f}[sound]"
    )
    output_arguments = [
        "-filter_complex",
        ";".join(filter_chains),
        "-map",
        "0:v:0",
        "-map",
        "[sound]",
    ]
    return inputs, [*output_arguments, "-c:a", "aac", "-b:a", "192k"]


def _tempo_filters(speed: float) -> list[str]:
    """Filters that change the tempo and keep the pitch."""
    steps = list[str]()
    while speed < _MIN_TEMPO:
        steps.append(f"atempo={_MIN_TEMPO:g}")
        speed /= _MIN_TEMPO
    return steps if speed == 1.0 else [*steps, f"atempo={speed:.6f}"]
