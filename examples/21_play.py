"""Compile a play for three, and measure when its cues are seen.

Prints the time at which every cue is seen, and why one is impossible: Columbine would stand where
the table is. Writes a strip of pictures, out/play.png.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.output import view

PLAY = """
play: by_the_table
tempo: 100
stage:
  obstacles: [{name: table, type: box, size: [0.25, 0.25, 0.22], at: [0.2, 0, 0.11]}]
  marks:
    west: {at: [0, 0.65], facing: table}
    east: {at: [0, -0.65], facing: table}
    front: {at: [0.7, 0.3], facing: audience}
cast:
  pierrot: {at: west}
  columbine: {at: east}
acts:
  - act: By the table
    cues:
      - {who: pierrot, does: wave, on: {second: 5}, says: Good evening!}
      - {who: columbine, walks to: table}
      - {who: pierrot, walks to: front, when: 8}
      - {who: all, does: bow, after: 1}
"""

out = Path("out")
out.mkdir(exist_ok=True)
(out / "play.yaml").write_text(PLAY, encoding="utf-8")
play = fan.load_play(out / "play.yaml", progress=lambda at: print(f"{at.share:4.0%} {at.what}"))
for change in play.changes:
    print(change)
check = fan.theatre.verify_play(play)
for cue in check.cues:
    print(f"{cue.cue.action}: {cue.who} at {cue.observed:.2f} s, {1e3 * cue.lateness:+.0f} ms")
print(play, check, sep="\n")
view.strip(play.marionette, check.run, out / "play.png", times=[0.0, 3.0, 7.0, 10.0])
