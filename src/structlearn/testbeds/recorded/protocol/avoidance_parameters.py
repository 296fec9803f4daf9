"""What is chosen for models of recorded obstacle avoidance."""

from pydantic import Field

from structlearn.avoidance.network_training import NetworkParameters
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.ground.params import Parameters


class RecordedAvoidanceParameters(Parameters):
    """Parameters of the recorded samples.

    Attributes:
        folds: blocks of consecutive rows.
        ridge_decay: of the linear model on standardised inputs.
        network: the feed-forward network; its members make the ensemble, the first of them alone is the
            network. What it sees is varied.
        pmnn: training of the phase-modulated network.
        pmnn_hidden: its regular hidden layers.
    """

    folds: int = Field(ge=2)
    ridge_decay: float = Field(gt=0)
    network: NetworkParameters
    pmnn: TrainingParameters
    pmnn_hidden: tuple[int, ...]
