"""Who may look: the address that `ir view` prints ends with a token, and only who has it gets an
answer.

The page is asked for with the token; its answer sets a cookie, which the browser sends with
everything that the page asks for then, the websocket included. Cookies don't know ports, so its
name has the port.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from hmac import compare_digest
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

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
