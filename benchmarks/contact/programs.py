"""The runtime with a scene's solids, in a program of its own."""

from __future__ import annotations

import functools
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel import build
from fantoccini.motion import Input, State

from ..speed.programs import flags

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Burst:
    """The output of the program.

    Attributes:
        seconds: processor time of one step, for each repetition [s].
        points: number of points that push at the end.
        force: sum of the normal forces there [N].
        depth: deepest overlap there [m].
        residual: residual of the law there.
    """

    seconds: tuple[float, ...]
    points: int
    force: float
    depth: float
    residual: float


@dataclass(frozen=True)
class Program:
    """A scene's program.

    Attributes:
        path: the program.
        marionette: the scene.
        dt: step [s].
    """

    path: Path
    marionette: Marionette
    dt: float

    def run(self, x: State, work: str, times: int, count: int) -> Burst:
        """Times steps from a state, with constant inputs."""
        *seconds, points, force, depth, residual = self.numbers(x, work, str(times), str(count))
        return Burst(tuple(seconds), int(points), force, depth, residual)

    def numbers(self, x: State, *arguments: str) -> list[float]:
        """The numbers that the program prints for a state and further arguments."""
        text = "\n".join(repr(float(n)) for part in self._words(x) for n in np.ravel(part))
        command = [str(self.path), *arguments]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
        return [float(word) for word in done.stdout.split()]

    def _words(self, x: State) -> list[Sequence[float]]:
        puppet = self.marionette
        bound = Input.hold(puppet).bound(x.q_K, 0.0)
        options = puppet.run_options()
        numbers = [self.dt, options.recovery_speed, options.tension_cap]
        words = [x.q_D, x.v_D, puppet.p, np.minimum(puppet.winches, 1e250), numbers]
        words += [[len(bound.coef)], bound.breaks, bound.coef, bound.base]
        return [*words, *_solids(puppet)]


def _solids(puppet: Marionette) -> list[Sequence[float]]:
    """Solids and pairs that may touch, in the program's format."""
    contacts = puppet.contacts
    if contacts is None:
        return [[0]] * 6
    words: list = [[len(contacts.solids)]]
    for solid in contacts.solids:
        words += [[solid[name]] for name in ("kind", "link")]
        words += [solid[name] for name in ("a", "b", "R", "half", "radius")]
    structure = contacts.structure
    for array in structure.kept[1:]:
        words += [[len(array)], array]
    return words


@functools.cache
def _folder() -> tempfile.TemporaryDirectory:
    """A folder that lives as long as Python."""
    return tempfile.TemporaryDirectory()


def compile_scene(marionette: Marionette, dt: float, source: Path = HERE / "stage.cpp") -> Program:
    """A scene's program, compiled like its library."""
    folder = Path(tempfile.mkdtemp(dir=_folder().name))
    for file, text in marionette.libraries.source_files().files.items():
        Path(folder, file).write_text(text, encoding="utf-8")
    include = [f"-I{folder}", f"-I{build.runtime_folder()}", f"-I{HERE}"]
    path = folder / "stage"
    command = [*build.find_compiler().command, *flags(), *include]
    subprocess.run([*command, str(source), "-o", str(path)], check=True)
    return Program(path, marionette, dt)
