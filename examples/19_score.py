"""Play a score with the marionette: gestures on the beats, in lanes that add up.

The knees march in fours while the right hand waves and the left one points; it bows on the last
beat. Changes of the score that were necessary are printed with their lines. Writes out/number.png.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.output import view

NUMBER = """
score: number
tempo: 100
speed: 1.2
acceleration: 12
lanes:
  legs:
    - {gesture: march, at: 2, lasts: 4, repeat: 4}
  arms:
    - {gesture: wave, on: {first: 6}}
    - {gesture: point, on: {points: 14}, mirrored: true}
  body:
    - {gesture: bow, on: {low: 22}}
"""

out = Path("out")
out.mkdir(exist_ok=True)
(out / "number.yaml").write_text(NUMBER, encoding="utf-8")
puppet = fan.puppets.marionette()
x0 = puppet.rest()
score = fan.load_score(puppet, out / "number.yaml")
for change in score.changes:
    print(change)
for cue in score.cues:
    beats = ", ".join(f"{name} on beat {t / score.beat:g}" for name, t in cue.marks.items())
    print(f"{cue.lane}: {cue.gesture} from {cue.start:.2f} to {cue.end:.2f} s ({beats})")
run = fan.simulate(puppet, x0, score.inputs(x0), method="timestepping")
times = [0.0, 6 * score.beat, 14 * score.beat, 22 * score.beat]
view.strip(puppet, run, out / "number.png", times=times)
