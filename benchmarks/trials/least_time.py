"""Least times of a bob and a double pendulum on grids of their own, beside collocation by IPOPT.

    python benchmarks/trials/least_time.py

Runs `fantoccini optimise` on files, and prints the status and both times. The reference has the
same grid.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.optimal.least_time_oracle import Problem, least_time

PROBLEMS = {
    # problem (its last number: longest duration over interval), interval, step
    "bob": (Problem((1.4,), (0.7,), 1.7, 0.9, 1.3, (1.0, 7.0), 100), 0.07, 0.013),
    "slow bob": (Problem((0.45,), (3.0,), 1.1, 0.5, 0.7, (1.0, 6.0), 86), 0.07, 0.031),
    "double": (Problem((0.8, 0.5), (1.5, 0.4), 1.4, 0.8, 0.9, (1.0, 6.3), 70), 0.09, 0.017),
}


def files(folder: Path, problem: Problem, interval: float, step: float) -> Path:
    """Writes a puppet and its task; returns the task."""
    z, above, bodies, strings, pose = 0.0, "{driven: [x], at: [0, 0, 0]}", [], [], []
    for k, (length, mass) in enumerate(zip(problem.lengths, problem.masses, strict=True)):
        z -= length
        shape = f"{{type: sphere, radius: 0.02, mass: {mass}}}"
        joint = "{type: translation, axes: [x, z]}"
        bodies.append(f"- {{name: bob{k}, joint: {joint}, shapes: [{shape}]}}")
        path = f"[{{body: bob{k}}}, {above}]"
        strings.append(f"- {{name: line{k}, path: {path}, length: {length}}}")
        above, pose = f"{{body: bob{k}}}", [*pose, f"bob{k}.z: {z}"]
    text = ["puppet: chain", "bodies:", *bodies, "strings:", *strings]
    (folder / "chain.yaml").write_text("\n".join([*text, f"pose: {{{', '.join(pose)}}}\n"]))
    task = folder / "task.yaml"
    task.write_text(
        "task: trial\npuppet: chain.yaml\nstart: {line0.x: 0}\n"
        f"end: {{line0.x: {problem.distance}}}\n"
        f"duration: [{problem.duration[0]}, {problem.duration[1]}]\nbounds:\n"
        f"  speed: {{line0.x: {problem.speed}}}\n"
        f"  acceleration: {{line0.x: {problem.acceleration}}}\n"
        f"smooth: {{acceleration: {problem.weight}, jerk: 0}}\ninterval: {interval}\nstep: {step}\n"
    )
    return task


def main() -> None:
    """Prints a line for each problem."""
    for name, (problem, interval, step) in PROBLEMS.items():
        with tempfile.TemporaryDirectory() as folder:
            task = files(Path(folder), problem, interval, step)
            run = "from fantoccini.app.cli import main; main()"
            command = [sys.executable, "-c", run, "optimise", str(task), "--time-limit", "900"]
            out = subprocess.run(command, capture_output=True, text=True, check=False)
        status, time = (
            re.search(r"status +(\w+)", out.stdout),
            re.search(r"cost +(\S+)", out.stdout),
        )
        if status is None or time is None:
            print(f"{name}: exit {out.returncode}: {out.stderr[-500:]}")
            continue
        duration, best = float(time[1]), least_time(problem, 3.5)
        print(
            f"{name}: {status[1]}, {duration} s; IPOPT {best:.5f} s ({duration / best - 1.0:+.2e})"
        )


if __name__ == "__main__":
    main()
