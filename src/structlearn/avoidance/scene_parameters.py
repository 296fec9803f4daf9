"""What is chosen for reaches through scenes of several obstacles: cutting, learning, judging."""

from pydantic import Field, PositiveInt

from structlearn.avoidance.look_ahead import LookAheadParameters
from structlearn.avoidance.network_training import EnsembleParameters, NetworkParameters
from structlearn.ground.params import Parameters


class SceneReachParameters(Parameters):
    """From recordings to reaches. Fields: `params.yaml`, `recorded_boxes.reaches`."""

    smoothing_hz: float = Field(gt=0, le=45)
    onset_share: float = Field(gt=0, lt=1)
    fastest_m_s: float = Field(gt=0)
    longest_s: float = Field(gt=0)
    samples: int = Field(ge=20, le=2000)


class SceneLearningParameters(Parameters):
    """Learning to reach through scenes. Fields: `params.yaml`, `recorded_boxes`."""

    reaches: SceneReachParameters
    folds: int = Field(ge=2)
    hand_radius_m: float = Field(gt=0)
    straight_share: float = Field(gt=0, lt=1)
    keep_every: PositiveInt
    cloud_count: int = Field(ge=6)
    look_ahead: LookAheadParameters
    network: EnsembleParameters
    return_stiffness: float = Field(ge=0)
    end_limit_m: float = Field(gt=0)
    return_coupling: float = Field(ge=0)
    text_network: NetworkParameters
    text_decay_per_m2: float = Field(ge=0)
