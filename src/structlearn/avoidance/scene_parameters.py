"""What is chosen for reaches through scenes of several obstacles: cutting, learning, judging."""

from pydantic import Field, PositiveInt

from structlearn.avoidance.look_ahead import LookAheadParameters
from structlearn.avoidance.network_training import EnsembleParameters, NetworkParameters
from structlearn.ground.params import Parameters


class SceneReachParameters(Parameters):
    """From recordings to reaches.

    Attributes:
        smoothing_hz: low-pass of the hand's positions.
        onset_share: of the peak speed, below which the hand has not begun.
        fastest_m_s: between two samples; more is a jump of the tracking, and the recording is left out.
        longest_s: duration; beyond it the recording is left out.
        samples: of a reach, in equal steps.
    """

    smoothing_hz: float = Field(gt=0, le=45)
    onset_share: float = Field(gt=0, lt=1)
    fastest_m_s: float = Field(gt=0)
    longest_s: float = Field(gt=0)
    samples: int = Field(ge=20, le=2000)


class SceneLearningParameters(Parameters):
    """Reaches through scenes.

    Attributes:
        reaches: from recordings to reaches.
        folds: parts of those who are judged on, left out in turn.
        hand_radius_m: of the sphere that must not touch an obstacle.
        straight_share: of its length, by which a reach may leave the straight line at most if the baseline is
            to learn from it.
        keep_every: of the samples of a reach, those that coupling is learned from.
        cloud_count: points of an obstacle's surface.
        look_ahead: of the scene's features.
        network: of the scene's features: an ensemble whose members see samples from elsewhere.
        return_stiffness: by how much, per m off the demonstrated path, what members see leads back to it.
        end_limit_m: how far from where the baseline ends the coupling may leave the hand.
        return_coupling: m, may be needed to keep this limit.
        text_network: of the text's 17 features.
        text_decay_per_m2: k of the text's post-processing.
    """

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
