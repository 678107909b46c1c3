"""Structured mutations of files: bytes and numbers of binary ones, tokens, lines and nesting of text."""

from __future__ import annotations

import struct

NUMBERS = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1)
TOKENS = ("", "nan", "inf", "-1", "1e300", "9.9e300", "1e-300", "9" * 400, "9223372036854775808", "true",
          "null", "[]", "{}", '"text"', "346.5", "\x00", "é", "1 2 3 4 5 6 7 8 9", "&a [*a]",
          "-9223372036854775808")  # fmt: skip


def mutated(whole: bytes, rng, text: bool) -> tuple[str, bytes]:
    """The name of a mutation, and what it makes of a file."""
    if text and rng.random() < 0.75:
        return _mutated_text(whole.decode(errors="replace"), rng)
    kind = ("cut", "bits", "number", "zeros", "repeat", "swap")[rng.integers(6)]
    at = int(rng.integers(len(whole))) if rng.random() < 0.5 else int(rng.integers(min(len(whole), 2000)))
    content = bytearray(whole)
    if kind == "cut":
        del content[at:]
    elif kind == "bits":
        for k in rng.integers(len(whole), size=rng.integers(1, 8)):
            content[k] ^= 1 << int(rng.integers(8))
    elif kind == "number":
        form = ("<H", "<I", "<Q")[rng.integers(3)]
        number = struct.pack(form, NUMBERS[rng.integers(len(NUMBERS))] % 2 ** (8 * struct.calcsize(form)))
        content[at : at + len(number)] = number
    elif kind == "zeros":
        size = int(rng.integers(1, 4000))
        content[at : at + size] = bytes(size)
    elif kind == "repeat":
        content[at:at] = content[at : at + int(rng.integers(1, 5000))]
    else:
        other, size = int(rng.integers(len(whole))), int(rng.integers(1, 500))
        one, two = content[at : at + size], content[other : other + size]
        content[at : at + size], content[other : other + size] = two, one
    return kind, bytes(content)


def _mutated_text(whole: str, rng) -> tuple[str, bytes]:
    """A token, a line or the nesting of a text changed."""
    lines = whole.splitlines(keepends=True) or [""]
    k = int(rng.integers(len(lines)))
    kind = ("token", "token", "token", "lost line", "line twice", "nested")[rng.integers(6)]
    if kind == "token":
        separators = ", :[]{}\n"
        before = separators[0] + lines[k]
        places = [i for i, c in enumerate(lines[k]) if c not in separators and before[i] in separators]
        start = places[rng.integers(len(places))] if places else 0
        stop = next((i for i in range(start, len(lines[k])) if lines[k][i] in separators), len(lines[k]))
        lines[k] = lines[k][:start] + TOKENS[rng.integers(len(TOKENS))] + lines[k][stop:]
    elif kind == "lost line":
        del lines[k]
    elif kind == "line twice":
        lines.insert(k, lines[k])
    else:
        depth = int(rng.choice([30, 1000, 50_000]))
        lines[k] = lines[k].rstrip("\n") + "[" * depth + "]" * depth + "\n"
    return kind, "".join(lines).encode(errors="surrogateescape")
