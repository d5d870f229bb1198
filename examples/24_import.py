"""Import a model: a doll in MJCF becomes a puppet, and its limited tendons become strings.

Writes out/doll.xml, the model; out/doll.yaml, the puppet; and out/doll.png, its swing. Prints
the features that were not imported.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.output import view

DOLL = """<mujoco model="doll">
  <default>
    <geom density="400" rgba="0.75 0.5 0.3 1"/>
    <joint damping="0.002" armature="1e-4"/>
  </default>
  <worldbody>
    <site name="hook_l" pos="0 0.1 1.2"/>
    <site name="hook_r" pos="0 -0.1 1.2"/>
    <body name="torso" pos="0 0 0.8">
      <freejoint name="torso"/>
      <geom type="capsule" fromto="0 0 -0.08 0 0 0.08" size="0.05"/>
      <geom type="sphere" size="0.045" pos="0 0 0.165"/>
      <site name="shoulder_l" pos="0 0.06 0.1"/>
      <site name="shoulder_r" pos="0 -0.06 0.1"/>
      <body name="arm_l" pos="0 0.06 0.08">
        <joint name="lift_l" axis="0 1 0" range="-90 90" limited="true"/>
        <joint name="spread_l" axis="1 0 0" range="-10 100" limited="true"/>
        <geom type="capsule" fromto="0 0.01 0 0 0.01 -0.2" size="0.02"/>
      </body>
      <body name="arm_r" pos="0 -0.06 0.08">
        <joint name="lift_r" axis="0 1 0" range="-90 90" limited="true"/>
        <joint name="spread_r" axis="-1 0 0" range="-10 100" limited="true"/>
        <geom type="capsule" fromto="0 -0.01 0 0 -0.01 -0.2" size="0.02"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="left" limited="true" range="0 0.35">
      <site site="shoulder_l"/><site site="hook_l"/></spatial>
    <spatial name="right" limited="true" range="0 0.35">
      <site site="shoulder_r"/><site site="hook_r"/></spatial>
  </tendon>
  <actuator><motor name="shoulder" joint="lift_l"/></actuator>
</mujoco>
"""

out = Path("out")
out.mkdir(exist_ok=True)
(out / "doll.xml").write_text(DOLL)
imported = fan.import_model(out / "doll.xml")
imported.save(out / "doll.yaml", force=True)
for note in imported.report:
    print(note)

doll = fan.load(out / "doll.yaml")
print(doll)
x0 = doll.rest()
strings = zip(doll.tree.strings, doll.forward_dynamics(x0).tension, strict=False)
print("tensions:", ", ".join(f"{string.name} {tension:.2f} N" for string, tension in strings))
hanging = dict(zip(doll.coordinates.q_D, x0.q_D, strict=True))
pushed = doll.state(hanging | {"v:spread_l": 6.0, "v:lift_r": -4.0})
run = fan.simulate(doll, pushed, t_end=2.0)
view.strip(doll, run, out / "doll.png", n=6, times="even", view="front")
