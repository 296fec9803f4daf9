"""Parameters of published samples of the coupling term past obstacles."""

from pydantic import Field

from structlearn.avoidance.network_training import AvoidanceNetworkParameters
from structlearn.feedback.trainers import TrainingParameters
from structlearn.readers.source import SourceParameters


class CouplingParameters(SourceParameters):
    """Cross-validation over blocks, and the models compared."""

    kind = __package__

    folds: int = Field(ge=2)
    ridge_decay: float = Field(gt=0)
    network: AvoidanceNetworkParameters
    pmnn: TrainingParameters
    pmnn_hidden: tuple[int, ...]


Entry = CouplingParameters
