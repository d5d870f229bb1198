"""The emulated GRBL on a pseudo-terminal, with the serial buffer of the real one."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import threading
import time
from collections.abc import Callable

from fantoccini.errors import StandError
from fantoccini.stand.grbl_machine import GrblMachine

GREETING = b"\r\nGrbl 1.1h ['$' for help]\r\n"
RESET = 0x18
_PATIENCE = 5.0
"""Time in which what it said last is to be read [s]."""
_WAIT = 0.02
"""Time without characters after which it looks again whether it is to end [s]."""


class Emulator:
    """A controller that answers at the other end of a pseudo-terminal, in a thread of its own.

    Args:
        machine: what does the lines.
        pace: time that a line takes [s]; the moves themselves take none.
        heard: called with every line and its answer.

    Attributes:
        port: name of the terminal to stream to.
        machine: what was done.
        lines: lines that came, in order.
        fullest: most characters that its buffer held.
        overrun: characters that found no room and were lost.
        held: whether a feed hold stopped it.
        resets: how often it was reset.
    """

    def __init__(
        self, machine: GrblMachine, pace: float = 0.0,
        heard: Callable[[str, str], None] | None = None,
    ):  # fmt: skip
        if sys.platform == "win32":
            raise StandError("the emulator needs pseudo-terminals, which Windows lacks")
        self.machine, self.pace, self.heard = machine, pace, heard
        self.lines: list[str] = []
        self.fullest = self.overrun = self.resets = 0
        self.held = False
        self._received = bytearray()
        self._stop = threading.Event()
        self._master, self._slave = os.openpty()
        _raw(self._slave)
        self.port = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Emulator:
        self._thread.start()
        self._say(GREETING)
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def wait_until_read(self) -> None:
        """Waits until all that it said was read, but not for long."""
        import fcntl
        import termios

        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            left = fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4))
            if not any(left):
                return
            time.sleep(_WAIT)

    def _serve(self) -> None:
        while not self._stop.is_set():
            ready = b"\n" in self._received and not self.held
            self._receive(0.0 if ready else _WAIT)
            if b"\n" in self._received and not self.held:
                self._one_line()

    def _receive(self, timeout: float) -> None:
        """Takes all characters that are there, before the next line is done."""
        while select.select([self._master], [], [], timeout)[0]:
            timeout = 0.0
            for character in os.read(self._master, 4096):
                if not self._at_once(character):
                    self._store(character)

    def _store(self, character: int) -> None:
        if len(self._received) >= self.machine.settings.buffer:
            self.overrun += 1
            return
        self._received.append(character)
        self.fullest = max(self.fullest, len(self._received))

    def _at_once(self, character: int) -> bool:
        """Whether a character is a command of its own, which takes no room."""
        if character == RESET:
            self._received.clear()
            self.machine.reset()
            self.held = False
            self.resets += 1
            self._say(GREETING)
        elif character == ord("!"):
            self.held = True
        elif character == ord("~"):
            self.held = False
        elif character == ord("?"):
            at = ",".join(f"{x:.3f}" for x in self.machine.position)
            self._say(f"<{'Hold' if self.held else 'Idle'}|WPos:{at}>\r\n".encode())
        else:
            return False
        return True

    def _one_line(self) -> None:
        end = self._received.index(b"\n")
        text = self._received[:end].decode("ascii", "replace").strip("\r")
        if self.pace:
            time.sleep(self.pace)
        answer = self.machine.line(text)
        del self._received[: end + 1]
        self.lines.append(text)
        self._say(f"{answer}\r\n".encode())
        if self.heard is not None:
            self.heard(text, answer)

    def _say(self, text: bytes) -> None:
        os.write(self._master, text)


def _raw(terminal: int) -> None:
    """Lets all characters through as they are."""
    import tty

    with contextlib.suppress(OSError):
        tty.setraw(terminal)
