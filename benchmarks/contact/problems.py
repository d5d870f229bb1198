"""Section 6: published problems, solved by our solver and by Siconos.

u = M r + q,   0 <= u_n, 0 <= r_n, u_n r_n = 0,   |r_t| <= mu r_n,   r_t = -mu r_n u_t / |u_t|
"""

from __future__ import annotations

import functools
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.base.arrays import Array
from fantoccini.kernel import build

from ..speed.figures import Chapter, time_text
from ..speed.programs import flags
from ..strings.report import Section, Table, number

HERE = Path(__file__).resolve().parent
LARGEST = 300
"""Largest number of contacts of a problem."""

TOLERANCE = 1e-10
SOLVERS = {"NSN_AC": 1000, "NSGS": 10000}
"""Siconos's solver -> largest number of iterations."""

OTHERS = ("GFC3D_Ex", "GFC3D_One", "GFC3D_TwoRods1.", "RFC3D", "GRFC3D")
"""Prefixes of problems in another form: with the bodies' equations, or rolling."""

SECONDS = 60.0
"""Time limit for one problem and solver [s]."""


@dataclass(frozen=True)
class Problem:
    """A problem of n contacts.

    Attributes:
        file: file of the problem.
        M: (3n, 3n), symmetric.
        q: (3n,).
        mu: (n,).
    """

    file: Path
    M: Array
    q: Array
    mu: Array

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.file.name.removesuffix(".dat").removesuffix(".hdf5")

    def text(self) -> str:
        """The problem in Siconos's text format, M by blocks."""
        n = len(self.mu)
        blocks = self.M.reshape(n, 3, n, 3).swapaxes(1, 2)
        there = np.any(blocks != 0.0, axis=(2, 3))
        first = np.concatenate([[0], np.cumsum(there.sum(axis=1))])
        ends = " ".join(str(3 * k + 3) for k in range(n))
        lines = [
            3,
            n,
            1,
            3 * n,
            3 * n,
            int(there.sum()),
            n,
            n,
            ends,
            ends,
            n + 1,
            int(there.sum()),
            " ".join(map(str, first)),
            " ".join(map(str, np.nonzero(there)[1])),
        ]
        for k, (i, j) in enumerate(np.argwhere(there)):
            lines += [k, *(repr(float(x)) for x in blocks[i, j].T.ravel())]
        lines += [" ".join(repr(float(x)) for x in part) for part in (self.q, self.mu)]
        return "\n".join(map(str, lines)) + "\n1\n"

    def residual(self, r: Array) -> float:
        """The largest g |r - P(r - u / g)| of a contact, relative to the largest |q_i|."""
        u, worst = self.M @ r + self.q, 0.0
        for c, mu in enumerate(self.mu):
            own = slice(3 * c, 3 * c + 3)
            g = float(np.trace(self.M[own, own])) / 3.0
            w = r[own] - u[own] / g
            w[0] = max(w[0], 0.0)
            size, radius = float(np.hypot(*w[1:])), mu * max(r[3 * c], 0.0)
            if size > radius:
                w[1:] *= radius / size
            worst = max(worst, g * float(np.abs(r[own] - w).max()))
        return worst / float(np.abs(self.q).max())


@dataclass(frozen=True)
class Answer:
    """A solver's result: processor time [s], iterations and residual of the law."""

    seconds: float
    iterations: int
    residual: float


def read_problem(file: Path) -> Problem | None:
    """A problem of contacts in space; None for other problems."""
    if file.suffix != ".hdf5":
        return _read_text(file)
    from .fclib import read_arrays

    parts = read_arrays(file)
    if parts is None or not 0 < len(parts[2]) <= LARGEST:
        return None
    M, q, mu = parts
    return Problem(file, 0.5 * (M + M.T), q, mu)


def _read_text(file: Path) -> Problem | None:
    """The same in Siconos's text format, with dense or block storage."""
    words = iter(file.read_text(encoding="utf-8").split())

    def take(n: int) -> Array:
        return np.array([float(next(words)) for _ in range(n)])

    def whole(n: int) -> list[int]:
        return [int(next(words)) for _ in range(n)]

    try:
        dimension, contacts, storage, rows, columns = whole(5)
        n = 3 * contacts
        if dimension != 3 or storage not in (0, 1) or (rows, columns) != (n, n):
            return None
        if not 0 < contacts <= LARGEST:
            return None
        M = np.zeros((n, n))
        if storage == 0:
            whole(2)
            M[:] = take(n * n).reshape(n, n)
        else:
            blocks, across, down = whole(3)
            whole(across + down)
            n_first, n_second = whole(2)
            first, second = whole(n_first), whole(n_second)
            lines = np.repeat(np.arange(n_first - 1), np.diff(first))
            for _ in range(blocks):
                (k,) = whole(1)
                i, j = 3 * lines[k], 3 * second[k]
                M[i : i + 3, j : j + 3] = take(9).reshape(3, 3).T
        q, mu = take(n), take(contacts)
    except (StopIteration, RuntimeError, ValueError):
        return None
    return Problem(file, 0.5 * (M + M.T), q, mu)


@functools.cache
def _program() -> tuple[tempfile.TemporaryDirectory, Path]:
    folder = tempfile.TemporaryDirectory()
    path = Path(folder.name) / "cone"
    include = f"-I{build.runtime_folder()}"
    command = [*build.find_compiler().command, *flags(), include, str(HERE / "cone.cpp")]
    subprocess.run([*command, "-o", str(path)], check=True)
    return folder, path


def solve_with_fantoccini(problem: Problem) -> Answer:
    """Our solver."""
    words = np.concatenate([[len(problem.mu)], problem.mu, -problem.q, problem.M.ravel()])
    text = "\n".join(map(repr, words.tolist()))
    done = subprocess.run(
        [str(_program()[1])], input=text, capture_output=True, text=True, check=True
    )
    seconds, _, iterations, rounds, *r = map(float, done.stdout.split())
    return Answer(seconds, int(iterations + rounds), problem.residual(np.array(r)))


def solve_with_siconos(problem: Problem, python: str, solver: str) -> Answer | None:
    """One of Siconos's solvers; None where it fails or takes too long."""
    worker = str(HERE / "siconos_worker.py")
    try:
        with tempfile.NamedTemporaryFile("w", suffix=".dat", encoding="utf-8") as file:
            file.write(problem.text())
            file.flush()
            command = [python, worker, file.name, solver, str(SOLVERS[solver]), str(TOLERANCE)]
            done = subprocess.run(
                command, capture_output=True, text=True, check=True, timeout=SECONDS
            )
        words = done.stdout.split()[-3 * len(problem.mu) - 3 :]
        seconds, _, iterations, *r = map(float, words)
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return Answer(seconds, int(iterations), problem.residual(np.array(r)))


def chapter(folder: Path | None, python: str | None) -> Chapter:
    """The section on the problems in a folder; without a folder, how to supply one."""
    title = "7. Published problems"
    files = sorted([*folder.glob("*.dat"), *folder.glob("*.hdf5")]) if folder else []
    problems = [p for f in files if not f.name.startswith(OTHERS) and (p := read_problem(f))]
    if not problems:
        text = (
            "Not measured: give `python -m benchmarks.contact` a folder of problems in Siconos's "
            "text format, or in FCLIB's, with `--problems`, and with `--siconos` an interpreter "
            "that has Siconos."
        )
        return Chapter(Section(title, [text]))
    rows = []
    for problem in problems:
        answers = [solve_with_fantoccini(problem)]
        answers += [solve_with_siconos(problem, python, s) if python else None for s in SOLVERS]
        rows.append([f"{problem.name}, {len(problem.mu)}", *map(_answer_text, answers)])
    text = (
        "Contact problems from the tests of Siconos (`numerics/src/FrictionContact/test/data`), "
        "some of the collection FCLIB as text and some (`*.hdf5`) in its own files: all "
        f"three-dimensional problems with at most {LARGEST} contacts. The table gives the "
        "iterations (for ours those of Newton's method and rounds of the method of multipliers), "
        "the processor time, and the residual of the exact law, by one formula for all: the "
        "largest g |r - P(r - u/g)| relative to the largest |q|. The tolerance was "
        f"{number(TOLERANCE)}, by each solver's own measure. `-`: no solution, or none within "
        f"{SECONDS:g} s. Problems are solved from zero. M, in some files symmetric to five digits "
        "only, is symmetrised for all."
    )
    header = ["problem, contacts", "fantoccini", *(f"Siconos, {s}" for s in SOLVERS)]
    return Chapter(Section(title, [text, Table(header, rows)]))


def _answer_text(answer: Answer | None) -> str:
    if answer is None:
        return "-"
    return f"{answer.iterations}, {time_text(answer.seconds)}, {number(answer.residual)}"
