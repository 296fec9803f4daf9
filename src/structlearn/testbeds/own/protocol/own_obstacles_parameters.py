"""What is chosen for reaches of your own past obstacles."""

from pydantic import Field

from structlearn.avoidance.scene_parameters import SceneLearningParameters
from structlearn.ground.params import Name
from structlearn.recordings.topics import SceneTopicMap


class ObstacleParameters(SceneLearningParameters):
    """Reaches of your own past obstacles.

    Attributes:
        source: folder of recordings, one reach each, with the shapes around it; where it has sub-folders,
            each holds the reaches of one person (or robot), and people are left out in turn.
        topics: of the hand's pose and of the shapes.
        ignored: shapes whose names begin with one of these are in nobody's way, e.g. what is reached for.
    """

    source: str = Field(min_length=1)
    topics: SceneTopicMap
    ignored: tuple[Name, ...]
