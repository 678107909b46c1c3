"""Tables of flatbuffers, in which AEDAT4 packs its header and its packets."""

from __future__ import annotations

import struct

import numpy as np


class Table:
    """The root table of a flatbuffer (after its size, or at ``start``), with every offset checked."""

    def __init__(self, content: bytes, start: int = 4):
        self._content = content
        self._at = start + self._read("<I", start)
        self._fields = self._at - self._read("<i", self._at)
        self._size = self._read("<H", self._fields)

    def _read(self, form: str, at: int):
        if at < 0:  # Python would count from the end
            raise ValueError("a packet with an offset that points outside it")
        return unpack(form, self._content[at : at + struct.calcsize(form)])[0]

    def _place(self, field: int) -> int | None:
        slot = self._read("<H", self._fields + 4 + 2 * field) if 6 + 2 * field <= self._size else 0
        return self._at + slot if slot else None

    def number(self, field: int, form: str, default: int = 0) -> int:
        at = self._place(field)
        return default if at is None else self._read(form, at)

    def vector(self, field: int, dtype) -> np.ndarray:
        at = self._place(field)
        if at is None:
            return np.zeros(0, dtype)
        at += self._read("<I", at)
        return np.frombuffer(self._content, dtype, self._read("<I", at), at + 4)


def unpack(form: str, content: bytes) -> tuple:
    if len(content) != struct.calcsize(form):
        raise ValueError("truncated")
    return struct.unpack(form, content)
