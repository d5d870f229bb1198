"""``fantoccini doctor``: checks that this machine has everything that fantoccini needs."""

from __future__ import annotations

import platform
from importlib import metadata

import typer
from packaging.requirements import Requirement

from fantoccini.app.cli_support import FAILED, print_message, print_output, version_text
from fantoccini.kernel.build import describe


def print_diagnosis() -> None:
    """Prints versions on stdout and problems on stderr; exits with 1 if there are problems."""
    entries = {
        "fantoccini": version_text(),
        "python": f"{platform.python_version()} ({platform.system()} {platform.machine()})",
    }
    problems = []
    for name in required_distributions():
        try:
            entries[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            entries[name] = "missing"
            problems.append(f"{name} is missing; install it: python -m pip install {name}")
    compiler = describe()
    if problem_text := compiler.pop("problem", ""):
        problems += problem_text.split("\n")
    entries |= compiler
    entries["ffmpeg"], problem_text = _ffmpeg_version()
    if problem_text:
        problems.append(problem_text)
    widest = max(map(len, entries))
    for label, text in entries.items():
        print_output(f"{label:{widest}}  {text}")
    for problem in problems:
        print_message(f"fantoccini: {problem}")
    if problems:
        raise typer.Exit(FAILED)


def required_distributions() -> list[str]:
    """Distributions that the installed package requires on this system, without extras."""
    requirements = map(Requirement, metadata.requires("fantoccini") or [])
    return sorted(r.name for r in requirements if not r.marker or r.marker.evaluate({"extra": ""}))


def _ffmpeg_version() -> tuple[str, str]:
    """Version and path of ffmpeg, and an error message if it does not run."""
    try:
        import imageio_ffmpeg

        path, version = imageio_ffmpeg.get_ffmpeg_exe(), imageio_ffmpeg.get_ffmpeg_version()
    except (ImportError, RuntimeError, OSError) as error:
        text = str(error).split("\n")[0]
        return "none", f"ffmpeg does not run, so films cannot be written: {text}"
    return f"{version} ({path})", ""
