"""Play a puppet from Python: move its hands, record, replay and edit the performance.

The control bar of the marionette is moved and tilted like a hand's, then thrown farther than the
puppet can follow. Writes out/performance.npz, out/encore.npz and out/performance.png.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

live = fan.Performance(fan.puppets.marionette_bar())
for handle in live.handles:
    print(f"{handle.name}: a {handle.kind} on a {handle.joint} joint")
home, level = live.place("bar")

live.record()
for turn in (0.25, -0.25, 0.0):  # rolls the bar: one shoulder rises, then the other
    live.move("bar", home + np.array([0.0, 0.3 * turn, 0.02]), [1.0, turn / 2, 0.0, 0.0])
    live.advance(0.6)
live.move("bar", home, level)
live.advance(1.0)
recording = live.stop()
recording.save(out / "performance.npz")
print(f"recorded {recording.duration:g} s, {len(recording)} ticks")

read = fan.theatre.Recording.load(out / "performance.npz")
again = read.replay()
print("replayed to the last bit:", np.array_equal(again.q_D, recording.trajectory.q_D))
event = fan.simulate(read.marionette, read.start, read.inputs)
apart = np.max(np.abs(event.resample(again.t).q_D - again.q_D))
print(f"event-driven simulation of the same hands differs by {apart:.1e}")

encore = recording.trimmed(0.3, 2.4).smoothed(0.15).stretched(1.5)
encore.save(out / "encore.npz")
peaks = [np.max(r.trajectory.tension.values) for r in (recording, encore)]
print(f"largest tension {peaks[0]:.1f} N; trimmed, smoothed and slower {peaks[1]:.1f} N")

figures = fan.Performance(fan.puppets.marionette())
figures.move("hand_left", figures.place("hand_left")[0] + np.array([10.0, 0.0, 0.0]))
figures.advance(3.0)
for name, why in figures.lagging.items():
    print(f"{name}: {why}")
recording.trajectory.plot(out / "performance.png")
print("wrote", out / "performance.npz")
