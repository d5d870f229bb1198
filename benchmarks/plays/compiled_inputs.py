"""Inputs of scores and first placings of plays, kept in a file or compared with one.

python -m benchmarks.plays.compiled_inputs kept.npz             # writes, or compares where it is
python -m benchmarks.plays.compiled_inputs kept.npz --plays 3 --scores 20
"""

from __future__ import annotations

import argparse
import sys
import tempfile
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
    """A score with lanes, phrases, holds and times by name, as the data of its file."""
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


def of_score(path: Path) -> dict[str, Array]:
    """Arrays and texts of a compiled score; its mistakes where it has some."""
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


def of_play(path: str | Path) -> dict[str, Array]:
    """Arrays and texts of the first placing of a play."""
    play = fan.load_play(path, within=0.0)
    kept: dict[str, Array] = {
        "times": np.array([(cue.start, cue.end, cue.wanted) for cue in play.cues]),
        "refused": np.array([cue.refused for cue in play.cues]),
    }
    for name, motion in play.motions.items():
        kept |= {f"{name} breaks": motion.breaks, f"{name} coef": motion.coef}
    return kept


def compiled(folder: Path, scores: int, plays: int) -> dict[str, Array]:
    """Those of random scores, of random plays and of the bundled plays."""
    kept: dict[str, Array] = {}
    texts = [(f"score {seed}", random_score(seed)) for seed in range(scores)]
    texts += [(f"play {seed}", random_play(seed)) for seed in range(plays)]
    for name, data in texts:
        path = folder / "given.yaml"
        YAML().dump(data, path)
        own = of_score(path) if name.startswith("score") else of_play(path)
        kept |= {f"{name} {key}": value for key, value in own.items()}
        print(name, *(f"{key} {value.shape}" for key, value in own.items()), flush=True)
    for name in play_names():
        kept |= {f"{name} {key}": value for key, value in of_play(name).items()}
        print(name, flush=True)
    return kept


def differences(before: dict[str, Array], after: dict[str, Array]) -> list[str]:
    """What is not the same within the tolerance."""
    faults = [f"{key} is in one only" for key in sorted(before.keys() ^ after.keys())]
    for key in sorted(before.keys() & after.keys()):
        old, new = before[key], after[key]
        if old.shape != new.shape:
            faults.append(f"{key}: {old.shape} and {new.shape}")
        elif old.dtype.kind == "U" or not old.size:
            faults += [f"{key}: {a!r} and {b!r}" for a, b in zip(old, new, strict=True) if a != b]
        elif (far := float(np.max(np.abs(new - old)))) > TOLERANCE:
            faults.append(f"{key}: differs by {far:.3g}")
    return faults


def main() -> int:
    """Writes the file, or prints what differs from it; 1 where something does."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--scores", type=int, default=20)
    parser.add_argument("--plays", type=int, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        after = compiled(Path(folder), given.scores, given.plays)
    if not given.file.exists():
        np.savez(given.file, **after)  # type: ignore[arg-type]
        print(f"{given.file}: {len(after)} arrays")
        return 0
    with np.load(given.file, allow_pickle=False) as saved:
        before = {key: saved[key] for key in saved.files}
    faults = differences(before, after)
    bits = sum(np.array_equal(before[key], after[key]) for key in before if key in after)
    print(*faults, f"{bits} of {len(before)} arrays are the same to the bit", sep="\n")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
