"""viser's server for `ir view`: browsers on this machine alone, with a token.

It listens on 127.0.0.1 and answers a request that has its token, and a page that it served itself:
another page in the same browser is refused by its Origin. viser can publish a server through a
tunnel when a client asks for it; this one does not.
"""

from __future__ import annotations

import io
import secrets
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from hmac import compare_digest
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from importlib.util import find_spec
from typing import Any
from urllib.parse import parse_qs, urlsplit

from ir_cli.errors import CommandError, InputError
from ir_cli.ports import TCP, free_port, is_free

# The token. The page is asked for with it; its answer sets a cookie, which the browser sends with
# everything that the page asks for then, the websocket included. Cookies don't know ports, so its
# name has the port.

REFUSAL = "ir view answers to the address that it printed: it ends with a token\n"
Answer = Callable[[Any, Any], Any]
"""What websockets calls with connection and request: a response, None: go on with the websocket."""


def new_token() -> str:
    """A token, made anew at each start."""
    return secrets.token_urlsafe(24)


def address(host: str, port: int, token: str) -> str:
    """What a browser opens."""
    return f"http://{host}:{port}/?token={token}"


def guarded(answer: Answer, token: str, port: int) -> Answer:
    """The same answers for who has the token, a refusal for all others."""
    name = f"ir_view_{port}"

    def answered(connection: Any, request: Any) -> Any:
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        if not any(_same(each, token) for each in (given, _cookie(request, name))):
            return connection.respond(HTTPStatus.FORBIDDEN, REFUSAL)
        response = answer(connection, request)
        if response is not None and given:
            response.headers["Set-Cookie"] = f"{name}={token}; Path=/; HttpOnly; SameSite=Strict"
        return response

    return answered


def _same(given: str, token: str) -> bool:
    return compare_digest(given.encode(), token.encode())


def _cookie(request: Any, name: str) -> str:
    try:
        found = SimpleCookie("; ".join(request.headers.get_all("Cookie"))).get(name)
    except CookieError:
        return ""
    return found.value if found is not None else ""


# viser's server, for browsers on this machine alone.
#
HOST = "127.0.0.1"
PORT = 8880
ATTEMPTS = 20
"""Free ports that are tried: another program may take one between the look and the use."""
MISSING = 'ir view needs viser: pip install "ir_cli[view]", or pip install viser'
_STARTING = threading.Lock()


def check_installed() -> None:
    """Raise InputError with what to install where viser is missing."""
    if find_spec("viser") is None:
        raise InputError(MISSING)


def opened(port: int | None, token: str) -> Any:
    """A running viser.ViserServer on a port, 0: a free one, None: the usual one or a free one; for
    who has the token.

    Raises CommandError where the port is taken.
    """
    if port is None:
        port = PORT if is_free(PORT, TCP, HOST) else 0
    if port:
        server = _on(port, token)
        if server is None:
            raise CommandError(f"port {port} of {HOST} is taken: give another, or 0 for a free one")
        return server
    for _ in range(ATTEMPTS):
        server = _on(free_port(TCP), token)
        if server is not None:
            return server
    raise CommandError(f"no port of {HOST} is free")


def closed(server: Any) -> None:
    """Ends the server and its threads, without a word on the terminal."""
    with redirect_stdout(io.StringIO()):
        server.stop()


def _on(port: int, token: str) -> Any:
    """A server on exactly this port, None where that is taken."""
    if not is_free(port, TCP, HOST):
        return None
    import viser
    from viser import _messages

    origins = [f"http://{name}:{port}" for name in (HOST, "localhost")]
    with _STARTING, _asked_by(origins, token, port), redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=HOST, port=port, verbose=False)
    if server.get_port() != port:  # viser goes on to the next port, where the origins would not fit
        closed(server)
        return None
    for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)
    return server


class _asked_by:  # noqa: N801 - used as a function
    """While it lasts, servers of websockets start that answer to these origins only (None: to
    programs), and to who has the token.
    """

    def __init__(self, origins: list[str], token: str, port: int) -> None:
        self._origins: list[Any] = [*origins, None]
        self._token = token
        self._port = port

    def __enter__(self) -> None:
        import websockets.asyncio.server as module

        self._module = module
        self._serve = module.serve
        module.serve = self._started  # type: ignore[assignment, misc]  # viser has no argument for it

    def _started(self, *arguments: Any, process_request: Answer, **settings: Any) -> Any:
        answer = guarded(process_request, self._token, self._port)
        return self._serve(*arguments, process_request=answer, origins=self._origins, **settings)

    def __exit__(self, *_: object) -> None:
        self._module.serve = self._serve  # type: ignore[misc]
