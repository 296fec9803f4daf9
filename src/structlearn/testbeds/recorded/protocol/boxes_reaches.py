"""Recorded trials past boxes as reaches: from their onset to the target, in their own local frames."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.avoidance.scene_parameters import SceneReachParameters
from structlearn.avoidance.scene_reaches import SceneReach, cut_reach
from structlearn.avoidance.shapes import recorded_obstacle
from structlearn.ground.errors import InputError
from structlearn.primitives.trajectory import differentiated
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.reaches_past_boxes import BOUNDARY, BOX


def reaches_past_boxes(
    trials: Sequence[Demonstration], parameters: SceneReachParameters
) -> tuple[list[SceneReach], pd.DataFrame]:
    """The reaches of some trials, and which were left out.

    A trial says when its hand had moved, well after it began to: the reach begins where its speed, looked at
    backwards from there, first is below a share of its peak, or with the slowest sample where the recording
    began too late for that. It ends when the target was reached.

    Args:
        trials: with provenance and shapes of `recordings.reaches_past_boxes`.
        parameters: see there.

    Returns:
        The reaches, and per trial left out `trial`, `person` and `reason`.

    Raises:
        InputError: a trial has no boxes, or does not say whose it is and when it moved.
    """
    reaches, left_out = [], []
    for trial in trials:
        found = _reach(trial, parameters)
        if isinstance(found, str):
            left_out.append((trial.name, trial.provenance["person"], found))
        else:
            reaches.append(found)
    return reaches, pd.DataFrame(left_out, columns=["trial", "person", "reason"])


def _reach(trial: Demonstration, parameters: SceneReachParameters) -> SceneReach | str:
    """The reach of a trial, or why there is none."""
    try:
        person = trial.provenance["person"]
        moved, reached = (float(trial.provenance[key]) for key in ("moved_s", "reached_s"))
    except (KeyError, ValueError) as error:
        raise InputError(f"{trial.name}: its provenance lacks {error}") from error
    boxes, walls = (
        tuple(recorded_obstacle(shape) for shape in trial.shapes if shape.name.startswith(kind))
        for kind in (BOX, BOUNDARY)
    )
    if not boxes:
        raise InputError(f"{trial.name}: has no boxes")
    smooth = differentiated(trial.position, trial.dt, parameters.smoothing_hz)
    begins, ends = (int(np.searchsorted(trial.time, at - 1e-6)) for at in (moved, reached))
    ends = min(ends, len(trial.time) - 1)
    if begins >= ends:
        return "does not move before it ends"
    speed = np.linalg.norm(smooth.velocity, axis=1)
    before = speed[: begins + 1]
    slow = np.flatnonzero(before < parameters.onset_share * speed[begins : ends + 1].max())
    onset = int(slow[-1]) if len(slow) else int(before.argmin())
    part = slice(onset, ends + 1)
    return cut_reach(trial, trial.name, person, smooth, part, boxes, walls, parameters)
