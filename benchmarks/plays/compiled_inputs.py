"""Inputs of scores and of plays after their first round, stored in a file or compared with it.

python -m benchmarks.plays.compiled_inputs kept.npz             # writes it, or compares
python -m benchmarks.plays.compiled_inputs kept.npz --plays 3 --scores 20
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.plays.random_plays import random_play
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.base import Array, FileError
from fantoccini.theatre.plays import play_names

TOLERANCE = 1e-12
GESTURES = {"nod": "low", "bow": "low", "wave": "up", "sit": "", "march": ""}
"""Gesture -> one of its marks."""


def random_score(seed: int) -> dict[str, Any]:
    """A score with lanes, phrases, holds and named times, as the data of its file."""
    rng = np.random.default_rng(seed)
    lanes: dict[str, list[dict[str, Any]]] = {}
    names: list[str] = []
    for lane in ("body", "arms", "head")[: int(rng.integers(1, 4))]:
        lanes[lane] = []
        for _ in range(int(rng.integers(1, 5))):
            cue, beat = dict[str, Any](), float(rng.integers(0, 30))
            chance = rng.random()
            if chance < 0.15:
                cue["hold"] = float(rng.integers(1, 4))
            elif chance < 0.3:
                cue |= {"phrase": "hello", "repeat": int(rng.integers(1, 3))}
            elif chance < 0.4:
                cue |= {"gesture": "walk", "steps": 4, "turn": float(rng.choice([0.0, 0.5]))}
            else:
                cue["gesture"] = str(rng.choice([*GESTURES]))
                cue |= {"larger": 0.8} if rng.random() < 0.3 else {}
                cue |= {"mirrored": True} if rng.random() < 0.3 else {}
                cue |= {"repeat": 2} if rng.random() < 0.3 else {}
            mark = GESTURES.get(cue.get("gesture", ""), "")
            if mark and rng.random() < 0.4:
                cue["on"] = {mark: "turn" if rng.random() < 0.3 else beat + 4.0}
            elif rng.random() < 0.5:
                by_name = names and rng.random() < 0.5
                cue["at"] = f"{rng.choice(names)}.end + 1" if by_name else beat
            cue["name"] = f"cue_{len(names)}"
            names.append(cue["name"])
            lanes[lane].append(cue)
    hello = [{"gesture": "wave"}, {"hold": 1}, {"gesture": "nod", "at": "wave.end + 2"}]
    return {
        "score": f"random {seed}".replace(" ", "_"),
        "tempo": float(rng.choice([60.0, 100.0, 120.0])),
        "speed": 2.0,
        "acceleration": 20.0,
        "marks": {"turn": 12.0, "later": f"{names[0]}.end + 1"},
        "phrases": {"hello": hello},
        "lanes": lanes,
        "captions": [{"at": f"{names[-1]}.start", "until": "later + 90", "text": "words"}],
    }


def score_data(path: Path) -> dict[str, Array]:
    """Arrays and texts of a compiled score, or its mistakes."""
    try:
        score = fan.load_score(fan.puppets.marionette(), path)
    except FileError as error:
        return {"mistakes": np.array([str(m).partition(":")[2] for m in error.mistakes])}
    cues = [(cue.start, cue.end, *cue.marks.values()) for cue in score.cues]
    return {
        "breaks": score.gesture.breaks,
        "coef": score.gesture.coef,
        "times": np.array([t for times in cues for t in times] + [*score.marks.values()]),
        "captions": np.array([(words.start, words.end) for words in score.captions]),
        "changes": np.array([str(change).partition(":")[2] for change in score.changes]),
    }


def play_data(path: str | Path) -> dict[str, Array]:
    """Arrays and texts of a play after its first round."""
    play = fan.load_play(path, within=0.0)
    arrays: dict[str, Array] = {
        "times": np.array([(cue.start, cue.end, cue.wanted) for cue in play.cues]),
        "refused": np.array([cue.refused for cue in play.cues]),
    }
    for name, motion in play.motions.items():
        arrays |= {f"{name} breaks": motion.breaks, f"{name} coef": motion.coef}
    return arrays


def compile_all(folder: Path, scores: int, plays: int) -> Iterator[tuple[str, dict[str, Array]]]:
    """Names and arrays of random scores, of random plays and of the bundled plays."""
    for seed in range(scores):
        yield f"score {seed}", score_data(write_file(folder, random_score(seed)))
    for seed in range(plays):
        yield f"play {seed}", play_data(write_file(folder, random_play(seed)))
    for name in play_names():
        yield name, play_data(name)


def write_file(folder: Path, data: dict[str, Any]) -> Path:
    """The file of a score or a play."""
    path = folder / "given.yaml"
    YAML().dump(data, path)
    return path


def difference_text(old: Array | None, new: Array | None) -> str:
    """Text on a difference beyond the tolerance; empty if the inputs agree."""
    if old is None or new is None:
        return "is in only one file"
    if old.shape != new.shape:
        return f"{old.shape} and {new.shape}"
    if old.dtype.kind == "U" or not old.size:
        return "; ".join(f"{a!r} and {b!r}" for a, b in zip(old, new, strict=True) if a != b)
    largest = float(np.max(np.abs(new - old)))
    return f"differs by {largest:.3g}" if largest > TOLERANCE else ""


def main() -> int:
    """Writes the file, or prints differences from it; returns 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--scores", type=int, default=20)
    parser.add_argument("--plays", type=int, default=5)
    arguments = parser.parse_args()
    before: dict[str, Array] = {}
    if arguments.file.exists():
        with np.load(arguments.file, allow_pickle=False) as saved:
            before = {key: saved[key] for key in saved.files}
    after, differ = dict[str, Array](), 0
    with tempfile.TemporaryDirectory() as folder:
        for name, arrays in compile_all(Path(folder), arguments.scores, arguments.plays):
            own = {f"{name} {key}": value for key, value in arrays.items()}
            after |= own
            old = {key: x for key, x in before.items() if key.startswith(f"{name} ")}
            faults = {key: difference_text(old.get(key), own.get(key)) for key in old | own}
            wrong = [f"{key}: {fault}" for key, fault in faults.items() if fault]
            same = sum(np.array_equal(old[key], own[key]) for key in old.keys() & own.keys())
            differ += bool(before and wrong)
            print(f"{name}: {len(own)} arrays", end=", " if before else "\n", flush=True)
            if before:
                print(f"{same} the same to the bit", *wrong, sep="\n  ", flush=True)
    if not before:
        np.savez(arguments.file, **after)  # type: ignore[arg-type]
    print(f"{differ} differ" if before else f"{arguments.file}: {len(after)} arrays")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main())
