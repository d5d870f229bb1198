"""Server of a page, which by default only browsers on this machine can reach."""

from __future__ import annotations

import contextlib
import errno
import gzip
import ipaddress
import os
import socket
import sys
import webbrowser
from typing import Any
from urllib.parse import unquote, urlsplit

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from fantoccini.app.pages import viser_private
from fantoccini.app.pages.viser_private import Handler
from fantoccini.base import FantocciniError
from fantoccini.output.html import element, to_html
from fantoccini.output.view import Theme, rgb, to_bytes

HOST, PORT = "127.0.0.1", 8080
"""Default address and port of a page."""
MAX_PORTS = 100
"""Number of further ports to try if the first one is in use."""


class ServerError(FantocciniError):
    """No page can be served at this address."""


class Server:
    """Server of viser on one port, with its own index page and additional websockets.

    viser accepts connections from any page that the browser has open, and cannot add scripts. Here
    a request must name this server as its host and come from its own page, so that no other page
    can move the puppet, not even by DNS rebinding.

    Attributes:
        viser: the server of viser.
        port: port on which it listens.
        port_changed: whether the requested port was in use.

    Args:
        title: title of the page, as plain text.
        theme: colours.
        host: address to listen on.
        port: first port to try; 0 lets the system choose.
        script: additional JavaScript for the page.
        handlers: path -> handler of websockets.

    Raises:
        ServerError: no port at this address can be used.
        ViserError: this version of viser is not supported.
    """

    def __init__(
        self,
        title: str,
        theme: Theme,
        host: str = HOST,
        port: int = PORT,
        script: str = "",
        handlers: dict[str, Handler] | None = None,
    ):
        self.host = host
        self.port = free_port(host, port)
        page = with_title(viser_private.client_page(), title)
        # Before the client's own script, so that our listeners run first.
        script = f"<script>{viser_private.CLIENT_SCRIPT + script}</script>"
        self._index = insert_in_head(page, script).encode()
        self._handlers = handlers or {}
        self.viser = viser_private.start_server(
            host, self.port, title, self._dispatch, self._filter_request
        )
        self.port = self.viser.get_port()
        self.port_changed = port not in (0, self.port)
        self.viser.gui.configure_theme(
            dark_mode=theme.name == "dark",
            show_logo=False,
            show_share_button=False,
            brand_color=to_bytes(rgb(theme.line_colours[0])),
        )

    @property
    def url(self) -> str:
        """Address of the page."""
        host = _browser_address(self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def exposed(self) -> bool:
        """Whether other machines can reach the page."""
        return not _is_loopback(self.host)

    def open_browser(self) -> bool:
        """Opens the page, if there is a display; returns whether it did."""
        if not has_display():
            return False
        return webbrowser.open(self.url)

    def stop(self) -> None:
        """Ends the server."""
        viser_private.stop_server(self.viser)

    # -- requests ------------------------------------------------------------------------------

    def _dispatch(self, default: Handler) -> Handler:
        async def handle(connection: Any) -> None:
            path = connection.request.path.partition("?")[0]
            with contextlib.suppress(ConnectionClosed):  # a closed tab
                await self._handlers.get(path, default)(connection)

        return handle

    def _filter_request(self, connection: Any, request: Request) -> Response | None:
        try:
            response = self._respond(request)
        except (LookupError, ValueError):  # repeated headers, or a host that is no address
            response = _text_response(
                400, "Bad Request", "the headers of the request are not valid"
            )
        if response is not None and connection.headers_only:
            response.body = b""  # its length remains in the headers
        return response

    def _respond(self, request: Request) -> Response | None:
        """Response to a request; None for a websocket.

        Raises:
            LookupError, ValueError: the request has headers that are not valid.
        """
        if not self._accepts(request):
            return _text_response(403, "Forbidden", "this page is served to its own address only")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        # Parses paths as viser does: every spelling of the page's address returns the page.
        path = unquote(request.path.partition("?")[0]).replace("\\", "/")
        if [part for part in path.split("/") if part not in ("", ".")] in ([], ["index.html"]):
            return self._page_response(request)
        return _text_response(404, "Not Found", "there is only the page at /")

    def _accepts(self, request: Request) -> bool:
        host = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return False
        return self.exposed or _is_loopback(urlsplit(f"//{host}").hostname or "")

    def _page_response(self, request: Request) -> Response:
        host = request.headers.get("Host", "")
        content = self._index
        headers = Headers()
        if "gzip" in request.headers.get("Accept-Encoding", ""):
            content = gzip.compress(content, 6)
            headers["Content-Encoding"] = "gzip"
        headers["Content-Type"] = "text/html; charset=utf-8"
        return _response(
            200, "OK", headers, content, security_policy(f"'self' ws://{host} wss://{host}")
        )


def _text_response(code: int, reason: str, text: str) -> Response:
    headers = Headers({"Content-Type": "text/plain; charset=utf-8"})
    return _response(code, reason, headers, f"{text}\n".encode(), security_policy())


def _response(code: int, reason: str, headers: Headers, content: bytes, policy: str) -> Response:
    """Response with the headers that all our responses have."""
    headers["Content-Length"] = str(len(content))
    headers["Cache-Control"] = "no-store"
    headers["X-Frame-Options"] = "SAMEORIGIN"
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Content-Security-Policy"] = policy
    return Response(code, reason, headers, content)


def security_policy(connect: str = "") -> str:
    """Content security policy of a page that loads nothing from other addresses.

    ``connect`` lists additional addresses to which the page may connect.
    """
    inline_sources = "'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:"
    return (
        f"default-src 'none'; script-src {inline_sources}; worker-src data: blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; media-src data: blob:; "
        f"connect-src data: blob: {connect}; base-uri 'none'; form-action 'none'"
    ).strip()


def with_title(page: str, title: str) -> str:
    """The page with another title, given as plain text."""
    before, _, after = page.partition("<title>")
    return before + to_html(element("title", title)) + after.partition("</title>")[2]


def insert_in_head(page: str, html: str) -> str:
    """The page with ``html`` at the start of its head."""
    before, tag, after = page.partition("<head>")
    return f"{before}{tag}{html}{after}"


def free_port(host: str, first: int) -> int:
    """First unused port, starting at ``first``; 0 for 0.

    Raises:
        ServerError: all ports are in use, or the address cannot be used.
    """
    last = min(first + MAX_PORTS, 65535)
    for port in range(first, last + 1):
        try:
            _listen_once(host, port)
        except OSError as error:
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise ServerError(
                    f"no page can be served at {host}, port {port}: {error.strerror or error}"
                ) from None
            continue
        return port
    raise ServerError(f"the ports {first} to {last} at {host} are all in use")


def _listen_once(host: str, port: int) -> None:
    family, socket_type, protocol, _, address = socket.getaddrinfo(
        host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    with socket.socket(family, socket_type, protocol) as listener:
        # As in asyncio: a port that has just been released counts as free.
        if os.name == "posix":
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(1)


def _browser_address(host: str) -> str:
    """Address at which a browser on this machine reaches a server that listens on ``host``.

    For an unspecified address it is the loopback of its family: an IPv6 server does not answer at
    127.0.0.1.
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
    """Whether a browser window can be shown."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
