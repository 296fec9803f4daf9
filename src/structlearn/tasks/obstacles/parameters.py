"""Parameters of reaches past obstacles. Fields: `defaults.obstacles` in `tasks/stages/params.yaml`."""

from structlearn.avoidance.scene_reaches import SceneLearningParameters
from structlearn.readers.source_parameters import ClockParameters, SourceParameters
from structlearn.readers.topics import SceneTopicMap


class ObstacleParameters(SourceParameters, SceneLearningParameters):
    """Reaches past obstacles."""

    kind = "obstacles"

    topics: SceneTopicMap | None
    clock: ClockParameters | None


Entry = ObstacleParameters
