"""What is chosen for models of recorded obstacle avoidance."""

from pydantic import Field

from structlearn.avoidance.network_training import NetworkParameters
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.ground.params import Parameters


class RecordedAvoidanceParameters(Parameters):
    """Parameters of the recorded samples."""

    folds: int = Field(ge=2)
    ridge_decay: float = Field(gt=0)
    network: NetworkParameters
    pmnn: TrainingParameters
    pmnn_hidden: tuple[int, ...]
