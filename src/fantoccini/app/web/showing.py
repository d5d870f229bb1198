"""A puppet, a motion or a plan in the browser; the first call imports viser.

``show`` opens a page on this machine. A puppet is live there, and every viewer can move its
strings; a motion or a plan is replayed, or written as one file that plays from disk.

A live puppet is simulated while it is shown, and its strings follow the hands of the viewers.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias, overload

if TYPE_CHECKING:
    from fantoccini.app.web.page import Page
    from fantoccini.control.planning import PlanResult
    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.model.puppet import Puppet
    from fantoccini.model.scene import Scene
    from fantoccini.motion import Trajectory
    from fantoccini.theatre.perform import Recording

    Showable: TypeAlias = (
        str | Path | Marionette | Puppet | Scene | Trajectory | Recording | PlanResult
    )


@overload
def show(
    what: Showable,
    *,
    html: None = None,
    theme: Literal["light", "dark"] = "light",
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
    wait: bool | None = None,
    record_to: str | os.PathLike[str] = ".",
    balance: bool = False,
    score: str | os.PathLike[str] | None = None,
) -> Page: ...


@overload
def show(
    what: Showable,
    *,
    html: str | os.PathLike[str],
    theme: Literal["light", "dark"] = "light",
    forces: bool = False,
) -> Path: ...


def show(
    what: Showable,
    *,
    html: str | os.PathLike[str] | None = None,
    theme: Literal["light", "dark"] = "light",
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
    wait: bool | None = None,
    record_to: str | os.PathLike[str] = ".",
    forces: bool = False,
    balance: bool = False,
    score: str | os.PathLike[str] | None = None,
) -> Page | Path:
    """Shows something in the browser.

    Args:
        what: a puppet (its file, a bundled name, a Marionette) to show live; a trajectory, a
            recording or a plan (an object, or its npz file) to replay.
        html: file to write the motion to, as a page that plays from disk; opens no page.
        theme: ``light`` or ``dark``.
        host: address to listen on; other machines can connect if it is not local.
        port: first port to try.
        browser: open the page, if there is a display.
        wait: block until Ctrl-C; by default in scripts, and not at a prompt or in a notebook.
        record_to: folder for recordings, gestures and films.
        forces: whether ``html`` draws the forces of contacts; a live page has a box for them.
        balance: balance a live puppet by motions of the hands; a box on the page switches it.
        score: file of a score that a live puppet plays.

    Returns:
        The open page; with ``html`` the path of the file.

    Raises:
        FileError: the file cannot be shown, the score has mistakes, or there is no folder
            ``record_to``.
        ValueError: ``what`` cannot be shown, or not as a file; there are no forces to draw; or
            there is nothing to balance.
        StateError: the hands cannot balance this puppet.
    """
    from fantoccini.app.web import page

    subject = page.subject_of(what)
    if html is not None:
        return page.write_page(subject, html, theme, forces=forces)
    if forces:
        raise ValueError("forces needs html=FILE; on a page, a box shows them")
    if balance and subject.run is not None:
        raise ValueError("balance applies to a live puppet, not to a motion")
    if score is not None and subject.run is not None:
        raise ValueError("score applies to a live puppet, not to a motion")
    score = None if score is None else Path(score)
    opened_page = page.open_page(subject, theme, host, port, Path(record_to), balance, score)
    if browser:
        opened_page.server.open_browser()
    if page.is_script() if wait is None else wait:
        opened_page.wait()
    return opened_page
