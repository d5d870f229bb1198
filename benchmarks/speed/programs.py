"""The runtime in programs of its own, compiled as the puppet's library is."""

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
    """What a program printed.

    Attributes:
        seconds: of the processor for one evaluation or step, one number a time.
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
            arguments: of its command line.
        """
        text = "\n".join(repr(float(x)) for part in words for x in np.ravel(part))
        command = [str(self.path), *map(str, arguments)]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
        *seconds, tension, apart = map(float, done.stdout.split())
        return Burst(tuple(seconds), tension, apart)


def flags() -> list[str]:
    """Those of the library, without what makes it one."""
    return [f for f in (*BASE_FLAGS, *build.default_flags(source())) if f != "-shared"]


def compiled(name: str, folder: Path, text_of: build.Source | None = None) -> Program:
    """A program of this folder with the bundled marionette in it.

    Args:
        name: of the program.
        folder: where it is made.
        text_of: the marionette; that of its library when not given.
    """
    for file, text in (text_of or source()).files.items():
        Path(folder, file).write_text(text, encoding="utf-8")
    include = [f"-I{folder}", f"-I{build.runtime_folder()}"]
    command = [*build.find_compiler().command, *flags(), *include]
    path = folder / name
    subprocess.run([*command, str(HERE / f"{name}.cpp"), "-o", str(path)], check=True)
    return Program(path, " ".join(flags()))


def words(states: Sequence[State]) -> list:
    """What a program reads: the starts, then what they have in common, inputs that hold still."""
    puppet = marionette()
    bound = Input.hold(puppet).bound(hanging().q_K, 0.0)
    options = puppet.run_options()
    parts: list = [part for x in states for part in (x.q_D, x.v_D)]
    parts += [puppet.p, puppet.winches, [DT, options.recovery_speed, options.tension_cap]]
    return [*parts, [len(bound.coef)], bound.breaks, bound.coef, bound.base]


def lane_source() -> build.Source:
    """Likewise as the library of its lanes is made of it."""
    generated = generate(marionette().equations, "lanes")
    return build.Source(
        generated.files,
        generated.main,
        units=generated.units,
        pieces=generated.pieces,
        shared_units=generated.shared_units,
    )


def source() -> build.Source:
    """The bundled marionette as text to be compiled, just as the library is made of it."""
    return marionette().libraries.source_files()
