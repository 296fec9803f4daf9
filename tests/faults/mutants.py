"""Damage to files, each drawn from a seed.

Of bytes: bits, holes, insertions, blocks moved or repeated, ends cut, extreme numbers. Of text: words that
are something else, lines that are gone, doubled or moved, other encodings, brackets in brackets.
"""

import re
from collections.abc import Callable

import numpy as np

Damage = Callable[[bytes, np.random.Generator], bytes]


def _spliced(middle: Callable[[bytes, np.random.Generator], bytes], longest: int = 300) -> Damage:
    """Something else in place of a span."""

    def damage(content: bytes, rng: np.random.Generator) -> bytes:
        begin = int(rng.integers(len(content)))
        end = min(begin + int(rng.integers(1, longest)), len(content))
        return content[:begin] + middle(content[begin:end], rng) + content[end:]

    return damage


def _bit(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for place in rng.integers(8 * len(content), size=int(rng.integers(1, 4))).tolist():
        changed[place // 8] ^= 1 << place % 8
    return bytes(changed)


def _more(content: bytes, rng: np.random.Generator) -> bytes:
    begin = int(rng.integers(len(content)))
    return content[:begin] + rng.bytes(int(rng.integers(1, 60))) + content[begin:]


def _swap(content: bytes, rng: np.random.Generator) -> bytes:
    begin, middle, end = sorted(rng.integers(len(content) + 1, size=3).tolist())
    return content[:begin] + content[middle:end] + content[begin:middle] + content[end:]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    """A length or an offset that says something extreme."""
    extremes = (0, 1, 2**16 - 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1)
    value, width = extremes[rng.integers(len(extremes))], int(rng.choice([2, 4, 8]))
    begin = int(rng.integers(max(len(content) - width, 1)))
    number = (value % 2 ** (8 * width)).to_bytes(width, "little")
    return content[:begin] + number + content[begin + width :]


def _double(content: bytes, rng: np.random.Generator) -> bytes:
    """A float64 that no sensor reads."""
    value = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e15, 5e-324, -0.0])
    begin = int(rng.integers(max(len(content) // 4 - 1, 1))) * 4
    return content[:begin] + np.float64(value).tobytes() + content[begin + 8 :]


WORDS = (
    *b"nan -inf 1e999 1e308 -1 0 -0.0 1e-320 1_000 0x1F 1,5 true null yes ~ =1+1 ../x {} []".split(),
    *b"*a &a !!python/name:os.system << 2026-13-45 ' \" <!-- &x;".split(),
    *b"x; touch y|$(touch y)|\x1b[2J|~nouser/x|../../x|1e300|F8_E4M3|x\ny: z||\x00|!!int x".split(b"|"),
    *(b"x" * 5000, b"9" * 5000, "½".encode()),
)


def _word(content: bytes, rng: np.random.Generator) -> bytes:
    """One word or number is another."""
    words = [match.span() for match in re.finditer(rb"[\w.+-]+", content)] or [(0, 0)]
    begin, end = words[rng.integers(len(words))]
    return content[:begin] + WORDS[rng.integers(len(WORDS))] + content[end:]


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    """A line is gone, there twice, or elsewhere."""
    lines = content.split(b"\n")
    line = lines.pop(rng.integers(len(lines)))
    for _ in range(int(rng.integers(3))):
        lines.insert(int(rng.integers(len(lines) + 1)), line)
    return b"\n".join(lines)


def _encoding(content: bytes, rng: np.random.Generator) -> bytes:
    """As another program saves it."""
    text = content.decode("latin-1")
    return [
        b"\xef\xbb\xbf" + content,
        text.encode("utf-16"),
        text.encode("utf-32-be"),
        content.replace(b"\n", b"\r\n"),
        content.replace(b"\n", b"\r"),
        content.replace(b".", b","),
        content.replace(b" ", b"\t"),
        content.replace(b",", b";"),
    ][rng.integers(8)]


def _nesting(content: bytes, rng: np.random.Generator) -> bytes:
    """Brackets, lists or elements in one another."""
    opening = (b"[", b"{", b"- ", b"(", b"<a>", b"{a: ", b'{"a": ', b"[[1], ")[rng.integers(8)]
    begin = int(rng.integers(len(content)))
    return content[:begin] + int(rng.choice([100, 900, 5000])) * opening + content[begin:]


DAMAGES: dict[str, Damage] = {
    "bits flipped": _bit,
    "hole": _spliced(lambda span, rng: b""),
    "zeros": _spliced(lambda span, rng: bytes(len(span))),
    "noise": _spliced(lambda span, rng: rng.bytes(len(span)), longest=40),
    "insertion": _more,
    "repetition": _spliced(lambda span, rng: 2 * span),
    "blocks swapped": _swap,
    "cut off": lambda content, rng: content[: int(rng.integers(len(content)))],
    "extreme number": _number,
    "extreme float": _double,
    "other word": _word,
    "lines": _lines,
    "encoding": _encoding,
    "nesting": _nesting,
}


def mutant(content: bytes, seed: int) -> tuple[str, bytes]:
    """Kind of damage, and the damaged content."""
    rng = np.random.default_rng(seed)
    kind = list(DAMAGES)[rng.integers(len(DAMAGES))]
    return kind, DAMAGES[kind](content, rng)
