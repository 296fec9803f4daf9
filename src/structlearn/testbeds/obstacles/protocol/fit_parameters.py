"""What is chosen for the training of the avoidance models."""

from pydantic import PositiveInt

from structlearn.avoidance.network_training import EnsembleParameters, NetworkParameters, SplitParameters
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.ground.params import Parameters


class AvoidanceTrainingParameters(Parameters):
    """How the models are trained."""

    split: SplitParameters
    per_setting: NetworkParameters
    across_settings: NetworkParameters
    ensemble: EnsembleParameters
    phase_modulated: TrainingParameters
    phase_modulated_hidden: tuple[PositiveInt, ...]
