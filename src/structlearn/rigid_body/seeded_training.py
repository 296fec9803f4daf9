"""The models of chapter III on a robot's motion: every kind, loss and friction, each with several seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.parallel import parallel_map
from structlearn.ground.params import Parameters
from structlearn.networks.adam import AdamParameters
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_learning import (
    Kind,
    Learned,
    LearningParameters,
    Lesson,
    Loss,
    error_table,
    learn_in_epochs,
    learner,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import KinematicTree

FRICTIONS: Mapping[str, tuple[FrictionTerm, ...]] = {
    "none": (),
    "viscous": ("viscous",),
    "coulomb": ("viscous", "coulomb"),
    "offset": ("viscous", "coulomb", "offset"),
}
"""Friction that models learn: none in simulation, viscous on the robot (III.4.2); Coulomb friction, which the
dissertation names as future work; and a constant torque, for sensors that are not zeroed."""

SCHEDULED, PLAIN = "scheduled", "plain"
"""Optimisers of the structures."""


class EpochLimits(Parameters):
    """At most so many epochs.

    Attributes:
        raw: with the raw loss; DeLaN has all joints but the last then (published: 58 epochs).
        normalised: with the normalised loss.
        robot: with either on the robot's log, which no model of rigid bodies explains in full.
    """

    raw: int = Field(ge=1)
    normalised: int = Field(ge=1)
    robot: int = Field(ge=1)

    @property
    def by_loss(self) -> dict[Loss, int]:
        """Limits in simulation."""
        return {"raw": self.raw, "normalised": self.normalised}


class DynamicsTrainingParameters(Parameters):
    """Parameters of the trainings.

    Attributes:
        models: kinds to train.
        seeds: models of each kind.
        losses: each with all of them.
        learning: how they learn.
        plain: optimiser that the structures are also tried with, on the raw loss.
        epochs: how long.
        smoothing_hz: low-pass of the robot's log.
    """

    models: tuple[Kind, ...]
    seeds: int = Field(ge=1)
    losses: tuple[Loss, ...]
    learning: LearningParameters
    plain: AdamParameters
    epochs: EpochLimits
    smoothing_hz: float = Field(gt=0)


@dataclass(frozen=True)
class Training:
    """One training of the models of a kind.

    Attributes:
        data: name of the motion.
        kind: of the models.
        friction: a key of `FRICTIONS`.
        loss: raw or normalised.
        optimiser: `SCHEDULED` or `PLAIN`.
        epochs: at most so many.
    """

    data: str
    kind: Kind
    friction: str
    loss: Loss
    optimiser: str
    epochs: int

    @property
    def file(self) -> str:
        """Path of the models in the folder of all models, without suffix."""
        suffix = "" if self.friction in ("none", "viscous") else f"_{self.friction}"
        return f"{self.data}/{self.loss}/{self.kind}{suffix}"


def trainings(
    data: str, frictions: Sequence[str], limits: Mapping[Loss, int], parameters: DynamicsTrainingParameters
) -> list[Training]:
    """Trainings on one motion.

    Perceptrons need no friction of their own and are trained once per loss.

    Args:
        data: name of the motion.
        frictions: keys of `FRICTIONS`, each for all other kinds.
        limits: epochs at most, per loss.
        parameters: see there.
    """
    found = []
    for kind in parameters.models:
        learned = frictions if kind in STRUCTURES or kind == "delan" else ("none",)
        for friction in learned:
            for loss in parameters.losses:
                found.append(Training(data, kind, friction, loss, SCHEDULED, limits[loss]))
            if kind in STRUCTURES and friction == "none" and "raw" in parameters.losses:
                found.append(Training(data, kind, friction, "raw", PLAIN, limits["raw"]))
    return found


def train(
    work: Sequence[Training],
    motions: Mapping[str, Motion],
    tree: KinematicTree,
    parameters: DynamicsTrainingParameters,
) -> tuple[dict[str, DynamicsModels], pd.DataFrame, pd.DataFrame]:
    """Train all models, over processes; DeLaN first, since it takes longest.

    Args:
        work: the trainings.
        motions: by name.
        tree: the robot.
        parameters: see there.

    Returns:
        Models by `Training.file`, of the scheduled optimiser. Errors: `data`, `model`, `friction`, `loss`,
        `optimiser`, `seed`, `epoch`, `joint` (from 1), `nmse`. Outcomes: the same keys up to `seed` with
        `epochs` to the threshold on every joint and `epochs_but_last` on every joint but the last (NaN: not
        reached), `nmse_mean` and `nmse_max` over the joints of the model that was kept.
    """
    together = sorted(_together(work), key=lambda places: work[places[0]].kind != "delan")
    run = partial(_train_together, tree=tree, parameters=parameters)
    items = [([work[place] for place in places], motions[work[places[0]].data]) for places in together]
    results = {}
    for places, found in zip(together, parallel_map(run, items, "dynamics models"), strict=True):
        results |= dict(zip(places, found, strict=True))
    models, errors, outcomes = {}, [], []
    for place, training in enumerate(work):
        learned = results[place]
        keys = {
            "data": training.data,
            "model": training.kind,
            "friction": training.friction,
            "loss": training.loss,
            "optimiser": training.optimiser,
        }
        errors.append(error_table(learned.nmse, "epoch").assign(**keys))
        outcomes.append(_outcomes(learned, parameters.learning.threshold).assign(**keys))
        if training.optimiser == SCHEDULED:
            models[training.file] = DynamicsModels(
                training.kind,
                tree.names,
                FRICTIONS[training.friction],
                () if training.kind in STRUCTURES else parameters.learning.hidden,
                learned.state,
            )
    return models, pd.concat(errors, ignore_index=True), pd.concat(outcomes, ignore_index=True)


def _together(work: Sequence[Training]) -> list[list[int]]:
    """Places of trainings that share a process: structures with a common regressor, a network alone."""
    groups: dict[tuple, list[int]] = {}
    for place, training in enumerate(work):
        own = training.kind == "nostr" if training.kind in STRUCTURES else place
        groups.setdefault((training.data, training.friction, own), []).append(place)
    return list(groups.values())


def _train_together(
    item: tuple[Sequence[Training], Motion], tree: KinematicTree, parameters: DynamicsTrainingParameters
) -> list[Learned]:
    work, motion = item
    lesson = Lesson(tree, motion, FRICTIONS[work[0].friction])
    with one_thread():
        return [_train_one(training, lesson, parameters) for training in work]


def _train_one(training: Training, lesson: Lesson, parameters: DynamicsTrainingParameters) -> Learned:
    learning = parameters.learning
    if training.optimiser == PLAIN:
        learning = learning.model_copy(update={"structures": parameters.plain})
    models = learner(training.kind, lesson, training.loss, range(parameters.seeds), learning)
    return learn_in_epochs(models, learning.threshold, training.epochs, learning.stride)


def _outcomes(learned: Learned, threshold: float) -> pd.DataFrame:
    """One row per model; its errors are those of the epoch at which it was kept."""
    last = len(learned.nmse) - 1
    reached = learned.epochs > 0
    kept = np.where(reached, learned.epochs, last)
    nmse = learned.nmse[kept, np.arange(len(kept))]
    but_last = (learned.nmse[1:, :, :-1] <= threshold).all(axis=2)
    first = np.where(but_last.any(axis=0), but_last.argmax(axis=0) + 1.0, np.nan)
    return pd.DataFrame(
        {
            "seed": np.arange(len(kept)),
            "epochs": np.where(reached, learned.epochs, np.nan),
            "epochs_but_last": first,
            "nmse_mean": nmse.mean(axis=1),
            "nmse_max": nmse.max(axis=1),
        }
    )
