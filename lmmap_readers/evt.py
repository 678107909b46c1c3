"""Decode event cameras' words: Prophesee's EVT2, EVT2.1 and EVT3, and the codecs of event_camera_msgs.

The layouts are those of Prophesee's published "encoding formats" and of the ROS package event_camera_codecs.
A decoder is fed runs of words in stream order and keeps the state to which later words refer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmmap.types import EVENT, event_array


def _latest(is_set: np.ndarray, values: np.ndarray, before) -> np.ndarray:
    """At each word (N,), the value of the latest word that sets it; ``before`` where none has."""
    index = np.maximum.accumulate(np.where(is_set, np.arange(1, len(values) + 1), 0))
    return np.concatenate([[before], values])[index]


def _set_bits(masks: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and bit numbers of the ``count`` lowest bits that are set in masks (N,), in the order of rows."""
    return np.nonzero((masks[:, None] >> np.arange(count, dtype=masks.dtype)) & masks.dtype.type(1))


class HighTime:
    """High part of the time, ``bits`` bits long, which the stream repeats and which rolls over."""

    def __init__(self, bits: int):
        self.period, self.last = 1 << bits, None

    def unroll(self, highs: np.ndarray) -> np.ndarray:
        """The high parts (N,) without roll-over; a step of more than half the period counts as one."""
        if not len(highs):
            return highs.astype(np.int64)
        before = highs[0] if self.last is None else self.last
        values = np.unwrap(np.concatenate([[before], highs]).astype(np.int64), period=self.period)[1:]
        self.last = int(values[-1])
        return values

    def at_words(self, is_set: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The latest high part (N,) at each word, -1 before the first, of the values at words that set it."""
        before, highs = -1 if self.last is None else self.last, np.zeros(len(values), np.int64)
        highs[is_set] = self.unroll(values[is_set])
        return _latest(is_set, highs, before)


class Evt2:
    """EVT2: words of 32 bit, an event each."""

    encoding, word = "EVT2", np.dtype("<u4")

    def __init__(self):
        self.high = HighTime(28)

    def events(self, words: np.ndarray) -> np.ndarray:
        """Events (M,) EVENT of words (N,); those before the first time are dropped."""
        is_event, t_us = self._timed(words)
        return _events(t_us, words[is_event])

    def _timed(self, words: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which words (N,) are events of a known time, and their times (M,)."""
        kind = words >> 28
        high = self.high.at_words(kind == 8, words & 0xFFF_FFFF)
        is_event = (kind <= 1) & (high >= 0)
        return is_event, high[is_event] << 6 | (words[is_event] >> 22 & 0x3F).astype(np.int64)


class Evt21(Evt2):
    """EVT2.1: words of 64 bit; one half is as in EVT2, the other marks up to 32 events of a row.

    ``legacy``: each word's high half comes first, as the IMX636 sends it.
    """

    encoding, word = "EVT2.1", np.dtype("<u8")

    def __init__(self, legacy: bool = False):
        super().__init__()
        self.legacy = legacy

    def events(self, words: np.ndarray) -> np.ndarray:
        """Events (M,) EVENT of words (N,); those before the first time are dropped."""
        halves = (words >> np.uint64(32)).astype(np.uint32), words.astype(np.uint32)
        upper, valid = reversed(halves) if self.legacy else halves
        is_event, t_us = self._timed(upper)
        row, bit = _set_bits(valid[is_event], 32)
        return _events(t_us[row], upper[is_event][row], bit)


def _events(t_us: np.ndarray, words: np.ndarray, right=0) -> np.ndarray:
    """Events (M,) EVENT of words of EVT2, shifted to the right by this many pixels."""
    return event_array(t_us, (words >> 11 & 0x7FF) + right, words & 0x7FF, words >> 28 == 1)


@dataclass(frozen=True)
class Codes16:
    """Kinds of a 16-bit word by its upper 4 bits; ``line`` is the coordinate that single events and vectors
    share: y if ``line_is_y``, else x."""

    line: int
    single: int
    base: int
    vector_12: int
    vector_8: int
    time_low: int
    time_high: int
    line_is_y: bool


EVT3 = Codes16(0, 2, 3, 4, 5, 6, 8, True)
LIBCAER_CMP = Codes16(2, 3, 4, 6, 5, 1, 0, False)


class Evt3:
    """EVT3, and libcaer_cmp, which is built alike: words of 16 bit, several per event."""

    encoding, word = "EVT3", np.dtype("<u2")

    def __init__(self, codes: Codes16 = EVT3):
        self.codes, self.high = codes, HighTime(12)
        self.low = self.line = -1
        self.base = self.polarity = 0

    def start_at_zero(self) -> None:
        """Make the next run count its time from zero, as each packet of libcaer_cmp does."""
        self.high.last = self.low = 0

    def events(self, words: np.ndarray) -> np.ndarray:
        """Events (M,) EVENT of words (N,); those before the first time and the first line are dropped."""
        c, kind, value = self.codes, words >> 12, (words & 0xFFF).astype(np.int64)
        if not len(words):
            return np.zeros(0, EVENT)
        t_us = self._times_us(kind, value)
        line = _latest(kind == c.line, value & 0x7FF, self.line)
        is_base = kind == c.base
        length = 12 * (kind == c.vector_12) + 8 * (kind == c.vector_8)
        passed = np.cumsum(length) - length  # coordinates passed by the vectors before each word
        base = _latest(is_base, (value & 0x7FF) - passed, self.base) + passed
        polarity = _latest(is_base, value >> 11, self.polarity)
        self.line, self.polarity = int(line[-1]), int(polarity[-1])
        self.base = int(base[-1] + length[-1])

        is_single = kind == c.single
        place, on = np.where(is_single, value & 0x7FF, base), np.where(is_single, value >> 11, polarity)
        mask = np.where(is_single, 1, value & (1 << length) - 1)
        is_event = (is_single | (length > 0)) & (t_us >= 0) & (line >= 0)
        row, bit = _set_bits(mask[is_event], 12)
        place, line = place[is_event][row] + bit, line[is_event][row]
        x, y = (place, line) if c.line_is_y else (line, place)
        return event_array(t_us[is_event][row], x, y, on[is_event][row] == 1)

    def _times_us(self, kind: np.ndarray, value: np.ndarray) -> np.ndarray:
        """Time (N,) at each word, -1 before both parts of it are known."""
        sets_high, sets_low = kind == self.codes.time_high, kind == self.codes.time_low
        high = self.high.at_words(sets_high, value)
        # a low part without a high part before it says nothing
        low = _latest(sets_low & (high >= 0), value, self.low)
        self.low = int(low[-1])
        return np.where((high >= 0) & (low >= 0), high << 12 | low, -1)


MONO = np.dtype([("ns", "<u4"), ("x", "<u2"), ("y", "<u2")])  # the highest bit of y is the polarity


def mono(e: np.ndarray, time_base_ns: int) -> np.ndarray:
    """Events (M,) EVENT of records (M,) `MONO`, the codec "mono"."""
    t_us = (e["ns"].astype(np.int64) + (time_base_ns + 500)) // 1000
    return event_array(t_us, e["x"], e["y"] & 0x7FFF, e["y"] >> 15 == 1)


LIBCAER = np.dtype([("data", "<u4"), ("t_us", "<i4")])  # bits of data: valid, polarity, 15 of y, 15 of x


def libcaer(e: np.ndarray) -> np.ndarray:
    """Events (M,) EVENT of records (M,) `LIBCAER`, the codec "libcaer"; their time rolls over at 2^31."""
    t_us = np.unwrap(e["t_us"].astype(np.int64), period=1 << 31)
    return event_array(t_us, e["data"] >> 17, e["data"] >> 2 & 0x7FFF, e["data"] >> 1 & 1)
