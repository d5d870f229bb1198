"""What can be shown, and the page that shows it."""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini import puppets
from fantoccini.errors import FileError, Problem
from fantoccini.marionette import Marionette, load
from fantoccini.motion import Trajectory
from fantoccini.motion.archive import UNREADABLE
from fantoccini.perform import Performance, Recording
from fantoccini.plan import PlanResult, load_problem, problem_names
from fantoccini.puppet import Puppet
from fantoccini.show.export import write_html
from fantoccini.show.live import Live
from fantoccini.show.replay import Film, Replay
from fantoccini.show.server import Server
from fantoccini.show.tree import Growth
from fantoccini.view.theme import theme_of
from fantoccini.world import World


@dataclass(frozen=True, eq=False)
class Subject:
    """What is to be shown.

    Attributes:
        marionette: the puppet, among all that stands about it.
        run: its motion, or None for one to play with.
        growth: tree of the plan that the motion comes from, or None.
        file: the puppet's file, which is read again when it is saved; or None.
    """

    marionette: Marionette
    run: Trajectory | None = None
    growth: Growth | None = None
    file: Path | None = None


class Page:
    """An open page.

    Attributes:
        server: serves it.
        show: the :class:`Live` or :class:`Replay` that it shows.
    """

    def __init__(self, server: Server, show: Live | Replay):
        self.server, self.show = server, show
        self._closed = threading.Event()

    def __repr__(self) -> str:
        return f"<Page {self.url}>"

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Address of the page."""
        return self.server.url

    @property
    def said(self) -> str:
        """What became of the last recording; empty where there was none."""
        return self.show.take_said if isinstance(self.show, Live) else ""

    def wait(self) -> None:
        """Stays until Ctrl-C, then closes the page."""
        try:
            while not self._closed.wait(0.5):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """Ends the page; a recording that goes on is written first."""
        if not self._closed.is_set():
            self._closed.set()
            self.show.stop()


def subject_of(
    what: Any, problem: str | Path | None = None, progress: Callable[[str], None] | None = None
) -> Subject:
    """What an argument of :func:`fantoccini.show` is.

    Args:
        what: puppet, motion, plan, or the file of one.
        problem: of a plan's file, where it is no bundled one.
        progress: told what takes long while it happens.

    Raises:
        FileError: a file is none that can be shown.
        ValueError: what is given cannot be shown.
    """
    if isinstance(what, str | os.PathLike):
        return _of_file(os.fspath(what), problem, progress)
    if isinstance(what, Puppet | World):
        return Subject(Marionette(what, progress))
    if isinstance(what, Marionette):
        return Subject(what)
    if isinstance(what, Recording):
        what = what.trajectory
    if isinstance(what, Trajectory):
        if what.puppet is None:
            raise ValueError("the trajectory does not know its puppet, and cannot be shown")
        return Subject(Marionette(what.puppet, progress), what)
    if isinstance(what, PlanResult):
        if what.reason:
            raise ValueError(f"there is no plan to show: {what.reason}")
        return Subject(what.problem.stage, what.trajectory, Growth.of(what))
    raise ValueError(
        f"found {type(what).__name__}; what can be shown is a puppet, a trajectory, a recording, "
        "a plan, or the file of one"
    )


def _of_file(
    name: str, problem: str | Path | None, progress: Callable[[str], None] | None
) -> Subject:
    path = Path(name)
    if path.suffix.lower() == ".npz":
        form, about = _form(path)
        if form.startswith("fantoccini.plan."):
            return subject_of(_plan(path, about, problem, progress), progress=progress)
        if form.startswith("fantoccini.recording."):
            return subject_of(Recording.load(path), progress=progress)
        return subject_of(Trajectory.load(path), progress=progress)
    if not path.exists() and name in puppets.names():
        path = puppets.path(name)
    return Subject(load(path, progress), file=path)


def _form(path: Path) -> tuple[str, dict]:
    """What kind of npz file this is, and what it says of itself; empty where it says nothing."""
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            about = json.loads(file["about"].tobytes())
            return str(about["format"]), about
    except (*UNREADABLE, LookupError, TypeError, AttributeError):
        return "", {}


def _plan(
    path: Path, about: dict, problem: str | Path | None, progress: Callable[[str], None] | None
) -> PlanResult:
    if problem is None:
        problem = str(about.get("problem", ""))
        if problem not in problem_names():
            message = (
                f"is a plan of {problem!r}, which is no bundled problem; its problem file is "
                "needed as well (--problem FILE)"
            )
            raise FileError([Problem(str(path), None, "", message)])
    return PlanResult.load(path, load_problem(problem, progress=progress))


def write(
    subject: Subject,
    path: str | os.PathLike,
    theme: str,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Writes a motion as one file.

    Raises:
        ValueError: there is no motion to write.
    """
    if subject.run is None:
        raise ValueError("a puppet that is alive cannot be written as a file; a motion can")
    return write_html(
        subject.marionette, subject.run, path, theme_of(theme), subject.growth, progress=progress
    )


def open_page(
    subject: Subject, theme: str, host: str, port: int, record_to: Path = Path(".")
) -> Page:
    """Serves a page.

    Args:
        subject: what it shows.
        theme: ``light`` or ``dark``.
        host: address to listen on.
        port: first port to try.
        record_to: folder for recordings.

    Raises:
        ServerError: nothing can be served there.
    """
    look = theme_of(theme)
    title = subject.marionette.name
    if subject.run is not None:
        film = Film.of(subject.marionette, subject.run)
        server = Server(title, look, host, port)
        shown: Live | Replay = Replay(server, film, look, subject.growth)
    else:
        performance = Performance(subject.marionette)
        live = Live(performance, look, record_to, subject.file)
        server = Server(title, look, host, port, live.script, live.visitors)
        live.open(server)
        shown = live
    shown.start()
    return Page(server, shown)


def waits() -> bool:
    """Whether a page would vanish at once if nobody waited: in a script, not at a prompt."""
    return not (hasattr(sys, "ps1") or sys.flags.interactive or "ipykernel" in sys.modules)
