"""Installs the package as a stranger would, and uses it from an empty folder.

    python .ci/clean_room.py            the wheel without extras, under every Python found
    python .ci/clean_room.py extras     each extra alone makes its own feature work

The test environment hides what the package forgets to declare, because the tests bring libraries of
their own. So the distributions are built and checked, and the wheel goes into fresh environments
outside the checkout, with empty caches. Needs `build` and `twine`.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

VERSIONS = ("3.11", "3.12", "3.13", "3.14")
"""Versions of Python to try; those that this machine lacks are reported."""

EXTRA_OF_MODULE = {
    "collada": "dae",
    "foxglove_schemas_protobuf": "mcap",
    "google": "mcap",
    "mcap_protobuf": "mcap",
    "mujoco": "mujoco",
    "pxr": "usd",
    "pythonosc": "osc",
    "pyvista": "pyvista",
    "ray": "ray",
    "serial": "serial",
    "vtkmodules": "pyvista",
    "yourdfpy": "urdf",
}
"""The only modules that a plain installation may lack, each with the extra that brings it."""

DEVELOPERS_EXTRAS = {"bench", "docs", "test"}
"""Extras for work on the package itself."""

IMPORT_ALL = """
import importlib, pkgutil, fantoccini
def fail(name): raise
for module in pkgutil.walk_packages(fantoccini.__path__, "fantoccini.", fail):
    if module.name.endswith("__main__"):
        continue  # a program, which runs when it is imported
    try:
        importlib.import_module(module.name)
    except ModuleNotFoundError as error:
        print(module.name, error.name)
"""

LIST_COMMANDS = """
import typer
from fantoccini.cli.app import app
def walk(command, words):
    print(*words)
    for name, below in getattr(command, "commands", {}).items():
        walk(below, [*words, name])
walk(typer.main.get_command(app), ["fantoccini"])
"""

COMMANDS = (
    "check marionette arm2d",
    "info marionette",
    "simulate marionette --duration 0.2 --out run.npz --out run.png",
    "plan arm3d_boxes --picture plan.png",
    "play trio --report trio.html",
    "follow jumps marionette --out jumps.npz",
    "stand check gantry21 run.npz",
    "demo",
)
"""Run in this order in one empty folder, from an empty cache."""

TETRAHEDRON = """<?xml version="1.0"?>
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

BOB = """puppet: bob
bodies: [{name: bob, joint: free, shapes: [{type: mesh, file: bob.dae, density: 500}]}]
strings: [{name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: 1}]
"""

MJCF = """<mujoco><worldbody><body name="bob"><joint name="swing" axis="0 1 0"/>
<geom type="sphere" size="0.05" pos="0 0 -0.5"/></body></worldbody></mujoco>
"""

URDF = """<robot name="pendulum"><link name="base"/><link name="bob"><inertial>
<origin xyz="0 0 -0.5"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0"
iyz="0"/></inertial></link><joint name="swing" type="continuous"><parent link="base"/>
<child link="bob"/><axis xyz="0 1 0"/></joint></robot>
"""

SHADED = """
import fantoccini as fan
from fantoccini.view import draw
arm = fan.puppets.arm2d()
draw(arm, arm.rest(), "arm.png", renderer="pyvista")
"""

SWEPT = """
import fantoccini as fan
def study(case):
    return {"tension": float(case.marionette.rest().t + case["mass"])}
result = fan.sweep(study, {"mass": [1.0, 2.0]}, puppet=fan.puppets.arm2d(), on="ray")
assert result["tension"].tolist() == [1.0, 2.0], result
"""


class Failure(Exception):
    """A check that did not hold; the message says which, and what was printed."""


class Room:
    """A fresh virtual environment with an empty folder, home and cache.

    Args:
        parent: folder to make it in.
        python: interpreter of the environment.
        requirement: to install, as `fantoccini[mcap] @ file:///...`.
    """

    def __init__(self, parent: Path, python: str, requirement: str):
        self.place = Path(tempfile.mkdtemp(prefix="room-", dir=parent))
        self.folder = self.place / "empty"
        self.bin = self.place / "env" / "bin"
        for name in ("empty", "home"):
            (self.place / name).mkdir()
        kept = {key: value for key, value in os.environ.items() if not key.startswith("FANTOCCINI")}
        kept.pop("PYTHONPATH", None)
        self.environment = kept | {
            "FANTOCCINI_CACHE": str(self.place / "cache"),
            "HOME": str(self.place / "home"),
            "PATH": f"{self.bin}{os.pathsep}{kept['PATH']}",
        }
        call([python, "-m", "venv", str(self.place / "env")])
        self.install(requirement)

    def install(self, requirement: str) -> None:
        """Installs a requirement."""
        call([str(self.bin / "python"), "-m", "pip", "install", "--quiet",
              "--disable-pip-version-check", requirement])  # fmt: skip

    def write(self, name: str, text: str) -> str:
        """Writes a file into the empty folder, and returns its name."""
        (self.folder / name).write_text(text, encoding="utf-8")
        return name

    def run(self, command: str, **environment: str) -> str:
        """Output of a command.

        Raises:
            Failure: its exit code is not 0, or it printed a traceback.
        """
        words = shlex.split(command)
        words[0] = str(self.bin / words[0])
        return call(words, cwd=self.folder, env=self.environment | environment)

    @contextlib.contextmanager
    def started(self, command: str, until: str) -> Iterator[str]:
        """Runs a command in the background, and ends it as Ctrl-C does.

        Args:
            command: to run.
            until: pattern to wait for in its output; the context is its first group.

        Raises:
            Failure: it ends before it printed that, or badly.
        """
        words = shlex.split(command)
        process = subprocess.Popen(
            [str(self.bin / words[0]), *words[1:]], cwd=self.folder, env=self.environment,
            text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        assert process.stdout is not None
        watchdog = threading.Timer(300.0, process.kill)
        watchdog.start()
        printed: list[str] = []
        try:
            for line in process.stdout:
                printed.append(line)
                if match := re.search(until, line):
                    yield match.group(1)
                    break
            else:
                raise Failure(f"{command} ended:\n{''.join(printed)}")
            # A server that was interrupted before may be past its end.
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            printed.append(process.communicate(timeout=60)[0])
            if process.returncode not in (0, 130) or "Traceback" in printed[-1]:
                raise Failure(f"{command}: exit code {process.returncode}\n{''.join(printed)}")
        finally:
            watchdog.cancel()
            process.kill()


def call(words: list[str], **options: object) -> str:
    """Output of a program; a Failure with the output where it does not end well."""
    done = subprocess.run(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        text=True, timeout=900, check=False, **options,
    )  # fmt: skip
    if done.returncode != 0 or "Traceback (most recent call last)" in done.stdout:
        raise Failure(f"{shlex.join(words)}: exit code {done.returncode}\n{done.stdout}")
    return done.stdout


@contextlib.contextmanager
def step(text: str) -> Iterator[None]:
    """Prints what is checked, and the seconds that it took."""
    print(f"{text} ...", flush=True)
    start = time.monotonic()
    yield
    print(f"    {time.monotonic() - start:.0f} s", flush=True)


def distributions(folder: Path) -> Path:
    """The wheel, built from the source distribution; `twine` has checked both."""
    call([sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT)])
    files = sorted(folder.iterdir())
    call([sys.executable, "-m", "twine", "check", "--strict", *map(str, files)])
    (wheel,) = (file for file in files if file.suffix == ".whl")
    return wheel


def interpreters() -> dict[str, str]:
    """The Pythons of this machine, by version."""
    programs: dict[str, str] = {}
    managed = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in VERSIONS:
        for program in (
            f"python{version}", sys.executable,
            *map(str, managed.glob(f"{version}.*/bin/python{version}")),
        ):  # fmt: skip
            code = "import sys, ensurepip, venv; print('%d.%d' % sys.version_info[:2])"
            with contextlib.suppress(OSError, Failure):
                if call([program, "-c", code]).strip() == version:
                    programs[version] = program
                    break
    return programs


def import_all(room: Room) -> None:
    """Imports every module; only those that an extra brings may be missing."""
    printed = room.run(f"python -c {shlex.quote(IMPORT_ALL)}")
    missing = [line.split() for line in printed.splitlines()]
    undeclared = [
        f"{module} imports {name}, which nothing declares"
        for module, name in missing
        if name.split(".")[0] not in EXTRA_OF_MODULE
    ]
    if undeclared:
        raise Failure("\n".join(undeclared))


def know_all_extras(room: Room) -> None:
    """Each extra that the wheel declares has a feature here."""
    code = (
        "from importlib.metadata import metadata\n"
        "print(*metadata('fantoccini').get_all('Provides-Extra'))"
    )
    declared = set(room.run(f"python -c {shlex.quote(code)}").split())
    untried = declared - DEVELOPERS_EXTRAS - {feature.__name__ for feature in FEATURES}
    if untried:
        raise Failure(f"no feature is tried for the extras {', '.join(sorted(untried))}")


def answer_help(room: Room) -> None:
    """Every command and subcommand answers --help."""
    commands = room.run(f"python -c {shlex.quote(LIST_COMMANDS)}").splitlines()
    for command in commands:
        if "Usage: fantoccini" not in room.run(f"{command} --help"):
            raise Failure(f"{command} --help does not print its usage")
    print(f"    {len(commands)} commands")


def show_and_stop(room: Room) -> None:
    """The page is served until Ctrl-C."""
    with room.started("fantoccini show arm2d --no-browser --port 0", r"(http://\S+)") as address:
        page = urllib.request.urlopen(address, timeout=60).read().decode()
        if "<html" not in page:
            raise Failure(f"{address} serves no page:\n{page[:500]}")


def dae(room: Room) -> None:
    """COLLADA meshes."""
    room.write("bob.dae", TETRAHEDRON)
    room.run(f"fantoccini check {room.write('bob.yaml', BOB)}")


def mcap(room: Room) -> None:
    """Animations for Foxglove."""
    room.run("fantoccini simulate arm2d --duration 0.1 --out arm.mcap")


def mujoco(room: Room) -> None:
    """Models in MJCF."""
    room.run(f"fantoccini import {room.write('bob.xml', MJCF)} from_mjcf.yaml")


def osc(room: Room) -> None:
    """Streams set points to an emulated stand that hears OSC."""
    room.run("fantoccini simulate marionette --duration 0.2 --out still.npz")
    emulated = "fantoccini stand emulate gantry21 --controller osc --out moved.csv"
    with room.started(emulated, r"(127\.0\.0\.1:\d+)") as address:
        room.run(f"fantoccini stand stream gantry21 still.npz --controller osc --to {address}")


def pyvista(room: Room) -> None:
    """Shaded pictures."""
    room.run(f"python {room.write('shaded.py', SHADED)}")


def ray(room: Room) -> None:
    """Sweeps on Ray."""
    room.run(f"python {room.write('swept.py', SWEPT)}")


def serial(room: Room) -> None:
    """Streams G-code to an emulated stand."""
    room.run("fantoccini simulate marionette --duration 0.2 --out still.npz")
    with room.started("fantoccini stand emulate desktop6 --out moved.csv", r"(/dev/\S+)") as port:
        room.run(f"fantoccini stand stream desktop6 still.npz --port {port}")


def urdf(room: Room) -> None:
    """Models in URDF."""
    room.run(f"fantoccini import {room.write('bob.urdf', URDF)} from_urdf.yaml")


def usd(room: Room) -> None:
    """Animations in OpenUSD."""
    room.run("fantoccini simulate arm2d --duration 0.1 --out arm.usdc")


def compiler(room: Room) -> None:
    """A first motion where the path has no C++ compiler."""
    variables = {"PATH": str(room.bin), "FANTOCCINI_CACHE": str(room.place / "zig"), "CXX": ""}
    room.run("fantoccini simulate arm2d --duration 0.1 --out zig.npz", **variables)


FEATURES: tuple[Callable[[Room], None], ...] = (
    compiler, dae, mcap, mujoco, osc, pyvista, ray, serial, urdf, usd,
)  # fmt: skip
"""Each carries the name of its extra, and fails without it."""


def names_its_extra(feature: Callable[[Room], None], room: Room) -> None:
    """Without its extra a feature fails, and the message says what to install."""
    extra = feature.__name__
    try:
        feature(room)
    except Failure as failure:
        if f"pip install 'fantoccini[{extra}]'" in str(failure) and "Traceback" not in str(failure):
            return
        raise Failure(f"the message does not name the extra {extra}:\n{failure}") from None
    raise Failure(f"{feature.__doc__} works without the extra {extra}")


def try_wheel(folder: Path, wheel: Path) -> None:
    """The wheel without extras under the newest and every other Python, then without a compiler."""
    programs = interpreters()
    for version in VERSIONS:
        if version not in programs:
            print(f"Python {version}: not on this machine")
    oldest, *others = programs
    with step(f"Python {oldest}: install the wheel without extras"):
        room = Room(folder, programs[oldest], f"fantoccini @ {wheel.as_uri()}")
    with step("import every module"):
        import_all(room)
        know_all_extras(room)
    with step("ask every command for help"):
        answer_help(room)
    for command in COMMANDS:
        with step(f"fantoccini {command}"):
            room.run(f"fantoccini {command}")
    with step("fantoccini show"):
        show_and_stop(room)
    with step("ask for what needs an extra"):
        for feature in FEATURES:
            names_its_extra(feature, room)
    with step("install the compiler as an extra, and simulate with no other on the path"):
        room.install(f"fantoccini[compiler] @ {wheel.as_uri()}")
        compiler(room)
    for version in others:
        with step(f"Python {version}: install, import every module, simulate"):
            room = Room(folder, programs[version], f"fantoccini @ {wheel.as_uri()}")
            import_all(room)
            room.run("fantoccini simulate arm2d --duration 0.2 --out run.npz --out run.png")


def try_extras(folder: Path, wheel: Path) -> None:
    """Every extra alone, in an environment of its own."""
    for feature in FEATURES:
        extra = feature.__name__
        with step(f"fantoccini[{extra}]: {feature.__doc__}"):
            feature(Room(folder, sys.executable, f"fantoccini[{extra}] @ {wheel.as_uri()}"))


def main() -> None:
    """Command line; the exit code is 1 after the first failure."""
    parser = argparse.ArgumentParser(description="Install and use the package as a stranger would.")
    parser.add_argument("what", nargs="?", choices=("wheel", "extras"), default="wheel")
    what = parser.parse_args().what
    with tempfile.TemporaryDirectory(prefix="clean-room-") as name:
        folder = Path(name).resolve()
        try:
            with step("build and check the distributions"):
                wheel = distributions(folder)
            (try_wheel if what == "wheel" else try_extras)(folder, wheel)
        except (Failure, subprocess.TimeoutExpired) as failure:
            sys.exit(f"clean room: {failure}")


if __name__ == "__main__":
    main()
