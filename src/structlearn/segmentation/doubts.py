"""What speaks against a cut that was made: nobody looks at every cut, so a poor one has to say so itself.

A cut is poor where its evidence disagrees: the crossing with the alignment, the aligned movement with the
reference's, or, where runs of motion were assigned, what was chosen with what was expected. The bounds lie
above all that good cuts of the invented task show, and below what goes with a wrong one.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from structlearn.segmentation.movement_alignment import Refined
from structlearn.segmentation.result import RESULT

COLUMNS = ["demonstration", "primitive", "reason", "number"]
"""Of the table: demonstration, primitive, reason in words, and the number that is beyond its bound."""

APART = 0.2
"""Largest distance of an end by crossing from the same by alignment, in durations of the reference's."""

OFF_SHAPE = 0.5
"""Largest mean distance of the aligned movement from the reference's, each about its own mean and in its own
distance (root mean square) from that: a longer way is no other shape."""

UNLIKE = 1.0
"""Largest cost of a run of motion that was chosen (`run_assignment`): one of 2.7 times the duration."""

LEFT_OUT = 0.25
"""Longest way of motion that belongs to no primitive, in ways of a mean primitive; a twitch is shorter."""

RESTED_S = 0.35
"""Longest time in rests within a primitive that are taken for hesitations; a pause between primitives is
longer."""


def doubts(
    demonstration: str, refined: Mapping[str, Refined], reference: bool
) -> list[tuple[str, str, str, float]]:
    """What speaks against the cuts of one demonstration.

    `refined`: by primitive, those that have an axis, in order of time. `reference`: whether it is the
    reference, which has nothing to be compared with. Returns rows of `COLUMNS`; most demonstrations have
    none.
    """
    return [
        (demonstration, primitive, reason, number)
        for primitive, one in refined.items()
        for reason, number, bound in (*_of_motion(one), *(() if reference else _of_alignment(one)))
        if number > bound
    ]


def _of_motion(one: Refined) -> Iterator[tuple[str, float, float]]:
    """Reasons, numbers and bounds of what was chosen."""
    crossing = one.own.crossing
    yield "its duration, way or direction is unlike the reference's (cost)", crossing.unlike, UNLIKE
    yield "motion before it belongs to no primitive (ways of a primitive)", crossing.left_out[0], LEFT_OUT
    yield "motion after it belongs to no primitive (ways of a primitive)", crossing.left_out[1], LEFT_OUT
    yield "a rest within it was taken for a hesitation (s)", crossing.rested, RESTED_S


def _of_alignment(one: Refined) -> Iterator[tuple[str, float, float]]:
    """The same of how it lies relative to the reference."""
    crossing = one.reference.crossing
    duration = max(crossing.end - crossing.start, 1)
    apart = np.abs(one.ends("zvc") - one.ends("wls_text")).max() / duration
    yield "crossing and alignment lie apart (durations)", float(apart), APART
    times = np.arange(crossing.start, crossing.end + 1)
    aligned = np.interp(times, times[[0, -1]], one.ends(RESULT))
    own = np.stack([np.interp(aligned, np.arange(len(one.own.path)), x) for x in one.own.path.T], axis=1)
    centred = [path - path.mean(axis=0) for path in (one.reference.path[times], own)]
    tiny = np.finfo(float).tiny
    shapes = [path / max(float(np.sqrt(np.mean(np.sum(path**2, axis=1)))), tiny) for path in centred]
    off = float(np.linalg.norm(shapes[1] - shapes[0], axis=1).mean())
    yield "aligned, it has another shape than the reference's (sizes)", off, OFF_SHAPE
