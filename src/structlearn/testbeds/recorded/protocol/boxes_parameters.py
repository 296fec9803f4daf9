"""What is chosen for recorded reaches past boxes."""

from pydantic import Field

from structlearn.avoidance.scene_parameters import SceneLearningParameters


class BoxesParameters(SceneLearningParameters):
    """Reaches of people past boxes.

    Attributes:
        tuned_on: people on whom all else was chosen, each left out in turn; they are learned from and never
            judged on. All others are judged on; where they are fewer than `folds`, one at a time.
    """

    tuned_on: tuple[str, ...] = Field(min_length=1)
