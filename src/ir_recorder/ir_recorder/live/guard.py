"""Who is answered: browsers on this machine that look at this page, and none that another page
sent.

A page from elsewhere can make a browser ask a server on loopback, under a name that it lets point
there (DNS rebinding) or under its own address. The header Host says which name was asked for,
Origin which page asked. The token is in the address that the command prints, behind #: it is never
sent to a server on its own.
"""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from hmac import compare_digest

ADDRESS = "127.0.0.1"
TOKEN_HEADER = "X-Live-Token"
NAMES = (ADDRESS, "localhost")
_OWN_SITES = (
    "same-origin",
    "none",
)  # of Sec-Fetch-Site: this page, or a person who typed the address


@dataclass(frozen=True)
class Guard:
    """Judges requests to a port of this machine; the token is made anew at each start."""

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @property
    def origins(self) -> tuple[str, ...]:
        """Origins of the page."""
        return tuple(f"http://{name}:{self.port}" for name in NAMES)

    def refusal(self, headers: Mapping[str, str]) -> str:
        """Why a request is not answered, "" where it is."""
        if headers.get("Host", "") not in {f"{name}:{self.port}" for name in NAMES}:
            return f"this server answers to {ADDRESS}:{self.port} and localhost:{self.port} only"
        origin = headers.get("Origin")
        site = headers.get("Sec-Fetch-Site", "none")
        if (origin is not None and origin not in self.origins) or site not in _OWN_SITES:
            return "another page's requests are not answered"
        return ""

    def command_refusal(self, headers: Mapping[str, str]) -> str:
        """Why a request that acts is not answered, "" where it is."""
        given = headers.get(TOKEN_HEADER, "").encode("utf-8", "replace")
        if not compare_digest(given, self.token.encode()):
            return "the buttons need the address that `ir live` printed: it ends with a token"
        if headers.get("Content-Type", "").partition(";")[0].strip() != "application/json":
            return "a request has to be application/json"
        return ""
