"""``fantoccini show``: play a puppet, or replay a run or a plan, in the browser."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from fantoccini.app.console import (
    PageOptions,
    ShowRequest,
    Steps,
    check_folder,
    check_output,
    fail,
    puppet_path,
    say,
    write,
)
from fantoccini.control.planning import PlanResult
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory

if TYPE_CHECKING:
    from fantoccini.app.web import Page


def show_file(request: ShowRequest) -> None:
    """Shows a file until Ctrl-C, or writes it as a page."""
    if request.html is not None:
        check_output(request.html, (".html",), "--html")
    elif request.forces:
        fail("applies to --html PATH; a page has a box that shows them", "--forces")
    check_folder(request.record_to, "--record-to")
    name = request.file
    if not name.lower().endswith(".npz"):
        name = str(puppet_path(name))
        if request.html is not None:
            fail("applies to runs (.npz) only; a live puppet cannot be written to a file", "--html")
    from fantoccini.app.web import open_page, subject_of, write as write_motion

    with Steps(request.quiet) as steps:
        subject = subject_of(name, request.problem, steps.named)
        if request.html is not None:
            if request.forces and subject.run is not None and subject.run.contact is None:
                fail("this motion has no contact, so that there are no forces to draw", "--forces")
            done = steps.bar(f"writing {request.html}")
            write_motion(subject, request.html, request.theme.value, done, request.forces)
            return
        if request.balance and subject.run is not None:
            fail("applies to a live puppet, not to a motion", "--balance")
        if request.score is not None and subject.run is not None:
            fail("applies to a live puppet, not to a motion", "--score")
        steps.step("opening the page")
        theme, folder = request.theme.value, request.record_to
        page = open_page(
            subject, theme, request.host, request.port, folder, request.balance, request.score
        )
    serve(page, request)


def show_plan(found: PlanResult, quiet: bool) -> None:
    """Shows a plan until Ctrl-C.

    Args:
        found: the plan.
        quiet: print only the address.
    """
    from fantoccini.app.web import open_page, subject_of

    request = ShowRequest(file=found.problem.name, quiet=quiet)
    subject = subject_of(found)
    serve(open_page(subject, request.theme.value, request.host, request.port), request)


def show_run(marionette: Marionette, run: Trajectory, quiet: bool) -> None:
    """Shows a run until Ctrl-C.

    Args:
        marionette: the puppet.
        run: its motion.
        quiet: print only the address.
    """
    from fantoccini.app.web import Subject, open_page

    request = ShowRequest(file=marionette.name, quiet=quiet)
    page = open_page(Subject(marionette, run), request.theme.value, request.host, request.port)
    serve(page, request)


def serve(page: Page, request: PageOptions) -> None:
    """Prints the address and serves the page until Ctrl-C."""
    try:
        with page, contextlib.suppress(KeyboardInterrupt):
            _announce(page, request)
            if not request.no_browser:
                page.server.open_browser()
            page.wait()
    finally:
        if page.recording_status and not request.quiet:
            say(page.recording_status)


def _announce(page: Page, request: PageOptions) -> None:
    server = page.server
    if server.moved:
        say(f"port {request.port} is in use; the page is on port {server.port}")
    if server.exposed:
        say(
            f"--host {request.host}: anyone who can reach port {server.port} of this machine can "
            "see the page, move the puppet and write recordings to "
            f"{request.record_to.absolute()}; there is no password"
        )
    for change in page.changes:
        say(change)
    write(page.url)
    if not request.quiet:
        say("press Ctrl-C to stop")
