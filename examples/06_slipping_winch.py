"""Pull a load farther than its strings reach, without and with a slipping winch.

Without it no motion exists: the run stops and names the strings. With it the winch lets out the
missing length and takes it back. Writes out/winch.png.
"""

from pathlib import Path

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

LOAD = """
puppet: load
bodies:
  - name: load
    joint: {{type: translation, axes: [x, z], damping: 0.5}}
    shapes: [{{type: sphere, radius: 0.08, mass: 1.0, colour: "#b03a2e"}}]
strings:
  - {{name: left, path: [{{body: load}}, {{driven: [x], at: [-1, 0, 1]}}], length: 1.2{winch}}}
  - {{name: right, path: [{{body: load}}, {{driven: [x], at: [1, 0, 1]}}], length: 1.2}}
"""
PULL = {"left.x": [(0, -1.0), (2, -2.0), (4, -1.0)]}

stiff = fan.loads(LOAD.format(winch=""))
try:
    fan.simulate(stiff, stiff.rest(), fan.Input.waypoints(stiff, PULL))
except fan.errors.SimulationError as error:
    print(f"without a slipping winch: {error}")
    print(f"  {len(error.trajectory)} samples; cause: {', '.join(error.trajectory.causes)}")

winch = fan.loads(LOAD.format(winch=", max_tension: 30, rewind_speed: 0.3"))
pull = fan.Input.waypoints(winch, PULL)
run = fan.simulate(winch, winch.rest(), pull, t_end=8.0)
print(
    f"with one: it lets out {run.slip['left'].max():.3f} m at {run.tension['left'].max():.1f} N, "
    f"ends with {run.slip['left'][-1]:.3f} m, takes {run.ledger['slip'][-1]:.2f} J"
)
for event in run.events:
    print(f"  {event.t:.3f} s: {event.name} {event.kind}")

run.plot(out / "winch.png")
print("wrote", out / "winch.png")
