"""Half a minute to music: the marionette marches, waves, claps, leaps and bows on the beat.

This program makes the music; the score is 20_number.yaml, with its own gesture, 20_clap.yaml. The
puppet rehearses until its limbs are on the beat in the simulation. Writes out/number.wav,
out/number.mp4 and out/number.png.
"""

import shutil
import wave
from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.output import view

RATE, BEAT, BEATS = 44100, 60.0 / 86.0, 43
CHORDS = ["C", "C", "F", "G", "C", "Am", "F", "G", "F", "G", "C"]  # one per bar
ROOTS = {"C": 48, "F": 53, "G": 55, "Am": 57}  # MIDI numbers
MELODY = (  # beats, MIDI number; bars are separated by commas; 0 is a rest
    "1 72 1 76 2 79, 1 76 .5 74 .5 76 2 72, 1 77 .5 76 .5 77 1 81 1 77, 1 79 1 74 2 71,"
    "1 72 1 76 1 79 1 84, 1 81 .5 79 .5 81 2 76, 1 77 1 76 1 74 1 72, 2 74 1 71 1 67,"
    "1 77 1 81 1 84 1 81, 1 83 .5 81 .5 79 1 77 1 74, 3 72"
)


def tone(number: float, seconds: float, harmonics: tuple[float, ...], decay: float) -> np.ndarray:
    """A plucked tone."""
    t = np.arange(int(RATE * seconds)) / RATE
    f = 440.0 * 2.0 ** ((number - 69) / 12)
    parts = [
        size * np.sin(2 * np.pi * f * k * t) * np.exp(-decay * k**0.7 * t)
        for k, size in enumerate(harmonics, start=1)
    ]
    fade = np.minimum(1.0, t / 0.004) * np.minimum(1.0, (seconds - t) / 0.02)
    return np.sum(parts, axis=0) * fade


def music() -> np.ndarray:
    """The samples of the music (n,)."""
    out = np.zeros(int(RATE * BEATS * BEAT))
    noise = np.random.default_rng(0).normal(size=RATE)

    def put(beat: float, sound: np.ndarray, loud: float) -> None:
        k = int(RATE * beat * BEAT)
        part = out[k : k + len(sound)]
        part += loud * sound[: len(part)]

    t = np.arange(int(0.25 * RATE)) / RATE
    kick = np.sin(2 * np.pi * (50 * t + 8 * (1 - np.exp(-30 * t)))) * np.exp(-14 * t)
    hat = np.diff(noise[: len(t) + 1]) * np.exp(-60 * t)
    snap = noise[: len(t)] * np.exp(-35 * t)
    for bar, (chord, line) in enumerate(zip(CHORDS, MELODY.split(","), strict=True)):
        root, third = ROOTS[chord], 3 if chord.endswith("m") else 4
        beat, numbers = 4.0 * bar, line.split()
        for length, number in zip(numbers[::2], numbers[1::2], strict=True):
            put(beat, tone(int(number), 1.6 * float(length) * BEAT, (1, 0.5, 0.25, 0.1), 2.5), 0.3)
            beat += float(length)
        for k in range(4):
            if bar < len(CHORDS) - 1:
                put(4 * bar + k, kick, 0.5 if k % 2 == 0 else 0.25)
                put(4 * bar + k + 0.5, hat, 0.05)
                put(4 * bar + k, tone(root - 12 + 7 * (k % 4 == 2), 0.5, (1, 0.4), 4.0), 0.3)
            for interval in (0, third, 7) if k % 2 or bar == len(CHORDS) - 1 else ():
                put(4 * bar + k, tone(root + 12 + interval, 0.5, (1, 0.3, 0.1), 5.0), 0.09)
    for beat in (20, 21, 22, 34):
        put(beat, snap, 0.25)
    return 0.8 * out / np.abs(out).max()


out = Path("out")
out.mkdir(exist_ok=True)
shutil.copy(Path(__file__).with_suffix(".yaml"), out / "number.yaml")
shutil.copy(Path(__file__).with_name("20_clap.yaml"), out)
with wave.open(str(out / "number.wav"), "wb") as file:
    file.setnchannels(1)
    file.setsampwidth(2)
    file.setframerate(RATE)
    file.writeframes((32767 * music()).astype("<i2").tobytes())
puppet = fan.puppets.marionette()
score = fan.load_score(puppet, out / "number.yaml")
for change in score.changes:
    print(change)
rehearsal = fan.theatre.rehearse(score, rounds=36)
print(rehearsal)
for cue in score.cues:
    late = [f"{m.mark} {1e3 * m.seconds:.0f} ms" for m in rehearsal.final_lateness if m.cue is cue]
    if late:
        print(f"{cue.gesture} on beat {cue.start / score.beat:.1f}: late at", ", ".join(late))
view.film(
    puppet,
    rehearsal.run,
    out / "number.mp4",
    size=(480, 600),
    fps=25,
    focus="bodies",
    theme="dark",
    captions=score.captions,
    sounds=score.sounds,
)
times = [score.beat * beat for beat in (4, 15, 21, 26, 34, 38)]
view.strip(puppet, rehearsal.run, out / "number.png", times=times, focus="bodies")
