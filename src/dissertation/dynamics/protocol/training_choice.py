"""Choice of each model's training: what chapter III leaves open, by its own criterion on another motion.

    python -m dissertation.dynamics.protocol.training_choice

The text names neither optimiser nor learning rate nor batch size, and with the loss of eq. III.2 as printed
a joint with small torques hardly counts. So every kind of model is trained on `arm_motion.tuning` with the
usual Adam in every combination of `GRID`, with seeds that no verdict is over. The training with the fewest
epochs until the NMSE is at most the threshold on every joint (III.4.1.1) is the model's; it is entered in
`params.yaml`, `train_dynamics.chosen`, and the table of all is kept in git.
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
    TrainingData,
    learn_in_epochs,
    learner,
)

TABLE = Path("reports/studies/dynamics/training_choice/epochs.csv")

GRID = {"loss": ("raw", "normalised"), "batch": (256, 64), "rate": (0.001, 0.003, 0.01, 0.03)}
"""Raw: eq. III.2 as printed; normalised: each joint's squared error over the variance of its torque. The text
names batches of 256 for online learning."""

DECAY = 0.999  # of Adam's second moment, its usual default
SEEDS = (1, 2, 3)  # of initial models
LIMIT = 128  # epochs of 60 s, as many samples as 32 of the 240 s that are scored
FUTILITY = 32  # epochs, see `learn_in_epochs`
STRIDE = 25


def try_trainings(
    kinds: Sequence[Kind], data: TrainingData, learning: LearningParameters, limit: int = LIMIT
) -> pd.DataFrame:
    """Epochs to the threshold of every kind, training and seed.

    Returns `model`, the keys of `GRID`, `seed`, and `epochs` (NaN: not within `limit`).
    """
    tables = []
    for kind, *values in product(kinds, *GRID.values()):
        keys = dict(zip(GRID, values, strict=True))
        training = ChosenTraining(**keys, second_moment_decay=DECAY)
        models = learner(kind, data, training.loss, SEEDS, training.of(learning))
        learned = learn_in_epochs(models, learning.threshold, limit, STRIDE, FUTILITY)
        epochs = np.where(learned.epochs > 0, learned.epochs, np.nan)
        tables.append(pd.DataFrame({"model": kind, **keys, "seed": SEEDS, "epochs": epochs}))
    return pd.concat(tables, ignore_index=True)


def mean_epochs(table: pd.DataFrame, limit: int = LIMIT) -> pd.Series:
    """Geometric mean over seeds by model and training, in the order tried; not reached: the limit."""
    logs = np.log(table["epochs"].fillna(limit))
    return np.exp(logs.groupby([table[key] for key in ("model", *GRID)], sort=False).mean())


def choose(table: pd.DataFrame) -> dict[str, ChosenTraining]:
    """Training with the fewest epochs of each model; of equal ones the first that was tried."""
    means = mean_epochs(table)
    best = [means.xs(model, drop_level=False).idxmin() for model in table["model"].unique()]
    return {
        model: ChosenTraining(**dict(zip(GRID, values, strict=True)), second_moment_decay=DECAY)
        for model, *values in best
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
