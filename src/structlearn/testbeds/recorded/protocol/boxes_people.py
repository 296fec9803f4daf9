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


def folds_of_people(people: Sequence[str], count: int) -> list[list[str]]:
    """People dealt out in turn, in their order."""
    return [list(people[number::count]) for number in range(count)]


def judged_people(reaches: Sequence[SceneReach], parameters: BoxesParameters) -> list[str]:
    """People on whom nothing was chosen, in alphabetical order.

    Raises:
        MissingInputError: there are fewer than folds.
    """
    people = sorted({reach.person for reach in reaches} - set(parameters.tuned_on))
    if len(people) < parameters.folds:
        raise MissingInputError(
            f"{len(people)} people on whom nothing was chosen are too few for {parameters.folds} folds"
        )
    return people


def learn_past_boxes(trials: Sequence[Demonstration], parameters: BoxesParameters) -> SceneResults:
    """Cut the reaches, learn fold by fold, and try everything in the scenes left out.

    Raises:
        InputError: as `reaches_past_boxes`.
        MissingInputError: people are too few.
    """
    reaches, left_out = reaches_past_boxes(trials, parameters.reaches)
    folds = folds_of_people(judged_people(reaches, parameters), parameters.folds)
    return judge_folds(reaches, left_out, folds, parameters)
