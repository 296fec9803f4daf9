"""What is chosen for the training of the avoidance models."""

from pydantic import PositiveInt

from structlearn.avoidance.network_training import NetworkParameters, SplitParameters
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.ground.params import Parameters


class AvoidanceTrainingParameters(Parameters):
    """How the models are trained.

    Attributes:
        split: which demonstrations test.
        per_setting: network of one scenario.
        per_shape: network of all scenarios with one shape.
        all_shapes: network of all scenarios.
        phase_modulated: training of the phase-modulated networks.
        phase_modulated_hidden: nodes of their regular hidden layers.
    """

    split: SplitParameters
    per_setting: NetworkParameters
    per_shape: NetworkParameters
    all_shapes: NetworkParameters
    phase_modulated: TrainingParameters
    phase_modulated_hidden: tuple[PositiveInt, ...]
