"""Learn from some people how to reach past boxes, and try it in the scenes of others (IV.8).

Those on whom constants were chosen are learned from and never judged on.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.avoidance.scene_folds import SceneResults, judge_folds
from structlearn.avoidance.scene_unroll import (
    SceneLearningParameters,
    SceneReach,
    SceneReachParameters,
    cut_reach,
)
from structlearn.avoidance.shapes import recorded_obstacle
from structlearn.ground.errors import InputError, MissingInputError
from structlearn.primitives.trajectory import differentiated
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.reaches_past_boxes import BOUNDARY, BOX


class BoxesParameters(SceneLearningParameters):
    """Reaches of people past boxes."""

    tuned_on: tuple[str, ...] = Field(min_length=1)


def folds_of_people(reaches: Sequence[SceneReach], parameters: BoxesParameters) -> list[list[str]]:
    """People on whom nothing was chosen, in alphabetical order, dealt out in turn; fewer are fewer folds.

    Raises:
        MissingInputError: there is nobody, or nobody else to learn from.
    """
    people = sorted({reach.person for reach in reaches})
    judged = [person for person in people if person not in parameters.tuned_on]
    if not judged or len(people) < 2:
        raise MissingInputError(
            f"reaches of {len(people)} people, {len(judged)} of them on whom nothing was chosen: one is "
            "needed to be judged, and another person to learn from"
        )
    count = min(parameters.folds, len(judged))
    return [judged[number::count] for number in range(count)]


def learn_past_boxes(trials: Sequence[Demonstration], parameters: BoxesParameters) -> SceneResults:
    """Cut the reaches, learn fold by fold, and try everything in the scenes left out.

    Raises:
        InputError: as `reaches_past_boxes`.
        MissingInputError: people are too few.
    """
    reaches, left_out = reaches_past_boxes(trials, parameters.reaches)
    return judge_folds(reaches, left_out, folds_of_people(reaches, parameters), parameters)


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
