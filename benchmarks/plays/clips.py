"""Motion capture clips as cues: errors of the limbs in a verified play.

    python -m benchmarks.plays.clips [--after-walk] [CLIP ...]

Bundled clips, and those of :mod:`benchmarks.capture.clips`. A player performs each alone in a
play with the stage's usual bounds, from rest or after a walk and a turn. Errors are root mean
squares in per cent of the puppet's height: of the nearest hanging poses, and the increase by the
play's run.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from benchmarks.capture.clips import write
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.theatre.capture import bundled_clip_path, clip_names
from fantoccini.theatre.retarget import clip_gesture, place_on_spot
from fantoccini.theatre.retarget.deviations import PART_GROUPS
from fantoccini.theatre.retarget.retargeting import part_positions

PLAY = """play: clip
cast:
  pierrot: {at: [0, 0]}
acts:
  - act: one
    cues:
"""
WALK = "      - {who: pierrot, walks to: [0.3, 0.2], facing: left}\n"


def measured_row(path: Path, folder: Path, walks: bool) -> str:
    """A row of the table."""
    (folder / path.name).write_bytes(path.read_bytes())
    cue = f"      - {{who: pierrot, does: {path.name}}}\n"
    (folder / "clip.yaml").write_text(PLAY + (WALK if walks else "") + cue)
    began = time.perf_counter()
    play = fan.load_play(folder / "clip.yaml")
    compiled = time.perf_counter() - began
    cue_of_play = play.cues[-1]
    if cue_of_play.refused:
        return f"| {path.stem} | refused: {cue_of_play.refused} |"
    check = fan.theatre.verify_play(play)
    player, bounds = play.cast.players["pierrot"], play.cast.file.stage
    gesture = clip_gesture(
        place_on_spot(player.marionette, path, start=player.rest_state),
        speed=bounds.speed,
        acceleration=bounds.acceleration,
    )
    run, clip = check.run.resample(cue_of_play.start + gesture.t), gesture.retargeted
    seen = part_positions(clip.figure, player.marionette.poses(run.q_D, run.q_K))
    at, heading = np.array([player.start.x, player.start.y]), player.start.heading
    for way in play.walks["pierrot"]:
        (at,), (heading,) = way.footing(np.array([cue_of_play.start]))
    turn = Rotation.from_euler("z", heading).as_matrix()
    middle = np.array([player.middle.real, player.middle.imag, 0.0])

    def rms(errors: list[np.ndarray]) -> float:
        size = float(np.sqrt(np.mean(np.sum(np.square(errors), axis=-1))))
        return 100.0 * size / clip.figure.height

    cells = []
    for parts in PART_GROUPS.values():
        wanted = {part: clip.targets.parts[part] for part in parts}
        hung = rms([clip.hanging_positions[part] - wanted[part] for part in parts])
        off = rms([seen[part] - (wanted[part] - middle) @ turn.T - [*at, 0.0] for part in parts])
        cells.append(f"{hung:.1f} + {off - hung:.1f}")
    return (
        f"| {path.stem} | {clip.t[-1]:.1f} s | {compiled:.1f} s | {' | '.join(cells)} | "
        f"{len(check.faults)} |"
    )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--after-walk", action="store_true")
    parser.add_argument("clips", nargs="*")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "own").mkdir()
        paths = [bundled_clip_path(name) for name in clip_names()] + write(folder / "own", "lafan1")
        print(f"| clip | length | compiled in | {' | '.join(PART_GROUPS)} | faults |")
        for path in paths:
            if not arguments.clips or path.stem in arguments.clips:
                print(measured_row(path, folder, arguments.after_walk), flush=True)


if __name__ == "__main__":
    main()
