"""Who is answered by the live view's server, what it says, and that nobody holds it up."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from http.client import HTTPConnection, HTTPResponse
from typing import Any

import pytest

from ir_msgs_py.ros.testing import PATIENCE
from ir_recorder.errors import RecorderError
from ir_recorder.live.server import (
    BITS,
    MOST_ASKING,
    MOST_BODY,
    MOST_WAITING,
    MOST_WATCHING,
    ButtonAnswer,
    Commands,
    LevelCommand,
    LiveServer,
)
from ir_recorder.live.stream import Stream

SEEN = "1795973304123000002"


def level(value: bool) -> dict[str, Any]:
    """What a button asks for: a level, by who has seen this stop."""
    return {"level": value, "stop": SEEN}


PRESSED = json.dumps({"name": "ab", "value": level(True)})


class Cell:
    """A server with a stream, and what its buttons asked for."""

    def __init__(self) -> None:
        self.stream = Stream()
        self.scene = b""
        self.pressed: list[tuple[str, bool]] = []
        self.server = LiveServer(self.stream, self.press, lambda: self.scene)

    def press(self, name: str, value: bool) -> ButtonAnswer:
        self.pressed.append((name, value))
        return ButtonAnswer(True, "set")

    def ask(self, method: str, path: str, body: str | None = None, **headers: str) -> HTTPResponse:
        """An answer; headers by name with _ for -, None for those that a browser sends by
        itself.
        """
        connection = HTTPConnection("127.0.0.1", self.server.port, timeout=PATIENCE)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, named)
        return connection.getresponse()

    def post(self, body: str = PRESSED, **headers: str) -> HTTPResponse:
        own = {"X_Live_Token": self.server.guard.token, "Content_Type": "application/json"}
        return self.ask("POST", "/press", body, **{**own, **headers})


@pytest.fixture
def cell() -> Iterator[Cell]:
    cell = Cell()
    yield cell
    cell.server.close()


def test_the_page_holds_nothing_of_the_cell_and_may_load_nothing(cell: Cell) -> None:
    answer = cell.ask("GET", "/")
    page = answer.read().decode()
    policy = answer.headers["Content-Security-Policy"]
    assert answer.status == 200
    assert cell.server.guard.token not in page
    assert "{{" not in page
    assert "default-src 'none'" in policy
    nonce = policy.partition("script-src 'nonce-")[2].partition("'")[0]
    assert page.count("<script") == page.count(f'<script nonce="{nonce}">') == 1
    assert cell.server.address.startswith("http://127.0.0.1:")
    assert cell.ask("GET", "/scene").status == 404
    cell.scene = b"{}"
    assert cell.ask("GET", "/scene").read() == b"{}"
    assert cell.ask("GET", "/../etc/passwd").status == 404


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:{port}"},
        {"Host": "127.0.0.1"},
        {"Host": ""},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
def test_other_pages_and_other_names_get_nothing(cell: Cell, headers: dict[str, str]) -> None:
    sent = {name: value.format(port=cell.server.port) for name, value in headers.items()}
    for path in ("/", "/scene", "/events"):
        answer = cell.ask("GET", path, **sent)
        assert answer.status == 403
        assert len(answer.read()) < 200
    assert cell.post(**sent).status == 403
    assert cell.pressed == []


def test_own_pages_are_answered_under_both_names(cell: Cell) -> None:
    for name in ("127.0.0.1", "localhost"):
        host = f"{name}:{cell.server.port}"
        assert cell.ask("GET", "/", Host=host).status == 200
        assert (
            cell.post(Host=host, Origin=f"http://{host}", Sec_Fetch_Site="same-origin").status
            == 200
        )
    assert cell.pressed == [("ab", level(True))] * 2


def test_a_button_needs_the_token_and_a_request_that_makes_sense(cell: Cell) -> None:
    assert json.loads(cell.post().read()) == {"done": True, "sentence": "set"}
    for token in ("", "wrong", cell.server.guard.token[:-1], "\xff" * 32):
        assert cell.post(X_Live_Token=token).status == 403
    for kind in ("text/plain", "application/x-www-form-urlencoded", ""):
        assert cell.post(Content_Type=kind).status == 403
    for body in (
        "",
        "[]",
        "{",
        '{"name": 1, "value": true}',
        '{"name": "ab", "value": 1}',
        '{"name": "ab", "value": {"level": true}}',
        '{"name": "ab", "value": {"level": true, "stop": 3}}',
        '{"name": "ab", "value": {"level": true, "stop": "99999999999999999999"}}',
        "[" * 900,
    ):
        assert cell.post(body).status == 400
    assert cell.post("x" * (MOST_BODY + 1)).status == 400
    assert cell.post(Content_Length="-1").status == 400
    assert cell.ask("POST", "/", "{}", X_Live_Token=cell.server.guard.token).status == 403
    assert cell.ask("DELETE", "/").status == 501
    assert cell.pressed == [("ab", level(True))]


def test_what_is_no_bit_is_refused_and_too_many_at_once_too() -> None:
    commands = Commands()
    assert not commands.press("reboot", level(True)).done
    assert all(name in commands.press("<b>", level(True)).sentence for name in BITS)
    waiting = [
        threading.Thread(target=commands.press, args=("ab", level(True)))
        for _ in range(MOST_WAITING)
    ]
    for thread in waiting:
        thread.start()
    taken: list[LevelCommand] = []
    while len(taken) < MOST_WAITING:
        taken += commands.take()
    for command in taken:
        command.answer(True, "set")
        assert command.wait() == ButtonAnswer(True, "set")
    for thread in waiting:
        thread.join()


def events(answer: HTTPResponse) -> Iterator[tuple[str, Any]]:
    """Name and content of each event."""
    name = ""
    while line := answer.readline():
        key, _, value = line.decode().rstrip("\n").partition(": ")
        if key == "event":
            name = value
        if key == "data":
            yield name, json.loads(value)


def test_events_begin_with_what_is_kept_and_go_on_for_several_browsers(cell: Cell) -> None:
    cell.stream.add({"mode": "MOVING"})
    readers = [events(cell.ask("GET", "/events")) for _ in range(3)]
    for reader in readers:
        name, content = next(reader)
        assert name == "start"
        assert content["records"][0]["mode"] == "MOVING"
    cell.stream.add({"mode": "</script>\n\nevent: x"})
    for reader in readers:
        name, records = next(reader)
        assert name == "records"
        assert records[0]["mode"] == "</script>\n\nevent: x"


def test_browsers_that_never_read_hold_up_nobody_and_too_many_are_refused(cell: Cell) -> None:
    dead = []
    for _ in range(MOST_WATCHING - 1):
        connection = socket.create_connection(("127.0.0.1", cell.server.port))
        connection.sendall(
            f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{cell.server.port}\r\n\r\n".encode()
        )
        dead.append(connection)
    for connection in dead:  # it has been answered, and takes nothing
        connection.recv(1, socket.MSG_PEEK)
    reader = events(cell.ask("GET", "/events"))
    next(reader)
    assert cell.ask("GET", "/events").status == 503
    crowd = [socket.create_connection(("127.0.0.1", cell.server.port)) for _ in range(200)]
    for connection in crowd[:-MOST_ASKING]:
        connection.settimeout(60.0)
        with suppress(ConnectionResetError):  # hung up on just as well
            assert connection.recv(100) == b""
    assert json.loads(cell.post().read())["done"]
    for connection in crowd:
        connection.close()
    for k in range(50):
        cell.stream.add({"load": f"{k}" * 20_000})
    seen: list[Any] = []
    while len(seen) < 50:
        seen += next(reader)[1]
    for connection in dead:
        connection.close()
    cell.stream.add({"load": "after"})
    assert next(reader)[1][-1]["load"] == "after"


def test_connections_that_drip_keep_no_button_out(cell: Cell, wait_for: Any) -> None:
    """A byte now and then is no request: who takes too long is hung up on, however it does it."""
    dripping = [
        socket.create_connection(("127.0.0.1", cell.server.port), timeout=PATIENCE)
        for _ in range(2 * MOST_ASKING)
    ]

    def all_are_hung_up_on() -> bool:
        assert json.loads(cell.post().read())["done"]
        for connection in dripping:
            with suppress(OSError):
                connection.send(b"G")
        return not cell.server.connections

    wait_for(all_are_hung_up_on, timeout=PATIENCE, what="the end of the slow connections")
    for connection in dripping:
        connection.close()


def test_a_stop_finds_a_place_among_waiting_requests_and_refuses_what_was_asked_before(
    wait_for: Any,
) -> None:
    """As release, conf_mess and drives_on of another browser: they would follow the press."""
    commands = Commands()
    answers: list[ButtonAnswer] = []

    def ask(name: str, value: bool) -> threading.Thread:
        thread = threading.Thread(target=lambda: answers.append(commands.press(name, level(value))))
        thread.start()
        return thread

    before = [ask("conf_mess", True) for _ in range(MOST_WAITING)]
    wait_for(lambda: commands._queue.qsize() == MOST_WAITING, what="all requests wait")
    stop = ask("emergency_stop", True)
    for thread in before:
        thread.join()
    assert not any(answer.done for answer in answers)
    assert "the emergency stop was pressed after it" in answers[0].sentence
    after = ask("emergency_stop", False)
    wait_for(lambda: commands._queue.qsize() == 1, what="the release waits")
    taken = list(commands.take())
    for command in taken:
        command.answer(True, "set")
    stop.join()
    after.join()
    assert [(each.name, each.value) for each in taken] == [
        ("emergency_stop", True),
        ("emergency_stop", False),
    ]


def test_a_port_that_is_taken_is_named_and_others_are_free(cell: Cell) -> None:
    with pytest.raises(RecorderError, match=str(cell.server.port)):
        LiveServer(Stream(), cell.press, lambda: b"", cell.server.port)
    with pytest.raises(RecorderError, match="70000"):
        LiveServer(Stream(), cell.press, lambda: b"", 70_000)


def test_words_that_are_no_http_end_their_connection_only(cell: Cell) -> None:
    for words in (
        b"\x16\x03\x01\x02\x00\r\n\r\n",
        b"GET <script> \r\n\r\n",
        b"\r\n" * 10,
        b"G" * 70_000 + b"\r\n",
    ):
        with socket.create_connection(
            ("127.0.0.1", cell.server.port), timeout=PATIENCE
        ) as connection:
            connection.sendall(words)
            connection.shutdown(socket.SHUT_WR)
            try:
                answer = connection.recv(10_000)
            except ConnectionResetError:
                answer = b""
            assert b"text/html" not in answer
    assert cell.ask("GET", "/").status == 200
