"""A browser that looks at `ir view`, as far as messages go: what it would show, and what a person
does.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

PATIENCE = 60.0  # s: a busy machine


class FakeBrowser:
    """Connected until it is closed; `controls` are the panel's by uuid, `nodes` the scene's by
    name.
    """

    def __init__(self, port: int, token: str, origin: str | None = None) -> None:
        self._socket = connect(
            f"ws://127.0.0.1:{port}/",
            additional_headers={"Cookie": f"ir_view_{port}={token}"},
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            origin=None if origin is None else Origin(origin),
            max_size=None,
            proxy=None,
            open_timeout=PATIENCE,
            ping_timeout=PATIENCE,
        )
        self.controls: dict[str, dict[str, Any]] = {}
        self.nodes: dict[str, dict[str, Any]] = {}
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        places = dict.fromkeys(("position", "look_at", "up_direction"), (0.0, 0.0, 0.0))
        sizes = {"fov": 1.0, "near": 0.01, "far": 1000.0, "image_height": 300, "image_width": 400}
        self.send("ViewerCameraMessage", wxyz=(1.0, 0.0, 0.0, 0.0), **places, **sizes)

    def _read(self) -> None:
        try:
            for raw in self._socket:
                assert isinstance(raw, bytes)
                size = int.from_bytes(raw[8:16], "little")
                packed = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + size])
                for message in msgspec.msgpack.decode(packed, strict=False)["messages"]:
                    self._take(message)
        except ConnectionClosed:
            return

    def _take(self, message: Mapping[str, Any]) -> None:
        kind = message["type"]
        if kind == "GuiUpdateMessage":
            self.controls.get(message["uuid"], {}).update(message["updates"])
        elif kind == "GuiRemoveMessage":
            self.controls.pop(message["uuid"], None)
        elif kind.startswith("Gui") and "uuid" in message:
            value = {"value": message["value"]} if "value" in message else {}
            self.controls[message["uuid"]] = {
                **message.get("props", {}),
                **value,
                "uuid": message["uuid"],
            }
        elif kind == "RemoveSceneNodeMessage":
            self.nodes.pop(message["name"], None)
        elif kind == "SceneNodeUpdateMessage":
            self.nodes.get(message["name"], {}).update(message["updates"])
        elif kind in (
            "SetPositionMessage",
            "SetOrientationMessage",
            "SetSceneNodeVisibilityMessage",
        ):
            changed = {key: value for key, value in message.items() if key not in ("type", "name")}
            self.nodes.setdefault(message["name"], {}).update(changed)
        elif "name" in message and "props" in message:
            self.nodes[message["name"]] = dict(message["props"])

    @property
    def text(self) -> str:
        """All that stands in the panel as HTML."""
        return "\n".join(
            str(each["content"]) for each in list(self.controls.values()) if "content" in each
        )

    def red(self) -> set[str]:
        """Names of bodies and capsules that are drawn in red."""
        return {
            name.rpartition("/")[2].removeprefix("capsule_").removeprefix("held_")
            for name, props in list(self.nodes.items())
            if tuple(props.get("color", ())) == (225, 30, 40)
        }

    def control(self, label: str) -> dict[str, Any]:
        """The control with a label."""
        return next(each for each in list(self.controls.values()) if each.get("label") == label)

    def change(self, label: str, value: Any) -> None:
        """Give a control another value; press a button by True."""
        self.send("GuiUpdateMessage", uuid=self.control(label)["uuid"], updates={"value": value})

    def drag(self, position: Sequence[float], wxyz: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Move the handle to a place in the world."""
        self.send(
            "TransformControlsUpdateMessage", name="/drag", position=list(position), wxyz=list(wxyz)
        )

    def send(self, kind: str, **fields: Any) -> None:
        """Send any message."""
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
        self._thread.join(PATIENCE)
