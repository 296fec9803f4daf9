"""Cross-validate every representation of obstacle avoidance on recorded samples (dissertation IV.8)."""

from structlearn.avoidance.avoidance_dataset import from_table
from structlearn.core.artefacts import filled, publish, read_table, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.avoidance_representations import (
    RecordedAvoidanceParameters,
    compare_on_recorded,
)


def main() -> None:
    parameters = stage_parameters("recorded_avoidance", RecordedAvoidanceParameters, PARAMETER_FILE)
    samples = from_table(read_table(filled("data/raw/recorded/avoidance") / "samples.parquet"))
    results = compare_on_recorded(samples, parameters)
    with publish("data/recorded/avoidance") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/avoidance"))
