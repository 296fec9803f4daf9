"""Damage to files, each drawn from a seed: bits, holes, insertions, blocks moved or repeated, ends cut."""

from collections.abc import Callable

import numpy as np

Damage = Callable[[bytes, np.random.Generator], bytes]


def _span(content: bytes, rng: np.random.Generator, longest: int = 300) -> tuple[int, int]:
    begin = int(rng.integers(len(content)))
    return begin, min(begin + int(rng.integers(1, longest)), len(content))


def _bit(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for place in rng.integers(8 * len(content), size=int(rng.integers(1, 4))).tolist():
        changed[place // 8] ^= 1 << place % 8
    return bytes(changed)


def _hole(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng)
    return content[:begin] + content[end:]


def _zeros(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng)
    return content[:begin] + bytes(end - begin) + content[end:]


def _noise(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng, 40)
    return content[:begin] + rng.bytes(end - begin) + content[end:]


def _more(content: bytes, rng: np.random.Generator) -> bytes:
    begin = int(rng.integers(len(content)))
    return content[:begin] + rng.bytes(int(rng.integers(1, 60))) + content[begin:]


def _repeat(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng)
    return content[:end] + content[begin:end] + content[end:]


def _swap(content: bytes, rng: np.random.Generator) -> bytes:
    begin, middle, end = sorted(rng.integers(len(content) + 1, size=3).tolist())
    return content[:begin] + content[middle:end] + content[begin:middle] + content[end:]


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content)))]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    """A length or an offset that says something extreme."""
    extremes = (0, 1, 2**16 - 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1)
    value, width = extremes[rng.integers(len(extremes))], int(rng.choice([2, 4, 8]))
    begin = int(rng.integers(max(len(content) - width, 1)))
    number = (value % 2 ** (8 * width)).to_bytes(width, "little")
    return content[:begin] + number + content[begin + width :]


DAMAGES: dict[str, Damage] = {
    "bits flipped": _bit,
    "hole": _hole,
    "zeros": _zeros,
    "noise": _noise,
    "insertion": _more,
    "repetition": _repeat,
    "blocks swapped": _swap,
    "cut off": _cut,
    "extreme number": _number,
}


def mutant(content: bytes, seed: int) -> tuple[str, bytes]:
    """Kind of damage, and the damaged content."""
    rng = np.random.default_rng(seed)
    kind = list(DAMAGES)[rng.integers(len(DAMAGES))]
    return kind, DAMAGES[kind](content, rng)
