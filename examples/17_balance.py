"""Balance the marionette by its hands while it is pushed.

A push of 0.1 s sends the torso forward. Hands at rest let it swing;
hands under model predictive control (fan.theatre.Balance) bring it back. In the browser:
`fantoccini show marionette --balance`. Writes out/balance.png, the torso's distance over time.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)
puppet = fan.puppets.marionette()
fig, axes = plt.subplots(figsize=(6, 3), layout="constrained")

for balanced in (False, True):
    live = fan.Performance(puppet, tick=0.01)
    home = puppet.pose(live.state, "torso")[:3, 3]
    law = fan.theatre.Balance(live) if balanced else None
    live.set_hand_law(law)
    live.push("torso", [0.5, 0.2, 0.0])
    t, away, speed = [], [], 0.0
    for k in range(100):
        if k == 5:
            live.push("torso", None)
        x = live.advance(0.02)
        t.append(x.t)
        away.append(1e3 * np.linalg.norm(puppet.pose(x, "torso")[:3, 3] - home))
        if x.t > 1.5:
            speed = max(speed, float(np.linalg.norm(x.v_D)))
    name = "hands that balance" if balanced else "hands at rest"
    axes.plot(t, away, label=name)
    print(f"{name}: {away[-1]:.0f} mm away after {t[-1]:g} s, at most {speed:.2f} rad/s by then")
    if law is not None:
        print(law.summary)

axes.set(xlabel="time [s]", ylabel="torso away [mm]")
axes.legend()
fig.savefig(out / "balance.png", dpi=150)
print("wrote", out / "balance.png")
