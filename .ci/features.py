"""The feature of each extra, tried by a command in a clean environment."""

from __future__ import annotations

from collections.abc import Callable

from clean_environment import CheckFailed, CleanEnvironment

TETRAHEDRON_DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 .1 0 0 0 .1 0 0 0 .1</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""

BOB_YAML = """puppet: bob
bodies: [{name: bob, joint: {type: free}, shapes: [{type: mesh, file: bob.dae, density: 500}]}]
strings: [{name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: 1}]
"""

BALL_YAML = """puppet: ball
bodies:
  - {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, density: 500}]}
pose: {ball.z: 0.1}
floor: 0
contact: true
"""

PENDULUM_MJCF = """<mujoco><worldbody><body name="bob"><joint name="swing" axis="0 1 0"/>
<geom type="sphere" size="0.05" pos="0 0 -0.5"/></body></worldbody></mujoco>
"""

PENDULUM_URDF = """<robot name="pendulum"><link name="base"/><link name="bob"><inertial>
<origin xyz="0 0 -0.5"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0"
iyz="0"/></inertial></link><joint name="swing" type="continuous"><parent link="base"/>
<child link="bob"/><axis xyz="0 1 0"/></joint></robot>
"""

PYVISTA_SCRIPT = """
import fantoccini as fan
from fantoccini.output.view import draw
arm = fan.puppets.arm2d()
draw(arm, arm.rest(), "arm.png", renderer="pyvista")
"""

RAY_SCRIPT = """
import fantoccini as fan
def study(case):
    return {"tension": float(case.marionette.rest().t + case["mass"])}
result = fan.sweep(study, {"mass": [1.0, 2.0]}, puppet=fan.puppets.arm2d(), on="ray")
assert result["tension"].tolist() == [1.0, 2.0], result
"""


def dae(environment: CleanEnvironment) -> None:
    """COLLADA meshes"""
    environment.write("bob.dae", TETRAHEDRON_DAE)
    environment.run(f"fantoccini check {environment.write('bob.yaml', BOB_YAML)}")


def mcap(environment: CleanEnvironment) -> None:
    """MCAP animations"""
    environment.run("fantoccini simulate arm2d --duration 0.1 --out arm.mcap")


def mujoco(environment: CleanEnvironment) -> None:
    """MJCF import"""
    environment.run(f"fantoccini import {environment.write('bob.xml', PENDULUM_MJCF)} mjcf.yaml")


def osc(environment: CleanEnvironment) -> None:
    """OSC streaming to an emulated stand"""
    environment.run("fantoccini simulate marionette --duration 0.2 --out rest.npz")
    emulate = "fantoccini stand emulate gantry21 --controller osc --out stand_log.csv"
    stream = "fantoccini stand stream gantry21 rest.npz --controller osc"
    with environment.running(emulate, r"(127\.0\.0\.1:\d+)", exits=True) as address:
        environment.run(f"{stream} --to {address}")
    check_stand_log(environment)


def check_stand_log(environment: CleanEnvironment) -> None:
    """Checks that the emulated stand has logged the positions of its motors."""
    log = environment.working_folder / "stand_log.csv"
    rows = log.read_text(encoding="utf-8").splitlines() if log.exists() else []
    if len(rows) < 3:
        raise CheckFailed(f"the emulated stand logged {len(rows)} lines")
    log.unlink()


def pyvista(environment: CleanEnvironment) -> None:
    """pictures rendered by PyVista"""
    environment.run(f"python {environment.write('picture.py', PYVISTA_SCRIPT)}")


def ray(environment: CleanEnvironment) -> None:
    """Ray sweeps"""
    environment.run(f"python {environment.write('sweep.py', RAY_SCRIPT)}")


def serial(environment: CleanEnvironment) -> None:
    """G-code streaming to an emulated stand"""
    environment.run("fantoccini simulate marionette --duration 0.2 --out rest.npz")
    emulate = "fantoccini stand emulate desktop6 --out stand_log.csv"
    with environment.running(emulate, r"(/dev/\S+)", exits=True) as port:
        environment.run(f"fantoccini stand stream desktop6 rest.npz --port {port}")
    check_stand_log(environment)


def urdf(environment: CleanEnvironment) -> None:
    """URDF import"""
    environment.run(f"fantoccini import {environment.write('bob.urdf', PENDULUM_URDF)} urdf.yaml")


def usd(environment: CleanEnvironment) -> None:
    """OpenUSD animations"""
    environment.run("fantoccini simulate arm2d --duration 0.1 --out arm.usdc")


def compiler(environment: CleanEnvironment) -> None:
    """simulation with no system compiler on PATH"""
    alone = {"PATH": str(environment.bin), "FANTOCCINI_CACHE": str(environment.root / "zig_cache")}
    environment.run("fantoccini simulate arm2d --duration 0.1 --out arm.npz", **alone)
    ball = environment.write("ball.yaml", BALL_YAML)
    environment.run(f"fantoccini simulate {ball} --duration 0.5 --out ball.npz", **alone)


FEATURES: tuple[Callable[[CleanEnvironment], None], ...] = (
    compiler,
    dae,
    mcap,
    mujoco,
    osc,
    pyvista,
    ray,
    serial,
    urdf,
    usd,
)
"""One function for each extra, with the extra's name; it fails if the extra is not installed."""
