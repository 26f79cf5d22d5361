"""Who is let in: on this computer its own pages, elsewhere who knows the token; and what is said where none can be."""

from __future__ import annotations

import builtins
import http.client
import socket
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.web.server import LONGEST, Page, _gatekeeper, address_of, check_port, need_viser, token_for

TOKEN = 'let me&in+d#e;"ä中'
QUOTED = quote(TOKEN, safe="")


@pytest.fixture(scope="module")
def free() -> Iterator[Page]:
    page = Page("127.0.0.1", 0, "test")
    yield page
    page.close()


@pytest.fixture(scope="module")
def guarded() -> Iterator[Page]:
    page = Page("127.0.0.1", 0, "test", TOKEN)
    yield page
    page.close()


def ask(page: Page, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    port = page.server.get_port()
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    return connection.getresponse()


def upgrade(page: Page, path: str = "/", **headers: str) -> int:
    """Status of the answer to the request that opens a web socket."""
    fixed = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13"}
    key = {"Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA==", "Sec_WebSocket_Protocol": "viser-v0"}
    return ask(page, path, **fixed, **key, **headers).status


def test_on_this_computer_the_page_is_open_but_not_to_other_sites(free: Page) -> None:
    own = f"127.0.0.1:{free.server.get_port()}"
    assert ask(free).status == 200
    assert upgrade(free, Origin=f"http://{own}") == 101
    assert upgrade(free, Origin="http://example.org") == 403
    assert upgrade(free, Origin=f"http://{own}0") == 403
    assert ask(free, Host="example.org").status == 403  # a name of somebody else's that leads here
    assert upgrade(free, Host="example.org", Origin="http://example.org") == 403


def test_a_token_is_asked_for_and_remembered_by_a_cookie(guarded: Page) -> None:
    own = f"http://127.0.0.1:{guarded.server.get_port()}"
    assert guarded.address == f"{own}/?token={QUOTED}"
    assert ask(guarded).status == 403
    assert ask(guarded, "/?token=guess").status == 403
    assert upgrade(guarded, Origin=own) == 403
    assert upgrade(guarded, Origin=own, Cookie="qpsafe_token=guess") == 403
    assert upgrade(guarded, Origin=own, Cookie="qpsafe_token") == 403
    answer = ask(guarded, f"/?token={QUOTED}")
    assert answer.status == 200
    cookie = answer.getheader("Set-Cookie") or ""
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert upgrade(guarded, Origin=own, Cookie=cookie.partition(";")[0]) == 101
    assert upgrade(guarded, Origin="http://example.org", Cookie=cookie.partition(";")[0]) == 403


ODD_TOKENS = st.text(st.characters(), min_size=1) | st.text(" &=+#%?/\\;,\"'<>[]äß中\0\n", min_size=1)


@settings(max_examples=some(20, of=300), deadline=None)
@given(ODD_TOKENS | st.sampled_from(["a b&c+d#e", "%41", "x" * LONGEST, "x" * (LONGEST + 1), "中" * 1000, "\udcff"]))
def test_whatever_the_token_the_printed_address_and_its_cookie_open_the_page_or_it_is_refused(token: str) -> None:
    """Asked as a server would be: what it is told is a line of ASCII, parsed by the library that serves."""
    if len(token.encode("utf-8", "surrogatepass")) * 3 > LONGEST or not token.isprintable():
        try:
            token_for("127.0.0.1", token)
        except ConfigurationError:
            return
    address = address_of("127.0.0.1", 8080, token_for("127.0.0.1", token))
    assert address.isascii()
    assert all(letter.isprintable() and letter != " " for letter in address)
    path = address.removeprefix("http://127.0.0.1:8080")
    assert asked(token, path) == 200
    assert asked(token, "/", f"other=1; {cookie_of(token, path)}") == 200
    assert asked(token, "/") == asked(token, path + "x") == asked(token, "/?token=\udcff%ff") == 403
    assert asked(token, "/", cookie_of(token, path) + "x") == 403


def look(token: str, path: str, cookie: str = "") -> Any:
    """What the gatekeeper answers to a request."""
    request = Request(path, Headers(Host="127.0.0.1:8080", **({"Cookie": cookie} if cookie else {})))
    return _gatekeeper(token, lambda *_: Response(200, "OK", Headers()))(ServerProtocolLike(), request)


def asked(token: str, path: str, cookie: str = "") -> int:
    return look(token, path, cookie).status_code


def cookie_of(token: str, path: str) -> str:
    return look(token, path).headers["Set-Cookie"].partition(";")[0]


class ServerProtocolLike:
    """A connection, as far as it is asked."""

    def respond(self, status: HTTPStatus, text: str) -> Response:
        return Response(status.value, text, Headers())


@pytest.mark.parametrize("token", ["", "\udcff", "x" * (LONGEST + 1), 5, b"abc"])
@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_a_token_that_no_address_can_have_is_refused_by_name(token: Any, host: str) -> None:
    with pytest.raises(ConfigurationError, match="page: token = "):
        token_for(host, token)
    if token:
        with pytest.raises(ConfigurationError, match="page: token = "):
            Page(host, 0, "test", token)


def test_a_token_is_made_up_for_every_address_but_this_computers() -> None:
    assert token_for("127.0.0.1", None) == token_for("localhost", None) == ""
    first, second = token_for("0.0.0.0", None), token_for("0.0.0.0", None)
    assert first != second
    assert len(first) > 16
    assert token_for("0.0.0.0", "mine") == token_for("127.0.0.1", "mine") == "mine"


def test_a_port_that_is_taken_is_named(free: Page, capsys: pytest.CaptureFixture[str]) -> None:
    port = free.server.get_port()
    with pytest.raises(ConfigurationError, match=str(port)):
        check_port("127.0.0.1", port)
    with pytest.raises(ConfigurationError, match=str(port)):
        Page("127.0.0.1", port, "test")
    with pytest.raises(ConfigurationError, match="address of this computer"):
        check_port("192.0.2.1", 0)
    for command in (["web", "--port", str(port)], ["replay", "x.npz", "--web", "--web-port", str(port)]):
        with pytest.raises(ConfigurationError, match=f"127.0.0.1:{port}"):
            app(command, standalone_mode=False)


def test_no_browser_can_make_the_page_public(free: Page) -> None:
    from viser import _messages

    handlers = free.server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers
    assert _messages.ShareUrlDisconnect not in handlers


def test_without_viser_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def no_viser(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("viser"):
            raise ImportError(f"No module named {name!r}")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", no_viser)
    with pytest.raises(MissingExtraError, match=r"pip install 'qpsafe\[web\]'"):
        need_viser()
    with pytest.raises(MissingExtraError, match=r"pip install 'qpsafe\[web\]'"):
        app(["web"], standalone_mode=False)


def test_a_listener_of_another_program_counts_as_taken() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(ConfigurationError):
            Page("127.0.0.1", other.getsockname()[1], "test")
