"""What is chosen for reaches of your own past obstacles."""

from pydantic import Field

from structlearn.avoidance.scene_unroll import SceneLearningParameters
from structlearn.ground.params import Name
from structlearn.recordings.topics import SceneTopicMap


class ObstacleParameters(SceneLearningParameters):
    """Reaches of your own past obstacles. Fields: `stages/own/params.yaml`, `obstacles`."""

    source: str = Field(min_length=1)
    topics: SceneTopicMap
    ignored: tuple[Name, ...]
