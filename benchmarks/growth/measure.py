"""Measures one puppet of a size, in a separate process, and prints the result as JSON.

``python -m benchmarks.growth`` runs it, as does ``python -m benchmarks.growth.measure chain 25 3``
on its own.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass

import numpy as np
from benchmarks.growth.puppets import marionette

import fantoccini as fan
from fantoccini.kernel import build, codegen
from fantoccini.kernel.runtime import Library

CALLS, REPEATS = 50, 400


@dataclass(frozen=True)
class Size:
    """Costs of a puppet of a size.

    Attributes:
        kind, dof, strings: the puppet.
        operations: arithmetic operations of one exact evaluation.
        derive: seconds of processor time from the tree to the text.
        compile: seconds of the clock to compile the pieces in parallel, and the link.
        compile_cpu: seconds of processor time that the compilers took together.
        evaluate: microseconds of one exact evaluation, the shortest of many.
        step: likewise for the evaluation of a time step.
        memory: peak memory of the process [MB].
        compiler_memory: peak memory of one compiler [MB].
    """

    kind: str
    dof: int
    strings: int
    operations: int
    derive: float
    compile: float
    compile_cpu: float
    evaluate: float
    step: float
    memory: float
    compiler_memory: float


def measure(kind: str, dof: int, strings: int) -> Size:
    """All figures of one puppet."""
    puppet = marionette(kind, dof, strings)
    before = _processor_time(resource.RUSAGE_SELF)
    generated = codegen.generate(puppet.equations)
    derive = _processor_time(resource.RUSAGE_SELF) - before
    source = build.Source(
        generated.files,
        generated.main,
        units=generated.units,
        pieces=generated.pieces,
        shared_units=generated.shared_units,
    )
    with tempfile.TemporaryDirectory() as folder:
        os.environ["FANTOCCINI_CACHE"] = folder
        start = time.perf_counter()
        with MemoryWatch(folder) as watch:
            entry = build.obtain("0" * 64, lambda: source)
        compiled = time.perf_counter() - start
        library = Library(entry / build.LIBRARY, puppet.tree)
        evaluate, step = (
            evaluation_time(puppet, library, f) for f in ("dynamics", "step_dynamics")
        )
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Size(
        kind=kind,
        dof=dof,
        strings=strings,
        operations=generated.operations["dynamics"],
        derive=derive,
        compile=compiled,
        compile_cpu=spent.ru_utime + spent.ru_stime,
        evaluate=evaluate,
        step=step,
        memory=_peak_memory("self"),
        compiler_memory=watch.most,
    )


class MemoryWatch:
    """Samples the memory of the compilers that run below a folder.

    The system's own account of children begins with the memory of their parent, and so does a child
    until it runs its own program.
    """

    def __init__(self, folder: str):
        self.folder = os.path.realpath(folder)
        self.most = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look)

    def __enter__(self) -> MemoryWatch:
        self._thread.start()
        return self

    def __exit__(self, *_) -> None:
        self._ended.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._ended.wait(0.05):
            for process in filter(str.isdigit, os.listdir("/proc")):
                with contextlib.suppress(OSError):
                    own = os.readlink(f"/proc/{process}/exe") != os.path.realpath(sys.executable)
                    if own and os.readlink(f"/proc/{process}/cwd").startswith(self.folder):
                        self.most = max(self.most, _peak_memory(process))


def _peak_memory(process: str) -> float:
    """Peak memory of a process [MB]."""
    with open(f"/proc/{process}/status", encoding="ascii", errors="replace") as lines:
        words = next((line.split() for line in lines if line.startswith("VmHWM")), ["", "0"])
    return float(words[1]) / 1e3


def evaluation_time(puppet: fan.Marionette, library: Library, function: str) -> float:
    """Microseconds of one evaluation at a random state, the shortest of many."""
    table, rng = puppet.coordinates, np.random.default_rng(0)
    widths = {
        "q_D": table.n_qD,
        "v_D": table.n_vD,
        "q_K": table.n_qK,
        "v_K": table.n_vK,
        "acc_K": table.n_vK,
        "u_D": table.n_vD,
    }
    arguments = {name: np.tile(0.3 * rng.normal(size=n), (CALLS, 1)) for name, n in widths.items()}
    if function == "step_dynamics":
        arguments |= {"v_ahead": arguments["v_D"], "dt": np.zeros(CALLS)}
    took = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        library.evaluate(function, **arguments, p=puppet.p)
        took.append(time.perf_counter() - start)
    return 1e6 * min(took) / CALLS


def _processor_time(whose: int) -> float:
    spent = resource.getrusage(whose)
    return spent.ru_utime + spent.ru_stime


if __name__ == "__main__":
    print(json.dumps(asdict(measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))))
