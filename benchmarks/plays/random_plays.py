"""Random plays: each compiles and is verified, or names its impossible cues.

python -m benchmarks.plays.random_plays --plays 200 [--seed 0] [--players 2]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

import fantoccini as fan

PLAYERS = ("pierrot", "columbine", "harlequin")
MARKS: dict[str, dict[str, Any]] = {
    "centre": {"at": [0.0, 0.0]},
    "front": {"at": [0.5, 0.0], "facing": "audience"},
    "west": {"at": [0.0, 0.6], "facing": "centre"},
    "east": {"at": [0.0, -0.6], "facing": "left"},
    "door": {"at": [-0.6, 0.0]},
    "far": {"at": [1.4, 0.0]},  # outside the hands' space
    "behind": {"at": [-0.5, 0.55], "facing": "audience"},  # the table stands there
}
TABLE = {"name": "table", "type": "box", "size": [0.2, 0.2, 0.25], "at": [-0.5, 0.55, 0.125]}
GESTURES = (
    "bow",
    "breathe",
    "clap",
    "hang",
    "look",
    "march",
    "nod",
    "point",
    "shake",
    "stand",
    "wave",
)
"""Gestures of the players, whose order decides on the plays of a seed."""
WORDS = ("timidly", "boldly", "slowly", "quickly", "smaller", "larger", "mirrored", "twice")


def random_play(seed: int, players: int = 2, cues: int = 8) -> dict[str, Any]:
    """A play, as the data of its file."""
    rng = np.random.default_rng(seed)
    names = PLAYERS[:players]
    starts = rng.permutation(["west", "east", "door"])[:players]
    cast = {name: {"at": str(at)} for name, at in zip(names, starts, strict=True)}
    acts, walked = [], set[str]()
    for act in range(int(rng.integers(1, 3))):
        act_cues = [_cue(rng, names, walked) for _ in range(max(1, cues // 2))]
        acts.append({"act": f"act {act + 1}", "after": float(rng.integers(0, 3)), "cues": act_cues})
    return {
        "play": "trial",
        "tempo": float(rng.choice([60.0, 90.0, 100.0, 120.0])),
        "cast": cast,
        "stage": {
            "space": {"x": [-1.0, 1.0], "y": [-1.0, 1.0]},
            "marks": MARKS,
            "obstacles": [TABLE],
        },
        "times": {"drum": float(rng.integers(4, 12))},
        "acts": acts,
    }


def _cue(rng: np.random.Generator, names: tuple[str, ...], walked: set[str]) -> dict[str, Any]:
    who: Any = str(rng.choice(names))
    if rng.random() < 0.15:
        who = "all"
    cue: dict[str, Any] = {"who": who}
    verb = str(
        rng.choice(
            ["does", "walks to", "turns to", "looks at", "points at"], p=[0.45, 0.25, 0.1, 0.1, 0.1]
        )
    )
    others = [name for name in names if name != who]
    if verb == "does":
        cue["does"] = str(rng.choice(GESTURES))
        if rng.random() < 0.5:
            cue["how"] = [str(word) for word in rng.choice(WORDS, rng.integers(1, 3), False)]
        if cue["does"] == "wave" and rng.random() < 0.5:
            cue["on"] = {"up": float(rng.integers(3, 12))}
    elif verb == "walks to":
        marks = [*MARKS] if rng.random() < 0.3 else ["centre", "front", "west", "east", "door"]
        cue[verb] = str(rng.choice(marks)) if rng.random() < 0.8 else _place(rng, 2)
        if rng.random() < 0.7:
            cue["near"] = "60 cm"
    elif verb == "turns to":
        cue[verb] = str(rng.choice(["audience", "left", "right", "back", *others]))
    else:
        cue[verb] = str(rng.choice([*others, "centre"])) if others else _place(rng, 3)
    if "on" not in cue:
        when = rng.random()
        if when < 0.15:
            cue["when"] = float(rng.integers(0, 16))
            cue["may wait"] = 20.0 if rng.random() < 0.7 else 0.0
        elif when < 0.35 and walked:
            cue["when"] = f"{rng.choice(sorted(walked))} arrives + {rng.integers(0, 3)}"
        elif when < 0.4:
            cue["when"] = "drum"
        if "when" in cue and "may wait" not in cue and rng.random() < 0.7:
            cue["may wait"] = float(rng.integers(1, 10))
    if rng.random() < 0.1:
        cue["optional"] = True
    cue["name"] = f"cue_{rng.integers(1_000_000_000)}"
    if verb in ("walks to", "turns to"):
        walked.update(names if who == "all" else [who])
    return cue


def _place(rng: np.random.Generator, n: int) -> list[float]:
    return [round(float(x), 2) for x in rng.uniform(-0.9, 0.9, n)]


def main() -> int:
    """Prints the result of every play, and the sums; returns 1 if a play fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plays", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--players", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the plays that fail")
    parser.add_argument("--why", action="store_true", help="print impossible cues, and why")
    arguments = parser.parse_args()
    whole = refused = failed = 0
    seconds = []
    for seed in range(arguments.seed, arguments.seed + arguments.plays):
        data = random_play(seed, arguments.players)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "random.yaml"
            YAML().dump(data, path)
            begun = time.perf_counter()
            try:
                play = fan.load_play(path)
                check = fan.theatre.verify_play(play)
            except Exception as error:  # any failure is reported with the play and the seed
                failed += 1
                print(f"{seed:4}: {type(error).__name__}: {error}", flush=True)
                continue
            seconds.append(time.perf_counter() - begun)
            left = [cue for cue in play.cues if cue.refused]
            whole, refused = whole + (not left), refused + bool(left)
            text = f"{play.duration:5.1f} s, {len(play.cues)} cues, {len(left)} refused"
            print(f"{seed:4}: {text}, {play.rounds} rounds, {seconds[-1]:.1f} s", flush=True)
            if arguments.why:
                print("".join(f"      {change}\n" for change in play.changes), end="", flush=True)
            if not check:
                failed += 1
                for fault in check.faults:
                    print(f"      {fault}", flush=True)
                if arguments.keep is not None:
                    arguments.keep.mkdir(exist_ok=True)
                    (arguments.keep / f"{seed}.yaml").write_bytes(path.read_bytes())
    print(
        f"{arguments.plays} plays: {whole} whole, {refused} with impossible cues, {failed} fail; "
        f"{np.median(seconds):.1f} s each (median), {max(seconds):.1f} at most"
    )
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
