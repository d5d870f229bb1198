"""A puppet, a motion or a plan in the browser; viser is loaded by the first call.

``show`` opens a page on this machine. A puppet is alive there and its strings are held by whoever
looks at it; a motion and a plan are played back, or written as one file that plays from disk.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from fantoccini.marionette import Marionette
    from fantoccini.motion import Trajectory
    from fantoccini.perform import Recording
    from fantoccini.planning import PlanResult
    from fantoccini.puppet import Puppet
    from fantoccini.web.page import Page
    from fantoccini.world import World

__all__ = ["show"]


def show(
    what: str | Path | Marionette | Puppet | World | Trajectory | Recording | PlanResult,
    *,
    html: str | os.PathLike | None = None,
    theme: Literal["light", "dark"] = "light",
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
    wait: bool | None = None,
    record_to: str | os.PathLike = ".",
) -> Page | Path:
    """Shows something in the browser.

    Args:
        what: a puppet (its file, a bundled name, a handle) to play with; a trajectory or recording
            (an object, or its npz file) to play back; a plan.
        html: instead of a page, writes the motion as one file that plays from disk.
        theme: ``light`` or ``dark``.
        host: address to listen on; anything but this machine's own lets others in.
        port: first port to try.
        browser: open the page, where there is a display.
        wait: stay until Ctrl-C; by default where Python does not wait for a person anyway.
        record_to: folder for recordings.

    Returns:
        The page, to close it; with ``html`` the path of the file.

    Raises:
        FileError: a file is none that can be shown, with what is wrong; or there is no folder
            ``record_to``.
        ValueError: what is given cannot be shown, or not as a file.
    """
    from fantoccini.web import page

    subject = page.subject_of(what)
    if html is not None:
        return page.write(subject, html, theme)
    opened = page.open_page(subject, theme, host, port, Path(record_to))
    if browser:
        opened.server.open_browser()
    if page.waits() if wait is None else wait:
        opened.wait()
    return opened
