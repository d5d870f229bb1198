"""Who is let in, and where a page goes when its port is taken."""

from __future__ import annotations

import socket
from http.client import HTTPConnection

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from fantoccini.show.server import Server, ServerError, free_port
from fantoccini.view.theme import DARK

NAME = '<script>alert("x")</script>'


@pytest.fixture(scope="module")
def server():
    async def echo(connection):
        async for message in connection:
            await connection.send(message)

    found = Server(NAME, DARK, port=0, script="window.ours = 1;", visitors={"/echo": echo})
    yield found
    found.stop()


def answer(server: Server, **headers: str) -> tuple[int, str, dict[str, str]]:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request("GET", "/", headers=headers)
    got = connection.getresponse()
    return got.status, got.read().decode(), dict(got.getheaders())


def test_the_page_comes_with_our_script_an_escaped_title_and_a_policy(server):
    status, body, headers = answer(server)
    assert status == 200
    assert "window.ours = 1;" in body
    assert "<title>&lt;script&gt;alert(" in body
    assert NAME not in body
    assert "default-src 'none'" in headers["Content-Security-Policy"]


def test_it_listens_on_this_machine_only(server):
    assert not server.exposed
    sockets = server.viser._websock_server._background_event_loop
    assert sockets is not None
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as there:
        assert there.getpeername()[0] == "127.0.0.1"
    others = {a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in others - {"127.0.0.1", "127.0.1.1"}:
        with pytest.raises(OSError):
            socket.create_connection((address, server.port), timeout=2)


def test_a_name_that_was_bent_to_this_machine_is_refused(server):
    assert answer(server, Host=f"evil.example:{server.port}")[0] == 403
    assert answer(server, Host=f"localhost:{server.port}")[0] == 200


@pytest.mark.parametrize("path", ["/", "/echo"])
def test_other_pages_cannot_open_a_websocket(server, path):
    url = f"ws://127.0.0.1:{server.port}{path}"
    for origin in ("http://evil.example", "http://127.0.0.1:1", "null"):
        with pytest.raises(InvalidStatus) as refused:
            connect(url, origin=origin, subprotocols=["viser-v0"])
        assert refused.value.response.status_code == 403


def test_the_page_itself_can(server):
    url = f"ws://127.0.0.1:{server.port}/echo"
    with connect(url, origin=f"http://127.0.0.1:{server.port}") as there:
        there.send("hello")
        assert there.recv(timeout=5) == "hello"


def test_no_tunnel_can_be_asked_for(server):
    from viser import _messages

    handled = server.viser._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handled


def test_a_port_that_is_taken_gives_the_next_one():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        port = taken.getsockname()[1]
        found = free_port("127.0.0.1", port)
        assert found > port
        server = Server("toy", DARK, port=port)
        try:
            assert server.moved
            assert server.port > port
            assert answer(server)[0] == 200
        finally:
            server.stop()


def test_an_address_that_is_not_ours_is_a_clear_mistake():
    with pytest.raises(ServerError, match=r"no page can be served at 192\.0\.2\.1, port 8080"):
        Server("toy", DARK, host="192.0.2.1")
    with pytest.raises(ServerError, match=r"no page can be served at no\.such\.host"):
        Server("toy", DARK, host="no.such.host.invalid")
