"""What is chosen for the training of feedback models, and the names of those that are used in the end."""

from typing import TYPE_CHECKING

from pydantic import Field, PositiveInt

from structlearn.ground.params import Name, Parameters

if TYPE_CHECKING:
    from structlearn.feedback.coupling_model import CouplingModel

POINTWISE, LEVEL, UNROLLED = "pointwise", "level", "unrolled"
MODELS = (POINTWISE, LEVEL, UNROLLED)


class TrainingParameters(Parameters):
    """How a feedback model is trained sample by sample. Fields: `params.yaml`, `compare_models`."""

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    evaluate_every: PositiveInt
    chunk_samples: PositiveInt
    seed: int = Field(ge=0)


class UnrolledTrainingParameters(Parameters):
    """Training inside the unroll. Fields: `params.yaml`, `train_feedback.unrolled`."""

    steps: int = Field(ge=1)
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    coupling_loss_weight: float = Field(ge=0)
    seed: int = Field(ge=0)


class NetworkParameters(Parameters):
    """Which feedback network is trained."""

    network: Name
    hidden: tuple[int, ...]

    @property
    def model(self) -> "type[CouplingModel]":
        """The network; InputError where there is none of this name."""
        from structlearn.feedback.coupling_model import named_model

        return named_model(self.network)


class FeedbackParameters(NetworkParameters):
    """Training of the final models, sample by sample and inside the unroll."""

    pointwise: TrainingParameters
    unrolled: UnrolledTrainingParameters
    validation_share: float = Field(gt=0, lt=1)
