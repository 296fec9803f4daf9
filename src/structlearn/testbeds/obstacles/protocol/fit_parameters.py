"""What is chosen for the training of the avoidance models."""

from pydantic import PositiveInt

from structlearn.avoidance.network_training import EnsembleParameters, NetworkParameters, SplitParameters
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.ground.params import Parameters


class AvoidanceTrainingParameters(Parameters):
    """How the models are trained.

    Attributes:
        split: which demonstrations test.
        per_setting: network of one scenario.
        across_settings: network of all scenarios with one shape, or of all scenarios.
        ensemble: likewise, the mean of several.
        phase_modulated: training of the phase-modulated networks.
        phase_modulated_hidden: nodes of their regular hidden layers.
    """

    split: SplitParameters
    per_setting: NetworkParameters
    across_settings: NetworkParameters
    ensemble: EnsembleParameters
    phase_modulated: TrainingParameters
    phase_modulated_hidden: tuple[PositiveInt, ...]
