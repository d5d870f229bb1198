"""Run the bundled marionette's performance: 25 DOF on seven strings greet, step and bow.

Writes out/greeting.png (poses), out/greeting_plot.png (tensions, modes, energy) and
out/greeting.csv. ``fantoccini demo`` makes a film of the same run.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.output import view
from fantoccini.theatre.perform.demo import GREETING_PICTURE_TIMES, performance

out = Path("out")
out.mkdir(exist_ok=True)

puppet = fan.puppets.marionette()
x0, inputs, duration = performance(puppet)
print(puppet)
run = fan.simulate(puppet, x0, inputs, duration)

print(f"{'string':<16}{'min':>8}{'max':>8}{'slack':>9}  catches")
for name, s in run.summary()["tension"].items():
    print(f"{name:<16}{s['min']:6.2f} N{s['max']:6.2f} N{s['slack']:7.2f} s  {s['catches']}")

# The run has every event; the audience hears the hardest catches.
catches = [event for event in run.events if event.kind == "catch"]
for event in sorted(catches, key=lambda e: e.impulse)[-3:]:
    print(f"{event.t:7.4f} s: {event.name} caught with {1000 * event.impulse:.1f} mN s")
print(f"the energy ledger closes to {np.abs(run.ledger['residual']).max():.0e} J")

run.to_csv(out / "greeting.csv")
view.strip(puppet, run, out / "greeting.png", times=GREETING_PICTURE_TIMES, scale=1.0)
run.plot(out / "greeting_plot.png", scale=1.0)
print("wrote greeting.png, greeting_plot.png and greeting.csv in", out)
