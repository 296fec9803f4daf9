"""Learn from some people how to reach past boxes, and try it in the scenes of others (IV.8).

Those on whom constants were chosen are learned from and never judged on.
"""

from collections.abc import Sequence

from structlearn.avoidance.scene_folds import SceneResults, judge_folds
from structlearn.avoidance.scene_reaches import SceneReach
from structlearn.ground.errors import MissingInputError
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.recorded.protocol.boxes_parameters import BoxesParameters
from structlearn.testbeds.recorded.protocol.boxes_reaches import reaches_past_boxes


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
