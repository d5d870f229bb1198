"""Clean-install test: builds the wheel, installs it in fresh environments and runs it.

    python .ci/clean_room.py            the wheel without extras, on every Python version found
    python .ci/clean_room.py extras     each extra, installed alone, enables its feature

The test environment hides undeclared dependencies, because the tests install more libraries. This
script builds and checks the distributions, then installs the wheel outside the checkout, with an
empty cache. It needs `build` and `twine`.
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
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

VERSIONS = ("3.11", "3.12", "3.13", "3.14")
"""Python versions to test; missing ones are reported and skipped."""

OPTIONAL_MODULES = {
    "collada",
    "foxglove_schemas_protobuf",
    "google",
    "mcap_protobuf",
    "mujoco",
    "pxr",
    "pythonosc",
    "pyvista",
    "ray",
    "serial",
    "vtkmodules",
    "yourdfpy",
}
"""Modules that extras install; a plain installation may lack only these."""

DEVELOPMENT_EXTRAS = {"bench", "docs", "test"}
"""Extras for developing the package; they enable no user feature."""

IMPORT_ALL = """
import importlib, pkgutil, fantoccini
# A package is imported below before it is walked: errors are reported there.
for module in pkgutil.walk_packages(fantoccini.__path__, "fantoccini.", lambda name: None):
    if module.name.endswith("__main__"):
        continue  # importing it would run the program
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
    for name, subcommand in getattr(command, "commands", {}).items():
        walk(subcommand, [*words, name])
walk(typer.main.get_command(app), ["fantoccini"])
"""

LIST_EXTRAS = """
from importlib.metadata import metadata
print(*metadata("fantoccini").get_all("Provides-Extra"))
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
"""Commands to run in this order; later ones read the files of earlier ones."""

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
from fantoccini.view import draw
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


class CheckFailed(Exception):
    """A failed check; the message holds the command and its output."""


class CleanEnvironment:
    """A fresh virtual environment, with an empty working folder, home and cache.

    Args:
        parent: folder to create it in.
        python: interpreter of the environment.
        requirement: package to install, for example `fantoccini[mcap] @ file:///...`.
    """

    def __init__(self, parent: Path, python: str, requirement: str):
        self.root = Path(tempfile.mkdtemp(prefix="clean-", dir=parent))
        self.working_folder = self.root / "empty"
        self.bin = self.root / "env" / "bin"
        for name in ("empty", "home"):
            (self.root / name).mkdir()
        inherited = {k: v for k, v in os.environ.items() if not k.startswith("FANTOCCINI")}
        for name in ("PYTHONPATH", "PYTHONHOME", "CXX", "XDG_CACHE_HOME", "MPLCONFIGDIR"):
            inherited.pop(name, None)
        self.variables = inherited | {
            "FANTOCCINI_CACHE": str(self.root / "cache"),
            "HOME": str(self.root / "home"),
            "PATH": f"{self.bin}{os.pathsep}{inherited['PATH']}",
        }
        # pip keeps the user's home: it holds pip's settings and downloads.
        self.pip_variables = inherited
        run_program([python, "-m", "venv", str(self.root / "env")], env=inherited)
        self.install(requirement)

    def install(self, requirement: str) -> None:
        """Installs a requirement."""
        pip = [str(self.bin / "python"), "-m", "pip", "install", "--quiet"]
        run_program([*pip, "--disable-pip-version-check", requirement], env=self.pip_variables)

    def write(self, name: str, text: str) -> str:
        """Writes a file into the working folder, and returns its name."""
        (self.working_folder / name).write_text(text, encoding="utf-8")
        return name

    def run(self, command: str, **variables: str) -> str:
        """Runs a command and returns its output.

        Raises:
            CheckFailed: the exit code is not 0, or the output contains a traceback.
        """
        program, *arguments = shlex.split(command)
        words = [str(self.bin / program), *arguments]
        return run_program(words, cwd=self.working_folder, env=self.variables | variables)

    @contextlib.contextmanager
    def running(
        self, command: str, ready_pattern: str, exits: bool = False
    ) -> Iterator[str]:
        """Runs a command in the background, and interrupts it (SIGINT) on exit.

        Args:
            command: command to run.
            ready_pattern: regular expression to wait for in its output; yields its first group.
            exits: whether to give it time to exit by itself.

        Raises:
            CheckFailed: the command exits before the pattern matches, or exits with an error.
        """
        program, *arguments = shlex.split(command)
        process = subprocess.Popen(
            [str(self.bin / program), *arguments], cwd=self.working_folder, env=self.variables,
            text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
            preexec_fn=accept_interrupts,
        )  # fmt: skip
        assert process.stdout is not None
        watchdog = threading.Timer(300.0, process.kill)
        watchdog.start()
        output: list[str] = []
        try:
            for line in process.stdout:
                output.append(line)
                if match := re.search(ready_pattern, line):
                    break
            else:
                raise CheckFailed(f"{command} exited before it was ready:\n{''.join(output)}")
            yield match.group(1)
            # Emulators exit by themselves at the end of a stream.
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=20 if exits else 0)
            process.send_signal(signal.SIGINT)
            output.append(process.stdout.read())
            process.wait(timeout=60)
            text = "".join(output)
            if process.returncode not in (0, 130) or "Traceback" in text:
                raise CheckFailed(f"{command}: exit code {process.returncode}\n{text}")
        finally:
            watchdog.cancel()
            process.kill()


def accept_interrupts() -> None:
    """Restores SIGINT, which background jobs of a script ignore and pass on to their children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def run_program(words: list[str], **options: object) -> str:
    """Runs a program and returns its stdout; raises CheckFailed if it fails."""
    completed = subprocess.run(
        words, capture_output=True, stdin=subprocess.DEVNULL, text=True, timeout=900, check=False,
        **options,
    )  # fmt: skip
    output = completed.stdout + completed.stderr
    if completed.returncode != 0 or "Traceback (most recent call last)" in output:
        raise CheckFailed(f"{shlex.join(words)}: exit code {completed.returncode}\n{output}")
    return completed.stdout


@contextlib.contextmanager
def timed_check(name: str) -> Iterator[None]:
    """Prints the name of a check, and its duration [s]."""
    print(f"{name} ...", flush=True)
    start = time.monotonic()
    yield
    print(f"    {time.monotonic() - start:.0f} s", flush=True)


def build_wheel(folder: Path) -> Path:
    """Builds the source distribution and from it the wheel, checks both with twine.

    Returns:
        The wheel.
    """
    run_program([sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT)])
    files = sorted(folder.iterdir())
    run_program([sys.executable, "-m", "twine", "check", "--strict", *map(str, files)])
    (wheel,) = (file for file in files if file.suffix == ".whl")
    return wheel


def interpreters() -> dict[str, str]:
    """Python interpreters found on this machine, by version."""
    by_version: dict[str, str] = {}
    pyenv_versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in VERSIONS:
        for program in (
            f"python{version}", sys.executable,
            *map(str, pyenv_versions.glob(f"{version}.*/bin/python{version}")),
        ):  # fmt: skip
            code = "import sys, ensurepip, venv; print('%d.%d' % sys.version_info[:2])"
            with contextlib.suppress(OSError, CheckFailed):
                if run_program([program, "-c", code]).strip() == version:
                    by_version[version] = program
                    break
    return by_version


def import_all(environment: CleanEnvironment) -> None:
    """Imports every module; only modules from extras may be missing."""
    output = environment.run(f"python -c {shlex.quote(IMPORT_ALL)}")
    missing = [line.split() for line in output.splitlines()]
    undeclared = [
        f"{module} imports {name}, which is not a declared dependency"
        for module, name in missing
        if name.split(".")[0] not in OPTIONAL_MODULES
    ]
    if undeclared:
        raise CheckFailed("\n".join(undeclared))


def check_every_extra_is_tested(environment: CleanEnvironment) -> None:
    """Checks that every extra declared by the wheel has a test in FEATURES."""
    declared = set(environment.run(f"python -c {shlex.quote(LIST_EXTRAS)}").split())
    untested = declared - DEVELOPMENT_EXTRAS - {feature.__name__ for feature in FEATURES}
    if untested:
        raise CheckFailed(f"no test in FEATURES for the extras {', '.join(sorted(untested))}")


def check_help(environment: CleanEnvironment) -> None:
    """Checks that every command and subcommand prints its usage with --help."""
    commands = environment.run(f"python -c {shlex.quote(LIST_COMMANDS)}").splitlines()
    for command in commands:
        if f"Usage: {command}" not in environment.run(f"{command} --help"):
            raise CheckFailed(f"{command} --help does not print its usage")
    print(f"    {len(commands)} commands")


def check_show(environment: CleanEnvironment) -> None:
    """Checks that `fantoccini show` serves the page until it is interrupted."""
    command = "fantoccini show arm2d --no-browser --port 0"
    with environment.running(command, r"(http://\S+)") as address:
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        page = direct.open(address, timeout=60).read().decode()
        if "<html" not in page:
            raise CheckFailed(f"{address} did not return an HTML page:\n{page[:500]}")


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
    compiler, dae, mcap, mujoco, osc, pyvista, ray, serial, urdf, usd,
)  # fmt: skip
"""One function for each extra, with the extra's name; it fails if the extra is not installed."""


def check_missing_extra_message(
    feature: Callable[[CleanEnvironment], None], environment: CleanEnvironment
) -> None:
    """Checks that the feature fails without its extra, and that the error says what to install."""
    extra = feature.__name__
    try:
        feature(environment)
    except CheckFailed as error:
        if f"pip install 'fantoccini[{extra}]'" in str(error) and "exit code 0" not in str(error):
            return
        raise CheckFailed(f"the error does not name the extra {extra}:\n{error}") from None
    raise CheckFailed(f"{feature.__doc__} works without the extra {extra}")


def check_wheel(folder: Path, wheel: Path) -> None:
    """Checks the wheel without extras: in full on the oldest Python, briefly on newer ones."""
    programs = interpreters()
    for version in VERSIONS:
        if version not in programs:
            print(f"Python {version}: not installed, skipped")
    with timed_check(f"Python {', '.join(programs)}: install the wheel without extras"):
        requirement = f"fantoccini @ {wheel.as_uri()}"
        with ThreadPoolExecutor() as pool:
            install = partial(CleanEnvironment, folder, requirement=requirement)
            environments = list(pool.map(install, programs.values()))
    environment, *newer = environments
    with timed_check("import every module"):
        for each in environments:
            import_all(each)
        check_every_extra_is_tested(environment)
    with timed_check("run every command with --help"):
        check_help(environment)
    for command in COMMANDS:
        with timed_check(f"fantoccini {command}"):
            environment.run(f"fantoccini {command}")
    with timed_check("fantoccini show"):
        check_show(environment)
    with timed_check("use each feature without its extra"):
        for feature in FEATURES:
            check_missing_extra_message(feature, environment)
    with timed_check("install the extra `compiler`"):
        environment.install(f"fantoccini[compiler] @ {wheel.as_uri()}")
    with timed_check(compiler.__doc__ or ""):
        compiler(environment)
    with timed_check("simulate on the newer Pythons"):
        for each in newer:
            each.run("fantoccini simulate arm2d --duration 0.2 --out run.npz --out run.png")


def check_extras(folder: Path, wheel: Path) -> None:
    """Checks each extra alone, each in its own environment."""
    for feature in FEATURES:
        extra = feature.__name__
        with timed_check(f"fantoccini[{extra}]: {feature.__doc__}"):
            requirement = f"fantoccini[{extra}] @ {wheel.as_uri()}"
            feature(CleanEnvironment(folder, sys.executable, requirement))


def main() -> None:
    """Runs the chosen checks; exits with 1 at the first failure."""
    parser = argparse.ArgumentParser(description="Test the package in clean environments.")
    parser.add_argument("checks", nargs="?", choices=("wheel", "extras"), default="wheel")
    checks = parser.parse_args().checks
    with tempfile.TemporaryDirectory(prefix="clean-room-") as name:
        folder, distributions = Path(name).resolve(), Path(name).resolve() / "distributions"
        try:
            with timed_check("build and check the distributions"):
                wheel = build_wheel(distributions)
            (check_wheel if checks == "wheel" else check_extras)(folder, wheel)
        except (CheckFailed, subprocess.TimeoutExpired) as error:
            sys.exit(f"clean room: {error}")


if __name__ == "__main__":
    main()
