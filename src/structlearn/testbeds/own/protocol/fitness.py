"""Whether demonstrations are fit to be learned from: questions, each with a verdict and its number.

Nothing has been configured yet, so bounds are those of the readers and of the method where they have one, and
else rules of thumb with their reason beside them. A doubtful answer is no obstacle; it says where to look.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from structlearn.recordings.checks import NORM_TOLERANCE
from structlearn.recordings.clock import MAX_GAP_S

Verdict = Literal["yes", "doubtful", "no"]

ENOUGH, FEWEST = 5, 2
"""Demonstrations: with one there is nothing to compare it with; below five a mean error of those left out has
an interval as wide as itself."""

WIDE_M, NARROW_M = 0.05, 0.01
"""m, how far the hand gets: below a centimetre the sway of a hand and the noise of a sensor are of one size
with the movement."""

OVER_NOISE = (50.0, 10.0)
"""How far the hand gets, over its noise while it rests: at 50 the speed of a move of one second stands ten
times above that of the noise."""

RATES_HZ = (50.0, 20.0)
"""Hz, of the poses: moves of people have nothing above 5 Hz, and derivatives want ten samples of that."""

IN_STEP_S = (0.02, 0.1)
"""s, by which clocks differ: at 0.5 m/s, 10 and 50 mm between what two topics say of one moment."""

JITTER = (0.5, 1.0)
"""Of a step: half the range of the inner nine tenths of the steps."""

DISORDERED = 0.01
"""Share of messages with a stamp not after the one before, up to which leaving them out harms nothing."""

CONDITIONS = (100.0, 1000.0)
"""Of the base regressor: below 100 counts as well excited (Gautier and Khalil 1992)."""

VELOCITIES = (0.5, 0.1)
"""rad/s, the largest of a joint: Coulomb friction hides below 0.1 what inertia does."""

ACCELERATIONS = (1.0, 0.2)
"""rad/s^2, likewise."""


@dataclass(frozen=True)
class Answer:
    """One question about the recordings.

    Attributes:
        question: what is asked; yes is good.
        verdict: the answer.
        number: what it rests on, with units.
        advice: what to do about it; empty where there is nothing to do.
    """

    question: str
    verdict: Verdict
    number: str
    advice: str = ""


def at_least(value: float, bounds: tuple[float, float]) -> Verdict:
    """Yes from the first bound up, doubtful from the second up; NaN is no."""
    return "yes" if value >= bounds[0] else "doubtful" if value >= bounds[1] else "no"


def at_most(value: float, bounds: tuple[float, float]) -> Verdict:
    """Yes up to the first bound, doubtful up to the second; NaN is no."""
    return "yes" if value <= bounds[0] else "doubtful" if value <= bounds[1] else "no"
