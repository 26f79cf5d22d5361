"""The web server of a page: viser, bound to one address, closed to strangers, clear about a port that is taken."""

from __future__ import annotations

import hmac
import logging
import secrets
import socket
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from io import StringIO
from typing import Any
from urllib.parse import parse_qs, quote, unquote, urlsplit

from qpsafe.errors import ConfigurationError, MissingExtraError

HOST, PORT = "127.0.0.1", 8080
COOKIE = "qpsafe_token"
LOCAL = ("127.0.0.1", "localhost", "::1")
LONGEST = 2000  # characters of a token in an address: what every browser takes, in an address and in a cookie
NO_VISER = "a page in the browser needs viser: pip install 'qpsafe[web]'"


def need_viser() -> Any:
    """Viser's module.

    Raises:
        MissingExtraError: It is not installed, or too old.
    """
    try:
        import viser
        import viser.infra._infra
    except ImportError as error:
        raise MissingExtraError(f"{NO_VISER} ({error})") from error
    if not hasattr(viser.GuiApi, "add_uplot") or not hasattr(viser.GuiApi, "add_panel"):
        raise MissingExtraError(f"{NO_VISER} (found viser {viser.__version__}, 1.1 or newer is needed)")
    return viser


def check_port(host: str, port: int) -> None:
    """Check that a page can be served there.

    Args:
        host: Address of this computer.
        port: 0 for any free one.

    Raises:
        ConfigurationError: The port is taken, or the host is no address of this computer.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does: old ones may linger
            probe.bind((host, port))
    except OSError as error:
        expected = f"an address of this computer and a free port: --port 0 takes any ({error})"
        raise ConfigurationError("page", "host:port", f"{host}:{port}", expected) from None


def address_of(host: str, port: int, token: str = "") -> str:
    """What to open in a browser.

    Args:
        host: Served at.
        port: Likewise.
        token: That the page asks for.

    Raises:
        ConfigurationError: No address can have that token.
    """
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}/" + (f"?token={_quoted(token)}" if token else "")


def token_for(host: str, token: str | None) -> str:
    """The token that a page asks for: none on this computer alone, else the given one, or a new one.

    Args:
        host: Served at.
        token: As given.

    Raises:
        ConfigurationError: It is empty, or no address can have it.
    """
    if token is None:
        return "" if host in LOCAL else secrets.token_urlsafe(16)
    _quoted(token)
    return token


def _quoted(token: str) -> str:
    """A token as an address and a cookie can have it: letters, digits, and what is never special there."""
    try:
        found = quote(token, safe="")
    except (TypeError, UnicodeEncodeError):  # bytes of the command line that are no text
        found = ""
    if not isinstance(token, str) or not 0 < len(found) <= LONGEST:
        expected = f"text for an address, at most {LONGEST} characters when written there"
        raise ConfigurationError("page", "token", token, expected)
    return found


class Page:
    """A running server.

    Args:
        host: Address to listen at.
        port: Port; 0 for any free one.
        title: Of the panel.
        token: Must be known to open the page; empty for none.

    Attributes:
        server: Viser's.
        address: To open in a browser, with the token.

    Raises:
        ConfigurationError: The port is taken, or no address can have the token.
        MissingExtraError: Viser is not installed.
    """

    def __init__(self, host: str, port: int, title: str, token: str = "") -> None:
        viser = need_viser()
        address_of(host, port, token)  # raises
        check_port(host, port)
        logging.getLogger("websockets").setLevel(logging.CRITICAL)  # whoever knocks and goes away is no news
        with guarded(token), redirect_stdout(StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            self.server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
        self._forbid_tunnels(viser)
        found = self.server.get_port()
        if port not in (0, found):  # somebody was quicker; viser then takes the next one
            self.close()
            raise ConfigurationError("page", "host:port", f"{host}:{port}", "a free port: --port 0 takes any")
        self.address = address_of(host, found, token)

    def _forbid_tunnels(self, viser: Any) -> None:
        """A browser could ask viser to show the page to the whole world."""
        from viser import _messages

        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self.server._websock_server.unregister_handler(message)
        self.server.gui.configure_theme(show_share_button=False, show_logo=False)

    @property
    def watched(self) -> bool:
        """Whether anybody has the page open."""
        return bool(self.server.get_clients())

    def close(self) -> None:
        """Stop serving; threads of its own end with the program."""
        quiet = redirect_stdout(StringIO())
        with quiet:
            self.server.stop()


@contextmanager
def guarded(token: str) -> Iterator[None]:
    """Servers opened inside this context answer only requests of their own page that carry the token.

    Viser has no hook for this, so the function by which it opens its server is replaced for that time.
    """
    from viser.infra import _infra

    module: Any = _infra.websockets.asyncio.server
    opened = module.serve

    def serve(*given: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        return opened(*given, process_request=_gatekeeper(token, process_request), **options)

    with _ONE_AT_A_TIME:
        module.serve = serve
        try:
            yield
        finally:
            module.serve = opened


_ONE_AT_A_TIME = threading.Lock()


def _gatekeeper(token: str, inner: Callable[..., Any] | None) -> Callable[..., Any]:
    """What looks at every request before viser does."""

    def look(connection: Any, request: Any) -> Any:
        origin, host = request.headers.get("Origin"), request.headers.get("Host", "")
        if origin is not None and urlsplit(origin).netloc != host:
            return connection.respond(HTTPStatus.FORBIDDEN, "another site's page has no access\n")
        if not token:
            if urlsplit(f"//{host}").hostname not in LOCAL:  # a name of somebody else's that leads here
                return connection.respond(HTTPStatus.FORBIDDEN, "this page is for this computer only\n")
            return None if inner is None else inner(connection, request)
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        if not (_same(given, token) or _same(_cookie(request), token)):
            return connection.respond(HTTPStatus.FORBIDDEN, "the address needs the token that was printed with it\n")
        response = None if inner is None else inner(connection, request)
        if response is not None and given:
            response.headers["Set-Cookie"] = f"{COOKIE}={_quoted(token)}; HttpOnly; SameSite=Strict; Path=/"
        return response

    return look


def _same(one: str, other: str) -> bool:
    return hmac.compare_digest(*(each.encode("utf-8", "surrogatepass") for each in (one, other)))


def _cookie(request: Any) -> str:
    try:
        found = SimpleCookie(request.headers.get("Cookie", ""))
    except CookieError:
        return ""
    return unquote(found[COOKIE].value) if COOKIE in found else ""
