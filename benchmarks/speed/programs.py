"""The runtime in separate programs, compiled like the puppet's library."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.kernel import build
from fantoccini.kernel.build.compiler import BASE_FLAGS
from fantoccini.kernel.codegen import generate
from fantoccini.motion import Input, State

from .subject import DT, hanging, marionette

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Burst:
    """Output of a program.

    Attributes:
        seconds: processor time of one evaluation or step, for each repetition [s].
        tension: sum over the strings at the end [N].
        apart: the largest |h| of a string at the end [m].
    """

    seconds: tuple[float, ...]
    tension: float
    apart: float


@dataclass(frozen=True)
class Program:
    """A compiled program and the words it reads."""

    path: Path
    flags: str

    def run(self, words: Sequence, *arguments: object) -> Burst:
        """Runs it.

        Args:
            words: arrays and numbers for its stdin.
            arguments: arguments of its command line.
        """
        text = "\n".join(repr(float(x)) for part in words for x in np.ravel(part))
        command = [str(self.path), *map(str, arguments)]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
        *seconds, tension, apart = map(float, done.stdout.split())
        return Burst(tuple(seconds), tension, apart)


def flags() -> list[str]:
    """The library's compiler flags, without those for a shared library."""
    return [f for f in (*BASE_FLAGS, *build.default_flags(source())) if f != "-shared"]


def compile_program(name: str, folder: Path, text_of: build.Source | None = None) -> Program:
    """A program of this folder with the bundled marionette in it.

    Args:
        name: name of the program.
        folder: folder of the program.
        text_of: source of the marionette; that of its library by default.
    """
    for file, text in (text_of or source()).files.items():
        Path(folder, file).write_text(text, encoding="utf-8")
    include = [f"-I{folder}", f"-I{build.runtime_folder()}"]
    command = [*build.find_compiler().command, *flags(), *include]
    path = folder / name
    subprocess.run([*command, str(HERE / f"{name}.cpp"), "-o", str(path)], check=True)
    return Program(path, " ".join(flags()))


def program_input(states: Sequence[State]) -> list:
    """Input of a program: the starts, then common data with constant inputs."""
    puppet = marionette()
    bound = Input.hold(puppet).bound(hanging().q_K, 0.0)
    options = puppet.run_options()
    parts: list = [part for x in states for part in (x.q_D, x.v_D)]
    parts += [puppet.p, puppet.winches, [DT, options.recovery_speed, options.tension_cap]]
    return [*parts, [len(bound.coef)], bound.breaks, bound.coef, bound.base]


def lane_source() -> build.Source:
    """The bundled marionette's source, as for the library of its lanes."""
    generated = generate(marionette().equations, "lanes")
    return build.Source(
        generated.files,
        generated.main,
        units=generated.units,
        pieces=generated.pieces,
        shared_units=generated.shared_units,
    )


def source() -> build.Source:
    """The bundled marionette's source, as for its library."""
    return marionette().libraries.source_files()
