"""The text of a file: UTF-8. UTF-16, which some editors of Windows write, is recognised and
named.
"""

from __future__ import annotations

import codecs

from ir_description.errors import DescriptionFileError

_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_HEAD = 64  # bytes, in which every second one is zero where Latin letters stand in UTF-16


def text_of(content: bytes, source: str, error: type[DescriptionFileError]) -> str:
    """Return the text of a file's content; raise `error` with the line of the first byte that is
    none.
    """
    if is_utf16(content):
        raise error(source, 1, "the file is UTF-16 text, must be UTF-8: save it with that encoding")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as refused:
        line = content.count(b"\n", 0, refused.start) + 1
        raise error(
            source, line, f"byte 0x{content[refused.start]:02x} is not UTF-8 text"
        ) from refused


def is_utf16(content: bytes) -> bool:
    """Whether text begins with the mark of UTF-16 or, without it, with Latin letters of two
    bytes.
    """
    zeros = [content[odd:_HEAD:2].count(0) for odd in (0, 1)]
    return content.startswith(_MARKS) or (
        min(zeros) == 0 and 4 * max(zeros) > min(len(content), _HEAD)
    )
