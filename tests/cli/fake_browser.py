"""A browser that looks at `ir view`, as far as messages go: what it would show, and what a person
does.
"""

from __future__ import annotations

import json
import threading
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from typing import Any

PATIENCE = 60.0  # s: a busy machine


class FakeBrowser:
    """Connected until it is closed; `state` is all that the server said."""

    def __init__(self, port: int, token: str, **headers: str) -> None:
        self._port = port
        self._headers = {"X-Live-Token": token, **headers}
        self.state: dict[str, Any] = {}
        self._events = HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
        self._events.request("GET", "/events", headers=self._headers)
        self.answer = self._events.getresponse()
        self._thread = threading.Thread(target=self._read, daemon=True)
        if self.answer.status == 200:
            self._thread.start()

    def _read(self) -> None:
        name = ""
        with suppress(OSError, HTTPException, ValueError):
            while line := self.answer.readline():
                key, _, value = line.decode().rstrip("\n").partition(": ")
                if key == "event":
                    name = value
                if key == "data":
                    content = json.loads(value)
                    records = content if name == "records" else content["records"]
                    first = [] if name == "records" else [content["before"]]
                    for record in [*first, *records]:
                        self.state.update(record)

    @property
    def text(self) -> str:
        """All that the page says."""
        said = dict(self.state)
        plan = said.get("plan") or {}
        words = [*said.get("errors", []), *plan.get("lines", []), str(said.get("note", ""))]
        words += [f"{row[0]} with {row[1]}: {row[2]} {row[4]}" for row in said.get("stations", [])]
        words += [" ".join(map(str, tile[:3])) for tile in said.get("tiles", [])]
        near = said.get("near")
        words += [f"nearest {near[7]}"] if near else []
        return "\n".join([*words, str(said.get("snippet", "")), str(said.get("compared", ""))])

    def get(self, path: str) -> tuple[int, bytes]:
        """Status and content of what the page asks for."""
        connection = HTTPConnection("127.0.0.1", self._port, timeout=PATIENCE)
        connection.request("GET", path, headers=self._headers)
        answer = connection.getresponse()
        return answer.status, answer.read()

    def scene(self) -> dict[str, Any]:
        """What is drawn."""
        found: dict[str, Any] = json.loads(self.get("/scene")[1])
        return found

    def press(self, name: str, value: Any = True) -> tuple[int, dict[str, Any]]:
        """Operate a control; the status and the answer."""
        connection = HTTPConnection("127.0.0.1", self._port, timeout=PATIENCE)
        kind = {"Content-Type": "application/json"}
        body = json.dumps({"name": name, "value": value})
        connection.request("POST", "/press", body, {**self._headers, **kind})
        answer = connection.getresponse()
        content = answer.read()
        return answer.status, json.loads(content) if answer.status == 200 else {}

    def close(self) -> None:
        """Close the connection."""
        self._events.close()
