"""Cross-validate every representation of obstacle avoidance on 823 recorded samples (dissertation IV.8)."""

from structlearn.artefacts import publish, read_table, write_table
from structlearn.obstacles.dataset import from_table
from structlearn.recorded.avoidance import RecordedAvoidanceParameters, compare_on_recorded
from structlearn.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("recorded_avoidance", RecordedAvoidanceParameters)
    samples = from_table(read_table("data/raw/recorded/avoidance/samples.parquet"))
    results = compare_on_recorded(samples, parameters)
    with publish("data/recorded/avoidance") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
