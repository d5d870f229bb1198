"""A viser server that only this machine's browser can reach, unless more was asked for."""

from __future__ import annotations

import contextlib
import errno
import gzip
import io
import ipaddress
import os
import socket
import sys
import threading
import webbrowser
from collections.abc import Awaitable, Callable, Iterator
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import viser
import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from fantoccini.errors import FantocciniError
from fantoccini.view.theme import Theme
from fantoccini.web.gate import guard
from fantoccini.web.script import SCRIPT

HOST = "127.0.0.1"
PORT = 8080
_TRIED = 100
"""Ports that are tried after one that is taken."""

Visitor = Callable[[Any], Awaitable[None]]
"""What serves a websocket of our own."""

_serving = threading.Lock()


class ServerError(FantocciniError):
    """No page can be served at this address."""


class Server:
    """A viser server on one port, with the page's index and a websocket of our own.

    viser itself takes connections from any page that the browser has open, and has no place for
    scripts. Here a request must name this server as its host and come from its own page, so that
    no other page, and no name that is bent to this address, drives the puppet.

    Attributes:
        viser: the server of viser.
        port: that it listens on.
        moved: whether the port that was asked for was taken.

    Args:
        title: of the page; plain text.
        theme: the look.
        host: address to listen on.
        port: first port to try; 0 lets the system choose.
        script: more JavaScript for the page.
        visitors: path -> what serves websockets there.
    """

    def __init__(
        self,
        title: str,
        theme: Theme,
        host: str = HOST,
        port: int = PORT,
        script: str = "",
        visitors: dict[str, Visitor] | None = None,
    ):
        self.host = host
        self.port = free_port(host, port)
        self._index = _index(title, SCRIPT + script)
        self._visitors = visitors or {}
        with _serving, self._own_serve(), contextlib.redirect_stdout(io.StringIO()):
            self.viser = viser.ViserServer(host, self.port, label=title, verbose=False)
        self.port = self.viser.get_port()
        self.moved = port not in (0, self.port)
        guard(self.viser)
        accent = tuple(int(theme.cycle[0][k : k + 2], 16) for k in (1, 3, 5))
        self.viser.gui.configure_theme(
            dark_mode=theme.name == "dark", show_logo=False, show_share_button=False,
            brand_color=accent,
        )  # fmt: skip

    @property
    def url(self) -> str:
        """Address of the page."""
        host = _reached_at(self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def exposed(self) -> bool:
        """Whether other machines can reach the page."""
        return not _is_loopback(self.host)

    def open_browser(self) -> bool:
        """Opens the page where there is a display; whether it did."""
        if not has_display():
            return False
        return webbrowser.open(self.url)

    def stop(self) -> None:
        """Ends the server."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser.stop()

    # -- requests ------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _own_serve(self) -> Iterator[None]:
        """While a viser server starts, what it listens with is ours."""
        module = websockets.asyncio.server
        theirs = module.serve

        def serve(handler: Visitor, *args: Any, process_request: Any, **options: Any) -> Any:
            return theirs(
                self._dispatch(handler), *args, process_request=self._filter(process_request),
                **options,
            )  # fmt: skip

        module.serve = serve
        try:
            yield
        finally:
            module.serve = theirs

    def _dispatch(self, theirs: Visitor) -> Visitor:
        async def handle(connection: Any) -> None:
            path = connection.request.path.partition("?")[0]
            await self._visitors.get(path, theirs)(connection)

        return handle

    def _filter(self, theirs: Callable) -> Callable:
        def answer(connection: Any, request: Request) -> Response | None:
            if not self._welcome(request):
                return self._plain(403, "Forbidden", "this page is served to its own address only")
            if request.headers.get("Upgrade", "").lower() == "websocket":
                theirs(connection, request)  # it keeps the log of connections quiet
                return None
            # As viser reads a path: every spelling of the page's address is the page.
            path = unquote(request.path.partition("?")[0]).replace("\\", "/")
            if [part for part in path.split("/") if part not in ("", ".")] in ([], ["index.html"]):
                return self._page(request)
            return self._plain(404, "Not Found", "there is nothing here but the page at /")

        return answer

    def _welcome(self, request: Request) -> bool:
        host = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return False
        return self.exposed or _is_loopback(urlsplit(f"//{host}").hostname or "")

    def _page(self, request: Request) -> Response:
        host = request.headers.get("Host", "")
        content = self._index
        headers = Headers()
        if "gzip" in request.headers.get("Accept-Encoding", ""):
            content = gzip.compress(content, 6)
            headers["Content-Encoding"] = "gzip"
        headers["Content-Type"] = "text/html; charset=utf-8"
        return _safe(200, "OK", headers, content, policy(f"'self' ws://{host} wss://{host}"))

    def _plain(self, code: int, reason: str, words: str) -> Response:
        headers = Headers({"Content-Type": "text/plain; charset=utf-8"})
        return _safe(code, reason, headers, f"{words}\n".encode(), policy())


def _safe(code: int, reason: str, headers: Headers, content: bytes, rules: str) -> Response:
    """An answer with the headers that every one of ours has."""
    headers["Content-Length"] = str(len(content))
    headers["Cache-Control"] = "no-store"
    headers["X-Frame-Options"] = "SAMEORIGIN"
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Content-Security-Policy"] = rules
    return Response(code, reason, headers, content)


def policy(connect: str = "") -> str:
    """Content security policy of a page that loads nothing from elsewhere.

    Args:
        connect: more places that it may talk to.
    """
    inline = "'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:"
    return (
        f"default-src 'none'; script-src {inline}; worker-src data: blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; media-src data: blob:; "
        f"connect-src data: blob: {connect}; base-uri 'none'; form-action 'none'"
    ).strip()


def client_page() -> str:
    """The page of viser's client, one file with everything in it."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text("utf-8")


def with_title(page: str, title: str) -> str:
    """The page with another title; plain text."""
    start, end = page.index("<title>"), page.index("</title>")
    return f"{page[:start]}<title>{escape(title)}{page[end:]}"


def _index(title: str, script: str) -> bytes:
    page = with_title(client_page(), title)
    # Before the client's own script, whose listeners come after ours.
    head = page.index("<head>") + len("<head>")
    return f"{page[:head]}<script>{script}</script>{page[head:]}".encode()


def free_port(host: str, first: int) -> int:
    """The first port from ``first`` on that nobody listens on; 0 stays 0.

    Raises:
        ServerError: there is none, or nobody can listen at this address.
    """
    last = min(first + _TRIED, 65535)
    for port in range(first, last + 1):
        try:
            _listen_once(host, port)
        except OSError as error:
            if not _taken(error):
                raise ServerError(
                    f"no page can be served at {host}, port {port}: {error.strerror or error}"
                ) from None
            continue
        return port
    raise ServerError(f"the ports {first} to {last} at {host} are all taken")


def _listen_once(host: str, port: int) -> None:
    family, kind, protocol, _, address = socket.getaddrinfo(
        host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    with socket.socket(family, kind, protocol) as listener:
        # As asyncio does: a port that was served a moment ago is free.
        if os.name == "posix":
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(1)


def _taken(error: OSError) -> bool:
    return error.errno in (errno.EADDRINUSE, errno.EACCES)


def _reached_at(host: str) -> str:
    """Where a browser on this machine reaches what listens at an address.

    A server that listens at no address in particular is there at the loopback of its family: with
    IPv6 alone nobody answers at 127.0.0.1.
    """
    if not host:
        return HOST
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    if not address.is_unspecified:
        return host
    return HOST if address.version == 4 else "::1"


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def has_display() -> bool:
    """Whether a browser's window could be seen."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
