"""``fantoccini perform``: a play, live in the browser."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from fantoccini.app.cli.show import serve
from fantoccini.app.console import PerformRequest, Steps, check_folder, fail, say
from fantoccini.base import FileError, Mistake

if TYPE_CHECKING:
    from fantoccini.theatre.perform import Address


def perform_play(request: PerformRequest) -> None:
    """Compiles a play and performs it until Ctrl-C."""
    check_folder(request.record_to, "--record-to")
    hear = address_of(request.osc_in, "--osc-in")
    send = address_to(request.osc_out, "--osc-out")
    if hear is not None and hear == send:
        fail(f"found {hear} for --osc-in as well; needed: two addresses", "--osc-out")
    from fantoccini.app.web import open_show
    from fantoccini.theatre.perform import LivePlay
    from fantoccini.theatre.plays import load_play
    from fantoccini.theatre.script import is_play

    if os.path.isfile(request.file) and not is_play(request.file):
        message = "is no play; needed: YAML with the key `play`"
        raise FileError([Mistake(str(request.file), None, "", message)])
    with Steps(request.quiet) as steps:
        steps.step(f"compiling {request.file}")
        show = LivePlay(load_play(request.file))
        steps.step("opening the page")
        page = open_show(
            show, request.theme.value, request.host, request.port, request.record_to, hear, send
        )
    osc = page.osc
    if osc is not None and not request.quiet:
        if osc.heard_at is not None:
            say(f"OSC messages are heard at {osc.heard_at}")
        if send is not None:
            say(f"OSC messages are sent to {send}")
    serve(page, request)


def address_of(given: str | None, option: str) -> Address | None:
    """The address in an option's text; a mistake where it is none."""
    if given is None:
        return None
    from fantoccini.theatre.perform import Address

    try:
        return Address.of(given)
    except ValueError as error:
        fail(str(error), option)


def address_to(given: str | None, option: str) -> Address | None:
    """As :func:`address_of`, of what something is sent to: port 0 is a mistake."""
    found = address_of(given, option)
    if found is not None and found.port == 0:
        fail(f"found port 0 in {given!r}; needed: 1 to 65535", option)
    return found
