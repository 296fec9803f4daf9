"""Minimum-jerk profile of human movement from rest to rest (Flash & Hogan 1985)."""

from typing import TypeVar

import numpy as np

Fraction = TypeVar("Fraction", float, np.ndarray)


def progress(s: Fraction) -> Fraction:
    """Fraction of the way at a fraction s of the duration, both in [0, 1]: 10 s^3 - 15 s^4 + 6 s^5."""
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def rate(s: Fraction) -> Fraction:
    """Derivative of `progress` by s."""
    return 30.0 * s**2 * (1.0 - s) ** 2
