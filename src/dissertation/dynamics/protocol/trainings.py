"""Trainings of chapter III on arm motions: every kind of model in two forms, by seed or robot.

The dissertation names no optimiser, learning rate or batch. The chosen form takes them, and whether the loss
is normalised by each joint's torque, from a choice made for each kind on a motion that is not scored
(`protocol.training_choice`). The plain form is the least reading of the text: the raw loss of eq. III.2 as
printed, and Adam with its usual defaults. Models also learn online, in one pass over the motion without
shuffling (III.4.1.2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field, NonNegativeInt, model_validator

from dissertation.dynamics.protocol.forms import CHOSEN, FORMS, PART, PLAIN, EpochLimits, Form
from structlearn.core.metrics import nmse
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.networks.torch_settings import AdamParameters, one_thread, seeded
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques
from structlearn.rigid_body.dynamics_training import (
    Kind,
    LearningParameters,
    Loss,
    TrainedModels,
    TrainingData,
    epoch_errors,
    learn_in_epochs,
    learn_online,
    learner,
    loss_weights,
)
from structlearn.rigid_body.friction import FRICTIONS
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_names import COULOMB, IDEAL, ROBOT
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.network_models import NETWORKS, NetworkKind, NetworkLearner
from structlearn.rigid_body.payload import PayloadLearningParameters
from structlearn.rigid_body.tree import KinematicTree

ROBOT_FRICTIONS = {"mlp": ("none",), "mlp_scaled": ("none",), "delan": ("viscous",)}
"""Friction by kind, on robots' logs; MLPs take velocities as input and need no friction terms."""

STRUCTURE_FRICTIONS = ("viscous", "coulomb")  # all structures, on robots' logs

STACKED: tuple[NetworkKind, ...] = ("mlp", "delan")
"""Kinds that learn all robots' logs as one stack: for single small networks, overhead would dominate."""

UNPUBLISHED = ("mlp_scaled",)  # kinds that the dissertation does not have, and without a plain form

Seeds = Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)]


class ChosenTraining(AdamParameters):
    """What the dissertation leaves open of a model's training, as chosen (`protocol.training_choice`)."""

    loss: Loss

    def of(self, learning: LearningParameters) -> LearningParameters:
        """Learning parameters with this optimiser."""
        return learning.model_copy(update={"networks": self, "structures": self})


class DynamicsTrainingParameters(Parameters):
    """Parameters of the trainings."""

    models: tuple[Kind, ...]
    seeds: Seeds
    learning: LearningParameters
    chosen: dict[Kind, ChosenTraining]
    part: float = Field(gt=0, lt=1)
    stride: int = Field(ge=1)
    epochs: EpochLimits
    futility_epochs: int = Field(ge=1)
    smoothing_hz: float = Field(gt=0)

    @model_validator(mode="after")
    def _are_chosen(self) -> "DynamicsTrainingParameters":
        if missing := set(self.models) - set(self.chosen):
            raise ValueError(f"chosen: no training of {', '.join(sorted(missing))}")
        return self

    def of(self, form: Form, kind: Kind) -> tuple[Loss, LearningParameters]:
        """Loss and learning parameters of a kind in a form."""
        if form == PLAIN:
            return "raw", self.learning
        return self.chosen[kind].loss, self.chosen[kind].of(self.learning)


class OnlineParameters(Parameters):
    """Online learning, for every combination of model kind and loss."""

    models: tuple[Kind, ...]
    seeds: tuple[NonNegativeInt, ...]
    losses: tuple[Loss, ...]
    stride: int = Field(ge=1)
    payload: PayloadLearningParameters


@dataclass(frozen=True)
class Training:
    """One training run of the models of a kind."""

    motion: str  # motion name: that of the arm, or with the robot's seed (`perturbed/11`)
    kind: Kind
    friction: str  # a key of `FRICTIONS`
    form: Form
    seeds: tuple[int, ...]  # one per model; for a robot, its seed

    @property
    def arm(self) -> str:
        """`IDEAL`, `PART` of it, or `ROBOT`."""
        return self.motion.split("/")[0]

    @property
    def model(self) -> str:
        """Model name: its kind, with a suffix if it learns Coulomb friction."""
        return self.kind + (COULOMB if self.friction == "coulomb" else "")

    @property
    def file(self) -> str:
        """Path of the models without suffix, relative to the folder of all models."""
        return f"{self.motion}/{self.form}/{self.model}"


def trainings(robots: Sequence[int], parameters: DynamicsTrainingParameters) -> list[Training]:
    """All trainings on the arm's motion, on a part of it, and on the log of each robot."""
    found = []
    for kind, form in product(parameters.models, FORMS):
        if form == PLAIN and kind in UNPUBLISHED:
            continue
        found.append(Training(IDEAL, kind, "none", form, parameters.seeds))
        if form == CHOSEN:
            found.append(Training(PART, kind, "none", form, parameters.seeds))
        found += [
            Training(f"{ROBOT}/{robot}", kind, friction, form, (robot,))
            for robot, friction in product(robots, ROBOT_FRICTIONS.get(kind, STRUCTURE_FRICTIONS))
        ]
    return found


def train_all(
    work: Sequence[Training],
    motions: Mapping[str, Motion],
    tree: KinematicTree,
    parameters: DynamicsTrainingParameters,
) -> tuple[dict[str, DynamicsModels], pd.DataFrame, pd.DataFrame]:
    """Train all models in parallel; DeLaN first, since it takes longest. `motions`: without `PART`.

    Returns:
        Models, keyed by `Training.file`.
        Errors: `arm`, `model` (`cov`, `cov_coulomb`), `form`, `seed`, `epoch`, `joint` (from 1), `nmse`.
        Outcomes: `arm`, `model`, `form`, `seed`; `epochs` to the threshold on every joint and
        `epochs_but_last` on every joint but the last (NaN: not reached); `nmse_mean` and `nmse_max` over
        joints of the model that was kept (of `PART`, on the whole motion); `met`, whether the text's
        criterion is met, so that the model may track: in simulation the threshold on every joint, on
        robots' logs on average (III.4.2.1), where only networks have to meet it.
    """
    whole = motions[IDEAL]
    motions = {**motions, PART: whole.part(slice(round(parameters.part * len(whole))))}
    # trainings in one process: structures share a regressor, networks of robots are stacked
    groups: dict[tuple, list[Training]] = {}
    for training in work:
        own = training.kind == "nostr" if training.kind in STRUCTURES else (training.kind, training.form)
        stacked = training.arm == ROBOT and training.kind in STACKED
        where = len(motions[training.motion]) if stacked else training.motion
        groups.setdefault((where, training.friction, own), []).append(training)
    together = sorted(groups.values(), key=lambda group: group[0].kind != "delan")
    run = partial(_train_together, motions=motions, tree=tree, parameters=parameters)
    results: dict[Training, TrainedModels] = {}
    for group, found in zip(together, parallel_map(run, together, "dynamics models"), strict=True):
        results |= dict(zip(group, found, strict=True))
    models, errors, outcomes = {}, [], []
    for training in work:
        learned = results[training]
        keys = {"arm": training.arm, "model": training.model, "form": training.form}
        models[training.file] = DynamicsModels(
            training.kind,
            tree.names,
            FRICTIONS[training.friction],
            () if training.kind in STRUCTURES else parameters.learning.hidden,
            learned.state,
        )
        outcome = _outcomes(learned, training, parameters.learning.threshold).assign(**keys)
        if training.motion == PART:
            outcome = outcome.assign(
                **_errors_on(whole.part(slice(None, None, parameters.stride)), tree, models[training.file])
            )
        table = epoch_errors(learned.nmse, "epoch")
        errors.append(table.assign(seed=np.array(training.seeds)[table["seed"]], **keys))
        outcomes.append(outcome)
    return models, pd.concat(errors, ignore_index=True), pd.concat(outcomes, ignore_index=True)


def learn_once_through(
    tree: KinematicTree, motion: Motion, parameters: OnlineParameters, learning: LearningParameters
) -> pd.DataFrame:
    """Errors on the whole motion during one pass of online learning, without shuffling (figure III.2).

    Returns:
        `model`, `loss`, `seed`, `batch` (0: before the first), `joint`, `nmse`.
    """
    kinds: dict[str, list[Kind]] = {}
    for kind in sorted(parameters.models, key=lambda kind: kind != "delan"):  # it takes longest
        kinds.setdefault("symmetric" if kind in STRUCTURES and kind != "nostr" else kind, []).append(kind)
    run = partial(_once_through, data=TrainingData(tree, motion), parameters=parameters, learning=learning)
    return pd.concat(parallel_map(run, kinds.values(), "online learning"), ignore_index=True)


def _once_through(
    kinds: Sequence[Kind], data: TrainingData, parameters: OnlineParameters, learning: LearningParameters
) -> pd.DataFrame:
    tables, seeds = [], np.array(parameters.seeds)
    with one_thread():
        for kind, loss in product(kinds, parameters.losses):
            models = learner(kind, data, loss, parameters.seeds, learning)
            table = epoch_errors(learn_online(models, parameters.stride), "batch")
            tables.append(table.assign(model=kind, loss=loss, seed=seeds[table["seed"]]))
    return pd.concat(tables, ignore_index=True)


def _train_together(
    work: Sequence[Training],
    motions: Mapping[str, Motion],
    tree: KinematicTree,
    parameters: DynamicsTrainingParameters,
) -> list[TrainedModels]:
    first, terms = work[0], FRICTIONS[work[0].friction]
    with one_thread():
        if first.kind not in STACKED or first.arm != ROBOT:
            data = TrainingData(tree, motions[first.motion], terms)
            return [_train_one(training, data, parameters) for training in work]
        loss, learning = parameters.of(first.form, first.kind)
        logs = [motions[training.motion] for training in work]
        weights = np.stack([loss_weights(loss, log) for log in logs])
        generators = [seeded(*training.seeds) for training in work]
        models = NetworkLearner(
            first.kind, logs, terms, weights, learning.networks, learning.hidden, generators
        )
        learned = learn_in_epochs(models, 0.0, parameters.epochs.robot)
        return [learned.part(place) for place in range(len(work))]


def _train_one(
    training: Training, data: TrainingData, parameters: DynamicsTrainingParameters
) -> TrainedModels:
    loss, learning = parameters.of(training.form, training.kind)
    models = learner(training.kind, data, loss, training.seeds, learning)
    if training.arm == ROBOT:
        return learn_in_epochs(models, 0.0, parameters.epochs.robot)
    futile = training.form == PLAIN and training.kind in NETWORKS
    futility = parameters.futility_epochs if futile else None
    # of a part as many steps as of the whole
    epochs = parameters.epochs.simulation / (parameters.part if training.motion == PART else 1.0)
    return learn_in_epochs(models, learning.threshold, round(epochs), parameters.stride, futility)


def _outcomes(learned: TrainedModels, training: Training, threshold: float) -> pd.DataFrame:
    """Outcome of each model, one row each, with the errors at the epoch at which it was kept."""
    good = learned.nmse[1:] <= threshold
    first, first_but_last = (
        np.where(reached.any(axis=0), reached.argmax(axis=0) + 1.0, np.nan)
        for reached in (good.all(axis=2), good[:, :, :-1].all(axis=2))
    )
    kept = np.where(learned.epochs > 0, learned.epochs, len(learned.nmse) - 1)
    nmse = learned.nmse[kept, np.arange(len(kept))]
    mean = nmse.mean(axis=1)
    on_average = (mean <= threshold) | (training.kind in STRUCTURES)
    met = on_average if training.arm == ROBOT else learned.epochs > 0
    columns = {"seed": training.seeds, "epochs": first, "epochs_but_last": first_but_last}
    return pd.DataFrame(columns | {"nmse_mean": mean, "nmse_max": nmse.max(axis=1), "met": met})


def _errors_on(motion: Motion, tree: KinematicTree, models: DynamicsModels) -> dict[str, np.ndarray]:
    """Mean and largest NMSE (M,) over the joints on a motion that the models did not learn from."""
    errors = np.array([nmse(torques, motion.torque) for torques in predicted_torques(models, tree, motion)])
    return {"nmse_mean": errors.mean(axis=1), "nmse_max": errors.max(axis=1)}
