"""Expected sensor traces: what a sensor should read while a primitive runs (associative skill memory, IV.3).

Each channel is one dimension of a vector primitive on the primitive's canonical system; a deviation from the
expected trace is what feedback models take as input.
"""

from collections.abc import Sequence

import numpy as np

from structlearn.primitives.trajectory import differentiated
from structlearn.primitives.vector import VectorPrimitive, fit_vector

OFFSET_SAMPLES = 5
"""The offset of a run is the mean of this many samples at its start."""


def without_offset(trace: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
    """A trace relative to the sensor's reading at the start of the run.

    `trace`: (T, E) counts. `first`: (S, E) samples at the start of the run; default the trace itself. For
    later primitives of a run: the trace of its first primitive. Returns (T, E) counts.
    """
    return trace - (trace if first is None else first)[:OFFSET_SAMPLES].mean(axis=0)


def fit_expected_traces(traces: Sequence[np.ndarray], dt: float, smoothing_hz: float) -> VectorPrimitive:
    """Expected traces from repeated runs of a primitive.

    `traces`: per run (T_l, E) readings without offset, on one uniform clock from start to end.
    `smoothing_hz`: low-pass before the traces are differentiated. Returns a vector primitive with one
    dimension per channel.
    """
    return fit_vector([differentiated(trace, dt, smoothing_hz) for trace in traces])


def expected(primitive: VectorPrimitive, samples: int, dt: float) -> np.ndarray:
    """Expected traces over a run of `samples` samples: (samples, E) counts."""
    return primitive.unroll(dt, duration=dt * (samples - 1)).position


def deviation(primitive: VectorPrimitive, trace: np.ndarray, dt: float) -> np.ndarray:
    """Deviation s_actual - s_expected of a run without offset: (T, E) -> (T, E) counts."""
    return trace - expected(primitive, len(trace), dt)
