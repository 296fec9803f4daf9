"""Recorded logs of unscrewing by nearly a full turn: orientation primitives beyond half a turn."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.ground import quaternion, signals
from structlearn.ground.errors import InputError
from structlearn.primitives.fitting import FitParameters, learn_primitive, orientations, segment_paths, whole
from structlearn.primitives.sequence import OrientationPrimitive, PosePrimitive
from structlearn.primitives.twist_swing import largest_turn
from structlearn.recordings.demonstration import Demonstration


def learn_unscrewing(
    demonstrations: Sequence[Demonstration], parameters: FitParameters
) -> tuple[PosePrimitive, pd.DataFrame]:
    """A primitive from each log, and one from all of them.

    Args:
        demonstrations: the logs, with orientations.
        parameters: of the fit.

    Returns:
        The joint primitive, and a table with `learned_from`, `compared_with`, `turn_deg` (net turn of the
        log), `mean_deg`, `max_deg`, `end_deg`. A single log's primitive is unrolled with the log's start,
        goal and duration and compared with the log as recorded; the joint one with the mean start, goal and
        duration and compared with the logs' time-normalised mean.
    """
    segments = segment_paths(demonstrations, whole(demonstrations), parameters.smoothing_hz)
    rows = []
    paths = orientations(segments)
    for demonstration, segment, path in zip(demonstrations, segments, paths, strict=True):
        primitive = turning(learn_primitive("unscrew", [segment], parameters))
        turn = primitive.unroll(path.dt, path.orientation[0], path.orientation[-1], path.duration)
        rows.append(
            {
                "learned_from": demonstration.name,
                "compared_with": demonstration.name,
                "turn_deg": np.degrees(largest_turn([path])),
                **angular_errors(turn.orientation, demonstration.signal("orientation")),
            }
        )
    joint = learn_primitive("unscrew", segments, parameters)
    turn = turning(joint).unroll(paths[0].dt)
    mean = mean_orientation_path(
        [demonstration.signal("orientation") for demonstration in demonstrations], len(turn.time)
    )
    turns = np.degrees([largest_turn([path]) for path in paths])
    rows.append(
        {
            "learned_from": "all",
            "compared_with": "their mean",
            "turn_deg": turns.mean(),
            **angular_errors(turn.orientation, mean),
        }
    )
    return joint, pd.DataFrame(rows)


def turning(primitive: PosePrimitive) -> OrientationPrimitive:
    """How a primitive turns the hand.

    Raises:
        InputError: it was learned without orientations.
    """
    if primitive.orientation is None:
        raise InputError(f"{primitive.name}: was learned without orientations")
    return primitive.orientation


def angular_errors(path: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """Mean, largest and final angle in degrees between two orientation paths (T, 4)."""
    angle = np.degrees(quaternion.angle_between(path, reference))
    return {"mean_deg": angle.mean(), "max_deg": angle.max(), "end_deg": angle[-1]}


def mean_orientation_path(paths: Sequence[np.ndarray], samples: int) -> np.ndarray:
    """Time-normalised mean of orientation paths.

    Args:
        paths: (T_l, 4) unit quaternions, sign-continuous.
        samples: of the result.

    Returns:
        (samples, 4) the mean orientation at each fraction of the duration.
    """
    stretched = np.array([signals.time_normalised(path, samples) for path in paths])
    return quaternion.sign_continuous(
        np.array([quaternion.mean(quaternion.normalised(stretched[:, k])) for k in range(samples)])
    )
