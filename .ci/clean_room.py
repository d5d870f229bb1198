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
import shlex
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from clean_environment import CheckFailed, CleanEnvironment, run_program
from features import FEATURES, compiler

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
from fantoccini.app.cli.app import app
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
            f"python{version}",
            sys.executable,
            *map(str, pyenv_versions.glob(f"{version}.*/bin/python{version}")),
        ):
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
