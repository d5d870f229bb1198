"""Access to a page, and its port if the usual one is in use."""

from __future__ import annotations

import asyncio
import gc
import logging
import socket
import struct
import time
from http.client import HTTPConnection
from urllib.parse import urlsplit

import msgspec.msgpack
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from fantoccini.app.pages.server import Server, ServerError, free_port
from fantoccini.output.view.theme import DARK

NAME = '<script>alert("x")</script>'


@pytest.fixture(scope="module")
def server():
    async def echo(connection):
        async for message in connection:
            await connection.send(message)

    running = Server(NAME, DARK, port=0, script="window.ours = 1;", handlers={"/echo": echo})
    yield running
    running.stop()


def get(
    server: Server, path: str = "/", at: str = "127.0.0.1", **headers: str
) -> tuple[int, str, dict[str, str]]:
    connection = HTTPConnection(at, server.port, timeout=10)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    return response.status, response.read().decode(), dict(response.getheaders())


def test_the_page_comes_with_our_script_an_escaped_title_and_a_policy(server):
    status, body, headers = get(server)
    assert status == 200
    assert "window.ours = 1;" in body
    assert "<title>&lt;script&gt;alert(" in body
    assert NAME not in body
    assert "default-src 'none'" in headers["Content-Security-Policy"]


def test_it_listens_on_this_machine_only(server):
    assert not server.exposed
    sockets = server.viser._websock_server._background_event_loop
    assert sockets is not None
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection:
        assert connection.getpeername()[0] == "127.0.0.1"
    others = {a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in others - {"127.0.0.1", "127.0.1.1"}:
        with pytest.raises(OSError):
            socket.create_connection((address, server.port), timeout=2)


def test_another_name_for_this_machine_is_refused(server):
    assert get(server, Host=f"evil.example:{server.port}")[0] == 403
    assert get(server, Host=f"localhost:{server.port}")[0] == 200


@pytest.mark.parametrize("path", ["/", "/echo"])
def test_other_pages_cannot_open_a_websocket(server, path):
    url = f"ws://127.0.0.1:{server.port}{path}"
    for origin in ("http://evil.example", "http://127.0.0.1:1", "null"):
        with pytest.raises(InvalidStatus) as refused:
            connect(url, origin=origin, subprotocols=["viser-v0"])
        assert refused.value.response.status_code == 403


def test_the_page_itself_can_open_a_websocket(server):
    url = f"ws://127.0.0.1:{server.port}/echo"
    with connect(url, origin=f"http://127.0.0.1:{server.port}") as connection:
        connection.send("hello")
        assert connection.recv(timeout=5) == "hello"


def test_tunnels_cannot_be_requested(server):
    from viser import _messages

    handled = server.viser._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handled


def test_the_next_port_is_used_if_one_is_in_use():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        port = taken.getsockname()[1]
        other = free_port("127.0.0.1", port)
        assert other > port
        server = Server("toy", DARK, port=port)
        try:
            assert server.port_changed
            assert server.port > port
            assert get(server)[0] == 200
        finally:
            server.stop()


def test_an_address_that_is_not_ours_is_a_clear_mistake():
    with pytest.raises(ServerError, match=r"no page can be served at 192\.0\.2\.1, port 8080"):
        Server("toy", DARK, host="192.0.2.1")
    with pytest.raises(ServerError, match=r"no page can be served at no\.such\.host"):
        Server("toy", DARK, host="no.such.host.invalid")


@pytest.mark.parametrize(
    "path",
    ["//", "/./", "/index.html", "/index%2ehtml", "/./index.html?x=1", "/%2e/", "/x", "/../"],
)
def test_every_answer_has_the_security_headers(server, path):
    """Other spellings of the page's address had no policy."""
    status, body, headers = get(server, path)
    assert (status == 200) == ("window.ours = 1;" in body) == (path not in ("/x", "/../"))
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert headers["X-Frame-Options"] == "SAMEORIGIN"
    refused = get(server, path, Host="evil.example")
    assert refused[0] == 403
    assert "Content-Security-Policy" in refused[2]


def test_the_announced_address_answers():
    """The announced address with --host :: was 127.0.0.1, where nothing listened."""
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("this machine has no IPv6")
    for host in ("::", "0:0:0:0:0:0:0:0", "::1"):
        server = Server("toy", DARK, host=host, port=0)
        try:
            url = urlsplit(server.url)
            assert get(server, at=url.hostname)[0] == 200
            assert server.exposed == (host != "::1")
        finally:
            server.stop()


def test_only_values_that_a_control_can_have_are_set(server):
    """A viewer could set a control's callbacks, and break it for all."""
    from viser import _messages

    gui = server.viser.gui
    slider = gui.add_slider("length", 0.0, 1.0, 0.1, 0.5)
    group = gui.add_button_group("time", ("step", "reset"))
    box = gui.add_checkbox("floor", True)
    events = []
    slider.on_update(lambda event: events.append(event))
    (update,) = server.viser._websock_server._incoming_handlers[_messages.GuiUpdateMessage]

    def set_(control, **updates) -> None:
        asyncio.run(update(0, _messages.GuiUpdateMessage(control._impl.uuid, updates)))

    callbacks = list(slider._impl.update_cb)
    for updates in (
        {"update_cb": []},
        {"removed": True},
        {"value": 0.2, "removed": True},
        {"no_such": 1},
        {"is_button": True},
        {"value": float("nan")},
        {"value": 7.0},
        {"value": "x"},
        {"value": None},
        {},
    ):
        set_(slider, **updates)
        assert slider.value == 0.5
        assert slider._impl.update_cb == callbacks
        assert not slider._impl.removed
    set_(group, value="away")
    set_(box, value="no")
    assert group.value == "step"
    assert box.value is True
    set_(slider, value=0.2)
    set_(group, value="reset")
    set_(box, value=False)
    assert (slider.value, group.value, box.value) == (0.2, "reset", False)
    asyncio.run(update(0, _messages.GuiUpdateMessage("nothing", {"value": 1})))


def test_no_file_can_be_sent(server):
    """A file sent to a control became its value, and stayed in memory."""
    from viser import _messages

    handled = server.viser._websock_server._incoming_handlers
    assert _messages.FileTransferStartUpload not in handled
    assert _messages.FileTransferPart not in handled


def test_a_request_for_headers_only_is_answered_without_content(server):
    """`curl -I` got no answer, and a traceback was printed over the page's address."""
    for path, expected in (("/", 200), ("/x", 404)):
        connection = HTTPConnection("127.0.0.1", server.port, timeout=10)
        connection.request("HEAD", path)
        response = connection.getresponse()
        assert (response.status, response.read()) == (expected, b"")
        length = len(get(server, path)[1].encode())
        assert int(response.getheader("Content-Length")) == length


STRAY = {
    "nothing": b"",
    "half a request": b"GET / HT",
    "another protocol": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),
    "another method": b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 3\r\n\r\nabc",
    "an old version": b"GET / HTTP/1.0\r\n\r\n",
    "no host": b"GET / HTTP/1.1\r\n\r\n",
    "half an address": b"GET / HTTP/1.1\r\nHost: [::1\r\n\r\n",
    "two hosts": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: localhost\r\n\r\n",
    "a broken origin": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://[a\r\n\r\n",
    "a long line": b"GET /" + b"a" * 20_000 + b" HTTP/1.1\r\n\r\n",
    "a websocket without a key": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
    b"Connection: Upgrade\r\n\r\n",
}
"""Requests of port scanners and of programs that are no browsers."""


@pytest.fixture
def silent(capfd, caplog):
    """Fails if anything is printed or logged."""
    gc.freeze()  # a collection of all that other tests have left would take two seconds
    yield
    time.sleep(0.2)  # the server's thread ends its connections
    gc.collect()  # exceptions of tasks are logged when these are collected
    gc.unfreeze()
    records = [*caplog.get_records("call"), *caplog.records]
    own = [r for r in records if r.name != "websockets.client"]  # the client of the tests
    assert [r.getMessage() for r in own if r.levelno >= logging.WARNING] == []
    assert tuple(capfd.readouterr()) == ("", "")


@pytest.mark.parametrize("data", STRAY.values(), ids=STRAY)
def test_stray_requests_print_nothing(server, silent, data):
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as client:
        client.sendall(data)
        client.shutdown(socket.SHUT_WR)
        response = client.recv(65536)
    assert not response or response.startswith(b"HTTP/1.1 4")
    assert get(server)[0] == 200


def test_connections_that_are_reset_print_nothing(server, silent):
    for data in (b"", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", server.port), timeout=5) as client:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            client.sendall(data)
    with connect(f"ws://127.0.0.1:{server.port}/echo", close_timeout=0.1) as client:
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.socket.close()
    assert get(server)[0] == 200


@pytest.mark.parametrize("subprotocol", [None, "viser-v0.0.0", "viser-v" + "9" * 300])
def test_other_clients_are_closed_with_a_reason_and_print_nothing(server, silent, subprotocol):
    """A tab of another version connects again every second, and viser printed a line each time."""
    url = f"ws://127.0.0.1:{server.port}/"
    with (
        connect(url, subprotocols=subprotocol and [subprotocol]) as client,
        pytest.raises(ConnectionClosed) as closed,
    ):
        client.recv(timeout=5)
    assert closed.value.rcvd.code == 1002
    assert closed.value.rcvd.reason.startswith("Version mismatch. Client: ")


@pytest.mark.parametrize(
    "message",
    [b"\xc1", b"", "text", msgspec.msgpack.encode({"type": "NoSuchMessage"})],
    ids=["no message", "empty", "text", "unknown"],
)
def test_messages_that_cannot_be_read_end_the_connection_silently(server, silent, message):
    url = f"ws://127.0.0.1:{server.port}/"
    with connect(url, subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as client:
        client.send(message)
        with pytest.raises(ConnectionClosed):
            while True:
                client.recv(timeout=5)
    assert get(server)[0] == 200
