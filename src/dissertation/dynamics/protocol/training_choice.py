"""Choice of each model's training: what chapter III leaves open, by its own criterion on another motion.

    python -m dissertation.dynamics.protocol.training_choice

The text names neither optimiser nor learning rate nor batch size, and with the loss of eq. III.2 as printed
a joint with small torques hardly counts. So every kind of model is trained on `arm_motion.tuning` with the
usual Adam in every combination of `LOSSES`, `BATCHES` and `RATES`, with seeds that no verdict is over. The
training with the fewest epochs until the NMSE is at most the threshold on every joint (III.4.1.1) is the
model's, of equal ones that with the lowest NMSE of the worst joint; it is entered in `params.yaml`,
`train_dynamics.chosen`, and the table of all is kept in git.
"""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.dynamics.files import as_motion
from dissertation.dynamics.protocol.trainings import ChosenTraining, DynamicsTrainingParameters
from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import ideal_log
from dissertation.simulation.arm import ArmParameters
from structlearn.core.artefacts import write_csv
from structlearn.core.stage import run, stage_parameters
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.dynamics_training import (
    Kind,
    LearningParameters,
    Loss,
    TrainingData,
    learn_in_epochs,
    learner,
)
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.network_models import NETWORKS

TABLE = Path("reports/studies/dynamics/training_choice/epochs.csv")

LOSSES: tuple[Loss, ...] = ("normalised", "raw")
BATCHES = (64, 256)  # the text names 256 for online learning
RATES = {True: (0.003, 0.01, 0.03), False: (0.001, 0.003, 0.01)}
"""Learning rates of structures (True), whose parameters are in SI units, and of networks."""

DECAY = 0.999  # of Adam's second moment, its usual default
SEEDS = (1, 2, 3)  # of initial models
LIMIT = 128  # epochs of 60 s, as many samples as 32 of the 240 s that are scored
FUTILITY = 16  # epochs, of networks with the raw loss, which get nowhere; see `learn_in_epochs`
STRIDE = 25

TRAINING = ["loss", "batch", "rate"]  # columns that tell trainings apart


def try_trainings(
    kinds: Sequence[Kind], data: TrainingData, learning: LearningParameters, limit: int = LIMIT
) -> pd.DataFrame:
    """Epochs to the threshold of every kind, training and seed.

    Returns `model`, the columns `TRAINING`, `seed`, `epochs` (NaN: not within `limit`) and `nmse_max`, the
    NMSE of the worst joint then or at the end.
    """
    tables = []
    for kind in kinds:
        for loss, batch, rate in product(LOSSES, BATCHES, RATES[kind in STRUCTURES]):
            training = ChosenTraining(loss=loss, batch=batch, rate=rate, second_moment_decay=DECAY)
            models = learner(kind, data, loss, SEEDS, training.of(learning))
            futility = FUTILITY if kind in NETWORKS and loss == "raw" else None
            learned = learn_in_epochs(models, learning.threshold, limit, STRIDE, futility)
            epochs = np.where(learned.epochs > 0, learned.epochs, np.nan)
            columns = {"seed": SEEDS, "epochs": epochs, "nmse_max": learned.nmse[-1].max(axis=1)}
            keys = {"model": kind, "loss": loss, "batch": batch, "rate": rate}
            tables.append(pd.DataFrame(keys | columns))
    return pd.concat(tables, ignore_index=True)


def mean_scores(table: pd.DataFrame, limit: int = LIMIT) -> pd.DataFrame:
    """Geometric means over seeds by model and training: `epochs` (not reached: the limit), `nmse_max`."""
    scores = pd.DataFrame({"epochs": table["epochs"].fillna(limit), "nmse_max": table["nmse_max"]})
    return np.exp(np.log(scores).groupby([table[key] for key in ("model", *TRAINING)], sort=False).mean())


def choose(table: pd.DataFrame) -> dict[str, ChosenTraining]:
    """Training of each model with the fewest epochs; of equal ones that with the lowest NMSE."""
    order = mean_scores(table).sort_values(["epochs", "nmse_max"], kind="stable").reset_index()
    return {
        row.model: ChosenTraining(loss=row.loss, batch=row.batch, rate=row.rate, second_moment_decay=DECAY)
        for row in order.drop_duplicates("model").itertuples()
    }


def main() -> None:
    """Write the table and print the choice."""
    parameters = stage_parameters("train_dynamics", DynamicsTrainingParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    motion = stage_parameters("arm_motion", ArmMotionParameters).model_copy(update={"use": "tuning"})
    data = TrainingData(robot.tree, as_motion(ideal_log(robot, motion.used)))
    with one_thread():
        table = try_trainings(parameters.models, data, parameters.learning)
    write_csv(table, TABLE)
    for model, training in choose(table).items():
        print(f"{model}: {training.model_dump()}")


if __name__ == "__main__":
    run(main, stage=False)
