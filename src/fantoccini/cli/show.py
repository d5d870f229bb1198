"""``fantoccini show``: a puppet to play with, a motion or a plan to look at, in the browser."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.cli.files import check_folder, check_output, fail, puppet_path
from fantoccini.cli.terminal import Steps, say, write
from fantoccini.planning import PlanResult

if TYPE_CHECKING:
    from fantoccini.web.page import Page


@dataclass(frozen=True)
class Request:
    """What was asked for on the command line; see ``fantoccini show --help``."""

    file: str
    html: Path | None = None
    theme: str = "light"
    host: str = "127.0.0.1"
    port: int = 8080
    browser: bool = True
    record_to: Path = Path(".")
    problem: str | None = None
    quiet: bool = False


def show_file(request: Request) -> None:
    """Shows a file until Ctrl-C, or writes it as a page."""
    if request.html is not None:
        check_output(request.html, (".html",), "--html")
    check_folder(request.record_to, "--record-to")
    # Names of npz files are read as they are; all else is a puppet's file or a bundled name.
    name = request.file
    if not name.lower().endswith(".npz"):
        name = str(puppet_path(name))
        if request.html is not None:
            fail("a puppet that is alive cannot be written as a file; a run (.npz) can", "--html")
    from fantoccini.web.page import open_page, subject_of, write as write_motion

    with Steps(request.quiet) as steps:
        subject = subject_of(name, request.problem, steps.step)
        if request.html is not None:
            done = steps.bar(f"writing {request.html}", 1.0)
            write_motion(subject, request.html, request.theme, done)
            return
        steps.step("opening the page")
        page = open_page(subject, request.theme, request.host, request.port, request.record_to)
    _serve(page, request)


def show_plan(found: PlanResult, quiet: bool) -> None:
    """Shows a plan until Ctrl-C.

    Args:
        found: the plan.
        quiet: say nothing but the address.
    """
    from fantoccini.web.page import open_page, subject_of

    request = Request(file=found.problem.name, quiet=quiet)
    subject = subject_of(found)
    _serve(open_page(subject, request.theme, request.host, request.port), request)


def _serve(page: Page, request: Request) -> None:
    """Says where the page is, and stays until Ctrl-C, which is how a page is closed."""
    try:
        with page, contextlib.suppress(KeyboardInterrupt):
            _announce(page, request)
            if request.browser:
                page.server.open_browser()
            page.wait()
    finally:
        if page.recording_status and not request.quiet:
            say(page.recording_status)


def _announce(page: Page, request: Request) -> None:
    server = page.server
    if server.moved:
        say(f"port {request.port} is in use; the page is on port {server.port}")
    if server.exposed:
        say(
            f"--host {request.host}: everybody who can reach this machine on port {server.port} "
            "sees the page, can move the puppet and record into "
            f"{request.record_to.absolute()}; there is no password"
        )
    write(page.url)
    if not request.quiet:
        say("Ctrl-C ends")
