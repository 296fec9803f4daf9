"""Parameters of reaches past obstacles. Fields: `defaults.obstacles` in `tasks/stages/params.yaml`."""

from structlearn.avoidance.scene_reaches import SceneLearningParameters
from structlearn.readers.source import ClockParameters, SceneTopicMap, SourceParameters


class ObstacleParameters(SourceParameters, SceneLearningParameters):
    """Reaches past obstacles."""

    kind = "obstacles"

    topics: SceneTopicMap | None
    clock: ClockParameters | None


Entry = ObstacleParameters
