"""Traces of fingers out of recordings, one per run and finger."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.recording import Recording

FINGERS = ("left", "right")
ELECTRODES = 19
"""Of one finger."""


@dataclass(frozen=True)
class FingerTrace:
    """What one finger read in one run.

    Attributes:
        group: the set that the run belongs to.
        run: its name.
        finger: `left` or `right`.
        counts: (T, 19) as read, at the sensor's rate.
        contact: sample from which on the contact stands; None: from the start.
    """

    group: str
    run: str
    finger: str
    counts: np.ndarray
    contact: int | None = None

    @property
    def moving(self) -> np.ndarray:
        """The part in contact, (T', 19)."""
        return self.counts[self.contact or 0 :]


def finger_traces(
    group: str, recording: Recording | Demonstration, rate_hz: float, settling_s: float = 0.0
) -> list[FingerTrace]:
    """Traces of the fingers of one recording; where its segments are known, the first one makes the contact.

    Args:
        group: the set that it belongs to.
        recording: with a tactile stream per finger, or one of both; or a run on one clock.
        rate_hz: the sensor's own rate.
        settling_s: time after the first segment until force control holds.

    Returns:
        One trace per finger.

    Raises:
        InputError: there are no electrodes, not 19 per finger, or they come slower than `rate_hz`.
    """
    fingers: list[np.ndarray] = []
    for values, step in _touch(recording):
        count = values.shape[1]
        if count % ELECTRODES:
            raise InputError(f"{recording.name}: has {count} electrodes, a finger has 19")
        held = round(1 / (step * rate_hz))
        if held < 1:
            raise InputError(f"{recording.name}: touch comes at {1 / step:.0f} Hz, not at {rate_hz:g}")
        fingers += np.split(values[::held], count // ELECTRODES, axis=1)
    if not 1 <= len(fingers) <= len(FINGERS):
        raise InputError(f"{recording.name}: has electrodes of {len(fingers)} fingers, not of one or two")
    segments = recording.true_segments
    contact = None if segments is None else round((float(segments[0, 1]) + settling_s) * rate_hz)
    return [
        FingerTrace(group, recording.name, finger, counts, contact)
        for finger, counts in zip(FINGERS, fingers, strict=False)
    ]


def _touch(recording: Recording | Demonstration) -> list[tuple[np.ndarray, float]]:
    """Readings (T, E) and their step in s; of a run those of all fingers are side by side."""
    if isinstance(recording, Demonstration):
        return [(recording.signal("tactile"), recording.dt)]
    touch = [stream for stream in recording.streams if stream.kind == "tactile"]
    return [(stream.values, 1e-9 * float(np.median(np.diff(stream.stamps)))) for stream in touch]


def joined(
    group: str, run: str, parts: Sequence[Recording], rate_hz: float, settling_s: float = 0.0
) -> list[FingerTrace]:
    """Traces of one run whose primitives were recorded as files of their own; the first makes the contact.

    Args:
        group: the set that it belongs to.
        run: its name.
        parts: the primitives in order.
        rate_hz: the sensor's own rate.
        settling_s: time after the first part until force control holds.
    """
    traces = [finger_traces(group, part, rate_hz) for part in parts]
    return [
        FingerTrace(
            group,
            run,
            its[0].finger,
            np.vstack([part.counts for part in its]),
            len(its[0].counts) + round(settling_s * rate_hz),
        )
        for its in zip(*traces, strict=True)
    ]
