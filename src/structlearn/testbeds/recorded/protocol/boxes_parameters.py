"""What is chosen for recorded reaches past boxes."""

from pydantic import Field

from structlearn.avoidance.scene_parameters import SceneLearningParameters


class BoxesParameters(SceneLearningParameters):
    """Reaches of people past boxes."""

    tuned_on: tuple[str, ...] = Field(min_length=1)
