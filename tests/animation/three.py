"""A file in three.js, in a headless Chromium: matrices of its nodes, and its picture."""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.show.browser import chrome, until

MODULES = Path(sys.prefix) / "node_modules"
"""Folder of the packages that `make` installs with npm."""


class _Handler(SimpleHTTPRequestHandler):
    """Serves a file, the page and three.js."""

    def __init__(self, *args: Any, glb: Path):
        self.glb = glb
        super().__init__(*args)

    def translate_path(self, path: str) -> str:
        if path == "/shown.glb":
            return str(self.glb)
        if path.startswith("/three/"):
            return str(MODULES / path[1:])
        return str(Path(__file__).with_name("page.html"))

    def log_message(self, *_: Any) -> None:
        pass


class Three:
    """A loaded file.

    Attributes:
        names: names of all nodes.
    """

    def __init__(self, browser: Any, url: str):
        self.browser = browser
        browser.get(url)
        until(lambda: browser.execute_script("return window.ready"), "three.js loads")
        self.names = self._ask("return window.load('/shown.glb')")

    def matrices(self, names: Sequence[str], times: Sequence[float]) -> np.ndarray:
        """(T, n, 4, 4) world matrices of nodes."""
        numbers = self._ask("return window.matrices(...arguments)", list(names), list(times))
        return np.array(numbers).reshape(len(times), len(names), 4, 4).swapaxes(-1, -2)

    def vertices(self, name: str, times: Sequence[float]) -> np.ndarray:
        """(T, n, 3) vertices of a skinned mesh [m]."""
        return np.array(self._ask("return window.vertices(...arguments)", name, list(times)))

    def draw(self, t: float, eye: Sequence[float], target: Sequence[float]) -> int:
        """Draw the scene at a time; returns the number of triangles."""
        return self._ask("return window.draw(...arguments)", t, list(eye), list(target))

    def _ask(self, script: str, *arguments: Any) -> Any:
        return self.browser.execute_script(script, *arguments)


@contextmanager
def three(glb: Path) -> Iterator[Three]:
    """Open a file; the test is skipped without three.js or a browser."""
    if not (MODULES / "three").is_dir():
        pytest.skip("three.js is not installed (make installs it with npm)")
    handler = functools.partial(_Handler, glb=glb)
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with chrome() as browser:
            browser.set_script_timeout(60)
            yield Three(browser, f"http://127.0.0.1:{server.server_port}/")
    finally:
        server.shutdown()
        server.server_close()
