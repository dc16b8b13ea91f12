"""Definitions of strangers: what reading takes is bounded by the bytes that are read, whatever
types they claim to be of.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from ir_recorder.errors import ReadError
from ir_recorder.format import schemas
from ir_recorder.format.schemas import MOST_DEPTH, MOST_TYPES, SEPARATOR
from ir_recorder.reading import cdr
from ir_recorder.reading.cdr import Columns, fitting
from ir_recorder.reading.mcap_file import RawChannel
from ir_recorder.reading.messages import decoder_of
from ir_recorder.reading.reader import read_recording

CASES = 150
KIND = "p/msg/T0"
HEADER = b"\0\1\0\0"
ARRAYS = ("", "", "[]", "[]", "[3]", "[<=4]", "[4000000000]")
PRIMITIVES = ("uint8", "float64", "string", "bool")


def definition(sections: list[str]) -> str:
    """Of types T0, T1, ... with these fields."""
    inner = [f"{SEPARATOR}\nMSG: p/T{k}\n{text}" for k, text in enumerate(sections[1:], start=1)]
    return "\n".join([sections[0], *inner]) + "\n"


def deep(generator: np.random.Generator) -> list[str]:
    """Types one in the other, up to far more than are read."""
    depth = int(generator.choice([3, MOST_DEPTH - 1, MOST_DEPTH + 1, 3 * MOST_TYPES]))
    array = str(generator.choice(["", "[]"]))
    return [f"p/T{k + 1}{array} a" for k in range(depth)] + ["uint8 a"]


def wide(generator: np.random.Generator) -> list[str]:
    """A type of very many others, each of them empty or a byte."""
    count = int(generator.choice([20, MOST_TYPES + 1]))
    inner = str(generator.choice(["", "uint8 a"]))
    return ["\n".join(f"p/T{k}[] a{k}" for k in range(1, count)), *([inner] * (count - 1))]


def empty(generator: np.random.Generator) -> list[str]:
    """Sequences, and sequences of arrays, of a type without fields."""
    array = str(generator.choice(["[]", "[90000]", "[4000000000]"]))
    return [f"p/T1{array} a", "p/T2[] b", ""]


def recursive(generator: np.random.Generator) -> list[str]:
    """A type that contains itself, over some others."""
    count = int(generator.integers(1, 6))
    return [f"p/T{(k + 1) % count}{generator.choice(['', '[]'])} a" for k in range(count)]


def anything(generator: np.random.Generator) -> list[str]:
    """Any fields of any types, which may be missing, empty or contain each other."""
    count = int(generator.integers(1, 8))
    sections = []
    for _ in range(count):
        names = [f"p/T{generator.integers(count + 1)}", *PRIMITIVES]
        fields = int(generator.integers(0, 4))
        sections.append(
            "\n".join(
                f"{generator.choice(names)}{generator.choice(ARRAYS)} f{k}" for k in range(fields)
            )
        )
    return sections


def messages(generator: np.random.Generator) -> list[bytes]:
    """Few bytes that claim to be very much, or anything."""
    claims = HEADER + struct.pack("<I", 0xFFFFFFFF)
    noise = [
        HEADER + generator.integers(0, 4, 4 * int(size), dtype=np.uint8).tobytes()
        for size in generator.integers(0, 12, 20)
    ]
    return [claims] * 20 + [claims + bytes(40)] * 20 + noise


def counted(
    monkeypatch: pytest.MonkeyPatch, place: Any, name: str, counts: Counter[str]
) -> Callable[[str, int], None]:
    """Count the calls of a function, and fail at one more than `allow`ed."""
    original = getattr(place, name)
    allowed: dict[str, int] = {}

    def call(*arguments: Any) -> Any:
        counts[name] += 1
        assert counts[name] <= allowed.get(name, 0), f"{name} is called without end"
        return original(*arguments)

    monkeypatch.setattr(place, name, call)
    return allowed.__setitem__


@pytest.mark.parametrize("kind", [deep, wide, empty, recursive, anything])
def test_the_work_is_bounded_by_the_bytes_and_a_definition_is_read_once(
    kind: Callable[[np.random.Generator], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A byte holds at most one value, in at most MOST_DEPTH types; two readers walk it."""
    counts: Counter[str] = Counter()
    walks = [
        counted(monkeypatch, cdr._Walker, name, counts)
        for name in ("structure", "_numbers", "_text")
    ]
    parses = counted(monkeypatch, schemas, "fields_of", counts)
    generator = np.random.default_rng(27)
    for case in range(CASES if kind is anything else 12):
        sections = kind(generator)
        text = definition(sections) + f"# {kind.__name__} {case}\n"  # another one each time
        came = messages(generator)
        for allow, name in zip(walks, ("structure", "_numbers", "_text"), strict=True):
            allow(name, 2 * (MOST_DEPTH + 1) * sum(map(len, came)))
        parses("fields_of", min(len(sections), MOST_TYPES))
        counts.clear()
        times = np.zeros(len(came), dtype=np.int64)
        channel = RawChannel("/t", KIND, "cdr", "ros2msg", text, "", times, tuple(came))
        said = ""
        try:
            rows = fitting(came, KIND, text)
            assert Columns([came[row] for row in rows], KIND, text).count == len(rows)
            decoder_of(channel)
        except ReadError as error:
            said = str(error)
        except ValueError:  # the library refuses such a definition
            said = kind.__name__
        assert len(said) < 300


def test_messages_that_fail_alike_are_walked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: Counter[str] = Counter()
    counted(monkeypatch, cdr._Walker, "structure", counts)("structure", 3)
    good = HEADER + struct.pack("<I", 2) + b"ab"
    claims = HEADER + struct.pack("<I", 9) + b"ab"
    big_endian = b"\0\0\0\0" + good[4:]
    rows = fitting([claims, good, big_endian] * 1_000, KIND, "uint8[] a\n")
    assert rows == list(range(1, 3_000, 3))


def test_values_are_bounded_with_their_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """A byte each, but a path of any length: a long name, or types in types."""
    monkeypatch.setattr(cdr, "MOST_WALKED", 100_000)
    for name, most in (("a", 1_000), ("a" * 9_000, 5)):
        text = definition([f"p/T1[] {name}", "bool b"])
        for count, fits in ((most, True), (4 * most, False)):
            message = HEADER + struct.pack("<I", count) + bytes(count)
            if fits:
                assert Columns([message], KIND, text).lengths(f"{name}[0].b") == {1}
            else:
                with pytest.raises(ReadError, match="too many values"):
                    Columns([message], KIND, text)


def test_layouts_are_compared_in_few_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cdr, "MOST_COMPARED", 0)
    sizes = [(k, 99 - k) for k in range(100)]
    came = [
        HEADER + struct.pack("<I", a) + bytes(a + -a % 4) + struct.pack("<I", b) + bytes(b)
        for a, b in sizes
    ]
    came = [(message + bytes(200))[:200] for message in came]
    for few in (20, 100):
        if few == 20:
            assert Columns(came[:few], KIND, "uint8[] a\nuint8[] b\n").ends().size == few
        else:
            monkeypatch.setattr(cdr, "MOST_PASSES", 1)
            with pytest.raises(ReadError, match="too many layouts"):
                Columns(came, KIND, "uint8[] a\nuint8[] b\n")


def test_a_long_message_of_too_many_values_is_not_decoded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cdr, "MOST_WALKED", 1_000_000)
    text = definition(["p/T1[] a", "bool b"])
    channel = RawChannel("/t", KIND, "cdr", "ros2msg", text, "", np.zeros(0, dtype=np.int64), ())
    decode = decoder_of(channel)
    assert decode is not None
    few, many = (HEADER + struct.pack("<I", count) + bytes(count) for count in (1_000, 100_000))
    assert len(decode(few).a) == 1_000
    with pytest.raises(ReadError, match="too many values"):
        decode(many)


def test_a_topic_of_too_many_values_is_given_up_at_the_first_of_its_messages(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cdr, "MOST_WALKED", 100_000)
    counts: Counter[str] = Counter()
    counted(monkeypatch, cdr._Walker, "structure", counts)("structure", 20_000)
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "stranger")
        kind = "diagnostic_msgs/msg/DiagnosticArray"
        text = definition(["p/T1[] a", "bool b"])
        schema = writer.register_schema(kind, "ros2msg", text.encode())
        channel = writer.register_channel("/diagnostics", "cdr", schema)
        for k in range(100):
            writer.add_message(channel, k, HEADER + struct.pack("<I", 70_000) + bytes(70_000), k)
        writer.finish()
    said = [each for each in read_recording(path).problems if "too many values" in each]
    assert said
    assert all(each.startswith("/diagnostics: the rest is left out") for each in said)
