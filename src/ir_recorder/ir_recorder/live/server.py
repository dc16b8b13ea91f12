"""The server of `ir view`: one page, the cell's scene, a stream of events, and requests of its
controls.

    GET /        the page, which holds nothing of the cell
    GET /scene   the cell as JSON (404 while it isn't known)
    GET /events  server-sent events: `start` with what is kept, then `records`
    POST /press  {"name": "ab", "value": {"level": true, "stop": "1795973304123000002"}}: a bit of
                 the PLC, and the last stop that the page shows; of `ir view`, what a hand did; with
                 the token

It listens on 127.0.0.1 alone. Every connection has a thread that only reads what is kept, so a
browser that is slow or dead costs its own connection and nothing else. Those that watch have places
of their own; among the others a new one always finds a place, so nobody keeps the stop button out.
"""

from __future__ import annotations

import json
import queue
import re
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import cache
from hmac import compare_digest
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, NamedTuple

from ir_msgs_py.plc import PlcInputs
from ir_recorder.errors import RecorderError
from ir_recorder.live.stream import Stream
from ir_recorder.report.page import asset
from ir_values.errors import one_line

# Who is answered: browsers on this machine that look at this page, and none that another page
# sent.
#
# A page from elsewhere can make a browser ask a server on loopback, under a name that it lets
# point there (DNS rebinding) or under its own address. The header Host says which name was asked
# for, Origin which page asked. The token is in the address that the command prints, behind #: it
# is never sent to a server on its own.

ADDRESS = "127.0.0.1"
TOKEN_HEADER = "X-Live-Token"
NAMES = (ADDRESS, "localhost")
# of Sec-Fetch-Site: this page, or a person who typed the address
_OWN_SITES = (
    "same-origin",
    "none",
)


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

    def token_refusal(self, headers: Mapping[str, str]) -> str:
        """Why a request without the token is not answered, "" where it has it."""
        given = headers.get(TOKEN_HEADER, "").encode("utf-8", "replace")
        if not compare_digest(given, self.token.encode()):
            return "this needs the address that `ir view` printed: it ends with a token"
        return ""

    def command_refusal(self, headers: Mapping[str, str]) -> str:
        """Why a request that acts is not answered, "" where it is."""
        if refusal := self.token_refusal(headers):
            return refusal
        if headers.get("Content-Type", "").partition(";")[0].strip() != "application/json":
            return "a request has to be application/json"
        return ""


# The pages: the report's styles, charts and 3D view, what stands beside them, and what feeds them.

NONCE = secrets.token_urlsafe(18)
"""Of this process: only the page's own script and style run."""
_SHOWN = ("charts.js", "renderer.js", "motion.js", "export.js", "live_panel.js")


@cache
def _page(parts_of: str, scripts: tuple[str, ...]) -> str:
    """The page with the parts of a file, each below a comment with its name."""
    found = re.findall(r"<!-- (\w+) -->\n(.*?)(?=<!-- |\Z)", asset(parts_of), re.DOTALL)
    parts = {name: words if words.startswith(" ") else words.strip() for name, words in found}
    parts |= {
        "nonce": NONCE,
        "style": asset("page.css") + asset("view.css"),
        "script": "\n".join(asset(script) for script in (*_SHOWN, *scripts)),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("view.html"))


_NUMBER = re.compile(r"\d{0,19}\Z", re.ASCII)


@dataclass(frozen=True)
class Site:
    """A page and what its controls may ask for.

    parts, scripts: files of the page. accepts: whether something is a value of a control; values:
    what that is, in words. private: even who only watches needs the token.
    """

    parts: str
    scripts: tuple[str, ...]
    accepts: Callable[[object], bool]
    values: str
    private: bool

    @property
    def page(self) -> str:
        """The page as text; it holds nothing of the cell."""
        return _page(self.parts, self.scripts)


def _is_level(value: object) -> bool:
    """Whether it is a level, with or without the last stop that whoever asks for it has seen."""
    if isinstance(value, bool):
        return True
    if not isinstance(value, dict) or set(value) != {"level", "stop"}:
        return False
    level = value["level"]
    stop = value["stop"]
    return isinstance(level, bool) and isinstance(stop, str) and bool(_NUMBER.match(stop))


LIVE = Site(
    "view_live.html",
    ("live_motion.js", "live.js"),
    _is_level,
    'true, false or {"level": true or false, "stop": TEXT, the last stop that the page shows}',
    private=False,
)
"""Of a cell whose nodes run: whoever is on this machine may watch; buttons need the token."""


MOST_WATCHING = 32
"""Browsers that watch; each costs a thread that wakes 20 times a second."""
MOST_ASKING = 32
"""Connections whose request is being sent or answered. One more takes the place of the oldest."""
PATIENCE = 5.0  # s: for a request and its answer together, and for a browser to take an event
SILENCE = 1.0  # s: then a comment is sent, and a browser that has gone is noticed
MOST_BODY = 1_000  # bytes of a request
_CROWDED = "too many browsers look at this cell; close one"


class ButtonAnswer(NamedTuple):
    """What came of a button: whether it was done, and a sentence."""

    done: bool
    sentence: str


Press = Callable[[str, Any], ButtonAnswer]
"""Asks for what a control says, a level of a PLC bit, and waits for the answer; called from a
connection's thread.
"""


class LiveServer:
    """Serves a stream to browsers from a thread of its own until it is closed.

    press: does what a control asks for; scene: the cell as JSON, b"" while it isn't known; site:
    the page. RecorderError where the port is taken. port 0: a free one.
    """

    def __init__(
        self,
        stream: Stream,
        press: Press,
        scene: Callable[[], bytes],
        port: int = 0,
        *,
        site: Site = LIVE,
    ) -> None:
        try:
            self._server = _Server((ADDRESS, port), _Handler)
        except (OSError, OverflowError) as error:
            raise RecorderError(
                f"port {port} of {ADDRESS} can't be listened on: {error}"
            ) from error
        self.port = int(self._server.server_address[1])
        self.guard = Guard(self.port)
        self._server.guard = self.guard
        self._server.stream = stream
        self._server.press = press
        self._server.scene = scene
        self._server.site = site
        self._stream = stream
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="live", daemon=True
        )
        self._thread.start()

    @property
    def address(self) -> str:
        """What a browser opens; whoever has it may press the buttons."""
        return f"http://{ADDRESS}:{self.port}/#{self.guard.token}"

    @property
    def connections(self) -> int:
        """How many there are now."""
        return self._server.connections

    def close(self) -> None:
        """Ends all connections."""
        self._stream.close()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = 128
    guard: Guard
    stream: Stream
    press: Press
    scene: Callable[[], bytes]
    site: Site

    def __init__(self, *arguments: Any) -> None:
        self._places = threading.Lock()
        self._asking: dict[Any, float] = {}  # when each came, the oldest first
        self._watching: set[Any] = set()
        super().__init__(*arguments)

    @property
    def connections(self) -> int:
        """Those that ask and those that watch."""
        return len(self._asking) + len(self._watching)

    def process_request(self, request: Any, client_address: Any) -> None:
        """A thread for the connection; where all places are taken, the oldest that asks goes."""
        with self._places:
            if len(self._asking) >= MOST_ASKING:
                _hang_up(next(iter(self._asking)))
                del self._asking[next(iter(self._asking))]
            self._asking[request] = time.monotonic()
        try:
            super().process_request(request, client_address)
        except BaseException:  # no thread could be started
            self._leave(request)
            raise

    def service_actions(self) -> None:
        """Hang up on whoever takes too long, however often it sends a byte."""
        latest = time.monotonic() - PATIENCE
        with self._places:
            for request in [each for each, came in self._asking.items() if came < latest]:
                _hang_up(request)
                del self._asking[request]

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """As the base class does it, and frees the place."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._leave(request)

    def watch(self, request: Any) -> bool:
        """Whether a place to watch from is free; then the connection has it."""
        with self._places:
            free = len(self._watching) < MOST_WATCHING
            if free and self._asking.pop(request, 0.0):
                self._watching.add(request)
        return free

    def keep(self, request: Any) -> None:
        """A button was pressed: the connection stays until that is answered."""
        with self._places:
            self._asking.pop(request, None)

    def _leave(self, request: Any) -> None:
        with self._places:
            self._asking.pop(request, None)
            self._watching.discard(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke is nobody's error."""


def _hang_up(request: Any) -> None:
    with suppress(OSError):  # it has gone by itself
        request.shutdown(socket.SHUT_RDWR)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = PATIENCE
    protocol_version = "HTTP/1.1"
    server_version = "ir_live"
    sys_version = ""
    error_message_format = "%(message)s\n"
    error_content_type = "text/plain; charset=utf-8"

    def do_GET(self) -> None:
        guard = self.server.guard
        headers = self.headers
        site = self.server.site
        refusal = guard.refusal(headers)  # type: ignore[arg-type]
        if not refusal and site.private and self.path != "/":
            refusal = guard.token_refusal(headers)  # type: ignore[arg-type]
        if refusal:
            self._say(HTTPStatus.FORBIDDEN, refusal)
        elif self.path == "/":
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", site.page.encode())
        elif self.path == "/scene":
            scene = self.server.scene()
            found = HTTPStatus.OK if scene else HTTPStatus.NOT_FOUND
            self._send(found, "application/json", scene or b"null")
        elif self.path == "/events" and not self.server.watch(self.connection):
            self._say(HTTPStatus.SERVICE_UNAVAILABLE, _CROWDED)
        elif self.path == "/events":
            self._events()
        else:
            self._say(HTTPStatus.NOT_FOUND, "there is /, /scene and /events")

    def do_POST(self) -> None:
        guard = self.server.guard
        headers = self.headers
        refusal = guard.refusal(headers) or guard.command_refusal(headers)  # type: ignore[arg-type]
        length = headers.get("Content-Length", "")
        if refusal:
            self._say(HTTPStatus.FORBIDDEN, refusal)
        elif self.path != "/press":
            self._say(HTTPStatus.NOT_FOUND, "there is /press")
        elif not (length.isascii() and length.isdigit() and int(length) <= MOST_BODY):
            self._say(
                HTTPStatus.BAD_REQUEST,
                f"a request has a Content-Length of at most {MOST_BODY} bytes",
            )
        elif (command := _command(self.rfile.read(int(length)), self.server.site)) is None:
            words = f'a request is {{"name": TEXT, "value": {self.server.site.values}}}'
            self._say(HTTPStatus.BAD_REQUEST, words)
        else:
            self.server.keep(self.connection)
            answer = self.server.press(*command)
            self._send(HTTPStatus.OK, "application/json", json.dumps(answer._asdict()).encode())

    def _events(self) -> None:
        self.send_response(HTTPStatus.OK)
        self._headers("text/event-stream")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        stream = self.server.stream
        content, number = stream.begin()
        self._event(b"start", content)
        while not stream.closed:
            kept = stream.after(number, SILENCE)
            if kept is None:
                content, number = stream.begin()
                self._event(b"start", content)
                continue
            records, number = kept
            if records:
                self._event(b"records", b"[" + b",".join(records) + b"]")
            else:
                self.wfile.write(b": nothing new\n\n")

    def _event(self, name: bytes, data: bytes) -> None:
        self.wfile.write(b"event: " + name + b"\ndata: " + data + b"\n\n")

    def _say(self, status: HTTPStatus, sentence: str) -> None:
        self._send(status, "text/plain; charset=utf-8", f"{one_line(sentence)}\n".encode())

    def _send(self, status: HTTPStatus, kind: str, content: bytes) -> None:
        self.send_response(status)
        self._headers(kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        self.wfile.write(content)

    def _headers(self, kind: str) -> None:
        own = (
            f"script-src 'nonce-{NONCE}'; style-src 'nonce-{NONCE}'; connect-src 'self'; "
            "img-src data:; "
        )
        closed = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        for name, value in (
            ("Content-Type", kind),
            ("Content-Security-Policy", own + closed),
            ("Cache-Control", "no-store"),
            ("Referrer-Policy", "no-referrer"),
            ("X-Content-Type-Options", "nosniff"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Cross-Origin-Opener-Policy", "same-origin"),
        ):
            self.send_header(name, value)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing is logged: addresses hold no news, and their text is a stranger's."""


def _command(body: bytes, site: Site) -> tuple[str, Any] | None:
    """Name and value of a control; None for anything else."""
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    if not isinstance(content, dict) or set(content) != {"name", "value"}:
        return None
    name = content["name"]
    value = content["value"]
    return (name, value) if isinstance(name, str) and site.accepts(value) else None


# What browsers ask for, handed from their threads to the node's and answered there.

BITS = tuple(field.name for field in fields(PlcInputs) if field.name != "operating_mode")
MOST_WAITING = 16
"""Requests of buttons; a driver answers each within 20 ms."""
_STOP = "emergency_stop"


_UNANSWERED = ButtonAnswer(False, f"the driver has not answered within {PATIENCE:g} s")


@dataclass(eq=False)
class LevelCommand:
    """A level asked for, and the last stop that who asks has seen, 0 for none; `answer` lets the
    browser's thread go on, once.
    """

    name: str
    value: bool
    after_stop: int

    @property
    def presses_the_stop(self) -> bool:
        """Whether it is the one that counts whatever its sender has seen."""
        return self.name == _STOP and self.value

    _done: threading.Event = field(default_factory=threading.Event)
    _answer: ButtonAnswer = _UNANSWERED

    def answer(self, done: bool, sentence: str) -> None:
        """Says what came of it."""
        self._answer = ButtonAnswer(done, sentence)
        self._done.set()

    def wait(self) -> ButtonAnswer:
        """The answer, or that there was none in time."""
        self._done.wait(PATIENCE)
        return self._answer


class Commands:
    """A short queue; `press` is called by browsers' threads, `take` by the node.

    A press of the emergency stop always finds a place, and is taken first. What was asked for
    before it and waits is refused: nothing of it may acknowledge the press or let go of the button.
    """

    def __init__(self) -> None:
        self._queue: queue.Queue[LevelCommand] = queue.Queue(MOST_WAITING)
        self._stops: queue.Queue[LevelCommand] = queue.Queue()
        self._order = threading.Lock()  # of presses and of what waits when they come

    def press(self, name: str, value: Any) -> ButtonAnswer:
        """Asks and waits; refuses what is no bit, and what comes faster than it is answered."""
        if name not in BITS:
            return ButtonAnswer(
                False, f"{name[:60]!r} is no bit of the PLC: known are {', '.join(BITS)}"
            )
        level, seen = (value, "") if isinstance(value, bool) else (value["level"], value["stop"])
        command = LevelCommand(name, level, int(seen or 0))
        stop = command.presses_the_stop
        try:
            with self._order:
                for before in _waiting(self._queue) if stop else ():
                    before.answer(False, "the emergency stop was pressed after it: ask again")
                (self._stops if stop else self._queue).put_nowait(command)
        except queue.Full:
            return ButtonAnswer(False, f"{MOST_WAITING} requests wait already")
        return command.wait()

    def take(self) -> Iterator[LevelCommand]:
        """What has been asked since the last time."""
        with self._order:
            taken = [*_waiting(self._stops), *_waiting(self._queue)]
        yield from taken


def _waiting(commands: queue.Queue[LevelCommand]) -> Iterator[LevelCommand]:
    """Those that wait, taken out."""
    with suppress(queue.Empty):
        while True:
            yield commands.get_nowait()
