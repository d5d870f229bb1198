"""The system's C++ compiler: search, flags, execution.

No other module starts a compiler. Commands are lists, never shell text, and contain nothing from a
puppet file.

A flag is an option of the compiler.
"""

from __future__ import annotations

import contextlib
import functools
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fantoccini.base import BuildError
from fantoccini.kernel.build.entry import LIBRARY, Source

Kind = Literal["gcc", "clang", "zig"]

COMPILE_SECONDS = 600.0
"""Time after which a compilation is stopped [s]."""

BASE_FLAGS = ("-std=c++17", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=fast")
"""Flags of every compilation. -ffast-math would break infinities and the order of sums."""

OPTIMISATION = (
    "-O1",
    "-fstrict-aliasing",
    "-fexpensive-optimizations",
    "-finline-small-functions",
    "-finline-functions",
    "-findirect-inlining",
    "-fpartial-inlining",
    "-ftree-loop-vectorize",
)
"""Optimisations of g++, most of them from -O2, that make steps faster (docs/measured.md).

Measured with g++ 12.2. Without ``-fexpensive-optimizations`` products and sums are not contracted.
"""

_LEVEL = re.compile("-O([0-3sgz]|fast)?")
"""Levels of optimisation."""

APART = "-DFAN_APART"
"""Flag for sources whose units are compiled separately."""

_VERSION_SECONDS = 60.0
_ENGLISH = {"LC_ALL": "C"}
_FULL = ("No space left on device", "Disk quota exceeded", "Read-only file system")


@dataclass(frozen=True)
class Compiler:
    """A C++ compiler that runs on this machine.

    Attributes:
        command: program and fixed arguments, without flags.
        kind: kind of compiler, which determines its flags.
        version: first line of the output of ``--version``.
    """

    command: tuple[str, ...]
    kind: Kind
    version: str


class DiskError(OSError):
    """The compiler could not write its output: the disk is full or read-only."""


def find_compiler() -> Compiler:
    """The C++ compiler in the environment variable FANTOCCINI_CXX or CXX.

    Without these, the first of g++, c++, clang++ and the ziglang package that runs.

    Raises:
        BuildError: no compiler is installed (the message has a command that installs one), or the
            one in the variable does not run.
    """
    for variable in ("FANTOCCINI_CXX", "CXX"):
        value = os.environ.get(variable, "").strip()
        if not value:
            continue
        try:
            command = tuple(shlex.split(value))
        except ValueError as error:
            raise BuildError(f"{variable}={value!r} is not a command: {error}") from None
        try:
            return _identify(command, os.environ.get("PATH", ""))
        except OSError as error:
            raise BuildError(
                f"{variable}={value!r} names a C++ compiler that does not run ({error}); "
                f"set it to one that does, or unset it to use the system's"
            ) from None
    for command in (("g++",), ("c++",), ("clang++",), (sys.executable, "-m", "ziglang", "c++")):
        with contextlib.suppress(OSError):
            return _identify(command, os.environ.get("PATH", ""))
    commands = ["pip install 'fantoccini[compiler]'", *filter(None, [system_install_command()])]
    raise BuildError(
        f"a puppet is compiled on this machine, and no C++ compiler was found "
        f"(g++, c++, clang++, ziglang); install one with:  {'  or:  '.join(commands)}"
    )


@functools.lru_cache(maxsize=16)
def _identify(command: tuple[str, ...], path: str) -> Compiler:
    """Kind and version of a compiler from its output for --version, which is slow and cached.

    Args:
        command: program and fixed arguments.
        path: search path; part of the cache's key.

    Raises:
        OSError: there is no such program, or it does not answer. Not cached: the user can install
            it and try again.
    """
    program = shutil.which(command[0], path=path or None)
    if program is None:
        raise FileNotFoundError("there is no such program")
    try:
        answer = subprocess.run(
            [program, *command[1:], "--version"],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_VERSION_SECONDS,
            stdin=subprocess.DEVNULL,
            env={**os.environ, **_ENGLISH},
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise OSError("it gives no answer") from None
    if answer.returncode != 0:
        raise OSError(f"--version ends with exit code {answer.returncode}")
    lines = answer.stdout.strip().splitlines()
    # Others understand the flags of clang, which are the common ones.
    kind: Kind = "gcc" if "Free Software Foundation" in answer.stdout else "clang"
    if any(Path(word).stem in ("zig", "ziglang") for word in command):
        kind = "zig"
    return Compiler((program, *command[1:]), kind, lines[0] if lines else "")


def first_build_notice(compiler: Compiler) -> str:
    """Notice that this compiler's first build on this machine is slow; empty if it is not."""
    folder = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    caches = os.environ.get(folder) or os.path.expanduser("~/.cache")
    zig_cache = Path(os.environ.get("ZIG_GLOBAL_CACHE_DIR") or Path(caches, "zig"))
    if compiler.kind != "zig" or zig_cache.exists():
        return ""
    return "zig first builds its C++ standard library, once on this machine; this takes a minute"


def system_install_command() -> str:
    """Command that installs a C++ compiler with the system's package manager; empty if unknown."""
    if sys.platform == "darwin":
        return "xcode-select --install"
    as_root = "" if hasattr(os, "geteuid") and os.geteuid() == 0 else "sudo "
    for program, arguments in (
        ("apt-get", "install -y g++"),
        ("dnf", "install -y gcc-c++"),
        ("pacman", "-S --needed gcc"),
        ("zypper", "install -y gcc-c++"),
        ("apk", "add g++"),
    ):
        if shutil.which(program):
            return f"{as_root}{program} {arguments}"
    return ""


def compile_flags(compiler: Compiler) -> tuple[str, ...]:
    """The flags that depend on the compiler, the processor and the user.

    The same for every size: the compile time of code in pieces is proportional to its length. Flags
    in the environment variable FANTOCCINI_CXXFLAGS come last and override others; a level of
    optimisation among them replaces ``OPTIMISATION``, whose single flags would stay active.

    Raises:
        BuildError: FANTOCCINI_CXXFLAGS cannot be split into flags.
    """
    # On ARM all compilers understand only -mcpu; on other processors -march.
    arm = platform.machine().lower() in ("arm64", "aarch64")
    native = "-mcpu=native" if arm or compiler.kind == "zig" else "-march=native"
    # zig instruments for undefined behaviour unless told not to.
    extra = ("-fno-sanitize=undefined",) if compiler.kind == "zig" else ()
    users = _flags_of_the_user()
    if any(_LEVEL.fullmatch(flag) for flag in users):
        return (native, *extra, *users)
    return (*(OPTIMISATION if compiler.kind == "gcc" else ("-O2",)), native, *extra, *users)


def _flags_of_the_user() -> list[str]:
    """The flags in FANTOCCINI_CXXFLAGS, split as a shell would."""
    value = os.environ.get("FANTOCCINI_CXXFLAGS", "")
    try:
        return shlex.split(value)
    except ValueError as error:
        raise BuildError(f"FANTOCCINI_CXXFLAGS={value!r} are not flags: {error}") from None


def default_flags(source: Source) -> tuple[str, ...]:
    """The default flags of :func:`obtain`, the same for every source."""
    return compile_flags(find_compiler())


def command_lines(
    compiler: Compiler,
    source: Source,
    flags: tuple[str, ...],
    include: Path,
    object_files: Sequence[str] = (),
) -> tuple[list[list[str]], list[str]]:
    """The commands that build the library, to run in the entry's folder.

    Args:
        compiler: compiler to call.
        source: source files of the library.
        flags: compiler flags beyond the standard ones.
        include: folder of the runtime's headers.
        object_files: further object files to link, the main file's among them if there are units.

    Returns:
        Commands that compile the units and can run at the same time, and the one that links their
        output, and compiles the main file where there are no units.
    """
    common = [*compiler.command, *BASE_FLAGS, *flags]
    if not source.units:
        return [], [*common, "-I", str(include), source.main, *object_files, "-o", LIBRARY]
    unit_objects = [f"{Path(file).stem}.o" for file in source.units]
    parts = [
        object_command(compiler, unit, flags, include, to)
        for unit, to in zip(source.units, unit_objects, strict=True)
    ]
    return parts, [*common, *object_files, *unit_objects, "-o", LIBRARY]


def object_command(
    compiler: Compiler, file: str, flags: tuple[str, ...], include: Path, to: str
) -> list[str]:
    """The command that compiles one file, with ``FAN_APART`` defined, to an object file."""
    alone = [flag for flag in (*BASE_FLAGS, *flags) if flag != "-shared"]
    return [*compiler.command, *alone, APART, "-I", str(include), "-c", file, "-o", to]


class Compilers:
    """Context in which compilers run, as many at a time as there are processors.

    If it is left by an exception, those that still run are killed.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(os.cpu_count())
        self._together = _Together()
        self._futures: list[Future[None]] = []

    def __enter__(self) -> Compilers:
        return self

    def __exit__(self, kind: object, error: object, traceback: object) -> None:
        if error is not None:
            self._together.end()
            for future in self._futures:
                future.cancel()
        self._pool.shutdown()

    def start(self, command: list[str], folder: Path, seconds: float = COMPILE_SECONDS) -> None:
        """Starts a compiler, or lets it wait for a processor; see :func:`run_compiler`."""
        arguments = command, folder, seconds, self._together
        self._futures.append(self._pool.submit(run_compiler, *arguments))

    def wait(self) -> None:
        """Waits for all compilers.

        Raises:
            BuildError, DiskError: one failed.
        """
        for future in as_completed(self._futures):
            future.result()


class _Together:
    """Compilers that run at the same time and are killed together."""

    def __init__(self) -> None:
        self._ended = threading.Event()
        self._running: set[subprocess.Popen[str]] = set()

    def add(self, process: subprocess.Popen[str]) -> None:
        """Adds a process; kills it immediately if the others have been killed."""
        self._running.add(process)
        if self._ended.is_set():
            _kill(process)

    def discard(self, process: subprocess.Popen[str]) -> None:
        """Removes a process that has ended."""
        self._running.discard(process)

    def end(self) -> None:
        """Kills the processes, and any that is added from now on."""
        self._ended.set()
        for process in self._running.copy():
            _kill(process)


def run_compiler(
    command: list[str],
    folder: Path,
    seconds: float = COMPILE_SECONDS,
    together: _Together | None = None,
) -> None:
    """Runs a compiler in a folder and waits for it.

    Args:
        command: program and arguments; the last one is the output file.
        folder: working folder, to which names in the command are relative.
        seconds: time limit [s].
        together: compilers that run at the same time.

    Raises:
        BuildError: the compiler failed, or exceeded the time limit.
        DiskError: the compiler could not write its output.
    """
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            # Temporary files are in the same folder, so that they are on the same disk.
            env={**os.environ, **_ENGLISH, "TMPDIR": str(folder)},
            start_new_session=True,
        )
    except OSError as error:
        raise BuildError(f"the compiler {command[0]!r} does not start: {error}") from error
    together = together or _Together()
    together.add(process)
    try:
        output, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        _end(process)
        raise BuildError(
            f"the compiler was stopped after {seconds:g} s; the command was\n"
            f"  {shlex.join(command)}"
        ) from None
    except BaseException:
        _end(process)
        raise
    finally:
        together.discard(process)
    if process.returncode == 0:
        if not (folder / command[-1]).is_file():
            raise BuildError(f"{command[0]} reports success and has not written {command[-1]}")
        return
    if any(sign in output for sign in _FULL):
        raise DiskError(next(line for line in output.splitlines() if any(s in line for s in _FULL)))
    lines = output.strip().splitlines()
    listed_lines = "\n".join(f"  {line}" for line in lines[:20]) or "  (it printed nothing)"
    omitted_text = f"\n  ... and {len(lines) - 20} lines more" if len(lines) > 20 else ""
    raise BuildError(
        f"the compiler failed with exit code {process.returncode}; the command was\n"
        f"  {shlex.join(command)}\nand it said\n{listed_lines}{omitted_text}"
    )


def _end(process: subprocess.Popen[str]) -> None:
    """Ends a compiler and waits for it."""
    _kill(process)
    process.communicate()


def _kill(process: subprocess.Popen[str]) -> None:
    """Kills a compiler and the programs it started, which would outlive it."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
