"""One recorded execution of the three scraping primitives with 38 electrodes."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground import metrics
from structlearn.ground.params import Parameters
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, learn_primitive, segment_paths, whole
from structlearn.primitives.sequence import PoseGoal, PosePrimitive, SequencePath
from structlearn.primitives.vector import (
    VectorPrimitive,
    expected_traces,
    fit_expected_traces,
    without_offset,
)
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.recorded.protocol.unscrewing import angular_errors


class ExecutionParameters(Parameters):
    """Learning from the recorded execution."""

    fit: FitParameters
    tactile_smoothing_hz: float = Field(gt=0)


def learn_execution(
    parts: Sequence[Demonstration], parameters: FitParameters
) -> tuple[list[PosePrimitive], SequencePath, pd.DataFrame]:
    """Primitives of the execution, unrolled as a sequence with goal evolution.

    Args:
        parts: the recorded primitives in order, each its own demonstration.
        parameters: of the fit.

    Returns:
        The primitives, the unrolled sequence, and per primitive the distance from the recording: `mean_mm`,
        `max_mm`, `end_mm`, and with orientations `mean_deg`, `max_deg`, `end_deg`.
    """
    segments = [segment_paths([part], whole([part]), parameters.smoothing_hz)[0] for part in parts]
    primitives = [
        learn_primitive(part.name, [segment], parameters)
        for part, segment in zip(parts, segments, strict=True)
    ]
    goals = [
        PoseGoal(position.position[-1], None if orientation is None else orientation.orientation[-1])
        for position, orientation in segments
    ]
    path = sequence.unroll(primitives, parts[0].dt, goals=goals)
    rows = []
    for part, first, last in zip(parts, path.switches[:-1], path.switches[1:], strict=True):
        here = slice(first, last + 1)
        distance = 1e3 * np.linalg.norm(path.position.position[here] - part.position, axis=1)
        row = {
            "primitive": part.name,
            "mean_mm": distance.mean(),
            "max_mm": distance.max(),
            "end_mm": distance[-1],
        }
        if path.orientation is not None:
            turned, recorded = path.orientation.orientation[here], part.signal("orientation")
            row |= angular_errors(turned, recorded)
        rows.append(row)
    return primitives, path, pd.DataFrame(rows)


def learn_traces(
    parts: Sequence[Demonstration], parameters: ExecutionParameters
) -> tuple[list[VectorPrimitive], pd.DataFrame, pd.DataFrame]:
    """Sensor primitives of all electrodes in every primitive.

    The sensors' offset is taken at the start of the first primitive and stays for the whole run.

    Args:
        parts: the recorded primitives in order.
        parameters: see there.

    Returns:
        One vector primitive per recorded primitive; a table per primitive and electrode with `range` (largest
        minus smallest count), `rms` (root mean squared error in counts) and `nmse`; and the traces, with
        `primitive`, `electrode`, `time_s`, `recorded`, `expected` (counts).
    """
    primitives, scores, traces = [], [], []
    for part in parts:
        recorded = without_offset(part.signal("tactile"), parts[0].tactile)
        primitive = fit_expected_traces([recorded], part.dt, parameters.tactile_smoothing_hz)
        unrolled = expected_traces(primitive, len(recorded), part.dt)
        primitives.append(primitive)
        electrodes = np.arange(1, recorded.shape[1] + 1)
        scores.append(
            pd.DataFrame(
                {
                    "primitive": part.name,
                    "electrode": electrodes,
                    "range": np.ptp(recorded, axis=0),
                    "rms": np.sqrt(np.mean((unrolled - recorded) ** 2, axis=0)),
                    "nmse": metrics.nmse(unrolled, recorded),
                }
            )
        )
        traces.append(
            pd.DataFrame(
                {
                    "primitive": part.name,
                    "electrode": np.repeat(electrodes, len(recorded)),
                    "time_s": np.tile(part.time, len(electrodes)),
                    "recorded": recorded.T.ravel(),
                    "expected": unrolled.T.ravel(),
                }
            )
        )
    return primitives, pd.concat(scores, ignore_index=True), pd.concat(traces, ignore_index=True)
