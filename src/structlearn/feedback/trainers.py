"""Training of feedback networks: jobs, results, and the trainer of each network, looked up by its name.

A trainer is the function `train` of `feedback.training.<name>`, or of a network's own module. `network: pmnn`
in `params.yaml` chooses it.
"""

import importlib
import pkgutil
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Generic, Protocol, TypeVar

import numpy as np
from pydantic import Field, PositiveInt

from structlearn.core.errors import InputError
from structlearn.core.params import Name, Parameters
from structlearn.feedback import models, training
from structlearn.feedback.coupling_dataset import CouplingDataset, Fold, without_generalization
from structlearn.feedback.coupling_model import CouplingModel


class TrainingParameters(Parameters):
    """Sample-by-sample training of a feedback model. Fields: `params.yaml`, `compare_models`."""

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    evaluate_every: PositiveInt
    chunk_samples: PositiveInt
    seed: int = Field(ge=0)


class UnrolledTrainingParameters(Parameters):
    """Training through the unroll. Fields: `params.yaml`, `train_feedback.unrolled`."""

    steps: int = Field(ge=1)
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    coupling_loss_weight: float = Field(ge=0)
    seed: int = Field(ge=0)


class FeedbackNetworkParameters(Parameters):
    """Choice of the feedback network: its trainer, and the width of each hidden layer."""

    network: Name
    hidden: tuple[int, ...]


Jobs = Sequence[tuple[CouplingDataset, Fold]]
"""Per model, its samples and the fold that splits them."""

Nodes = Sequence[int]  # width of each hidden layer

Model = TypeVar("Model", bound=CouplingModel, covariant=True)


@dataclass(frozen=True)
class Trained(Generic[Model]):
    """Result of a training job."""

    # by the part that chose the step: `validation`, which is unbiased, and, if a demonstration was left out,
    # `generalization`, the dissertation's, which is optimistic
    models: dict[str, Model]
    steps: dict[str, int]  # gradient steps taken, likewise; 0 for training without steps
    code: float = np.nan  # dimensions that the deviations are compressed to; NaN without compression

    @classmethod
    def closed_form(cls, model: CouplingModel) -> "Trained[CouplingModel]":
        """Result for a model that is trained without gradient steps."""
        parts = ("validation", "generalization")
        return Trained(dict.fromkeys(parts, model), dict.fromkeys(parts, 0))


class Trainer(Protocol):
    """Trains one network per job."""

    def __call__(
        self,
        jobs: Jobs,
        parameters: TrainingParameters,
        hidden: Nodes = (),
        initial: CouplingModel | None = None,
        /,
    ) -> Sequence[Trained]:
        """Train one network per job.

        `jobs`: of equal sizes; they may differ in fold, target or deviation. `initial`: network to start
        from; its shape and input standardisation are kept. Raises InputError: too few samples, or a constant
        target.
        """


def named_trainer(name: str) -> Trainer:
    """Trainer of a network. Raises InputError: no module of this name trains one."""
    packages: dict[str, ModuleType] = {}
    for package in (models, training):
        packages |= {module.name: package for module in pkgutil.iter_modules(package.__path__)}
    if name not in packages:
        raise InputError(f"there is no feedback network '{name}' among {', '.join(sorted(packages))}")
    module = importlib.import_module(f"{packages[name].__name__}.{name}")
    if not hasattr(module, "train"):
        raise InputError(f"{module.__file__}: has no function `train`, which trains the network")
    return module.train


def train_final(
    network: str,
    dataset: CouplingDataset,
    parameters: TrainingParameters,
    hidden: Nodes = (),
    initial: CouplingModel | None = None,
) -> CouplingModel:
    """Train the final model on all demonstrations, with early stopping on the validation part.

    Arguments and errors as in `Trainer`; refinement starts from an initial model.
    """
    fold = without_generalization(dataset, parameters.chunk_samples, parameters.seed)
    train = named_trainer(network)
    (trained,) = train([(dataset, fold)], parameters, hidden, initial)
    return trained.models["validation"]
