"""Fresh virtual environments outside the checkout, and programs run in them."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import signal
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path


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
    def running(self, command: str, ready_pattern: str, exits: bool = False) -> Iterator[str]:
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
            [str(self.bin / program), *arguments],
            cwd=self.working_folder,
            env=self.variables,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            preexec_fn=accept_interrupts,
        )
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
        words,
        capture_output=True,
        stdin=subprocess.DEVNULL,
        text=True,
        timeout=900,
        check=False,
        **options,
    )
    output = completed.stdout + completed.stderr
    if completed.returncode != 0 or "Traceback (most recent call last)" in output:
        raise CheckFailed(f"{shlex.join(words)}: exit code {completed.returncode}\n{output}")
    return completed.stdout
