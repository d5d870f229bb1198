"""Browser pages, and the puppets, motions and plans that they show.

A subject is the puppet, motion or plan that a page shows; a live puppet follows the hands of
viewers, a motion is replayed.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from fantoccini.app.live import MIDI_SCRIPT, PAD_SCRIPT, SOUND_SCRIPT, Live
from fantoccini.app.pages import PlanTree, Replay, ResampledRun, Server, write_html
from fantoccini.base import FantocciniError, FileError, Mistake, OnProgress, npz
from fantoccini.control.planning import PlanResult
from fantoccini.control.problems import load_problem
from fantoccini.control.tasks import problem_names, task_names
from fantoccini.dynamics.marionette import Marionette, load
from fantoccini.model.puppet import Puppet, bundled_files
from fantoccini.model.scene import Scene
from fantoccini.motion import Trajectory
from fantoccini.output.view import theme_of
from fantoccini.theatre.perform import Address, LivePlay, Osc, Performance, Recording


@dataclass(frozen=True, eq=False)
class Subject:
    """Puppet, motion or plan that a page shows.

    Attributes:
        marionette: the puppet, with its obstacles.
        run: its motion; None for a live puppet.
        tree: search tree of the plan that led to the motion, or None.
        file: the puppet's file, which is loaded again when it changes; or None.
    """

    marionette: Marionette
    run: Trajectory | None = None
    tree: PlanTree | None = None
    file: Path | None = None


class Page:
    """An open page.

    Attributes:
        server: server of the page.
        view: the live puppet or the replay that the page shows.
    """

    def __init__(self, server: Server, view: Live | Replay):
        self.server, self.view = server, view
        self._closed = threading.Event()
        atexit.register(self.close)

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
    def recording_status(self) -> str:
        """Message about the last recording; empty without one."""
        return self.view.recorder.status if isinstance(self.view, Live) else ""

    @property
    def changes(self) -> tuple[str, ...]:
        """Deviations from the score or the play, with file and line."""
        if not isinstance(self.view, Live):
            return ()
        stage = self.view.stage
        script = stage.score if stage.live_play is None else stage.live_play.play
        return () if script is None else tuple(map(str, script.changes))

    @property
    def osc(self) -> Osc | None:
        """OSC connection of a live play, or None."""
        return self.view.stage.osc if isinstance(self.view, Live) else None

    def wait(self) -> None:
        """Blocks until Ctrl-C, then closes the page; SIGHUP and SIGTERM also end Python."""
        with _exit_on_signals():
            try:
                while not self._closed.wait(0.5):
                    pass
            except KeyboardInterrupt:
                pass
            finally:
                self.close()

    def close(self) -> None:
        """Closes the page, after writing a running recording."""
        if not self._closed.is_set():
            self._closed.set()
            atexit.unregister(self.close)
            self.view.stop()


@contextlib.contextmanager
def _exit_on_signals() -> Iterator[None]:
    """Context in which SIGTERM and SIGHUP raise SystemExit, unless handled elsewhere."""

    def raise_exit(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    in_main_thread = threading.current_thread() is threading.main_thread()
    signals = [getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")]
    unhandled_signals = [
        s for s in signals if in_main_thread and s and signal.getsignal(s) is signal.SIG_DFL
    ]
    for number in unhandled_signals:
        signal.signal(number, raise_exit)
    try:
        yield
    finally:
        for number in unhandled_signals:
            signal.signal(number, signal.SIG_DFL)


def subject_of(
    source: Any, problem: str | Path | None = None, progress: OnProgress | None = None
) -> Subject:
    """Subject of a page, from an argument of :func:`fantoccini.app.show`.

    Args:
        source: puppet, motion or plan, or a file with one of them.
        problem: problem file of a plan whose problem is not bundled.
        progress: callback with the name of each long step.

    Raises:
        FileError: the file cannot be shown.
        ValueError: ``source`` cannot be shown.
    """
    if isinstance(source, str | os.PathLike):
        return _subject_of_file(os.fspath(source), problem, progress)
    if isinstance(source, Puppet | Scene):
        return Subject(Marionette(source, progress))
    if isinstance(source, Marionette):
        return Subject(source)
    if isinstance(source, Recording):
        return Subject(source.marionette, source.trajectory)
    if isinstance(source, Trajectory):
        return Subject(_puppet_of(source, progress), source)
    if isinstance(source, PlanResult):
        if source.reason:
            raise ValueError(f"there is no plan to show: {source.reason}")
        return Subject(
            source.problem.drawn_marionette, source.trajectory, PlanTree.from_plan(source)
        )
    raise ValueError(
        f"found {type(source).__name__}; needed: a puppet, a trajectory, a recording, a plan, or a "
        "file with one of them"
    )


def _puppet_of(run: Trajectory, progress: OnProgress | None) -> Marionette:
    """Puppet of a trajectory."""
    if run.puppet is None:
        raise ValueError("the trajectory has no puppet, so it cannot be shown")
    return Marionette(run.puppet, progress)


def _subject_of_file(name: str, problem: str | Path | None, progress: OnProgress | None) -> Subject:
    path = Path(name)
    if path.suffix.lower() == ".npz":
        file_format, description = npz_format(path)
        if file_format.startswith("fantoccini.plan."):
            return subject_of(_load_plan(path, description, problem, progress), progress=progress)
        _check_no_problem(path, problem)
        if file_format.startswith("fantoccini.recording."):
            return subject_of(Recording.load(path), progress=progress)
        try:
            return subject_of(Trajectory.load(path), progress=progress)
        except ValueError as error:
            raise FileError([Mistake(str(path), None, "", str(error))]) from None
    _check_no_problem(path, problem)
    if not os.path.exists(path) and name in (*bundled_files.names(), *bundled_files.scenes()):
        path = bundled_files.path(name)
    return Subject(load(path, progress), file=path)


def _check_no_problem(path: Path, problem: str | Path | None) -> None:
    """Raises FileError if a problem file is given without a plan."""
    if problem is not None:
        message = f"is not a plan; a problem file ({problem}) is for plans only"
        raise FileError([Mistake(str(path), None, "", message)])


def npz_format(path: Path) -> tuple[str, dict[str, Any]]:
    """Format and description in an npz file; empty if it has none."""
    try:
        description = npz.about_of(npz.read(path, array_name=npz.ABOUT))
        return str(description["format"]), description
    except npz.UNREADABLE:
        return "", {}


def _load_plan(
    path: Path, description: dict[str, Any], problem: str | Path | None, progress: OnProgress | None
) -> PlanResult:
    if problem is None:
        problem = str(description.get("problem", ""))
        if problem not in (*problem_names(), *task_names()):
            message = (
                f"is a plan of {problem!r}, which is not a bundled problem; give its problem file "
                "(--problem FILE)"
            )
            raise FileError([Mistake(str(path), None, "", message)])
    return PlanResult.load(path, load_problem(problem, progress=progress))


def write_page(
    subject: Subject,
    path: str | os.PathLike[str],
    theme: str,
    progress: OnProgress | None = None,
    forces: bool = False,
) -> Path:
    """Writes a motion as a page in one file, with or without the forces of its contacts.

    Raises:
        ValueError: there is no motion to write, or there are no forces to draw.
    """
    if subject.run is None:
        raise ValueError("a live puppet cannot be written as a file; a motion can")
    return write_html(
        subject.marionette, subject.run, path, theme_of(theme), subject.tree, progress, forces
    )


def open_page(
    subject: Subject,
    theme: str,
    host: str,
    port: int,
    record_to: Path = Path("."),
    balance: bool = False,
    score: Path | None = None,
) -> Page:
    """Serves a page with a subject.

    Args:
        subject: subject to show.
        theme: ``light`` or ``dark``.
        host: address to listen on.
        port: first port to try.
        record_to: folder for recordings.
        balance: whether the hands move so that a live puppet keeps its balance.
        score: file of a score that a live puppet plays, or None.

    Raises:
        StateError: the hands cannot balance this puppet.
        FileError: there is no such folder for recordings, or the score has mistakes.
        ServerError: the address cannot be used.
    """
    page_theme = theme_of(theme)
    _check_folder(record_to)
    title = subject.marionette.name
    if subject.run is not None:
        motion = ResampledRun.from_run(subject.marionette, subject.run)
        server = Server(title, page_theme, host, port)
        view: Live | Replay = Replay(server, motion, page_theme, subject.tree)
    else:
        performance = Performance(subject.marionette)
        live = Live(performance, page_theme, record_to.absolute(), subject.file, score)
        server = Server(title, page_theme, host, port, PAD_SCRIPT + SOUND_SCRIPT, live.handlers)
        live.open(server)
        if balance:
            try:
                live.set_balance(True)
            except FantocciniError:
                server.stop()
                raise
        view = live
    view.start()
    return Page(server, view)


def _check_folder(record_to: Path) -> None:
    """Raises FileError if the folder for recordings does not exist."""
    if not os.path.isdir(record_to):
        message = "there is no such folder for recordings"
        raise FileError([Mistake(str(record_to), None, "", message)])


def open_live_play(
    live_play: LivePlay,
    theme: str,
    host: str,
    port: int,
    record_to: Path = Path("."),
    receive_at: Address | None = None,
    send_to: Address | None = None,
) -> Page:
    """Serves a page on which a play is performed.

    Args:
        live_play: the play.
        theme, host, port, record_to: see :func:`open_page`.
        receive_at: address that receives OSC messages, or None.
        send_to: address to which OSC messages are sent, or None.

    Raises:
        FileError: there is no such folder for recordings.
        MissingLibraryError: python-osc is not installed.
        StateError: an address for messages cannot be used.
        ServerError: the address of the page cannot be used.
    """
    page_theme = theme_of(theme)
    _check_folder(record_to)
    live = Live(live_play.performance, page_theme, record_to.absolute(), live_play=live_play)

    def run_and_send_state(action: Callable[[], None]) -> None:
        action()
        live.stage.sounds.changed()

    if receive_at is not None or send_to is not None:
        live.stage.osc = Osc(
            live_play,
            receive_at,
            send_to,
            lambda action: live.enqueue(None, partial(run_and_send_state, action)),
        )
    script = PAD_SCRIPT + SOUND_SCRIPT + MIDI_SCRIPT
    try:
        server = Server(live_play.play.name, page_theme, host, port, script, live.handlers)
    except FantocciniError:
        if live.stage.osc is not None:
            live.stage.osc.stop()
        raise
    live.open(server)
    live.start()
    return Page(server, live)


def is_script() -> bool:
    """Whether Python runs a script, which closes pages at its end; not a prompt or notebook."""
    return not (hasattr(sys, "ps1") or sys.flags.interactive or "ipykernel" in sys.modules)
