"""Compiles and verifies a play of a minute, then the same with one gesture changed.

python -m benchmarks.plays.minute [--play FILE] [--change "clap, when: 24}" "nod, when: 24}"]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import fantoccini as fan

PLAY = Path(__file__).with_name("minute.yaml")


def main() -> None:
    """Prints durations, lateness and faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--play", type=Path, default=PLAY)
    parser.add_argument(
        "--change", nargs=2, default=["does: shake, how: timidly", "does: nod, how: timidly"]
    )
    arguments = parser.parse_args()
    text = arguments.play.read_text()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / arguments.play.name
        path.write_text(text)
        fan.load_play(path)  # compiles the library of the stage, once
        play = _print_times("from nothing", path)
        if arguments.change[0] not in text:
            raise SystemExit(f"{arguments.play} has no {arguments.change[0]!r}")
        path.write_text(text.replace(*arguments.change, 1))
        again = _print_times("one gesture changed", path, play)
        anew = fan.load_play(path)
        same = (again.score.gesture.coef == anew.score.gesture.coef).all()
        print(f"the changed play is {'' if same else 'not '}the one compiled from nothing")


def _print_times(what: str, path: Path, before: fan.theatre.Play | None = None) -> fan.theatre.Play:
    begun = time.perf_counter()
    play = fan.load_play(path, before=before)
    compiled = time.perf_counter()
    check = fan.theatre.verify_play(play)
    verified = time.perf_counter()
    table = play.marionette.coordinates
    print(
        f"{what}: compiled in {compiled - begun:.1f} s ({play.rounds} rounds), verified in "
        f"{verified - compiled:.1f} s\n  {play!r}\n  {table.n_vD} degrees of freedom, "
        f"{len(play.marionette.tree.strings)} strings, {table.n_vK} driven coordinates\n  cues: "
        f"{len(check.cues)} parts, {sum(cue.is_limb_time for cue in check.cues)} seen by limbs; "
        f"the worst is {1e3 * check.max_lateness:.1f} ms off\n"
        f"  {sum(check.catches.values())} catches; {len(check.faults)} faults"
    )
    for change in play.changes:
        print(f"  {change}")
    for fault in check.faults:
        print(f"  {fault}")
    return play


if __name__ == "__main__":
    main()
