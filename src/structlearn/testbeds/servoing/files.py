"""The files of the servoing testbed, read typed, for its page and its recordings."""

from dataclasses import dataclass, fields

import pandas as pd

from structlearn.core.artefacts import read_table
from structlearn.tactile.touch_dataset import TouchDataset, read_dataset
from structlearn.testbeds.servoing.protocol.model_scores import ModelScores
from structlearn.testbeds.servoing.protocol.servo_variants import Comparison

RUNS, DATA = "data/runs/servoing.parquet", "data/servoing"

MADE_BY = {
    "touch": (f"{DATA}/touch.safetensors", "servoing_touch_dataset"),
    "contacts": (f"{DATA}/true_contacts.parquet", "servoing_record_touch"),
    "models": (f"{DATA}/evaluation", "servoing_train_latent"),
    "loops": (f"{DATA}/servo", "servoing_servo"),
    "skins": (f"{DATA}/other_skins", "servoing_other_skins"),
}
"""Files and folders, and the stages that write them."""

REPORT, RECORDINGS = "reports/servoing", "reports/rerun/servoing"


@dataclass(frozen=True)
class OtherSkinTables:
    """Of all other skins, with a column `skin`.

    Attributes:
        latent: see `tactile.latent_evaluation.latent_errors`.
        directions: see `tactile.latent_evaluation.direction_errors`.
        trials: see `protocol.servo_variants.Comparison`.
    """

    latent: pd.DataFrame
    directions: pd.DataFrame
    trials: pd.DataFrame


def touch() -> TouchDataset:
    """Samples of touch."""
    return read_dataset(MADE_BY["touch"][0])


def true_contacts() -> pd.DataFrame:
    """See `simulation.touch_demonstrator.true_contacts`."""
    return read_table(MADE_BY["contacts"][0])


def model_scores() -> ModelScores:
    """Scores of the trained models."""
    return ModelScores(**_tables("models", ModelScores))


def closed_loops() -> Comparison:
    """Closed loops of all controllers."""
    return Comparison(**_tables("loops", Comparison))


def other_skins() -> OtherSkinTables:
    """What was learned and servoed with other skins."""
    learned = MADE_BY["skins"][0]
    return OtherSkinTables(
        read_table(f"{learned}/latent.parquet"),
        read_table(f"{learned}/directions.parquet"),
        read_table(f"{MADE_BY['loops'][0]}/other_skins.parquet"),
    )


def _tables(source: str, kind: type) -> dict[str, pd.DataFrame]:
    folder, _ = MADE_BY[source]
    return {field.name: read_table(f"{folder}/{field.name}.parquet") for field in fields(kind)}
