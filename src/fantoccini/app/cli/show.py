"""``fantoccini show``: shows a live puppet, or replays a run or a plan, in the browser."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from fantoccini.app.cli_support import (
    PageOptions,
    ProgressDisplay,
    ShowArguments,
    check_folder,
    check_output,
    fail,
    print_message,
    print_output,
    puppet_path,
)
from fantoccini.control.planning import PlanResult
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory

if TYPE_CHECKING:
    from fantoccini.app.web import Page


def show_file(arguments: ShowArguments) -> None:
    """Shows a file until Ctrl-C, or writes it as a page."""
    if arguments.html is not None:
        check_output(arguments.html, (".html",), "--html")
    elif arguments.forces:
        fail("applies to --html PATH; on the page, a box shows them", "--forces")
    check_folder(arguments.record_to, "--record-to")
    name = arguments.file
    if not name.lower().endswith(".npz"):
        name = str(puppet_path(name))
        if arguments.html is not None:
            fail("applies to runs (.npz) only; a live puppet cannot be written to a file", "--html")
    from fantoccini.app.web import open_page, subject_of, write_page

    with ProgressDisplay(arguments.quiet) as display:
        subject = subject_of(name, arguments.problem, display.update)
        if arguments.html is not None:
            if arguments.forces and subject.run is not None and subject.run.contact is None:
                fail("this motion has no contacts, so there are no forces to draw", "--forces")
            progress = display.bar(f"writing {arguments.html}")
            write_page(subject, arguments.html, arguments.theme.value, progress, arguments.forces)
            return
        if arguments.balance and subject.run is not None:
            fail("applies to a live puppet, not to a motion", "--balance")
        if arguments.score is not None and subject.run is not None:
            fail("applies to a live puppet, not to a motion", "--score")
        display.stage("opening the page")
        theme, folder = arguments.theme.value, arguments.record_to
        page = open_page(
            subject,
            theme,
            arguments.host,
            arguments.port,
            folder,
            arguments.balance,
            arguments.score,
        )
    serve(page, arguments)


def show_plan(plan: PlanResult, quiet: bool) -> None:
    """Shows a plan until Ctrl-C.

    Args:
        plan: the plan.
        quiet: print only the address.
    """
    from fantoccini.app.web import open_page, subject_of

    arguments = ShowArguments(file=plan.problem.name, quiet=quiet)
    subject = subject_of(plan)
    serve(open_page(subject, arguments.theme.value, arguments.host, arguments.port), arguments)


def show_run(marionette: Marionette, run: Trajectory, quiet: bool) -> None:
    """Shows a run until Ctrl-C.

    Args:
        marionette: the puppet.
        run: its motion.
        quiet: print only the address.
    """
    from fantoccini.app.web import Subject, open_page

    arguments = ShowArguments(file=marionette.name, quiet=quiet)
    page = open_page(
        Subject(marionette, run), arguments.theme.value, arguments.host, arguments.port
    )
    serve(page, arguments)


def serve(page: Page, arguments: PageOptions) -> None:
    """Prints the address and serves the page until Ctrl-C."""
    try:
        with page, contextlib.suppress(KeyboardInterrupt):
            _announce(page, arguments)
            if not arguments.no_browser:
                page.server.open_browser()
            page.wait()
    finally:
        if page.recording_status and not arguments.quiet:
            print_message(page.recording_status)


def _announce(page: Page, arguments: PageOptions) -> None:
    server = page.server
    if server.port_changed:
        print_message(f"port {arguments.port} is in use; the page is on port {server.port}")
    if server.exposed:
        print_message(
            f"--host {arguments.host}: anyone who can reach port {server.port} of this machine can "
            "see the page, move the puppet and write recordings to "
            f"{arguments.record_to.absolute()}; there is no password"
        )
    for change in page.changes:
        print_message(change)
    print_output(page.url)
    if not arguments.quiet:
        print_message("press Ctrl-C to stop")
