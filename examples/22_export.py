"""Export a motion: the crane carries a load, as an animation for other programs.

Writes out/crane.glb, which any glTF viewer plays, and prints its contents.
"""

import json
import struct
from pathlib import Path

import fantoccini as fan

crane = fan.puppets.crane()
x0 = crane.rest()
carry = fan.Input.waypoints(crane, {"trolley": [(0.0, 0.0), (3.0, 1.5)]})
run = fan.simulate(crane, x0, carry, t_end=6.0)

out = Path("out")
out.mkdir(exist_ok=True)
path = fan.export(run, out / "crane.glb")

data = path.read_bytes()
length = struct.unpack("<I", data[12:16])[0]
content = json.loads(data[20 : 20 + length])
keys = [content["accessors"][s["input"]]["count"] for s in content["animations"][0]["samplers"]]
print(f"{path}: {len(data) / 1e3:.0f} kB for {run.duration:g} s")
print("nodes:", ", ".join(node["name"] for node in content["nodes"]))
print(f"{sum(keys)} keys in {len(keys)} channels; the run has {len(run)} samples")
