"""Numbers and lists as text, for sentences."""

import math
from collections.abc import Iterable
from typing import Any

MINUS = "\N{MINUS SIGN}"
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def listing(words: Iterable[object], nothing: str = "none") -> str:
    """Join words into `a`, `a and b` or `a, b and c`."""
    items = [str(word) for word in words]
    if not items:
        return nothing
    return " and ".join([", ".join(items[:-1]), items[-1]]) if len(items) > 1 else items[0]


def counted(number: int, thing: str) -> str:
    """Number with a noun: `1 demonstration`, `3 demonstrations`."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def interval(low: float, high: float, number_format: str = ".1f") -> str:
    """Interval such as `[0.4, 1.2]`, with true minus signs; `unknown` if an end is not finite."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return "unknown"
    return f"[{spelled(low, number_format)}, {spelled(high, number_format)}]"


def capitalised(sentence: str) -> str:
    """Capitalise the first letter."""
    return sentence[:1].upper() + sentence[1:]


def level_name(level: float) -> str:
    """Key of a noise level or setting, e.g. `0p3` for 0.3."""
    return f"{level:g}".replace(".", "p")


def rounded(value: float, number_format: str) -> str:
    """Number with a true minus sign, and none before zero; `unknown` if it is not finite."""
    if not math.isfinite(value):
        return "unknown"
    text = spelled(value, number_format)
    return text.lstrip(MINUS) if text.strip(MINUS + "0.%") == "" else text


def spelled(value: Any, number_format: str) -> str:
    """Number with a true minus sign, and without an e, e.g. 76 300 for 7.63e+04."""
    text = f"{value:{number_format}}"
    digits, e, exponent = text.partition("e")
    if e and 0 <= int(exponent) < 7:
        text = f"{float(text):,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    elif e:
        text = f"{digits} \N{MULTIPLICATION SIGN} 10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", MINUS)


def with_interval(mean: float, half_width: float, number_format: str = ".1f") -> str:
    """Mean with its confidence interval, e.g. `1.2 [0.4, 2.0]`."""
    return f"{rounded(mean, number_format)} {interval(mean - half_width, mean + half_width, number_format)}"


def with_spread(mean: float, std: float, number_format: str = ".1f") -> str:
    """Mean with its std if finite, e.g. `1.2 ± 0.4`."""
    text = rounded(mean, number_format)
    return f"{text} ± {std:{number_format}}" if math.isfinite(std) else text


def percent(count: float, n: float, fewest: int = 0) -> str:
    """Percentage such as `99.8 %`, with enough digits not to round to 0 or 100 unless it is exactly that."""
    return next(
        text
        for digits in range(fewest, 10)
        if (text := f"{100 * count / n:.{digits}f} %")
        and (count in (0, n) or float(text[:-2]) not in (0.0, 100.0))
    )
