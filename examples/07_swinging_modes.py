"""Find the swing modes of the marionette, and the inputs that excite them.

Lists the modes at rest, then moves the ends of both shoulder strings back and forth by 4 mm at the
frequency of one mode, and compares the growth with linear theory.
Writes out/swing.png.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

puppet = fan.puppets.marionette()
x0 = puppet.rest()
modes = puppet.modes(x0)
print(f"{puppet} hangs on {', '.join(modes.rows)}, with {len(modes.swinging)} swing modes.")
print("Modes that last more than a few periods, and the inputs that excite them:")
for mode in modes.swinging:
    if mode.damping < 0.1:
        moves = max(mode.share, key=mode.share.get)
        hand = max(mode.gain, key=mode.gain.get) if mode.excitable else "nothing"
        text = f"{mode.frequency:.2f} Hz, damping {100 * mode.damping:4.1f} %"
        print(f"  {text}: mostly {moves:<13} by {hand}")

HANDS, SIDE = ("shoulder_left.x", "shoulder_right.x"), 0.004
mode = max((m for m in modes.swinging if m.excitable), key=lambda m: m.share["torso.x"])
period = 1.0 / mode.frequency
t = np.linspace(0.0, 6.0 * period, 361)
start = dict(zip(puppet.coordinates.q_K, x0.q_K, strict=True))
wave = SIDE * np.sin(2.0 * np.pi * t / period) * np.minimum(1.0, t / period)
sway = fan.Input.samples(puppet, t, {hand: start[hand] + wave for hand in HANDS})
run = fan.simulate(puppet, x0, sway, method="timestepping", save_every=5)

x = run.columns()["torso.x"] - x0.q_D[puppet.coordinates.q_D.index("torso.x")]
reach = [np.max(np.abs(x[(run.t >= k * period) & (run.t < (k + 1) * period)])) for k in range(6)]
# A period adds the gain, half of it while the amplitude grows, and damping reduces the sum.
gain = abs(mode.shape["torso.x"]) * sum(mode.gain[hand] for hand in HANDS) * SIDE
predicted = [0.5 * gain]
while len(predicted) < 6:
    predicted.append(gain + predicted[-1] * np.exp(-2.0 * np.pi * mode.damping))
print(f"at {mode.frequency:.3f} Hz the torso sways farther with each period:")
print("  simulated   " + ", ".join(f"{100 * amplitude:4.1f}" for amplitude in reach) + " cm")
print("  predicted   " + ", ".join(f"{100 * amplitude:4.1f}" for amplitude in predicted) + " cm")
run.plot(out / "swing.png")
print("wrote", out / "swing.png")
