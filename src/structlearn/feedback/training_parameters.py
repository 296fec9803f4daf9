"""What is chosen for the training of feedback models, and the names of those that are used in the end."""

from typing import TYPE_CHECKING

from pydantic import Field, PositiveInt

from structlearn.ground.params import Name, Parameters

if TYPE_CHECKING:
    from structlearn.feedback.coupling_model import CouplingModel

POINTWISE, LEVEL, UNROLLED = "pointwise", "level", "unrolled"
MODELS = (POINTWISE, LEVEL, UNROLLED)


class TrainingParameters(Parameters):
    """How a feedback model is trained.

    Attributes:
        steps: gradient steps.
        batch_size: samples per model and step.
        learning_rate: of RMSProp.
        dropout: probability with which a hidden node is left out of a step (IV.9.1.4).
        evaluate_every: steps between two evaluations, which are where training can stop.
        chunk_samples: consecutive samples that are split together; 1 is the text.
        seed: of initial weights, splits, batches and dropout.
    """

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    evaluate_every: PositiveInt
    chunk_samples: PositiveInt
    seed: int = Field(ge=0)


class UnrolledTrainingParameters(Parameters):
    """Parameters of training inside the unroll.

    Attributes:
        steps: largest number of steps of the optimiser (Adam).
        learning_rate: of the optimiser.
        dropout: probability with which a hidden node is left out of a step.
        coupling_loss_weight: of the loss on the coupling terms themselves, beside that on the path.
        seed: of the batches and the dropout masks.
    """

    steps: int = Field(ge=1)
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    coupling_loss_weight: float = Field(ge=0)
    seed: int = Field(ge=0)


class NetworkParameters(Parameters):
    """Which feedback network is trained.

    Attributes:
        network: module of `feedback.models`.
        hidden: nodes of its regular hidden layers.
    """

    network: Name
    hidden: tuple[int, ...]

    @property
    def model(self) -> "type[CouplingModel]":
        """The network; InputError where there is none of this name."""
        from structlearn.feedback.coupling_model import named_model

        return named_model(self.network)


class FeedbackParameters(NetworkParameters):
    """Training of the final models.

    Attributes:
        pointwise: training sample by sample.
        unrolled: training inside the unroll.
        validation_share: of the demonstration numbers, on which training inside the unroll is stopped.
    """

    pointwise: TrainingParameters
    unrolled: UnrolledTrainingParameters
    validation_share: float = Field(gt=0, lt=1)
