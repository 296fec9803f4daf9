"""Files of the servoing testbed that its page and recordings read."""

import pandas as pd

from structlearn.core.artefacts import read_table

RUNS, DATA = "data/runs/servoing.parquet", "data/servoing"

MADE_BY = {
    "touch": (f"{DATA}/touch.safetensors", "servoing_touch_dataset"),
    "contacts": (f"{DATA}/true_contacts.parquet", "servoing_record_touch"),
    "models": (f"{DATA}/evaluation", "servoing_train_latent"),
    "loops": (f"{DATA}/servo", "servoing_servo"),
    "skins": (f"{DATA}/other_skins", "servoing_other_skins"),
}
"""File or folder of each source, and the stage that writes it."""

TABLES = {
    "models": ("latent", "forward", "decoded", "directions", "curve", "latent_map"),
    "loops": ("trials", "progress", "paths", "other_skins"),
    "skins": ("latent", "directions"),
}
"""Tables in these folders, see `tactile.latent_comparison.LatentComparison` and
`protocol.servo_trials.compare_controllers`; tables of other skins have a column `skin`."""


def tables(source: str) -> dict[str, pd.DataFrame]:
    """Read all tables of a source, keyed by name."""
    return {name: read_table(f"{MADE_BY[source][0]}/{name}.parquet") for name in TABLES[source]}
