"""``fantoccini perform``: performs a play live in the browser.

A cue is a line of the play: a verb with its player and time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fantoccini.app.cli.show import serve
from fantoccini.app.cli_support import (
    PerformArguments,
    ProgressDisplay,
    check_folder,
    fail,
    print_message,
)
from fantoccini.base import FileError, Mistake

if TYPE_CHECKING:
    from fantoccini.theatre.perform import Address


def perform_play(arguments: PerformArguments) -> None:
    """Compiles a play and performs it until Ctrl-C."""
    check_folder(arguments.record_to, "--record-to")
    receive_at = address_of(arguments.osc_in, "--osc-in")
    send_to = target_address(arguments.osc_out, "--osc-out")
    if receive_at is not None and receive_at == send_to:
        fail(f"found {receive_at}, which is also --osc-in; needed: another address", "--osc-out")
    from fantoccini.app.web import open_live_play
    from fantoccini.theatre.perform import LivePlay
    from fantoccini.theatre.plays import load_play, play_path
    from fantoccini.theatre.script import is_play

    if not is_play(play_path(arguments.file)):
        message = "is not a play; needed: YAML with the key `play`"
        raise FileError([Mistake(str(arguments.file), None, "", message)])
    with ProgressDisplay(arguments.quiet) as display:
        display.stage(f"compiling {arguments.file}")
        live_play = LivePlay(load_play(arguments.file, on_disk=True))
        display.stage("opening the page")
        page = open_live_play(
            live_play,
            arguments.theme.value,
            arguments.host,
            arguments.port,
            arguments.record_to,
            receive_at,
            send_to,
        )
    osc = page.osc
    if osc is not None and not arguments.quiet:
        if osc.heard_at is not None:
            print_message(f"OSC messages are received at {osc.heard_at}")
        if send_to is not None:
            print_message(f"OSC messages are sent to {send_to}")
    try:
        serve(page, arguments)
    finally:
        if osc is not None and not arguments.quiet:
            print_message(f"OSC messages: {osc.counts}")


def address_of(text: str | None, option: str) -> Address | None:
    """Address in an option's text; raises a usage error if it is invalid."""
    if text is None:
        return None
    from fantoccini.theatre.perform import Address

    try:
        return Address.parse(text)
    except ValueError as error:
        fail(str(error), option)


def target_address(text: str | None, option: str) -> Address | None:
    """Address to send to: as :func:`address_of`, but port 0 is a usage error."""
    address = address_of(text, option)
    if address is not None and address.port == 0:
        fail(f"found port 0 in {text!r}; needed: 1 to 65535", option)
    return address
