"""Identify an arm's masses and the camera's delay from a record of its motion.

An arm is simulated with other parameters than in its file, and filmed with noise, gaps and a delay.
Identification recovers them from the record. Without a force the masses' scale is unknown; the
string's tension determines it. Writes out/record.csv, the report out/record.html, and
out/next.csv, the most informative next motion.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.base.files import write_table
from fantoccini.output import reports

out = Path("out")
out.mkdir(exist_ok=True)

text = fan.puppets.path("arm3d").read_text(encoding="utf-8")
for place, name in (
    ("name: shoulder\n      type: ball\n      damping: 2.0e-4", "shoulder_damping"),
    ("at: [0, 0, -0.3]\n      damping: 2.0e-4", "elbow_damping"),
):
    text = text.replace(place, place[:-6] + f"{{parameter: {name}, value: 2.0e-3}}")
text = text.replace(
    "radius: 0.015, density: 600", "radius: 0.015, density: {parameter: upper_density, value: 600}"
)
text = text.replace(
    "radius: 0.012, density: 600", "radius: 0.012, density: {parameter: lower_density, value: 600}"
)
text = text.replace(
    'density: 600, colour: "#f0c890"',
    'density: {parameter: lower_density, value: 600}, colour: "#f0c890"',
)
arm = fan.loads(text)
truth = {
    "shoulder_damping": 2.5e-3,
    "elbow_damping": 1.6e-3,
    "upper_density": 700.0,
    "lower_density": 560.0,
}
true = arm.with_parameters(truth)

rng, times = np.random.default_rng(3), np.arange(0.0, 15.1, 0.75)
hanging, points = arm.rest(), {}
for q, name in enumerate(arm.coordinates.q_K):
    values = hanging.q_K[q] + 0.08 * rng.uniform(-1, 1, len(times))
    values[[0, -1]] = hanging.q_K[q]
    points[name] = list(zip(times, values, strict=True))
played = fan.Input.waypoints(arm, points)
run = fan.simulate(true, true.rest(played.first_values()), played, 15.0)

t = np.arange(0.1, 14.8, 1 / 60)
seen = run.resample(t - 0.025)  # the camera is 25 ms late
poses = true.poses(seen.q_D, seen.q_K)
links = [link.name for link in true.tree.links]
markers = [
    fan.lab.Marker("sleeve", "upper", (0, 0.015, -0.2)),
    fan.lab.Marker("wrist", "lower", (0.012, 0, -0.2)),
]
columns = {}
for marker in markers:
    pose = poses[:, links.index(marker.body)]
    place = pose[:, :, 3] + pose[:, :, :3] @ np.array(marker.at)
    place += 2e-3 * rng.standard_normal(place.shape)
    place[200:260] = np.nan  # hidden for a second
    columns |= {f"{marker.name}.{axis}": place[:, i] for i, axis in enumerate("xyz")}
tension = seen.tension["hand"] + 0.02 * rng.standard_normal(len(t))
write_table({"time": t} | columns | {"hand.tension": tension}, out / "record.csv")

record = fan.lab.Record(arm, played, t, columns, markers, tuple(truth), find_delay=True)
print("markers:", *fan.identify(record).combinations)
weighed = replace(record, columns=columns | {"hand.tension": tension})
identified = fan.identify(weighed)
reports.identified_report(identified, out / "record.html")
for name in identified.names:
    low, high = identified.interval(name)
    print(f"{name:18s} {low:.5g} to {high:.5g}, truth {truth.get(name, 0.025):.5g}")
best = fan.lab.suggest_motion(weighed, duration=8.0, reach=0.1, draws=1)
print("most informative motion:", best[0].name, f"{best[0].gain:.0f} bits")
best[0].save(out / "next.csv")
