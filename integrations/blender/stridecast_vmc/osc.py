"""OSC 1.0, as far as VMC needs it: bundles and messages of strings and numbers. Plain Python, without Blender."""

from __future__ import annotations

import struct
from collections.abc import Iterator

MOST_DEEP = 4
"""Bundles in bundles."""

_NUMBERS = {"f": ">f", "i": ">i", "d": ">d", "h": ">q"}


def messages(data: bytes, depth: int = 0) -> Iterator[tuple[str, list]]:
    """Addresses and arguments of all messages in a datagram.

    Raises
    ------
    ValueError
        It is no OSC.
    """
    if not data.startswith(b"#bundle\0"):
        yield _message(data)
        return
    if depth >= MOST_DEEP:
        raise ValueError("bundles within bundles within bundles")
    at = 16
    while at < len(data):
        if at + 4 > len(data):
            raise ValueError("a bundle is cut")
        (size,) = struct.unpack_from(">i", data, at)
        at += 4
        if not 0 < size <= len(data) - at:
            raise ValueError("a bundle promises more than it has")
        yield from messages(data[at : at + size], depth + 1)
        at += size


def _message(data: bytes) -> tuple[str, list]:
    address, at = _string(data, 0)
    if not address.startswith("/"):
        raise ValueError("no address")
    kinds, at = _string(data, at)
    if not kinds.startswith(","):
        raise ValueError("no types")
    arguments: list = []
    for kind in kinds[1:]:
        if kind == "s":
            text, at = _string(data, at)
            arguments.append(text)
        elif kind in _NUMBERS:
            size = struct.calcsize(_NUMBERS[kind])
            if at + size > len(data):
                raise ValueError("a message is cut")
            arguments += struct.unpack_from(_NUMBERS[kind], data, at)
            at += size
        elif kind in "TF":
            arguments.append(kind == "T")
        else:
            raise ValueError(f"arguments of type {kind!r} are not read")
    return address, arguments


def _string(data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at)
    if end < 0:
        raise ValueError("a string has no end")
    return data[at:end].decode("utf-8", "replace"), (end + 4) // 4 * 4
