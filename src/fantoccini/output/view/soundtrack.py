"""Sounds of a film: ffmpeg's arguments that mix them and lay them under the picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fantoccini.base import sound_input

if TYPE_CHECKING:
    from fantoccini.theatre.gestures import Sound

SPEEDS = (0.25, 4.0)
"""Slowest and fastest film that has sound."""

_RATE = 48000
"""Samples of a film's sound in a second."""
_SLOWEST = 0.5
"""Least factor of ffmpeg's atempo."""


def soundtrack(
    sounds: Sequence[Sound], start: float, seconds: float, speed: float = 1.0
) -> tuple[list[str], list[str]]:
    """ffmpeg's arguments for the sounds of a film whose first input is its pictures.

    They last as long as the film, with silence after them. In films that are slower or faster than
    the motion, they are as well, at their own pitch.

    Args:
        sounds: what is heard when, on the motion's clock.
        start: the motion's time at which the film begins [s].
        seconds: duration of the film [s].
        speed: seconds of motion per second of film, from 0.25 to 4.

    Returns:
        Arguments of the inputs, and those of the output; the output's are ``-an`` without sounds.

    Raises:
        ValueError: the speed is out of range.
        MediaError: an ending that is no sound's.
    """
    end = start + speed * seconds
    heard = [one for one in sounds if one.start + one.duration > start and one.start < end]
    if not heard:
        return [], ["-an"]
    if not SPEEDS[0] <= speed <= SPEEDS[1]:
        raise ValueError(
            f"speed is {speed:g}; a film with sound needs {SPEEDS[0]:g} to {SPEEDS[1]:g}, "
            "or no sounds"
        )
    inputs, chains = list[str](), list[str]()
    for i, sound in enumerate(heard, start=1):
        after = (sound.start - start) / speed
        if after < 0.0:
            inputs += ["-ss", f"{start - sound.start:.6f}"]
        inputs += sound_input(sound.path)
        steps = [
            f"aresample={_RATE}",
            "aformat=channel_layouts=stereo",
            *_tempo(speed),
            f"volume={sound.gain:.6f}",
            f"adelay={1e3 * max(after, 0.0):.3f}:all=1",
            "asetpts=N/SR/TB",  # atempo leaves times before 0
        ]
        chains.append(f"[{i}:a:0]{','.join(steps)}[sound{i}]")
    every = "".join(f"[sound{i}]" for i in range(1, len(heard) + 1))
    chains.append(
        f"{every}amix=inputs={len(heard)}:normalize=0:duration=longest,apad,"
        f"atrim=end={seconds:.6f}[sound]"
    )
    mapped = ["-filter_complex", ";".join(chains), "-map", "0:v:0", "-map", "[sound]"]
    return inputs, [*mapped, "-c:a", "aac", "-b:a", "192k"]


def _tempo(speed: float) -> list[str]:
    """Filters that change the pace and keep the pitch."""
    steps = list[str]()
    while speed < _SLOWEST:
        steps.append(f"atempo={_SLOWEST:g}")
        speed /= _SLOWEST
    return steps if speed == 1.0 else [*steps, f"atempo={speed:.6f}"]
